"""Outlines as CSV: a row a point, x and y in mm.

    # Inner face, knee level
    x, y
    57.1, 0.0
    56.9, 4.2

The header may be missing and may name the unit, ``x [mm]``. Cells are separated by commas,
semicolons or tabs; beside semicolons and tabs, decimals may have a comma. Lines that start with #
are comments. The last point may repeat the first.
"""

import re
from pathlib import Path

import numpy as np

from calfsocket.io.errors import InputError
from calfsocket.io.schema import read_text
from calfsocket.meshes.curves import SAME_POINT
from calfsocket.meshes.drawn import Drawn

#: The outline is open where it closes with a side this many times as long as the longest other.
_OPENING = 3.0
#: No outline has larger coordinates, mm, in whatever unit it was drawn.
_LARGEST = 1e9
_HEADER = re.compile(r"\s*(\w+)\s*(?:[\[(]\s*([^\])]*?)\s*[\])])?\s*")


def read_csv(path: Path) -> Drawn:
    """Read the points of an outline.

    Raises
    ------
    InputError
        Naming file and line.
    """
    lines = read_text(path).removeprefix("\ufeff").splitlines()
    rows = [
        (number, line)
        for number, line in enumerate(lines, 1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if not rows:
        raise InputError(f"{path}: is empty; give a row `x, y` in mm for each point")
    separator = next((mark for mark in ";\t," if mark in rows[0][1]), ",")
    cells = [(number, line.split(separator)) for number, line in rows]
    if all(_length(cell, separator) is None for cell in cells[0][1]):
        _check_header(path, *cells[0])
        del cells[0]
    points = np.array([_point(path, number, row, separator) for number, row in cells])
    places = [f"line {number}" for number, _ in cells]
    if len(points) > 1 and np.linalg.norm(points[0] - points[-1]) <= SAME_POINT:
        points, places = points[:-1], places[:-1]
    drawn = Drawn(path, points.reshape(-1, 2), places)
    _check_closed(drawn)
    return drawn


def _check_header(path: Path, number: int, cells: list[str]) -> None:
    found = [_HEADER.fullmatch(cell) for cell in cells]
    if [match and match[1].lower() for match in found] != ["x", "y"]:
        raise InputError(
            f"{path}, line {number}: {', '.join(cell.strip() for cell in cells)!r} is neither a"
            " point nor a header; write `x, y` or two numbers"
        )
    for match in found:
        if match and match[2] not in (None, "mm"):
            raise InputError(f"{path}, line {number}: unit {match[2]!r}; give coordinates in mm")


def _point(path: Path, number: int, cells: list[str], separator: str) -> list[float]:
    if len(cells) != 2:
        noun = "cell" if len(cells) == 1 else "cells"
        raise InputError(
            f"{path}, line {number}: has {len(cells)} {noun}; it must have two, x and y in mm"
        )
    point = []
    for cell in cells:
        value = _length(cell, separator)
        if value is None or not abs(value) <= _LARGEST:
            raise InputError(
                f"{path}, line {number}: {cell.strip()!r} is not a length; give a number in mm"
            )
        point.append(value)
    return point


def _length(cell: str, separator: str) -> float | None:
    """Return a number, whose decimals may have a comma unless cells are separated by commas."""
    try:
        return float(cell if separator == "," else cell.replace(",", "."))
    except ValueError:
        return None


def _check_closed(drawn: Drawn) -> None:
    """Refuse points that stop half-way round."""
    if len(drawn.points) < 4:
        return  # which has an error of its own
    sides = np.linalg.norm(np.roll(drawn.points, -1, axis=0) - drawn.points, axis=1)
    if sides[-1] > _OPENING * sides[:-1].max():
        raise InputError(
            f"{drawn.path}: the outline is open: its ends, {drawn.places[-1]} and"
            f" {drawn.places[0]}, are {sides[-1]:.1f} mm apart, its points at most"
            f" {sides[:-1].max():.1f} mm; continue it to its start"
        )
