"""CSV tables that several cases share, each case with rows of its own."""

import csv
import io
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from calfsocket.io.errors import WriteError, in_one_line
from calfsocket.io.files import locked, replacing

if TYPE_CHECKING:
    import pandas as pd

FLOAT_FORMAT = "%.10g"

Name = tuple[str, ...]
"""Values of the columns that name a case."""


@dataclass(frozen=True)
class Rows:
    """Rows of a CSV as texts, which pandas takes many times as long to read and to write."""

    columns: list[str]
    rows: list[list[str]]

    @classmethod
    def read(cls, path: Path) -> "Rows":
        """Read a file.

        Raises
        ------
        OSError, ValueError
            When it cannot be read, or is no table.
        """
        with path.open(encoding="utf-8-sig", newline="") as file:
            try:
                columns, *rows = filter(None, csv.reader(file, strict=True))
            except csv.Error as error:
                raise ValueError(str(error)) from None
        if set(map(len, rows)) - {len(columns)}:
            raise ValueError("rows differ in length")
        return cls(columns, rows)

    def of_cases(self, key: Sequence[str]) -> dict[Name, list[list[str]]]:
        """Return the rows of each case, in their order."""
        places = [self.columns.index(column) for column in key]
        found: dict[Name, list[list[str]]] = {}
        for row in self.rows:
            found.setdefault(tuple([row[place] for place in places]), []).append(row)
        return found

    def under(self, columns: Sequence[str]) -> "Rows":
        """Return the rows with other columns; what they lack is empty."""
        if list(columns) == self.columns:
            return self
        place = {column: i for i, column in enumerate(self.columns)}
        at = [place.get(column, len(self.columns)) for column in columns]
        return Rows(list(columns), [[[*row, ""][i] for i in at] for row in self.rows])

    def text(self) -> str:
        """Return the file's text."""
        buffer = io.StringIO()
        csv.writer(buffer, lineterminator="\n").writerows([self.columns, *self.rows])
        return buffer.getvalue()

    def write(self, path: Path) -> None:
        """Write the file, in one step."""
        with replacing(path) as temporary:
            temporary.write_text(self.text(), encoding="utf-8", newline="")


def _text(value: object) -> str:
    if isinstance(value, float | np.floating):
        return "" if np.isnan(value) else FLOAT_FORMAT % (value + 0.0)  # -0 is written as 0
    return "" if value is None else str(value)


def merge_csv(
    path: Path, rows: "pd.DataFrame", key: Sequence[str], order: Sequence[tuple[str, ...]]
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
    path = Path(path)
    texts = [map(_text, rows.iloc[:, i].tolist()) for i in range(rows.shape[1])]
    new = Rows(list(rows.columns), list(map(list, zip(*texts, strict=True))))
    rank = {case: place for place, case in enumerate(order)}
    with locked(path.parent):
        columns, cases = new.columns, new.of_cases(key)
        if path.exists():
            others = _read_table(path, key)
            columns = list(dict.fromkeys([*columns, *others.columns]))
            cases = others.under(columns).of_cases(key) | new.under(columns).of_cases(key)
        names = sorted(cases, key=lambda name: (rank.get(name, len(rank)), name))
        Rows(columns, [row for name in names for row in cases[name]]).write(path)


def remove_rows(path: Path, key: Sequence[str], cases: Iterable[Name]) -> None:
    """Remove the rows of cases from a CSV that several cases share, if there is one."""
    path = Path(path)
    with locked(path.parent):
        if not path.exists():
            return
        table = _read_table(path, key)
        gone = set(cases)
        kept = [row for name, of in table.of_cases(key).items() if name not in gone for row in of]
        if len(kept) < len(table.rows):
            Rows(table.columns, kept).write(path)


def _read_table(path: Path, key: Sequence[str]) -> Rows:
    """Read a CSV as text; raise a WriteError when it has not the columns of `key`."""
    try:
        table = Rows.read(path)
        if missing := [column for column in key if column not in table.columns]:
            raise ValueError(f"no column {missing[0]}")
    except ValueError as error:
        raise WriteError(
            f"{path}: is not the table that this run wrote; move it away, or restore it "
            f"({in_one_line(error)})"
        ) from None
    return table
