"""Stress-stretch data from a CSV file, checked.

    # Strips of crural fascia, mediolateral
    stretch, engineering_stress [kPa]
    1.00, 0.0
    1.02, 310.5

Columns, in any order: ``stretch``, or the engineering ``strain [-]`` or ``strain [%]``;
``engineering_stress [UNIT]``, ``cauchy_stress [UNIT]`` or ``stress [UNIT]``; if known, the standard
deviation of each stress, ``stress_sd [UNIT]``; if wanted, the ``mode``, the same in every row. The
first comment is the title. One file is one test, loaded in one direction; rows may repeat a
stretch.
"""

import csv
import hashlib
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeVar, get_args

import numpy as np

from calfsocket.io.errors import InputError
from calfsocket.io.schema import nearest, read_text
from calfsocket.io.units import STRESS
from calfsocket.materials.modes import MODES, Array, Mode
from calfsocket.materials.stability import SCANNED

Choice = TypeVar("Choice", bound=str)
Measure = Literal["engineering", "cauchy"]
MEASURES: tuple[Measure, ...] = get_args(Measure)

_STRAIN_UNITS = {"": 1.0, "-": 1.0, "%": 0.01}
_STRESSES: dict[str, Measure | None] = {
    "engineering_stress": "engineering",
    "cauchy_stress": "cauchy",
    "stress": None,
}
_COLUMNS = ("stretch", "strain", *_STRESSES, "stress_sd", "mode")
_HEADER = re.compile(r"\s*(\w+)\s*(?:\[([^\]]*)\])?\s*")


@dataclass(frozen=True)
class Test:
    """One test: engineering stress over stretch."""

    __test__ = False  # not one of pytest's

    path: Path
    title: str  #: first comment of the file, or its name
    sha256: str  #: of the file
    mode: Mode
    measure: Measure  #: stress as measured
    stretch: Array  #: along the load, 1 unloaded, (n,)
    stress: Array  #: engineering stress, MPa, (n,)
    sd: Array | None  #: its standard deviation, MPa, where known, (n,)


def read_test(path: Path, mode: Mode | None = None, measure: Measure | None = None) -> Test:
    """Read a test.

    Where neither the file nor `mode` and `measure` say so, it is uniaxial, and a column ``stress``
    holds the engineering stress.

    Raises
    ------
    InputError
        When the file cannot be used; the message names file, line or column, and what is allowed.
    """
    table = _Table(Path(path))
    named = next(name for name in table.units if name in _STRESSES)
    measure = _agree(path, "the column's name", _STRESSES[named], "--stress", measure)
    mode = _agree(path, "the column mode", table.mode(), "--mode", mode) or "uniaxial"
    stretch = table.stretch()
    # Load over reference area: the current one is 1/stretch of it where the volume is kept.
    area = 1.0 / stretch if measure == "cauchy" else np.ones_like(stretch)
    stress = table.in_mpa(named) * area
    sd = table.in_mpa("stress_sd") * area if "stress_sd" in table.units else None
    if sd is not None:
        table.refuse(sd <= 0, "stress_sd is 0 or less; give it above 0, or remove the column")
    if np.sum(stress * (stretch - 1)) <= 0:
        raise table.wrong(
            "stress and strain have opposite signs; "
            "tension must be positive and compression negative"
        )
    measure = measure or "engineering"
    return Test(table.path, table.title, table.sha256, mode, measure, stretch, stress, sd)


class _Table:
    """The file's columns as text, with the line of each row."""

    def __init__(self, path: Path) -> None:
        self.path = path
        content = read_text(path)
        self.sha256 = hashlib.sha256(content.encode()).hexdigest()
        lines = content.removeprefix("\ufeff").splitlines()  # a mark that spreadsheets leave
        comments = [line.lstrip("# ").rstrip() for line in lines if line.startswith("#")]
        self.title = next(filter(None, comments), path.name)
        numbered = [
            (number, self._cells(number, line))
            for number, line in enumerate(lines, 1)
            if line.strip() and not line.startswith("#")
        ]
        if len(numbered) < 2:
            raise self.wrong("contains no data; give a header and rows of numbers")
        self.units = self._header(numbered[0][1])
        self.lines = [number for number, _ in numbered[1:]]
        for number, cells in numbered[1:]:
            if len(cells) != len(self.units):
                raise self.wrong(f"{len(cells)} cells; the header has {len(self.units)}", number)
        columns = zip(*(cells for _, cells in numbered[1:]), strict=True)
        self.text = dict(zip(self.units, columns, strict=True))

    def _cells(self, number: int, line: str) -> list[str]:
        try:
            return next(csv.reader([line], skipinitialspace=True))
        except csv.Error as error:
            raise self.wrong(f"is not a CSV row ({error})", number) from error

    def _header(self, cells: list[str]) -> dict[str, str]:
        """Return the unit of each column."""
        columns: dict[str, str] = {}
        for cell in cells:
            found = _HEADER.fullmatch(cell)
            if not found:
                raise self.wrong(
                    f"column {cell.strip()!r} cannot be read; write NAME or NAME [UNIT], "
                    "e.g. stress [kPa]"
                )
            if found[1] not in _COLUMNS:
                hint = nearest(found[1], _COLUMNS)
                raise self.wrong(f"column {cell.strip()!r} is unknown; {hint}")
            if found[1] in columns:
                raise self.wrong(f"column {found[1]} appears twice; keep one")
            columns[found[1]] = (found[2] or "").strip()
        for wanted in (("stretch", "strain"), tuple(_STRESSES)):
            number = sum(name in columns for name in wanted)
            if number != 1:
                what = "no column" if number == 0 else "more than one column"
                raise self.wrong(f"{what} of {', '.join(wanted)}; give one of them")
        return columns

    def wrong(self, what: str, line: int = 0) -> InputError:
        """Return the error that names the file, and the line if there is one."""
        return InputError(f"{self.path}{f', line {line}' if line else ''}: {what}")

    def refuse(self, bad: Iterable[Any], what: str) -> None:
        """Refuse the first row that is bad."""
        for line, is_bad in zip(self.lines, bad, strict=True):
            if is_bad:
                raise self.wrong(what, line)

    def numbers(self, name: str) -> Array:
        """Return a column of finite numbers, in the file's unit."""
        values = []
        for line, cell in zip(self.lines, self.text[name], strict=True):
            try:
                values.append(float(cell))
            except ValueError:
                values.append(np.nan)
            if not np.isfinite(values[-1]):
                raise self.wrong(f"{name} is {cell.strip()!r}; give a finite number", line)
        return np.array(values)

    def in_mpa(self, name: str) -> Array:
        """Return a column of stresses."""
        try:
            factor = STRESS.factor(self.units[name])
        except ValueError as error:
            raise self.wrong(f"{name}: {error}, e.g. `{name} [kPa]`") from error
        return self.numbers(name) * float(factor)

    def stretch(self) -> Array:
        """Return the stretches, which run in one direction."""
        name = "stretch" if "stretch" in self.units else "strain"
        allowed = _STRAIN_UNITS if name == "strain" else {"": 1.0, "-": 1.0}
        unit = self.units[name]
        if unit not in allowed:
            use = " or ".join(filter(None, allowed))
            raise self.wrong(f"{name}: unit {unit!r} is unknown; use {use}")
        values = self.numbers(name) * allowed[unit] + (name == "strain")
        low, high = SCANNED
        self.refuse(
            (values < low) | (values > high),
            f"the stretch is outside {low} to {high}; 1 is unloaded, shortening is below 1",
        )
        steps = np.diff(values, prepend=values[0])
        direction = np.sign(values[-1] - values[0])
        self.refuse(
            steps * direction < 0,
            "the stretch turns back; sort the rows, or give one loading in one direction",
        )
        return values

    def mode(self) -> Mode | None:
        """Return the mode that every row names, if the file names one."""
        if "mode" not in self.text:
            return None
        found = [cell.strip() for cell in self.text["mode"]]
        allowed = ", ".join(MODES)
        self.refuse([mode not in MODES for mode in found], f"mode is unknown; use one of {allowed}")
        self.refuse(
            [mode != found[0] for mode in found],
            f"mode changes from {found[0]}; put each test in a separate file, "
            "and give all files to `fit`",
        )
        return next(mode for mode in MODES if mode == found[0])


def _agree(
    path: Path, place: str, read: Choice | None, option: str, asked: Choice | None
) -> Choice | None:
    """Return what the file says, else what the option says; they must not contradict each other."""
    if read and asked and read != asked:
        raise InputError(
            f"{path}: {place} says {read}, but {option} says {asked}; make them the same"
        )
    return read or asked
