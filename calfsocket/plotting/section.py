"""What every drawing of the section shares: outlines, fields, directions, colours."""

from collections.abc import Collection
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path
from numpy.typing import NDArray

from calfsocket.meshes.frame import Frame
from calfsocket.plotting.raster import FieldImage, Raster, Window
from calfsocket.postprocess.fields import TISSUES, SectionFields
from calfsocket.postprocess.quantities import REPORTED, SUMMARY_TISSUES

# Distinct by hue, and by lightness for colour-blind eyes.
TISSUE_COLOURS = {
    "skin": "#c98d6b",
    "fat": "#f8e9b0",
    "fascia": "#6f7f8f",
    "muscle": "#dc9a92",
    "vessel": "#2a5d9c",
    "bone": "#efede6",
    "liner": "#9ec9a8",
}
# Light where the value is low, so that outlines show; colour-blind eyes can read them, too.
STRESS_COLOURS = "YlGnBu"
ABOVE = "#cc3c58"
BONE = "#d9d9d9"
SOCKET = "#555555"
OUTLINE = "#1a1a1a"
QUIET = "#333333"


def _edges(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return start, end and middle of the three edges of every cell, one after the other."""
    corners = cells[:, :3]
    ends = np.roll(corners, -1, axis=1)
    return np.stack([corners, ends, cells[:, 3:]], axis=2).reshape(-1, 3)


def _control(points: NDArray[np.float64], edges: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the control points of the Bezier curves that edges are, (n, 2)."""
    start, end, middle = edges.T
    return 2 * points[middle] - 0.5 * (points[start] + points[end])


def outlines(
    cells: NDArray[np.int64], region: NDArray[np.int64], points: NDArray[np.float64]
) -> Path:
    """Return the edges at which the region of some cells ends, each once: curves of one path."""
    edges = _edges(cells)
    _, first = np.unique(edges[:, 2], return_index=True)
    _, last = np.unique(edges[::-1, 2], return_index=True)
    last = len(edges) - 1 - last  # of the edge's second cell, where it has one
    shown = edges[first[(first == last) | (region[first // 3] != region[last // 3])]]
    vertices = np.stack([points[shown[:, 0]], _control(points, shown), points[shown[:, 1]]], axis=1)
    codes = np.tile(np.array([Path.MOVETO, Path.CURVE3, Path.CURVE3], np.uint8), len(shown))
    return Path(vertices.reshape(-1, 2), codes)


def boundary(cells: NDArray[np.int64], points: NDArray[np.float64]) -> Path:
    """Return the boundary of some cells: closed curves that turn as the cells do, holes reversed.

    A quadratic element's edge is a quadratic Bezier curve, so the path is the mesh's own boundary
    without loss: its control point is 2 m - (a + b)/2, with the ends a, b and the mid-side node m.

    The cells are six-node triangles, all turning the same way, (n_cells, 6).
    """
    edges = _edges(cells)
    _, index, count = np.unique(edges[:, 2], return_index=True, return_counts=True)
    edges = edges[np.sort(index[count == 1])]
    ends = [int(end) for end in edges[:, 1]]
    onward = {int(start): place for place, start in enumerate(edges[:, 0])}
    rings = []
    while onward:
        node, ring = next(iter(onward)), []
        while node in onward:
            ring.append(onward.pop(node))
            node = ends[ring[-1]]
        rings.append(_closed(edges[ring], points))
    return Path.make_compound_path(*rings)


def _closed(edges: NDArray[np.int64], points: NDArray[np.float64]) -> Path:
    """Return the closed curve of edges that follow each other."""
    curves = np.stack([_control(points, edges), points[edges[:, 1]]], axis=1).reshape(-1, 2)
    vertices = np.vstack([points[edges[:1, 0]], curves, curves[-1:]])
    codes = np.full(len(vertices), Path.CURVE3, np.uint8)
    codes[0], codes[-1] = Path.MOVETO, Path.CLOSEPOLY
    return Path(vertices, codes)


def limb_boundary(fields: SectionFields, points: NDArray[np.float64]) -> Path:
    """Return the outline of the limb, with a hole where it is fixed."""
    return boundary(fields.cells[fields.cells_of(*SUMMARY_TISSUES, "bone")], points)


def draw_path(axes: Axes, path: Path, **style: Any) -> PathPatch:
    """Draw a path on axes whose limits are set by `frame`, not by what is drawn."""
    patch = PathPatch(path, **style)
    axes.add_artist(patch)  # add_patch would look for the extremes of every curve
    return patch


def draw_tissue(
    axes: Axes, fields: SectionFields, points: NDArray[np.float64], tissue: str, **style: Any
) -> None:
    """Fill a tissue; nothing where the section has none."""
    cells = fields.cells_of(tissue)
    if len(cells):
        draw_path(axes, boundary(fields.cells[cells], points), **{"linewidth": 0, **style})


def key(fields: SectionFields, **colours: str) -> list[Patch]:
    """Return the handles of a legend for those of some tissues that the section has."""
    return [
        Patch(color=colour, label=tissue)
        for tissue, colour in colours.items()
        if len(fields.cells_of(tissue))
    ]


def draw_outlines(
    axes: Axes,
    fields: SectionFields,
    points: NDArray[np.float64],
    tissues: Collection[str] = TISSUES,
    **style: Any,
) -> None:
    """Draw the outlines of the regions of some tissues, by default of all, the socket's too."""
    cells = fields.cells_of(*tissues)
    path = outlines(fields.cells[cells], fields.region[cells], points)
    draw_path(axes, path, fill=False, edgecolor=OUTLINE, **style)


def section_raster(fields: SectionFields, window: Window, pixels: int) -> Raster:
    """Return the pixels of an image of the deformed soft tissues and liner."""
    return Raster.of(fields.deformed[fields.cells[fields.cells_of(*REPORTED)]], window, pixels)


def draw_field(
    axes: Axes,
    fields: SectionFields,
    values: NDArray[np.float64],
    raster: Raster,
    scale: ScalarMappable,
    linewidth: float,
    zorder: float = 0,
) -> None:
    """Draw a field of the deformed soft tissues and liner, with what is hard.

    `values` are those at the six nodes of every cell, (n_cells, 6): they may jump from cell to
    cell. `raster` is that of `section_raster` for the window of the axes.
    """
    points, shown = fields.deformed, raster.image(values[fields.cells_of(*REPORTED)])
    axes.add_artist(FieldImage(shown, scale, zorder))
    draw_tissue(axes, fields, points, "bone", facecolor=BONE, zorder=zorder)
    draw_tissue(axes, fields, points, "socket", facecolor=SOCKET, zorder=zorder)
    draw_outlines(axes, fields, points, linewidth=linewidth, zorder=zorder + 1)


def frame(axes: Axes, window: Window) -> None:
    """Show the window alone, to scale, without axes."""
    left, right, bottom, top = window
    axes.set(xlim=(left, right), ylim=(bottom, top), aspect="equal")
    axes.axis("off")


def mark_directions(
    axes: Axes, window: Window, limb: Frame, fontsize: float, margin: float = 3.0
) -> None:
    """Write what lies to the window's four sides, such as anterior."""
    left, right, bottom, top = window
    x, y = (left + right) / 2, (bottom + top) / 2
    places = (
        ((right - margin, y), "right", "center", 270),
        ((x, top - margin), "center", "top", 0),
        ((left + margin, y), "left", "center", 90),
        ((x, bottom + margin), "center", "bottom", 0),
    )
    for text, (place, ha, va, rotation) in zip(limb.words, places, strict=True):
        axes.text(*place, text, ha=ha, va=va, rotation=rotation, fontsize=fontsize, color=QUIET)


def scale_bar(axes: Axes, window: Window, fontsize: float, margin: float = 3.0) -> None:
    """Draw 20 mm at the window's lower left."""
    x, y = window[0] + margin, window[2] + margin
    axes.plot([x, x + 20], [y, y], color="black", linewidth=1.5, solid_capstyle="butt")
    axes.text(x + 10, y + 1.5, "20 mm", ha="center", va="bottom", fontsize=fontsize)
