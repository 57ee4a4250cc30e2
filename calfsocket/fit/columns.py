"""Columns of a CSV file, as spreadsheets and test machines write them.

Columns are separated by semicolons, tabs, commas or blanks: by the first of these, in this order,
that the header has. Decimals may have commas. Lines that begin with ``#`` are remarks. Names may
have capitals, and units in brackets, behind a slash or in a line of their own:

    Stretch;Stress (kPa)          strain_%, stress_MPa          Stretch  Stress
    1,00;0,00                     0, 0                          -        N/mm²
"""

import difflib
import hashlib
import re
from collections.abc import Callable, Collection, Iterable, Mapping
from io import StringIO
from pathlib import Path
from typing import Any
from warnings import catch_warnings, simplefilter

import numpy as np
import pandas as pd

from calfsocket.io.errors import InputError
from calfsocket.io.schema import read_text
from calfsocket.materials.modes import Array

MISSPELT = 0.85
"""Similarity (`difflib`) from which an unknown name is a known one misspelt, and not of another
quantity: strech is 0.92 like stretch, strain_rate 0.71 like strain."""

MOST_COLUMNS = 1000

FIRST = 100
"""Lines among which the header is looked for."""

_UNIT = re.compile(r"(.*\S)\s*[\[(]\s*([^\[\]()]*?)\s*[\])]")
_JOINED = re.compile(r"(?i)\b(engineering|nominal|cauchy|true|log|shear|standard)\s+(?=[a-z])")


class Columns:
    """The columns of a file as text, with the line of each row.

    Parameters
    ----------
    path : Path
        The file.
    names : mapping of str to collection of str
        Columns that are used, and what they are called in files, in small letters.
    needed : collection of collection of str
        Alternatives, of which the file must have one each.

    Attributes
    ----------
    title, sha256 : str
        First remark of the file, or its name; hash of the file.
    units : dict of str to str
        Unit of each column, as written.
    unused : tuple of str
        Headers of other columns.

    Raises
    ------
    InputError
        One line: file, line or column, what is allowed, what to do.
    """

    def __init__(
        self,
        path: Path,
        names: Mapping[str, Collection[str]],
        needed: Collection[Collection[str]],
    ) -> None:
        self.path, self._names, self._needed = path, names, needed
        content = read_text(path)
        self.sha256 = hashlib.sha256(content.encode()).hexdigest()
        lines = [line.strip() for line in content.splitlines()]
        remarks = [line.lstrip("# ").rstrip(";, \t") for line in lines if line.startswith("#")]
        self.title = next(filter(None, remarks), path.name)
        numbered = [
            (number, line)
            for number, line in enumerate(lines, 1)
            if line.strip(";,") and not line.startswith(("#", "sep="))  # a spreadsheet's mark
        ]
        # Machines may write about the test first.
        heads = (i for i, (_, line) in enumerate(numbered[:FIRST]) if self._heads(line))
        start = next(heads, _likely_header([line for _, line in numbered[:FIRST]]))
        self.lines = [number for number, _ in numbered[start + 1 :]]
        self._check_data()
        table = self._table([line for _, line in numbered[start:]])
        header, rows = self._parts(table)
        columns = [self._column(cell) for cell in header]
        if not any(unit for _, unit in columns) and not any(map(_is_number, rows.iloc[0])):
            units = [cell.strip("[]() ") for cell in rows.iloc[0, : len(header)]]
            columns = [(name, unit) for (name, _), unit in zip(columns, units, strict=True)]
            rows, self.lines = rows.iloc[1:], self.lines[1:]
            self._check_data()
        self._check_names([name for name, _ in columns if name], header)
        self.units = {name: unit for name, unit in columns if name}
        self.unused = tuple(
            cell for cell, (name, _) in zip(header, columns, strict=True) if cell and not name
        )
        self._cells = {name: rows[i].str.strip() for i, (name, _) in enumerate(columns) if name}

    def _check_data(self) -> None:
        if not self.lines:
            raise self.wrong("contains no data; give a header and rows of numbers")

    def _heads(self, line: str) -> bool:
        """Whether a line names the columns that are needed."""
        cells = [cell.strip(' "') for cell in _joined(line).split(_separator(line))]
        found = {self._named(cell)[0] for cell in cells}
        return all(not found.isdisjoint(several) for several in self._needed)

    def _table(self, lines: list[str]) -> pd.DataFrame:
        """Return all cells as text, None where a row has none."""
        separator = _separator(lines[0])
        most = max(len(line.split(separator)) for line in lines)
        if most > MOST_COLUMNS:
            raise self.wrong(f"has {most} columns; up to {MOST_COLUMNS} are read")
        try:
            with catch_warnings():
                simplefilter("error", pd.errors.ParserWarning)
                table = pd.read_csv(
                    StringIO("\n".join([_joined(lines[0]), *lines[1:]])),
                    sep=separator or r"\s+",
                    engine="python",
                    header=None,
                    names=range(most),
                    index_col=False,
                    dtype=str,
                    na_filter=False,
                    skipinitialspace=True,
                )
        except (ValueError, pd.errors.ParserWarning) as error:  # pandas' own errors, too
            raise self.wrong(f"is not a table ({error}); check the quotation marks") from None
        if len(table) != len(lines):
            raise self.wrong("a quotation mark is not closed; remove it, or close it in its line")
        return table

    def _parts(self, table: pd.DataFrame) -> tuple[list[str], pd.DataFrame]:
        """Return the header and the rows, which have as many cells."""
        header = [cell.strip() for cell in table.iloc[0].dropna()]
        while header and not header[-1]:  # separators at the end
            header.pop()
        if all(map(_is_number, header)):
            choice = " and ".join(f"one of {', '.join(several)}" for several in self._needed)
            raise self.wrong(
                f"has no header; name the columns in the first line, {choice}, "
                "e.g. stretch, engineering_stress [kPa]"
            )
        rows = table.iloc[1:].reset_index(drop=True)
        self._check_width(rows, len(header))
        return header, rows

    def _check_names(self, used: list[str], header: list[str]) -> None:
        """Refuse a column that is there twice, and alternatives of which there is not one."""
        for name in used:
            if used.count(name) > 1:
                raise self.wrong(f"column {name} appears twice; keep one")
        for several in self._needed:
            here = [name for name in several if name in used]
            if not here:
                raise self.wrong(
                    f"no column of {', '.join(several)}; give one of them "
                    f"(the header has {', '.join(header)})"
                )
            if len(here) > 1:
                raise self.wrong(f"more than one column of {', '.join(here)}; keep one")

    def _check_width(self, table: pd.DataFrame, width: int) -> None:
        """Refuse rows that have more or fewer cells than the header, but for empty ones."""
        cells = table.notna().sum(axis=1)
        beyond = table.iloc[:, width:].fillna("").any(axis=1)
        hint = "; numbers with decimal commas need semicolons between them"
        for line, number, more in zip(self.lines, cells, beyond, strict=True):
            if more or number < width:
                count = f"{number} cell{'s' if number > 1 else ''}"
                raise self.wrong(f"{count}; the header has {width}{hint if more else ''}", line)

    def _column(self, cell: str) -> tuple[str, str]:
        """Return name and unit of a header; the name is empty where the column is not used."""
        name, unit = self._named(cell)
        ways = [way for several in self._names.values() for way in several]
        if not name and (close := difflib.get_close_matches(_plain(unit), ways, 1, MISSPELT)):
            raise self.wrong(f"column {cell!r} is unknown; did you mean '{close[0]}'?")
        return (name, unit) if name else ("", "")

    def _named(self, cell: str) -> tuple[str, str]:
        """Return name and unit of a header; "" and its words where the name is not known."""
        with_unit = _UNIT.fullmatch(cell)
        words, unit = with_unit.groups() if with_unit else (cell, "")
        parts = [(words, "-" if unit == "1" else unit)]
        parts += [
            (cell[: mark.start()], cell[mark.end() :])
            for mark in reversed([*re.finditer(r"[\s_/,]+(?:in\s+)?", cell)])
        ]
        for words_, unit_ in parts:
            for name, ways in self._names.items():
                if _plain(words_) in ways:
                    return name, unit_
        return "", words

    def __contains__(self, name: str) -> bool:
        """Whether the file has the column."""
        return name in self.units

    def wrong(self, what: str, line: int = 0) -> InputError:
        """Return the error that names the file, and the line if there is one."""
        return InputError(f"{self.path}{f', line {line}' if line else ''}: {what}")

    def refuse(self, bad: Iterable[Any], what: str) -> None:
        """Refuse the first row that is bad."""
        for line, is_bad in zip(self.lines, bad, strict=True):
            if is_bad:
                raise self.wrong(what, line)

    def text(self, name: str) -> list[str]:
        """Return a column's cells."""
        return [str(cell) for cell in self._cells[name]]

    def numbers(self, name: str, factor: Callable[[str], Any]) -> Array:
        """Return a column of finite numbers, times the factor of its unit.

        `factor` raises a ValueError for a unit that cannot be used.
        """
        try:
            scale = float(factor(self.units[name]))
        except ValueError as error:
            raise self.wrong(f"{name}: {error}") from error
        texts = [cells for column, cells in self._cells.items() if column != "mode"]
        cells = self._cells[name].str.replace("\u2212", "-")  # a minus as in print
        if not any(column.str.contains(".", regex=False).any() for column in texts):
            cells = cells.str.replace(",", ".", regex=False)
        values = pd.to_numeric(cells, errors="coerce").to_numpy(dtype=float)
        for line, cell, value in zip(self.lines, self._cells[name], values, strict=True):
            if not np.isfinite(value):
                hint = " (the file has decimal points and commas)" if "," in cell else ""
                raise self.wrong(f"{name} is {cell!r}; give a finite number{hint}", line)
        return np.asarray(values * scale)


def _likely_header(lines: list[str]) -> int:
    """Return which line has the names, where none is known: the first as wide as the numbers."""
    cells = [[cell.strip(' "') for cell in line.split(_separator(line))] for line in lines]
    data = next((i for i, row in enumerate(cells) if all(map(_is_number, row))), 0)
    return next((i for i, row in enumerate(cells) if len(row) == len(cells[data])), 0)


def _separator(header: str) -> str | None:
    """Return what separates columns; None are blanks."""
    return next((mark for mark in ";\t," if mark in header), None)


def _joined(header: str) -> str:
    """Join the words of a name and its unit, where blanks separate columns."""
    if _separator(header):
        return header
    return _JOINED.sub(r"\1_", re.sub(r"\s+(?=[\[(])", "", header))


def _plain(words: str) -> str:
    return re.sub(r"[\s_.-]+", "_", words.strip().casefold()).strip("_")


def _is_number(cell: object) -> bool:
    return bool(re.fullmatch(r"[+-]?[\d.,]*\d[\d.,]*([eE][+-]?\d+)?", str(cell).strip()))
