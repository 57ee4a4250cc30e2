"""Figures 5, 6 and 8: what merging fascia and muscle changes, beside the paper's own numbers."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, MultipleLocator, NullLocator

from calfsocket.postprocess.quantities import SUMMARY_TISSUES
from calfsocket.report import comparison, names
from calfsocket.report.figures.style import (
    OTHER_SOCKET,
    SOCKET_COLOURS,
    WIDTH_MM,
    add_axes,
    legend_at,
    new_figure,
    socket_title,
)
from calfsocket.report.results import Results

STRESSES = ("effective_stress", "shear_stress")
STRAINS = ("amp_log_strain", "shear_log_strain")
SHORT = {
    "effective_stress": "effective",
    "shear_stress": "shear",
    "amp_log_strain": "AMP",
    "shear_log_strain": "shear",
    "max_separate": "S",
    "max_combined": "C",
}

LINEAR_TO_PCT = 100.0  # logarithmic beyond, where all of the range is shown
LIMITED_PCT = 250.0
PAPER: dict[str, Any] = {"marker": "D", "markerfacecolor": "white", "markeredgecolor": "black"}


def of_maxima(results: Results) -> Figure:
    """Draw the relative change of the maxima by equation (3), as the paper's figure 5."""
    return _maxima(results, ("ours", "paper"), "relative change, eq. (3), %")


def of_magnitudes(results: Results) -> Figure:
    """Draw the change of the maxima's magnitude, which equation (3) does not tell."""
    return _maxima(results, ("ours_magnitude", "paper_magnitude"), "change of magnitude, %")


def of_stress_at_sites(results: Results) -> Figure:
    """Draw the relative change of stresses at both sets' sites, as the paper's figure 6."""
    return _at_sites(results, STRESSES)


def of_strain_at_sites(results: Results) -> Figure:
    """Draw the relative change of strains at both sets' sites, as the paper's figure 8."""
    return _at_sites(results, STRAINS)


def _maxima(results: Results, columns: tuple[str, str], label: str) -> Figure:
    table = comparison.changes(results)
    table = table[table.site == "max_both"]
    sockets = _sockets(results)
    figure = new_figure(130.0)
    for bottom, outcomes, title in ((79.0, STRESSES, "stresses"), (18.0, STRAINS, "strains")):
        axes = add_axes(figure, 14.0, bottom, WIDTH_MM - 16.0, 45.0)
        _bars(axes, table, "outcome", outcomes, columns, sockets)
        axes.set_title(f"Largest {title}")
        axes.set_ylabel(label)
    legend_at(figure, 14.0, 3.0, _key(sockets))
    return figure


def _at_sites(results: Results, outcomes: Sequence[str]) -> Figure:
    table = comparison.changes(results)
    sockets = _sockets(results)
    figure = new_figure(136.0)
    width = (WIDTH_MM - 2.0) / 2 - 15.0
    for j, outcome in enumerate(outcomes):
        of_outcome = table[table.outcome == outcome]
        for bottom, limited in ((84.0, False), (23.0, True)):
            axes = add_axes(figure, 15.0 + j * (width + 15.0), bottom, width, 46.0)
            _bars(
                axes, of_outcome, "site", ("max_separate", "max_combined"),
                ("ours", "paper"), sockets,
            )  # fmt: skip
            if limited:
                axes.set_ylim(-LIMITED_PCT, LIMITED_PCT)
                axes.yaxis.set_major_locator(MultipleLocator(100))
                axes.set_title(f"{names.OUTCOMES[outcome]}, within ±{LIMITED_PCT:g} %")
            else:
                _logarithmic(axes)
                axes.set_title(f"{names.OUTCOMES[outcome]}, full range")
            if j == 0:
                axes.set_ylabel("relative change, eq. (3), %", labelpad=2)
    sites = [
        Line2D([], [], linestyle="", label=f"{SHORT[site]}: {names.SITES[site]}")
        for site in ("max_separate", "max_combined")
    ]
    legend_at(figure, 15.0, 7.0, _key(sockets))
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
    return rf"{sign}10$^{{{round(np.log10(abs(value)))}}}$"


def _sockets(results: Results) -> list[str]:
    return [socket for socket in results.sockets if results.complete(socket)]


def _bars(
    axes: Axes,
    table: pd.DataFrame,
    inner: str,
    inners: Sequence[str],
    columns: tuple[str, str],
    sockets: Sequence[str],
) -> None:
    """Draw clusters of bars: tissues, within them `inners`, within them sockets.

    `columns` are ours, as bars, and the paper's, as marks.
    """
    at = table.set_index(["tissue", inner, "socket"])
    breadth = len(inners) + 0.45
    width = 0.84 / len(sockets)
    ticks, labels = [], []
    tissues = [tissue for tissue in SUMMARY_TISSUES if tissue in set(table.tissue)]
    for i, tissue in enumerate(tissues):
        left = i * breadth
        if i % 2 == 0:
            axes.axvspan(left - 0.225, left + breadth - 0.225, color="#f2f2f2", zorder=0, lw=0)
        for k, name in enumerate(inners):
            ticks.append(left + k + 0.5)
            labels.append(SHORT[name])
            for s, socket in enumerate(sockets):
                if (tissue, name, socket) not in at.index:
                    continue
                row = at.loc[(tissue, name, socket)]
                x = left + k + 0.08 + (s + 0.5) * width
                axes.bar(
                    x,
                    row[columns[0]],
                    width,
                    color=SOCKET_COLOURS.get(socket, OTHER_SOCKET),
                    zorder=2,
                )
                axes.plot(
                    x, row[columns[1]], **PAPER, markersize=2.6, markeredgewidth=0.6,
                    zorder=3,
                )  # fmt: skip
        axes.text(
            left + 0.5 * len(inners), -0.11, names.TISSUES[tissue],
            transform=axes.get_xaxis_transform(), ha="center", va="top", fontsize=7.5,
        )  # fmt: skip
    axes.axhline(0, color="black", linewidth=0.6, zorder=2.5)
    axes.set_xticks(ticks, labels)
    axes.tick_params(axis="x", length=0)
    axes.set_xlim(-0.225, len(tissues) * breadth - 0.225)
    axes.grid(axis="y", color="#d0d0d0", linewidth=0.4, zorder=1)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def _key(sockets: Sequence[str]) -> list[Artist]:
    bars: list[Artist] = [
        Patch(color=SOCKET_COLOURS.get(socket, OTHER_SOCKET), label=socket_title(socket))
        for socket in sockets
    ]
    paper = Line2D([], [], linestyle="", **PAPER, markersize=3.2, markeredgewidth=0.6,
                   label="the paper's number")  # fmt: skip
    return [*bars, paper]
