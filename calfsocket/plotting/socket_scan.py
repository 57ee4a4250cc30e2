"""The outlines of a socket over the sections of its limb."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from calfsocket.io.files import replacing
from calfsocket.meshes.curves import ClosedCurve
from calfsocket.meshes.limb import Limb
from calfsocket.meshes.socket import MeshedSocket, Sections
from calfsocket.plotting import section as drawing
from calfsocket.plotting.source import fill
from calfsocket.plotting.style import type_set

_STEP_MM, _MARGIN_MM = 0.3, 4.0
_INCHES, _FEWEST, _COLUMNS, _DPI = 2.6, 2, 4, 150
_FOOT = 0.35
_FACE = "#0b6fb8"


def draw_sections(socket: Sections | MeshedSocket, limbs: Sequence[Limb], path: Path) -> None:
    """Draw the inner face and the wall of a socket over each section that it reaches, as PNG."""
    drawn = limbs
    if isinstance(socket, Sections):
        drawn = [limb for limb in limbs if any(each.is_of(limb) for each in socket.sections)]
    columns = min(len(drawn), _COLUMNS)
    rows = -(-len(drawn) // columns)
    half = max(np.abs(limb.skin.evaluate(limb.skin.knots)).max() for limb in drawn)
    half += max(socket.thickness(limb) for limb in drawn) + _MARGIN_MM
    size = max(columns, _FEWEST) * _INCHES, rows * (_INCHES + 0.25) + _FOOT
    with type_set():
        figure = Figure(figsize=size, dpi=_DPI)
        for number, limb in enumerate(drawn):
            row, column = divmod(number, columns)
            bottom = size[1] - (row + 1) * (_INCHES + 0.25)
            left = (size[0] - columns * _INCHES) / 2 + column * _INCHES
            axes = figure.add_axes(
                (left / size[0], bottom / size[1], _INCHES / size[0], _INCHES / size[1])
            )
            _draw(axes, socket, limb, (-half, half, -half, half))
        tissues = dict.fromkeys(each for limb in drawn for each in limb.tissues.values())
        figure.legend(
            handles=[
                *(Patch(facecolor=drawing.TISSUE_COLOURS[each], label=each) for each in tissues),
                Patch(facecolor=drawing.SOCKET, alpha=0.5, edgecolor=_FACE, label="socket"),
            ],
            loc="lower center",
            ncols=len(tissues) + 1,
            frameon=False,
            fontsize=6.5,
            columnspacing=0.8,
            handlelength=1.0,
        )
        with replacing(path) as temporary:
            figure.savefig(temporary, facecolor="white")


def _draw(axes: Axes, socket: Sections | MeshedSocket, limb: Limb, window: drawing.Window) -> None:
    fill(axes, limb)
    inner = _points(socket.inner_face(limb))
    if isinstance(socket, MeshedSocket):
        outer = _points(socket.faces(limb)[1])
    else:  # as a stroke on the outside: a wall that folds over can be seen, too
        outer = inner + socket.thickness(limb) * _normals(socket.inner_face(limb))
    axes.fill(
        np.append(inner[:, 0], outer[::-1, 0]), np.append(inner[:, 1], outer[::-1, 1]),
        color=drawing.SOCKET, alpha=0.5, linewidth=0,
    )  # fmt: skip
    axes.plot(*inner.T, color=_FACE, linewidth=0.8)
    drawing.frame(axes, window)
    drawing.scale_bar(axes, window, 6)
    source = limb.source
    where = source.level if source and source.level else "a plane"
    less = 1 - socket.inner_face(limb).area / limb.skin.area
    axes.set_title(f"{where}: {100 * less:.1f} % less area", fontsize=7, pad=2, parse_math=False)


def _points(curve: ClosedCurve) -> np.ndarray:
    points = curve.evaluate(curve.sample(_STEP_MM))
    return np.concatenate([points, points[:1]])


def _normals(curve: ClosedCurve) -> np.ndarray:
    normals = curve.normal(curve.sample(_STEP_MM))
    return np.concatenate([normals, normals[:1]])
