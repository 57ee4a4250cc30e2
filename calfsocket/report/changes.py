r"""What the Combined set changes: relative changes of maxima and at their sites.

In percent, of signed values with the Separate set as reference,

.. math:: 100 \frac{c - s}{|s|}

is positive when the signed value rises. For a negative stress whose magnitude grows it is negative,
so that the change of magnitude stands beside it:

.. math:: 100 \frac{|c| - |s|}{|s|}.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from calfsocket.postprocess.contact_line import ContactLine
from calfsocket.postprocess.mesh_error import error_of
from calfsocket.postprocess.quantities import (
    NOWHERE,
    SIGNED,
    SUMMARY_TISSUES,
    Maximum,
    first_largest,
    reported,
)
from calfsocket.report.names import SETS
from calfsocket.simulation.result import Result
from calfsocket.simulation.results import Results

COLUMNS = ("socket", "tissue", "quantity", "site", "separate", "combined", "region", "x_mm", "y_mm")

NUMBERS = ("separate", "combined", "relative_change_pct", "magnitude_change_pct")
"""Columns that have a mesh error where both cases have a second mesh."""

Row = tuple[str, str, float, float, str, float, float]
"""The columns from the quantity on."""


def relative_change(separate: float, combined: float) -> float:
    """Relative change of signed values, %; NaN where the reference is 0."""
    return 100 * (combined - separate) / abs(separate) if separate else np.nan


def magnitude_change(separate: float, combined: float) -> float:
    """Change of magnitude, %; NaN where the reference is 0."""
    return relative_change(abs(separate), abs(combined))


def complete_sockets(results: Results) -> tuple[str, ...]:
    """Return the sockets that are solved with both material sets."""
    return tuple(
        socket for socket in results.sockets if all((socket, name) in results for name in SETS)
    )


def relative_changes(results: Results, tissues: Sequence[str] = SUMMARY_TISSUES) -> pd.DataFrame:
    """Compare the two sets in every socket that has both, in some tissues.

    Returns
    -------
    DataFrame
        One row a socket, tissue, quantity and site, with `COLUMNS`: values of both sets in the
        quantity's unit and the site in the reference section, and with relative_change_pct and
        magnitude_change_pct. Site "max_separate"
        compares both sets where Separate has its maximum, "max_combined" where Combined has it,
        "max_both" each set's own maximum, wherever it is. Contact pressure stands with the skin:
        contact_pressure_max at its sites, and contact_pressure_mean, which has no site. Where cases
        have a second mesh, each of `NUMBERS` has a column with its mesh error: by the change of the
        number itself, since errors of two cases on one mesh are alike.
    """
    parts = [_of_socket(results, socket, tissues) for socket in complete_sockets(results)]
    return pd.concat(parts or [_compared("", (), ())], ignore_index=True)


def _of_socket(results: Results, socket: str, tissues: Sequence[str]) -> pd.DataFrame:
    """Return the rows of a socket, with mesh errors where both of its cases have one."""
    pair = [results[socket, name] for name in SETS]
    table = _compared(socket, pair, tissues)
    second = [each.second for each in pair if each.second]
    if len(second) < len(pair):
        return table
    other = _compared(socket, second, tissues)
    times = max(each.times_change for each in pair)
    signed = table["quantity"].isin(SIGNED)
    errors = {}
    for name in NUMBERS:
        change = (table[name] - other[name]).abs()
        if name in SETS:  # as in the summary
            change = change.where(~signed, (table[name].abs() - other[name].abs()).abs())
        errors[error_of(name)] = times * change
    return table.assign(**errors)


def _compared(socket: str, pair: Sequence[Result], tissues: Sequence[str]) -> pd.DataFrame:
    rows: list[tuple[Any, ...]] = []
    for tissue in tissues:
        s, c = pair
        found = [row for name in reported(tissue) for row in _tissue_rows(s, c, tissue, name)]
        if tissue == "skin":
            found += _contact_rows(s, c)
        rows += [(socket, tissue, *row) for row in found]
    table = pd.DataFrame(rows, columns=list(COLUMNS))
    return table.assign(
        relative_change_pct=table.separate.combine(table.combined, relative_change),
        magnitude_change_pct=table.separate.combine(table.combined, magnitude_change),
    )


def _row(quantity: str, site: str, separate: float, combined: float, at: Maximum = NOWHERE) -> Row:
    return quantity, site, separate, combined, at.region, at.x_mm, at.y_mm


def _tissue_rows(separate: Result, combined: Result, tissue: str, quantity: str) -> list[Row]:
    s, c = (each.quantities.maximum(tissue, quantity) for each in (separate, combined))
    c_at_s = combined.quantities.level_at(tissue, quantity, s.x_mm, s.y_mm)
    s_at_c = separate.quantities.level_at(tissue, quantity, c.x_mm, c.y_mm)
    return [
        _row(quantity, "max_separate", s.value, c_at_s, s),
        _row(quantity, "max_combined", s_at_c, c.value, c),
        _row(quantity, "max_both", s.value, c.value),
    ]


def _contact_rows(separate: Result, combined: Result) -> list[Row]:
    peak, mean = "contact_pressure_max", "contact_pressure_mean"
    rows = []
    for site, each in (("max_separate", separate), ("max_combined", combined)):
        arc = each.line.arc_mm[first_largest(each.line.running_mean_kPa)]
        s, c = (_mean_at(result.line, arc) for result in (separate, combined))
        rows.append(_row(peak, site, s, c, each.contact_levels[peak]))
    for quantity in (peak, mean):
        s, c = (result.contact_levels[quantity].value for result in (separate, combined))
        rows.append(_row(quantity, "max_both", s, c))
    return rows


def _mean_at(line: ContactLine, arc_mm: float) -> float:
    """Return the running mean of contact pressure at the skin's point nearest to a place, kPa."""
    return float(line.running_mean_kPa[np.argmin(np.abs(line.arc_mm - arc_mm))])
