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

import numpy as np
import pandas as pd

from calfsocket.io.errors import InputError
from calfsocket.io.schema import read_text
from calfsocket.materials.modes import Array

MISSPELT = 0.85
"""Similarity (`difflib`) from which an unknown name is a known one misspelt, and not of another
quantity: strech is 0.92 like stretch, strain_rate 0.71 like strain."""

MOST_COLUMNS = 1000

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
        self.path, self._names = path, names
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
        if len(numbered) < 2:
            raise self.wrong("contains no data; give a header and rows of numbers")
        table = self._table([line for _, line in numbered])
        if len(table) != len(numbered):
            raise self.wrong("a quotation mark is not closed; remove it, or close it in its line")
        width = int(table.iloc[0].notna().sum())
        header = [cell.strip() for cell in table.iloc[0, :width]]
        if all(map(_is_number, header)):
            choice = " and ".join(f"one of {', '.join(several)}" for several in needed)
            raise self.wrong(
                f"has no header; name the columns in the first line, {choice}, "
                "e.g. stretch, engineering_stress [kPa]"
            )
        table = table.iloc[1:].reset_index(drop=True)
        self.lines = [number for number, _ in numbered[1:]]
        self._check_width(table, width)
        found = [self._column(cell) for cell in header]
        if not any(unit for _, unit in found) and not any(map(_is_number, table.iloc[0])):
            units = [cell.strip("[]() ") for cell in table.iloc[0, :width]]
            found = [(name, unit) for (name, _), unit in zip(found, units, strict=True)]
            table, self.lines = table.iloc[1:], self.lines[1:]
        used = [name for name, _ in found if name]
        for name in used:
            if used.count(name) > 1:
                raise self.wrong(f"column {name} appears twice; keep one")
        for several in needed:
            here = [name for name in several if name in used]
            if len(here) != 1:
                what = "more than one column of" if here else "no column of"
                raise self.wrong(
                    f"{what} {', '.join(several)}; give one of them"
                    + ("" if here else f" (the header has {', '.join(header)})")
                )
        self.units = {name: unit for name, unit in found if name}
        self.unused = tuple(
            cell for cell, (name, _) in zip(header, found, strict=True) if cell and not name
        )
        self._text = {name: table[i].str.strip() for i, (name, _) in enumerate(found) if name}

    def _table(self, lines: list[str]) -> pd.DataFrame:
        """Return all cells as text, None where a row has none."""
        separator = next((mark for mark in ";\t," if mark in lines[0]), None)
        if separator is None:  # blanks within a name, and before its unit, do not separate
            lines = [_JOINED.sub(r"\1_", re.sub(r"\s+(?=[\[(])", "", lines[0])), *lines[1:]]
        most = max(len(line.split(separator)) for line in lines)
        if most > MOST_COLUMNS:
            raise self.wrong(f"has {most} columns; up to {MOST_COLUMNS} are read")
        try:
            return pd.read_csv(
                StringIO("\n".join(lines)),
                sep=separator or r"\s+",
                engine="python",
                header=None,
                names=range(most),
                index_col=False,
                dtype=str,
                na_filter=False,
                skipinitialspace=True,
            )
        except ValueError as error:  # pandas' own errors, too
            raise self.wrong(f"is not a table ({error}); check the quotation marks") from None

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
        unit = _UNIT.fullmatch(cell)
        if unit and (name := self._name(unit[1])):
            return name, unit[2]
        if name := self._name(cell):
            return name, ""
        for mark in reversed([*re.finditer(r"[\s_/,]+(?:in\s+)?", cell)]):
            if name := self._name(cell[: mark.start()]):
                return name, cell[mark.end() :]
        word = _plain(unit[1] if unit else cell)
        known = [way for ways in self._names.values() for way in ways]
        if close := difflib.get_close_matches(word, known, 1, MISSPELT):
            raise self.wrong(f"column {cell!r} is unknown; did you mean '{close[0]}'?")
        return "", ""

    def _name(self, words: str) -> str:
        plain = _plain(words)
        return next((name for name, ways in self._names.items() if plain in ways), "")

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
        return [str(cell) for cell in self._text[name]]

    def numbers(self, name: str, factor: Callable[[str], Any]) -> Array:
        """Return a column of finite numbers, times the factor of its unit.

        `factor` raises a ValueError for a unit that cannot be used.
        """
        try:
            scale = float(factor(self.units[name]))
        except ValueError as error:
            raise self.wrong(f"{name}: {error}") from error
        cells = self._text[name]
        if not cells.str.contains(".", regex=False).any():
            cells = cells.str.replace(",", ".", regex=False)
        values = pd.to_numeric(cells, errors="coerce").to_numpy(dtype=float)
        for line, cell, value in zip(self.lines, self._text[name], values, strict=True):
            if not np.isfinite(value):
                raise self.wrong(f"{name} is {cell!r}; give a finite number", line)
        return np.asarray(values * scale)


def _plain(words: str) -> str:
    return re.sub(r"[\s_-]+", "_", words.strip().casefold()).strip("_")


def _is_number(cell: object) -> bool:
    return bool(re.fullmatch(r"[+-]?[\d.,]*\d[\d.,]*([eE][+-]?\d+)?", str(cell).strip()))
