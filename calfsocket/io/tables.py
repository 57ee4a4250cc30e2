"""CSV tables that several cases share, each case with rows of its own."""

from collections.abc import Collection, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from calfsocket.io.errors import WriteError, in_one_line
from calfsocket.io.files import locked, replacing

FLOAT_FORMAT = "%.10g"


def _text(value: object) -> str:
    if isinstance(value, float | np.floating):
        return "" if np.isnan(value) else FLOAT_FORMAT % (value + 0.0)  # -0 is written as 0
    return "" if value is None else str(value)


def merge_csv(
    path: Path, rows: pd.DataFrame, key: Sequence[str], order: Sequence[tuple[str, ...]]
) -> None:
    """Put a case's rows into a CSV that several cases share, in place of its earlier rows.

    Several processes may do so at the same time. Rows of other cases are kept to the letter.

    Parameters
    ----------
    rows
        In the order to keep. Floats are written with `FLOAT_FORMAT`, NaN as an empty cell.
    key
        Columns that name a case.
    order
        Cases in the study's order; others come last, in order of name.
    """
    path, key = Path(path), list(key)
    new = rows.map(_text)
    cases = set(new[key].itertuples(index=False, name=None))
    rank = {case: place for place, case in enumerate(order)}
    with locked(path.parent):
        merged = new
        if path.exists():
            others = _of_others(_read_table(path, key), key, cases)
            merged = pd.concat([new, others], ignore_index=True).fillna("")
        names = [tuple(case) for case in merged[key].itertuples(index=False, name=None)]
        places = sorted(range(len(names)), key=lambda i: (rank.get(names[i], len(rank)), names[i]))
        with replacing(path) as temporary:
            merged.iloc[places].to_csv(temporary, index=False)


def remove_rows(path: Path, key: Sequence[str], cases: Collection[tuple[str, ...]]) -> None:
    """Remove the rows of cases from a CSV that several cases share, if there is one."""
    path, key = Path(path), list(key)
    with locked(path.parent):
        if not path.exists():
            return
        old = _read_table(path, key)
        others = _of_others(old, key, cases)
        if len(others) < len(old):
            with replacing(path) as temporary:
                others.to_csv(temporary, index=False)


def _of_others(
    table: pd.DataFrame, key: list[str], cases: Collection[tuple[str, ...]]
) -> pd.DataFrame:
    names = table[key].itertuples(index=False, name=None)
    return table[[case not in cases for case in names]]


def _read_table(path: Path, key: Sequence[str]) -> pd.DataFrame:
    """Read a CSV as text; raise a WriteError when it has not the columns of `key`."""
    try:
        table = pd.read_csv(path, dtype=str, keep_default_na=False)
        table[key]
    except (ValueError, KeyError) as error:
        raise WriteError(
            f"{path}: is not the table that this run wrote; move it away, or restore it "
            f"({in_one_line(error)})"
        ) from None
    return table
