"""Numbers and lists as people read them."""

from collections.abc import Iterable

import numpy as np
import pandas as pd

from calfsocket.postprocess.mesh_error import settled

TIMES = "\N{MULTIPLICATION SIGN}"
TOGETHER = "\N{NO-BREAK SPACE}"  # a narrow cell breaks before its bracket, not within it


def number(value: float) -> str:
    """Three digits and a minus sign, powers of ten far from 1; empty for NaN."""
    if not np.isfinite(value):
        return ""
    if value == 0:
        return "0"
    if not 1e-3 <= abs(value) < 1e5:
        mantissa, exponent = f"{value:.1e}".split("e")
        text = f"{mantissa}·10^{int(exponent)}"
    else:
        text = f"{value:.0f}" if abs(value) >= 99.95 else f"{value:#.3g}"
    return text.replace("-", "\N{MINUS SIGN}")


def measured(value: float, error: float = np.nan) -> str:
    """Return a number with its mesh error behind it, and a star where it has not settled."""
    if not (np.isfinite(error) and np.isfinite(value)):
        return number(value)
    star = "" if settled(value, error) else "*"
    return f"{number(value)}{TOGETHER}\N{PLUS-MINUS SIGN}{TOGETHER}{_short(error)}{star}"


def _short(error: float) -> str:
    """Return an error with two digits."""
    if error == 0 or not 1e-3 <= error < 1e5:
        return number(error)
    return f"{error:.0f}" if error >= 9.95 else f"{error:#.2g}"


def measured_all(values: "pd.Series[float]", rows: pd.DataFrame, column: str) -> list[str]:
    """Return numbers with their mesh errors, which a column of the rows has, if there are any."""
    errors = rows[column] if column in rows else pd.Series(np.nan, rows.index)
    return [measured(*pair) for pair in zip(values, errors, strict=True)]


def change(value: float) -> str:
    """Return a change in percent with its sign, without decimals from 10 on."""
    if not np.isfinite(value):
        return ""
    if abs(value) >= 1e5:
        text = number(value)
    else:
        text = f"{value:.0f}" if abs(value) >= 10 else f"{value:.1f}".replace("-0.0", "0.0")
        text = text.replace("-", "\N{MINUS SIGN}")
    return f"+{text}" if value > 0 else text


def span(values: "pd.Series[float]") -> str:
    """Return the range of changes in words."""
    return " to ".join(dict.fromkeys((change(values.min()), change(values.max()))))


def changes(values: "pd.Series[float]", most: int = 4) -> str:
    """Return changes in words: their range where there are many."""
    return span(values) if len(values) > most else listed(map(change, values))


def listed(words: Iterable[str], comma: bool = False) -> str:
    """Join words to a list as one reads it."""
    *first, last = [*words] or [""]
    return f"{', '.join(first)}{',' if comma else ''} and {last}" if first else last
