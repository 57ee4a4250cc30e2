"""Numbers and lists as people read them."""

from collections.abc import Iterable

import numpy as np
import pandas as pd

from calfsocket.postprocess.mesh_error import TOGETHER as TOGETHER
from calfsocket.postprocess.mesh_error import with_error

TIMES = "\N{MULTIPLICATION SIGN}"
SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
SMALLEST, LARGEST = 1e-3, 1e5
"""Magnitudes between which numbers have no power of ten."""
WHOLE = 100.0
"""What a change in percent is a change of."""


def number(value: float) -> str:
    """Three digits and a minus sign, powers of ten far from 1; empty for NaN."""
    if not np.isfinite(value):
        return ""
    if value == 0:
        return "0"
    if not SMALLEST <= abs(value) < LARGEST:
        mantissa, exponent = f"{value:.1e}".split("e")
        text = f"{mantissa}·10{str(int(exponent)).translate(SUPERSCRIPTS)}"
    else:
        text = f"{value:.0f}" if abs(value) >= 99.95 else f"{value:#.3g}"
    return text.replace("-", "\N{MINUS SIGN}")


def measured(value: float, error: float = np.nan) -> str:
    """Return a number with its mesh error behind it, and a star where it has not settled."""
    powers = value == 0 or not SMALLEST <= abs(value) < LARGEST
    return with_error(number(value), value, error, number(error) if powers else "")


def measured_all(values: "pd.Series[float]", rows: pd.DataFrame, column: str) -> list[str]:
    """Return numbers with their mesh errors, which a column of the rows has, if there are any."""
    errors = rows[column] if column in rows else pd.Series(np.nan, rows.index)
    return [measured(*pair) for pair in zip(values, errors, strict=True)]


def change(value: float, error: float = np.nan) -> str:
    """Return a change in percent with its sign, without decimals from 10 on, and its mesh error.

    It has settled where the error is small beside the larger of the two numbers.
    """
    text = _change(value)
    large = abs(value) >= LARGEST
    return with_error(text, value, error, number(error) if large else "", WHOLE)


def _change(value: float) -> str:
    if not np.isfinite(value):
        return ""
    if abs(value) >= LARGEST:
        text = number(value)
    else:
        text = f"{value:.0f}" if abs(value) >= 10 else f"{value:.1f}".replace("-0.0", "0.0")
        text = text.replace("-", "\N{MINUS SIGN}")
    return f"+{text}" if value > 0 else text


def changes_all(values: "pd.Series[float]", rows: pd.DataFrame, column: str) -> list[str]:
    """Return changes with their mesh errors, which a column of the rows has, if there are any."""
    return _changes(values, rows[column] if column in rows else None)


def span(values: "pd.Series[float]", errors: "pd.Series[float] | None" = None) -> str:
    """Return the range of changes in words, with the mesh errors of its ends."""
    known = values.notna().to_numpy()
    if not known.any():
        return ""
    ends = values[known].to_numpy()
    said = _changes(values[known], None if errors is None else errors[known])
    return " to ".join(dict.fromkeys((said[ends.argmin()], said[ends.argmax()])))


def changes(
    values: "pd.Series[float]", errors: "pd.Series[float] | None" = None, most: int = 4
) -> str:
    """Return changes in words, with their mesh errors: their range where there are many."""
    return span(values, errors) if len(values) > most else listed(_changes(values, errors))


def _changes(values: "pd.Series[float]", errors: "pd.Series[float] | None") -> list[str]:
    known = np.full(len(values), np.nan) if errors is None else errors
    return [change(*pair) for pair in zip(values, known, strict=True)]


def listed(words: Iterable[str], comma: bool = False) -> str:
    """Join words to a list as one reads it."""
    *first, last = [*words] or [""]
    return f"{', '.join(first)}{',' if comma else ''} and {last}" if first else last
