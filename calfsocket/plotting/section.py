"""What every drawing of the section shares: outlines, fields as images, directions, colours."""

from collections.abc import Iterable
from typing import Any

import numpy as np
import pyvista
from matplotlib.axes import Axes
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path
from numpy.typing import NDArray

from calfsocket.meshes.frame import Frame
from calfsocket.postprocess.fields import SectionFields
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

Window = tuple[float, float, float, float]
"""Left, right, bottom and top of a piece of the section, mm."""


def boundary(cells: NDArray[np.int64], points: NDArray[np.float64]) -> Path:
    """Return the boundary of some cells: closed curves that turn as the cells do, holes reversed.

    A quadratic element's edge is a quadratic Bezier curve, so the path is the mesh's own boundary
    without loss: its control point is 2 m - (a + b)/2, with the ends a, b and the mid-side node m.

    The cells are six-node triangles, all turning the same way, (n_cells, 6).
    """
    corners = cells[:, :3]
    edges = np.stack([corners, np.roll(corners, -1, axis=1), cells[:, 3:]], axis=2).reshape(-1, 3)
    _, index, count = np.unique(edges[:, 2], return_index=True, return_counts=True)
    onward = {start: (end, middle) for start, end, middle in edges[np.sort(index[count == 1])]}
    vertices: list[NDArray[np.float64]] = []
    codes: list[np.uint8] = []
    while onward:
        node = next(iter(onward))
        vertices.append(points[node])
        codes.append(Path.MOVETO)
        while node in onward:
            end, middle = onward.pop(node)
            vertices += [2 * points[middle] - 0.5 * (points[node] + points[end]), points[end]]
            codes += [Path.CURVE3, Path.CURVE3]
            node = end
        vertices.append(vertices[-1])
        codes.append(Path.CLOSEPOLY)
    return Path(np.array(vertices), codes)


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
    regions: Iterable[int] | None = None,
    **style: Any,
) -> None:
    """Draw the outlines of some regions, by default of all, the socket's too."""
    for region in np.unique(fields.region) if regions is None else regions:
        path = boundary(fields.cells[fields.region == region], points)
        draw_path(axes, path, **{"fill": False, "edgecolor": OUTLINE, **style})


def field_image(
    fields: SectionFields,
    values: NDArray[np.float64],
    cells: NDArray[np.int64],
    window: Window,
    pixels: int,
) -> np.ma.MaskedArray:
    """Sample a field of the deformed section at the pixels of an image.

    `values`, at the six nodes of every cell, (n_cells, 6), may jump from cell to cell. The image,
    `pixels` across the window's width, has the lowest row first; it is masked where none of `cells`
    is.
    """
    left, right, bottom, top = window
    step = (right - left) / pixels
    rows = round((top - bottom) / step)
    corners = fields.deformed[fields.cells[cells]].reshape(-1, 2)
    grid = pyvista.UnstructuredGrid(
        {pyvista.CellType.QUADRATIC_TRIANGLE: np.arange(len(corners)).reshape(-1, 6)},
        np.pad(corners, ((0, 0), (0, 1))),
    )
    grid.point_data["value"] = values[cells].ravel()
    raster = pyvista.ImageData(
        dimensions=(pixels, rows, 1),
        spacing=(step, step, step),
        origin=(left + 0.5 * step, bottom + 0.5 * step, 0.0),
    ).sample(grid)
    shape = (rows, pixels)
    outside = np.asarray(raster["vtkValidPointMask"]).reshape(shape) == 0
    return np.ma.masked_array(np.asarray(raster["value"]).reshape(shape), outside)


def draw_field(
    axes: Axes,
    fields: SectionFields,
    values: NDArray[np.float64],
    window: Window,
    pixels: int,
    linewidth: float,
    zorder: float = 0,
    **image: Any,
) -> None:
    """Draw a field of the deformed soft tissues and liner (`field_image`), with what is hard."""
    points, soft = fields.deformed, fields.cells_of(*REPORTED)
    shown = field_image(fields, values, soft, window, pixels)
    axes.imshow(shown, extent=window, origin="lower", zorder=zorder, **image)
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
