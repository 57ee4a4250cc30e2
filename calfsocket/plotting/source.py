"""The section of a limb over the outlines of the source that it was made from."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import shapely
import shapely.plotting
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from calfsocket.io.files import replacing
from calfsocket.meshes.limb import Limb
from calfsocket.plotting import section as drawing
from calfsocket.plotting.style import type_set

_STEP_MM, _MARGIN_MM = 0.2, 12.0
_INCHES, _DPI = 6.5, 150
_SOURCE = "#0b6fb8"


def draw_source(limb: Limb, data: Mapping[str, NDArray[np.float64]], path: Path) -> None:
    """Draw the regions of a limb, its own mesh, and the source's outlines over them, as PNG.

    Parameters
    ----------
    data
        Closed polygons, mm, in the limb's axes, by name.
    """
    with type_set():
        figure = Figure(figsize=(_INCHES, _INCHES), dpi=_DPI)
        axes = figure.add_axes((0.02, 0.06, 0.96, 0.9))
        low, high = _extent(data)
        window = (low[0], high[0], low[1], high[1])
        fill(axes, limb)
        if limb.mesh is not None:
            around = limb.mesh.coordinates[:, [0, 3, 1, 4, 2, 5, 0]]
            axes.add_collection(
                LineCollection(list(around), linewidths=0.2, colors=_SOURCE), autolim=False
            )
        for points in data.values():
            closed = np.concatenate([points, points[:1]])
            axes.plot(*closed.T, ".-", color=_SOURCE, linewidth=0.4, markersize=1.8)
        drawing.frame(axes, window)
        drawing.scale_bar(axes, window, 7)
        _directions(axes, limb, window)
        tissues = dict.fromkeys(limb.tissues.values())
        figure.legend(
            handles=[
                *(Patch(facecolor=drawing.TISSUE_COLOURS[each], label=each) for each in tissues),
                Line2D([], [], color=_SOURCE, marker=".", markersize=4, label="source"),
            ],
            loc="lower center",
            ncols=len(tissues) + 1,
            frameon=False,
        )
        figure.text(0.02, 0.97, limb.title, fontsize=8.5, parse_math=False)
        with replacing(path) as temporary:
            figure.savefig(temporary, facecolor="white")


def _extent(data: Mapping[str, NDArray[np.float64]]) -> tuple[NDArray[np.float64], ...]:
    points = np.concatenate(list(data.values()))
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    half = np.ptp(points, axis=0).max() / 2 + _MARGIN_MM
    return middle - half, middle + half


def fill(axes: Axes, limb: Limb) -> None:
    """Draw the regions of a limb by the colours of their tissues."""
    bodies = limb.bodies(_STEP_MM)
    for region in limb.regions:
        patch = shapely.plotting.patch_from_polygon(
            bodies[region.name], facecolor=drawing.TISSUE_COLOURS[region.tissue],
            edgecolor=drawing.OUTLINE, linewidth=0.5,
        )  # fmt: skip
        axes.add_artist(patch)  # the window is known: `add_patch` would look for it, for seconds


def _directions(axes: Axes, limb: Limb, window: drawing.Window) -> None:
    left, right, bottom, top = window
    x, y = (left + right) / 2, (bottom + top) / 2
    words = limb.frame.words
    places = (
        ((right - 2, y), "right", "center", 270),
        ((x, top - 2), "center", "top", 0),
        ((left + 2, y), "left", "center", 90),
        ((x, bottom + 2), "center", "bottom", 0),
    )
    for word, (place, ha, va, rotation) in zip(words, places, strict=True):
        axes.text(*place, word, ha=ha, va=va, rotation=rotation, fontsize=7, color=drawing.QUIET)
