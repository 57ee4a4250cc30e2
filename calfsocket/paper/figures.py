"""Figures 5, 6 and 8: what merging fascia and muscle changes, beside the paper's numbers."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path
from matplotlib.ticker import FuncFormatter, MultipleLocator, NullLocator
from numpy.typing import NDArray

from calfsocket.paper.evidence import STRAINS, STRESSES, Evidence
from calfsocket.plotting.style import WIDTH_MM, add_axes, legend_at, new_figure
from calfsocket.postprocess.mesh_error import error_of
from calfsocket.postprocess.quantities import SUMMARY_TISSUES
from calfsocket.report import names
from calfsocket.report.changes import complete_sockets

# After Okabe and Ito: distinct to colour-blind eyes, and in print by their lightness.
SOCKET_COLOURS = {"TC": "#e69f00", "TSB": "#56b4e9", "HS": "#1b4f72"}

SHORT = {
    "effective_stress": "effective",
    "shear_stress": "shear",
    "amp_log_strain": "AMP",
    "shear_log_strain": "shear",
    "max_separate": "S",
    "max_combined": "C",
}

LINEAR_TO_PCT = 100.0  # logarithmic beyond, where all of the range is shown
LIMITED_PCT, ROOM_PCT = 250.0, 10.0  # room for all of a mark at the limit
PAPER: dict[str, Any] = {"linestyle": "", "marker": "D", "markeredgewidth": 0.6}
PAPER |= {"markerfacecolor": "white", "markeredgecolor": "black"}

ERROR: dict[str, Any] = {"color": "black", "linewidth": 0.6}

RAISED = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")
"""Digits of an exponent."""

AT_SITES = ("max_separate", "max_combined")


def figures(evidence: Evidence) -> dict[str, Callable[[], Figure]]:
    """Return the figures by name, not yet drawn; none where no socket has both sets."""
    if not complete_sockets(evidence.results):
        return {}
    ours, magnitudes = ("ours", "paper"), ("ours_magnitude", "paper_magnitude")
    relative, change = "relative change, eq. (3), %", "change of magnitude, %"
    return {
        # as the paper's figure 5
        "changes_of_maxima": lambda: _maxima(evidence.compared_changes, ours, relative),
        "changes_of_magnitude": lambda: _maxima(evidence.compared_changes, magnitudes, change),
        "stress_at_sites": lambda: at_sites(evidence.compared_changes, STRESSES),
        "strain_at_sites": lambda: at_sites(evidence.compared_changes, STRAINS),
    }


def _maxima(table: pd.DataFrame, columns: tuple[str, str], label: str) -> Figure:
    table = table[table.site == "max_both"]
    sockets = list(table.socket.unique())
    figure = new_figure(130.0)
    for bottom, quantities, title in ((79.0, STRESSES, "stresses"), (18.0, STRAINS, "strains")):
        axes = add_axes(figure, 14.0, bottom, WIDTH_MM - 16.0, 45.0)
        _bars(axes, table, "quantity", quantities, columns, sockets)
        axes.set_title(f"Largest {title}", y=1.0)
        axes.set_ylabel(label)
    legend_at(figure, 14.0, 3.0, _key(table))
    return figure


def at_sites(table: pd.DataFrame, quantities: Sequence[str]) -> Figure:
    """Draw the relative change at both sets' sites, as the paper's figures 6 and 8."""
    sockets = list(table.socket.unique())
    figure = new_figure(136.0)
    width = (WIDTH_MM - 2.0) / 2 - 15.0
    for j, quantity in enumerate(quantities):
        of_quantity = table[table.quantity == quantity]
        for bottom, limited in ((84.0, False), (23.0, True)):
            axes = add_axes(figure, 15.0 + j * (width + 15.0), bottom, width, 46.0)
            marked = LIMITED_PCT if limited else np.inf
            _bars(axes, of_quantity, "site", AT_SITES, ("ours", "paper"), sockets, marked)
            if limited:
                axes.set_ylim(-LIMITED_PCT - ROOM_PCT, LIMITED_PCT + ROOM_PCT)
                axes.yaxis.set_major_locator(MultipleLocator(100))
                axes.set_title(f"{names.QUANTITIES[quantity]}, within ±{LIMITED_PCT:g} %", y=1.0)
            else:
                _logarithmic(axes)
                axes.set_title(f"{names.QUANTITIES[quantity]}, full range", y=1.0)
            if j == 0:
                axes.set_ylabel("relative change, eq. (3), %", labelpad=2)
    sites = [
        Line2D([], [], linestyle="", label=f"{SHORT[site]}: {names.SITES[site]}")
        for site in AT_SITES
    ]
    legend_at(figure, 15.0, 7.0, _key(table))
    legend_at(figure, 9.0, 2.0, sites)
    return figure


def _logarithmic(axes: Axes) -> None:
    """Linear to 100 %, logarithmic beyond: references near 0 make changes of many powers of ten."""
    axes.set_yscale("symlog", linthresh=LINEAR_TO_PCT, linscale=0.6)
    axes.autoscale_view()
    low, high = axes.get_ylim()
    powers = range(2, int(np.log10(max(-low, high, 1000))) + 1)
    ticks = [0.0, *(sign * 10.0**k for k in powers for sign in (-1, 1))]
    axes.set_yticks([tick for tick in ticks if low <= tick <= high], minor=False)
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(FuncFormatter(_power))


def _power(value: float, _: object = None) -> str:
    if abs(value) < 1e4:
        return f"{value:+g}".replace("-", "\N{MINUS SIGN}") if value else "0"
    sign = "\N{MINUS SIGN}" if value < 0 else "+"
    return f"{sign}10{str(round(np.log10(abs(value)))).translate(RAISED)}"


def _bars(
    axes: Axes,
    table: pd.DataFrame,
    inner: str,
    inners: Sequence[str],
    columns: tuple[str, str],
    sockets: Sequence[str],
    marked: float = np.inf,
) -> None:
    """Draw clusters of bars: tissues, within them `inners`, within them sockets.

    `columns` are ours, as bars, and the paper's, as marks where they are up to `marked`, %.
    """
    breadth = len(inners) + 0.45
    width = 0.84 / len(sockets)
    tissues = [tissue for tissue in SUMMARY_TISSUES if tissue in set(table.tissue)]
    left = {tissue: i * breadth for i, tissue in enumerate(tissues)}
    shown = table[table[inner].isin(inners)]
    x = (
        shown.tissue.map(left)
        + shown[inner].map({name: k + 0.08 for k, name in enumerate(inners)})
        + shown.socket.map({socket: (s + 0.5) * width for s, socket in enumerate(sockets)})
    )
    ours, paper = (shown[column] for column in columns)
    for socket in sockets:
        mine = (shown.socket == socket) & ours.notna()
        _draw_bars(axes, x[mine].to_numpy(), ours[mine].to_numpy(), width, SOCKET_COLOURS[socket])
    if (column := error_of(columns[0])) in shown:
        _draw_errors(axes, x, ours, shown[column])
    axes.plot(x, paper.where(paper.abs() <= marked), **PAPER, markersize=2.6, zorder=3)
    for i, tissue in enumerate(tissues):
        if i % 2 == 0:
            axes.axvspan(
                left[tissue] - 0.225, left[tissue] + breadth - 0.225,
                color="#f2f2f2", zorder=0, lw=0,
            )  # fmt: skip
        axes.text(
            left[tissue] + 0.5 * len(inners), -0.11, names.TISSUES[tissue],
            transform=axes.get_xaxis_transform(), ha="center", va="top", fontsize=7.5,
        )  # fmt: skip
    axes.axhline(0, color="black", linewidth=0.6, zorder=2.5)
    for at in left.values():
        for k, name in enumerate(inners):
            axes.text(at + k + 0.5, -0.027, SHORT[name], transform=axes.get_xaxis_transform(),
                      ha="center", va="top", fontsize=7)  # fmt: skip
    axes.set_xticks([])
    axes.set_xlim(-0.225, len(tissues) * breadth - 0.225)
    axes.grid(axis="y", color="#d0d0d0", linewidth=0.4, zorder=1)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def _draw_bars(
    axes: Axes, x: NDArray[np.float64], height: NDArray[np.float64], width: float, colour: str
) -> None:
    """Draw bars as one path: `Axes.bar` makes an artist of each, in several times the time."""
    half = 0.5 * width
    corners = [(x - half, 0 * x), (x - half, height), (x + half, height), (x + half, 0 * x)]
    vertices = np.stack([np.column_stack(each) for each in [*corners, corners[0]]], axis=1)
    codes = [Path.MOVETO, Path.LINETO, Path.LINETO, Path.LINETO, Path.CLOSEPOLY] * len(x)
    bars = PathPatch(Path(vertices.reshape(-1, 2), codes), facecolor=colour, linewidth=0, zorder=2)
    bars.sticky_edges.y.append(0.0)  # type: ignore[union-attr]  # no margin beyond bars' zero
    axes.add_artist(bars)
    axes.update_datalim(vertices.reshape(-1, 2))


def _draw_errors(
    axes: Axes, x: "pd.Series[float]", middle: "pd.Series[float]", error: "pd.Series[float]"
) -> None:
    """Draw mesh errors as lines; where these go beyond the bars, the axis does not follow."""
    ends = [np.column_stack([x, middle + side * error]) for side in (-1, 1)]
    lines = LineCollection([*np.stack(ends, axis=1)], **ERROR, zorder=2.6)
    axes.add_collection(lines, autolim=False)


def _key(table: pd.DataFrame) -> list[Artist]:
    sockets = table.socket.unique()
    bars: list[Artist] = [Patch(color=SOCKET_COLOURS[socket], label=socket) for socket in sockets]
    paper = Line2D([], [], **PAPER, markersize=3.2, label="the paper's number")
    if error_of("ours") not in table:
        return [*bars, paper]
    return [*bars, paper, Line2D([], [], **ERROR, label="mesh error")]
