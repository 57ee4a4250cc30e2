"""The picture of a pressure map: the limb unrolled, front in the middle, from end to end."""

import textwrap
from collections.abc import Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator

from calfsocket.plotting import files
from calfsocket.plotting.style import (
    WIDTH_MM,
    add_axes,
    height_mm,
    new_figure,
    type_set,
)
from calfsocket.postprocess.mesh_error import SETTLED, with_error
from calfsocket.postprocess.pressure_map import (
    PLANE_STRAIN,
    WINDOW,
    Array,
    MapLevel,
    PressureMap,
    angles,
)

PRESSURE_COLOURS, SHEAR_COLOURS = "YlOrRd", "RdBu_r"
MISSING: dict[str, Any] = {"facecolor": "#e4e4e4", "edgecolor": "#9a9a9a", "hatch": "///", "lw": 0}
LEVEL_LINE: dict[str, Any] = {"color": "#444444", "linewidth": 0.35, "alpha": 0.8}
#: Where the picture is cut open, anatomical degrees: at the back, so that the front is its middle.
CUT_DEG = 270.0
#: Of the picture, mm of paper.
PANEL_MM, LEFT_MM, RIGHT_MM, HEAD_MM, FOOT_MM, BETWEEN_MM = 72.0, 18.0, 36.0, 12.0, 16.0, 17.0
NOTE_LETTERS = 150


def draw(found: PressureMap) -> Figure:
    """Draw contact pressure over angle and height, and friction below it where there is any."""
    shear = bool(np.nan_to_num(found.shear_kPa).any())
    count = 2 if shear else 1
    figure = new_figure(HEAD_MM + count * PANEL_MM + (count - 1) * BETWEEN_MM + 10 + FOOT_MM)
    width = WIDTH_MM - LEFT_MM - RIGHT_MM
    bottom = height_mm(figure) - HEAD_MM - PANEL_MM
    axes = add_axes(figure, LEFT_MM, bottom, width, PANEL_MM)
    highest = _round_up(np.nanmax(found.pressure_kPa))
    colours = ScalarMappable(Normalize(0, highest), PRESSURE_COLOURS)
    _panel(figure, axes, found, found.pressure_kPa, colours, "contact pressure, kPa")
    _mark_largest(axes, found)
    if shear:
        axes = add_axes(figure, LEFT_MM, bottom - BETWEEN_MM - PANEL_MM, width, PANEL_MM)
        most = _round_up(np.nanmax(np.abs(found.shear_kPa)))
        colours = ScalarMappable(Normalize(-most, most), SHEAR_COLOURS)
        what = "friction on the skin, kPa\n(positive: toward larger angles)"
        _panel(figure, axes, found, found.shear_kPa, colours, what)
    title = f"Contact along the limb: {found.socket} socket, {found.material_set} set"
    figure.text(
        0.5, 1 - 4.5 / height_mm(figure), title, ha="center", va="center", fontsize=9.5,
        parse_math=False,
    )  # fmt: skip
    note = (
        f"Horizontal lines: the levels that were solved; between them colours are interpolated "
        f"linearly. Values are running means over {WINDOW} along the skin, at its unloaded place. "
        f"{PLANE_STRAIN}"
    )
    if any(np.isfinite(level.error_kPa) for level in found.levels):
        note += f" ±: mesh error; *: not settled within {100 * SETTLED:g} %."
    figure.text(
        LEFT_MM / WIDTH_MM, 1.5 / height_mm(figure), "\n".join(textwrap.wrap(note, NOTE_LETTERS)),
        va="bottom", fontsize=6,
    )  # fmt: skip
    return figure


def save(found: PressureMap, folder: Path) -> Path:
    """Write the picture of a map as NAME.png; return its path."""
    with type_set():
        return files.save(draw(found), folder / f"{found.name}.png")


def _panel(
    figure: Figure,
    axes: Axes,
    found: PressureMap,
    values: Array,
    colours: ScalarMappable,
    what: str,
) -> None:
    """Draw one quantity, (n levels, m angles), with its axes and colour bar."""
    angle, turned = _unrolled(values)
    height = found.height_mm
    low, high = height.min(), height.max()
    margin = 0.5 * np.diff(height).min() if len(height) > 1 else 5.0
    axes.set(xlim=(angle[0], angle[-1]), ylim=(low - margin, high + margin))
    axes.add_patch(
        Rectangle((angle[0], low - margin), 360, high - low + 2 * margin, facecolor="#f7f7f7")
    )
    lines = _lines_of_equal(colours)
    for run in _runs(found.levels):
        if len(run) > 1:
            axes.pcolormesh(
                angle, height[run], turned[run], shading="gouraud", cmap=colours.cmap,
                norm=colours.norm, rasterized=True,
            )  # fmt: skip
            drawn = axes.contour(
                angle, height[run], turned[run], levels=lines, colors="#222222", linewidths=0.4
            )
            axes.clabel(drawn, fontsize=5.5, fmt=_value, inline_spacing=8)
        else:  # no neighbour to interpolate to
            axes.scatter(
                angle, np.full(len(angle), height[run[0]]), c=turned[run[0]], cmap=colours.cmap,
                norm=colours.norm, marker="s", s=5, linewidths=0, zorder=3,
            )  # fmt: skip
    for row, level in enumerate(found.levels):
        if level.solved:
            axes.axhline(height[row], **LEVEL_LINE)
        else:
            _draw_missing(axes, found, row)
    _name_axes(axes, found)
    bar = figure.colorbar(
        colours, ax=axes, cax=axes.inset_axes((1.12, 0.0, 0.025, 1.0)), label=what
    )
    bar.outline.set_linewidth(0.4)  # type: ignore[operator]


def _value(level: float) -> str:
    return f"{level:g}".replace("-", "\N{MINUS SIGN}")


def _unrolled(values: Array) -> tuple[Array, Array]:
    """Return the picture's horizontal axis, 0 at the cut, and the values along it, once around."""
    order = np.argsort((angles() - CUT_DEG) % 360)
    along = np.append((angles()[order] - CUT_DEG) % 360, 360.0)
    return along, np.column_stack([values[:, order], values[:, order[:1]]])


def _runs(levels: Sequence[MapLevel]) -> list[list[int]]:
    """Return the rows of levels that have results, those beside one another together."""
    rows = groupby(range(len(levels)), lambda row: levels[row].solved)
    return [list(run) for solved, run in rows if solved]


def _draw_missing(axes: Axes, found: PressureMap, row: int) -> None:
    """Hatch the place of a level without results, up to its neighbours or the picture's edge."""
    edges = [axes.get_ylim()[0], *found.height_mm, axes.get_ylim()[1]]
    low, high = edges[row], edges[row + 2]
    axes.add_patch(Rectangle((0, low), 360, high - low, zorder=1.5, **MISSING))
    axes.text(
        180, found.height_mm[row], f"level {found.levels[row].place.name}: no result",
        ha="center", va="center", fontsize=6, zorder=4,
        bbox={"facecolor": "white", "linewidth": 0, "pad": 1},
    )  # fmt: skip


def _name_axes(axes: Axes, found: PressureMap) -> None:
    known = found.frame.known
    quarters = ("posterior", "lateral", "anterior", "medial", "posterior")
    if known:
        names = [f"{word}\n{(CUT_DEG + 90 * i) % 360:g}°" for i, word in enumerate(quarters)]
    else:
        names = [f"{(CUT_DEG + 90 * i) % 360:g}°" for i in range(5)]
    axes.set_xticks(np.arange(5) * 90.0, names)
    axes.set_xticks(np.arange(0, 361, 30), minor=True)
    axes.set_xlabel("anatomical angle around the limb" if known else "angle from +x")
    axes.set_ylabel("height above the distal end, mm")
    right = axes.secondary_yaxis("right")
    heights, shown = _apart(found)
    right.set_yticks(heights, shown, fontsize=6)
    right.set_ylabel("level, share of the height", fontsize=6.5)


def _apart(found: PressureMap) -> tuple[list[float], list[str]]:
    """Return the levels whose names do not overlap at the side."""
    height = found.height_mm
    least = (height.max() - height.min()) / 24 if len(height) > 1 else 0.0
    chosen: list[int] = []
    for row in range(len(height)):
        if not chosen or height[row] - height[chosen[-1]] >= least:
            chosen.append(row)
    return [float(height[i]) for i in chosen], [found.levels[i].place.name for i in chosen]


def _mark_largest(axes: Axes, found: PressureMap) -> None:
    pressure = found.pressure_kPa
    row, column = np.unravel_index(np.nanargmax(pressure), pressure.shape)
    place = (angles()[column] - CUT_DEG) % 360, found.height_mm[row]
    axes.plot(*place, marker="+", color="black", markersize=8, markeredgewidth=1.0, zorder=5)
    value = pressure[row, column]
    said = with_error(f"{value:.0f}", value, found.levels[int(row)].error_kPa)
    axes.annotate(
        f"{said} kPa", place, xytext=(4, 4), textcoords="offset points",
        fontsize=6.5, zorder=5, annotation_clip=False,
        path_effects=[withStroke(linewidth=1.6, foreground="white")],
    )  # fmt: skip


def _lines_of_equal(colours: ScalarMappable) -> Array:
    """Return round values between the ends of the colours."""
    low, high = colours.get_clim()
    values = np.asarray(MaxNLocator(6).tick_values(low, high))  # type: ignore[arg-type]
    return values[(values > low) & (values < high) & (values != 0)]  # type: ignore[operator]


def _round_up(value: float) -> float:
    """Return the end of a scale that holds a value."""
    if not value > 0:
        return 1.0
    return float(MaxNLocator(6).tick_values(0, value)[-1])
