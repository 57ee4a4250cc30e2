"""What every drawing of the section shares: outlines, fields, directions, colours."""

from collections.abc import Collection
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
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
SHADES = 250
"""With those of what is beyond a scale, and white, they fit into one byte a pixel of a PDF."""
ABOVE = "#cc3c58"
BONE = "#d9d9d9"
SOCKET = "#555555"
OUTLINE = "#1a1a1a"
QUIET = "#333333"
BARS_MM, LONGEST_BAR = (100, 50, 20, 10, 5, 2, 1), 0.25
"""Lengths of a scale bar, and how long it is at most as a share of the drawing's width."""
STRAIGHT = 0.02
"""Distance of a node from a straight line that leaves it out, pixels or, in a PDF, points."""


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
    """Return the edges at which the region of some cells ends, each once.

    They are straight from node to node, as those of the pixels of a field are (`Raster`): there are
    thousands, and curves would take twice the time and the bytes.
    """
    edges = _edges(cells)
    place, middle = np.arange(len(edges)), edges[:, 2]
    first = np.full(len(points), -1)
    last = first.copy()  # of the edge's second cell, where it has one
    last[middle], first[middle[::-1]] = place, place[::-1]  # what is assigned last stays
    a, b = first[first >= 0], last[last >= 0]
    shown = edges[a[(a == b) | (region[a // 3] != region[b // 3])]]
    vertices = points[shown[:, [0, 2, 1]]].reshape(-1, 2)
    codes = np.tile(np.array([Path.MOVETO, Path.LINETO, Path.LINETO], np.uint8), len(shown))
    path = Path(vertices, codes)
    path.simplify_threshold = STRAIGHT
    return path


def boundary(cells: NDArray[np.int64], points: NDArray[np.float64]) -> Path:
    """Return the boundary of some cells: closed curves that turn as the cells do, holes reversed.

    A quadratic element's edge is a quadratic Bezier curve, so the path is the mesh's own boundary
    without loss: its control point is 2 m - (a + b)/2, with the ends a, b and the mid-side node m.

    The cells are six-node triangles, all turning the same way, (n_cells, 6).
    """
    edges = _edges(cells)
    edges = edges[np.bincount(edges[:, 2])[edges[:, 2]] == 1]
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


@dataclass(frozen=True, eq=False)
class DeformedSection:
    """What drawings of one deformed section share, each part found once."""

    fields: SectionFields
    _rasters: dict[tuple[Window, int], Raster] = field(default_factory=dict, init=False)

    @cached_property
    def limb(self) -> Path:
        """Outline of the limb, with a hole where it is fixed."""
        return self._boundary(*SUMMARY_TISSUES, "bone")

    @cached_property
    def bone(self) -> Path:
        """Outlines of the bones."""
        return self._boundary("bone")

    @cached_property
    def socket(self) -> Path:
        """Outline of the socket."""
        return self._boundary("socket")

    @cached_property
    def outlines(self) -> Path:
        """Outlines of all regions."""
        return outlines(self.fields.cells, self.fields.region, self.fields.deformed)

    def _boundary(self, *tissues: str) -> Path:
        cells = self.fields.cells[self.fields.cells_of(*tissues)]
        return boundary(cells, self.fields.deformed) if len(cells) else Path(np.empty((0, 2)))

    def raster(self, window: Window, pixels: int) -> Raster:
        """Return the pixels, `pixels` across a window, of the soft tissues and liner."""
        if (window, pixels) not in self._rasters:
            cells = self.fields.cells[self.fields.cells_of(*REPORTED)]
            found = Raster.of(self.fields.deformed[cells], window, pixels)
            self._rasters[window, pixels] = found
        return self._rasters[window, pixels]


def colour_scale(low: float, high: float, colours: str, beyond: str) -> ScalarMappable:
    """Return colours between two limits, and one beyond them."""
    shades = matplotlib.colormaps[colours].resampled(SHADES)
    return ScalarMappable(Normalize(low, high), shades.with_extremes(over=beyond, under=beyond))


def draw_field(
    axes: Axes,
    section: DeformedSection,
    values: NDArray[np.float64],
    scale: ScalarMappable,
    linewidth: float,
    zorder: float = 0,
) -> None:
    """Draw a field of the deformed soft tissues and liner, and with `zorder` what is hard.

    `values` are those at the six nodes of every cell, (n_cells, 6): they may jump from cell to
    cell. They are shown at the middle of each pixel of the figure, in the window of the axes.
    """
    window = (*axes.get_xlim(), *axes.get_ylim())
    raster = section.raster(window, round(axes.bbox.width))
    shown = raster.sampled(values[section.fields.cells_of(*REPORTED)])
    axes.add_artist(FieldImage(raster, shown, scale))
    draw_path(axes, section.bone, facecolor=BONE, linewidth=0, zorder=zorder)
    draw_path(axes, section.socket, facecolor=SOCKET, linewidth=0, zorder=zorder)
    style = {"fill": False, "edgecolor": OUTLINE, "linewidth": linewidth}
    draw_path(axes, section.outlines, **style, zorder=zorder + 1)


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
    """Draw a round length, 20 mm in a section of a calf, at the window's lower left."""
    x, y = window[0] + margin, window[2] + margin
    width = window[1] - window[0]
    long = next((mm for mm in BARS_MM if mm <= LONGEST_BAR * width), BARS_MM[-1])
    axes.plot([x, x + long], [y, y], color="black", linewidth=1.5, solid_capstyle="butt")
    axes.annotate(
        f"{long} mm", (x + long / 2, y), xytext=(0, 2.5), textcoords="offset points", ha="center",
        va="bottom", fontsize=fontsize, annotation_clip=False,
    )  # fmt: skip
