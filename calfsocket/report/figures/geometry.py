"""Figures 1 and 2: the section with its regions named, and the sockets laid over the limb."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from calfsocket.plotting import section as drawing
from calfsocket.plotting.style import (
    WIDTH_MM,
    add_axes,
    compass,
    height_mm,
    legend_at,
    new_figure,
    panels,
    window_around,
)
from calfsocket.postprocess.fields import SectionFields
from calfsocket.postprocess.quantities import SUMMARY_TISSUES
from calfsocket.report.findings import Findings

LIMB = "#d9d9d9"
BONE_DARK = "#8c8c8c"
OVERLAP = "#d55e00"
EDGE: dict[str, Any] = {"edgecolor": "black", "linewidth": 0.4}

ROOM_FOR_NUMBER_MM = 2.2  # radius that a number of two digits needs

Place = NDArray[np.float64]
"""x and y, mm."""


def regions(findings: Findings) -> Figure:
    """Draw the unloaded limb, its tissues in colour, with a number and a name for every region."""
    fields = findings.fields
    limb = fields.cells_of(*SUMMARY_TISSUES, "bone")
    points = fields.points
    window = window_around(points[np.unique(fields.cells[limb])], margin_mm=1.0)
    size = 112.0  # mm of paper
    height = size * (window[3] - window[2]) / (window[1] - window[0])
    figure = new_figure(height)
    axes = add_axes(figure, 0, 0, size, height)
    drawing.frame(axes, window)
    for tissue in (*SUMMARY_TISSUES, "bone"):
        colour = drawing.TISSUE_COLOURS[tissue]
        drawing.draw_tissue(axes, fields, points, tissue, facecolor=colour)
    names = _by_tissue(fields)
    drawing.draw_outlines(axes, fields, points, (*SUMMARY_TISSUES, "bone"), linewidth=0.5, zorder=3)
    for number, place, target in _number_places(fields, names):
        if target is not None:
            axes.plot(*zip(place, target, strict=True), color="black", linewidth=0.5, zorder=4)
        x, y = place
        halo = [withStroke(linewidth=1.6, foreground="white")]
        axes.text(
            x, y, str(number), ha="center", va="center", fontsize=6.5, zorder=5, path_effects=halo
        )
    drawing.scale_bar(axes, window, fontsize=6.5, margin=0.5)
    _draw_names(figure, fields, names, left=size + 4)
    compass(figure, findings.frame)
    return figure


def _by_tissue(fields: SectionFields) -> list[int]:
    """Region ids of the limb, tissue by tissue, in the order of their ids."""
    order = list(drawing.TISSUE_COLOURS)
    ids = map(int, np.unique(fields.region[fields.cells_of(*SUMMARY_TISSUES, "bone")]))
    return sorted(ids, key=lambda i: (order.index(fields.region_tissues[i]), i))


def _number_places(fields: SectionFields, ids: list[int]) -> list[tuple[int, Place, Place | None]]:
    """Return number, place, and for regions too small for it the point that a line leads to.

    A number stands where its region is widest. That of a small one stands beside it, at the place
    within reach that is farthest from all outlines and from the other numbers.
    """
    nodes = {i: fields.cells[fields.region == i] for i in ids}
    outlines = cKDTree(
        np.vstack([drawing.boundary(nodes[i], fields.points).interpolated(3).vertices for i in ids])
    )
    placed: list[tuple[int, Place, Place | None]] = []
    small: list[tuple[int, Place]] = []
    for number, region in enumerate(ids, start=1):
        inside = fields.points[np.unique(nodes[region])]
        room, _ = outlines.query(inside)
        widest = inside[np.argmax(room)]
        if room.max() > ROOM_FOR_NUMBER_MM or fields.region_tissues[region] != "vessel":
            placed.append((number, widest, None))
        else:
            small.append((number, widest))
    angle = np.radians(np.arange(0, 360, 7.5))
    around = np.column_stack([np.cos(angle), np.sin(angle)])
    reach = np.vstack([radius * around for radius in (4.5, 6.0, 7.5, 9.0)])
    for number, target in small:
        places = target + reach
        to_outline, _ = outlines.query(places)
        to_number, _ = cKDTree([place for _, place, _ in placed]).query(places)
        room = np.minimum(to_outline, 0.5 * to_number)
        best = np.argmax(np.minimum(room, ROOM_FOR_NUMBER_MM))
        placed.append((number, places[best], target))
    return placed


def _draw_names(figure: Figure, fields: SectionFields, ids: list[int], left: float) -> None:
    """Write the key, right of `left` (mm): tissues with their colours, numbers with their names."""
    width, height = WIDTH_MM - left, height_mm(figure)
    axes = add_axes(figure, left, 0, width, height)
    drawing.frame(axes, (0, width, 0, height))
    y, step = height - 3.0, 3.1  # mm
    tissue = ""
    for number, region in enumerate(ids, start=1):
        if fields.region_tissues[region] != tissue:
            tissue = fields.region_tissues[region]
            y -= 0.4 * step
            colour = drawing.TISSUE_COLOURS[tissue]
            axes.add_patch(Rectangle((0, y - 1.1), 4.0, 2.2, facecolor=colour, **EDGE))
            axes.text(5.5, y, tissue, fontsize=7.5, weight="bold", va="center")
            y -= step
        axes.text(4.0, y, str(number), fontsize=7, va="center", ha="right")
        axes.text(5.5, y, fields.region_names[region].replace("_", " "), fontsize=7, va="center")
        y -= step


def overlays(findings: Findings) -> Figure:
    """Draw the limb and each socket before contact, and where they overlap."""
    results = findings.results
    section = {socket: results[socket, name].fields for socket, name in reversed(list(results))}
    window = window_around(*(fields.points for fields in section.values()), margin_mm=1.0)

    def draw(axes: Axes, socket: str, _: int) -> None:
        _draw_overlay(axes, section[socket])
        lost = findings.areas.lost[socket]
        text = f"encloses {abs(lost):.2f} % {'less' if lost > 0 else 'more'} area"
        text = text if lost else "encloses as much area"
        axes.text(0.5, -0.01, text, transform=axes.transAxes, ha="center", va="top", fontsize=7)

    titles, limb = findings.socket_titles, findings.frame
    figure = panels(titles, [""], window, draw, limb, key=18.0, below=4.0)
    liner = drawing.TISSUE_COLOURS["liner"]
    tissues = drawing.key(findings.fields, bone=BONE_DARK, liner=liner, socket=drawing.SOCKET)
    areas = [Patch(color=LIMB, label="limb"), *tissues]
    if findings.areas.overlap.any():
        lined = " with its liner" if findings.liner else ""
        label = f"socket inside the limb{lined}: the overlap that presses"
        areas.append(Patch(color=OVERLAP, label=label))
    legend_at(figure, 3.0, 6.0, areas)
    return figure


def _draw_overlay(axes: Axes, fields: SectionFields) -> None:
    """Draw limb and socket as meshed."""
    points = fields.points
    limb, socket = (drawing.boundary(fields.cells[body], points) for body in fields.bodies)
    drawing.draw_path(axes, limb, facecolor=LIMB, linewidth=0)
    drawing.draw_tissue(axes, fields, points, "bone", facecolor=BONE_DARK)
    drawing.draw_path(axes, socket, facecolor=drawing.SOCKET, linewidth=0)
    drawing.draw_tissue(axes, fields, points, "liner", facecolor=drawing.TISSUE_COLOURS["liner"])
    inside = drawing.draw_path(axes, socket, facecolor=OVERLAP, linewidth=0)
    inside.set_clip_path(limb, axes.transData)
    for path in (limb, socket):
        drawing.draw_path(axes, path, fill=False, edgecolor=drawing.OUTLINE, linewidth=0.4)
