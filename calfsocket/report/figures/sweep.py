"""What comes of a parameter of a sweep: a panel for each result, a curve for each other choice."""

import textwrap
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from calfsocket.plotting.style import WIDTH_MM, add_axes, new_figure
from calfsocket.postprocess.mesh_error import error_of
from calfsocket.report import names
from calfsocket.report.findings import Findings
from calfsocket.report.tables import heading, sweep, swept_results
from calfsocket.report.variants import variants
from calfsocket.simulation.record import KEY
from calfsocket.simulation.results import Results

MOST_CURVES, MOST_PANELS = 10, 12
TITLE_LETTERS, CURVE_LETTERS = 36, 120

# Of panels, mm.
ABREAST, PANEL_MM, LEFT_MM, HEAD_MM, FOOT_MM, LINE_MM = 3, 38.0, 12.0, 9.0, 11.0, 4.0


def figures(findings: Findings) -> dict[str, Callable[[], Figure]]:
    """Return the figure of a sweep over numbers by its name, not yet drawn."""
    study = findings.study
    if findings.uncertainty or findings.levels or variants(study):
        return {}
    data = sweep(study).data
    parameters = parameters_of(study, data)
    numeric = [name for name in parameters if pd.api.types.is_numeric_dtype(data[name])]
    several = [name for name in numeric if data[name].nunique() > 1]
    if not several:
        return {}
    most = max(several, key=lambda name: data[name].nunique())
    return {"sweep": partial(draw, data, most, [name for name in parameters if name != most])}


def parameters_of(study: Results, data: pd.DataFrame) -> list[str]:
    """Return the columns of parameters in the table of a sweep, which may have a unit."""
    known = {name for record in study.records.values() for name in record.changes}
    return [column for column in data if column.partition(" [")[0] in known]


def curves_of(data: pd.DataFrame, parameter: str, others: Sequence[str]) -> dict[str, pd.DataFrame]:
    """Return the rows of each curve over a parameter, by what its cases share.

    That is socket, material set, and the other parameters; where these change together with the
    parameter, the first two alone.
    """
    base = [data[name].str.partition("@")[0] for name in KEY]
    rows = data.assign(**dict(zip(KEY, base, strict=True)))
    rows = rows.assign(material_set=rows.material_set.map(names.material_set))
    together = rows.groupby([*KEY, *others], dropna=False, sort=False)[parameter].nunique().max()
    shared = [*KEY, *(others if together > 1 else [])]
    varying = [name for name in shared if rows[name].nunique(dropna=False) > 1]
    if not varying:
        return {" ".join(rows[[*KEY]].iloc[0]): rows.sort_values(parameter)}
    return {
        ", ".join(map(_choice, varying, key)): part.sort_values(parameter)
        for key, part in rows.groupby(varying, dropna=False, sort=False)
    }


def _choice(column: str, value: Any) -> str:
    """Return a choice in words: with its parameter, where it is a value of one."""
    if column in KEY:
        return str(value)
    name, _, unit = column.rstrip("]").partition(" [")
    text = f"{value:g}" if isinstance(value, float) else str(value)
    return " ".join(filter(None, [name, text, unit]))


def draw(data: pd.DataFrame, parameter: str, others: Sequence[str]) -> Figure:
    """Draw results over a parameter, with mesh errors where there are any."""
    results, curves = swept_results(data), curves_of(data, parameter, others)
    panels, shown = results[:MOST_PANELS], dict([*curves.items()][:MOST_CURVES])
    rows = -(-len(panels) // ABREAST)
    foot = LINE_MM * len(shown) + LINE_MM
    figure = new_figure(rows * (HEAD_MM + PANEL_MM + FOOT_MM) + foot)
    width = WIDTH_MM / ABREAST
    for place, result in enumerate(panels):
        row, column = divmod(place, ABREAST)
        bottom = foot + (rows - 1 - row) * (HEAD_MM + PANEL_MM + FOOT_MM) + FOOT_MM
        axes = add_axes(figure, LEFT_MM + column * width, bottom, width - LEFT_MM - 2.0, PANEL_MM)
        _draw_curves(axes, [*shown.values()], parameter, result)
        axes.set_title(textwrap.fill(heading(result), TITLE_LETTERS), fontsize=7, parse_math=False)
        axes.set_xlabel(parameter, fontsize=7, parse_math=False)
    handles = [
        Line2D(
            [],
            [],
            color=f"C{number}",
            marker=".",
            label=textwrap.shorten(name, CURVE_LETTERS),
        )
        for number, name in enumerate(shown)
    ]
    legend = figure.legend(handles=handles, loc="lower left", frameon=False, borderaxespad=0.4)
    for text in legend.get_texts():
        text.set_parse_math(False)
    if len(panels) < len(results) or len(shown) < len(curves):
        left_out = (
            f"{len(panels)} of {len(results)} results, {len(shown)} of {len(curves)} curves; "
            "all are in sweep.csv"
        )
        figure.text(0.99, 0.002, left_out, ha="right", va="bottom", fontsize=6)
    return figure


def _draw_curves(axes: Axes, curves: Sequence[pd.DataFrame], parameter: str, result: str) -> None:
    for number, rows in enumerate(curves):
        error = rows.get(error_of(result), pd.Series(np.nan, rows.index))
        axes.errorbar(
            rows[parameter], rows[result], yerr=error.fillna(0.0), color=f"C{number}", marker=".",
            markersize=4, linewidth=1.0, elinewidth=0.8, capsize=2.0,
        )  # fmt: skip
    shown = pd.concat([rows[result] for rows in curves])
    if (shown >= 0).all():
        axes.set_ylim(0.0, None if shown.any() else 1.0)
    axes.grid(color="#d0d0d0", linewidth=0.4)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
