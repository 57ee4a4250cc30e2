"""Outlines as CSV: a row a point, x and y in mm.

    # Inner face, knee level
    x, y
    57.1, 0.0
    56.9, 4.2

The header may be missing; it may have other columns, which are passed over, z, which must be
constant, and a unit, ``x [cm]``, or one in a line or a column of its own. Cells are separated by
commas, semicolons, tabs or blanks; beside all but commas, decimals may have a comma. Lines that
start with # are comments. The last point may repeat the first.
"""

import re
from pathlib import Path

import numpy as np

from calfsocket.io.errors import InputError
from calfsocket.io.schema import read_text
from calfsocket.meshes.curves import SAME_POINT, Array
from calfsocket.meshes.drawn import UNITS, Drawn, OutlineFile, check_flat

#: The outline is open where it closes with a side this many times as long as the longest other.
_OPENING = 3.0
#: No outline has larger coordinates, mm, in whatever unit it was drawn.
_LARGEST = 1e9
_UNITS = UNITS | {"in": UNITS["inch"], "um": UNITS["micrometres"]}
_COMMENTS = ("#", "%", "//", "sep=")
_NUMBER_WITH_COMMA = re.compile(r"[+-]?\d+(,\d+)?([eE][+-]?\d+)?")
#: Such as x, X [mm], x_cm, "pos y", and those of ParaView, Points:0.
_COLUMN = re.compile(
    r"(?:[\w .:]*[\W_])?(?:([xyz])|points?[:_]([012]))\s*(?:[\[(]\s*([^\])]*?)\s*[\])]|[_ ](\w+))?",
    re.IGNORECASE,
)
_Row = tuple[int, list[str]]


def read_csv(path: Path, file: OutlineFile) -> Drawn:
    """Read the points of an outline.

    Raises
    ------
    InputError
        Naming file and line.
    """
    if file.layer is not None or file.curve is not None:
        raise InputError(f"{path}: a CSV has one curve and no layers; remove `layer` and `curve`")
    rows = _rows(path)
    names = 0
    while names < len(rows) and all(_number(cell) is None for cell in rows[names][1]):
        names += 1
    header, data = rows[:names], rows[names:]
    columns, unit = _named(path, header, data) if header else (_unnamed(path, data), "")
    points: Array = np.array([_point(path, row, columns) for row in data]).reshape(-1, 3)
    places = [f"line {number}" for number, _ in data]
    points *= _UNITS[unit or "mm"]
    check_flat(path, points[:, 2], "; name the columns x and y where the third is not z")
    if len(points) > 1 and np.linalg.norm(points[0] - points[-1]) <= SAME_POINT:
        points, places = points[:-1], places[:-1]
    said = f"its header says {unit}" if unit not in ("", "mm") else ""
    drawn = Drawn.of(path, points[:, :2], places, said, file.extent)
    _check_closed(drawn)
    return drawn


def _rows(path: Path) -> list[_Row]:
    """Return number and cells of the lines that are no comments."""
    numbered = enumerate(read_text(path).splitlines(), 1)
    lines = [(number, line.strip().rstrip(";,")) for number, line in numbered]
    lines = [line for line in lines if line[1] and not line[1].startswith(_COMMENTS)]
    if not lines:
        raise InputError(f"{path}: is empty; give a row `x, y` in mm for each point")
    last = lines[-1][1]
    separator = next((mark for mark in ";\t" if mark in last), None)
    words = last.split()
    if not separator and "," in last:
        decimal = len(words) > 1 and all(map(_NUMBER_WITH_COMMA.fullmatch, words))
        separator = None if decimal else ","
    return [
        (number, [cell.strip().strip('"') for cell in line.split(separator)])
        for number, line in lines
    ]


def _number(cell: str) -> float | None:
    try:
        return float(cell.replace(",", ".") if _NUMBER_WITH_COMMA.fullmatch(cell) else cell)
    except ValueError:
        return None


def _unnamed(path: Path, data: list[_Row]) -> list[int]:
    """Return the columns of x, y and, if there is a third, z, where no header names them."""
    width = len(data[0][1])
    for number, cells in data:
        if len(cells) != width or width not in (2, 3):
            raise InputError(
                f"{path}, line {number}: has {len(cells)} {'cell' if len(cells) == 1 else 'cells'};"
                " every line must have two, x and y in mm, or a header must name them"
            )
    return list(range(width))


def _named(path: Path, header: list[_Row], data: list[_Row]) -> tuple[list[int], str]:
    """Return the columns of x, y and, if there is one, z; and the unit that the header says."""
    axes: list[str] = []
    while not {"x", "y"} <= set(axes):  # below a title
        if not header:
            raise InputError(f"{path}: names no columns x and y; write a header `x, y`, or none")
        (number, cells), *header = header
        found = [_COLUMN.fullmatch(cell) for cell in cells]
        axes = [(m[1] or "xyz"[int(m[2])]).lower() if m else "" for m in found]
    columns = [axes.index(axis) for axis in "xyz" if axis in axes]
    for row, values in data:
        if not max(columns) < len(values) <= len(cells):
            raise InputError(
                f"{path}, line {row}: has {len(values)} {'cell' if len(values) == 1 else 'cells'};"
                f" its header names {len(cells)}"
                + (
                    "; decimal commas need semicolons between cells"
                    if len(values) == 2 * len(cells)
                    else ""
                )
            )
    said = {
        m[3] or (m[4] if str(m[4]).lower() in _UNITS else "")
        for m in (found[i] for i in columns)
        if m
    }
    if header:
        said = {cell.strip("[]() ") for _, units in header for cell in units} - {""}
    for i in (i for i, cell in enumerate(cells) if cell.lower() in ("unit", "units")):
        said = {values[i] for _, values in data if i < len(values)}
    unit = ", ".join(sorted(said)).lower()
    if unit and unit not in _UNITS:
        raise InputError(
            f"{path}, line {number}: unit {unit!r}; give coordinates in mm, or in one of"
            f" {', '.join(UNITS)}"
        )
    return columns, unit


def _point(path: Path, row: _Row, columns: list[int]) -> list[float]:
    number, cells = row
    point = [0.0, 0.0, 0.0]
    for i, column in enumerate(columns):
        value = _number(cells[column])
        if value is None or not abs(value) <= _LARGEST:
            raise InputError(
                f"{path}, line {number}: {cells[column]!r} is not a length; give a number in mm"
            )
        point[i] = value
    return point


def _check_closed(drawn: Drawn) -> None:
    """Refuse points that stop half-way round."""
    sides = np.linalg.norm(np.roll(drawn.points, -1, axis=0) - drawn.points, axis=1)
    if sides[-1] > _OPENING * sides[:-1].max():
        raise InputError(
            f"{drawn.path}: the outline is open: its ends, {drawn.places[-1]} and"
            f" {drawn.places[0]}, are {sides[-1]:.1f} mm apart, its points at most"
            f" {sides[:-1].max():.1f} mm; continue it to its start"
        )
