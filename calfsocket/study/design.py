"""The design of uncertain inputs: its cases as changes of the study file."""

from collections.abc import Iterator, Mapping
from typing import Any

from calfsocket.io import units
from calfsocket.io.errors import InputError
from calfsocket.study.sweep import Point, value_at
from calfsocket.uncertainty.distributions import DIGITS, Distribution
from calfsocket.uncertainty.inputs import Uncertainty


def points(uncertain: Uncertainty, content: Mapping[str, Any]) -> list[Point]:
    """Return the file without changes, and a point for each case that is drawn."""
    found = [Point({}, "")]
    labels = [f"u{number + 1:03d}" for number in range(uncertain.cases)]
    labels += [f"c{number + 1:03d}" for number in range(uncertain.check)]
    for row, label in enumerate(labels):
        changed: dict[str, Any] = {}
        for i, (name, of) in enumerate(uncertain.inputs.items()):
            changed |= changes(content, of, name, of.text(uncertain.rows[row, i]))
        found.append(Point(changed, label, row))
    return found


def ends(uncertain: Uncertainty) -> Iterator[tuple[str, str, Any]]:
    """Yield input, key and value of what a parameter's own check must accept.

    Bounds and choices in the file, and the smallest and the largest value drawn.
    """
    smallest, largest = uncertain.rows.min(axis=0), uncertain.rows.max(axis=0)
    for i, (name, of) in enumerate(uncertain.inputs.items()):
        for key, value in of.bounds:
            yield name, key, of.text(of.get(key) or 0.0) if not of.discrete else value
        if not of.discrete:
            yield name, "smallest value drawn", of.text(smallest[i])
            yield name, "largest value drawn", of.text(largest[i])


def changes(content: Mapping[str, Any], of: Distribution, name: str, value: Any) -> dict[str, Any]:
    """Return what a value of an input changes in the content of a study file.

    Raises
    ------
    InputError
        If a value that it scales is not in the file, or no number.
    """
    if not of.scales:
        return {name: value}
    return {parameter: _scaled(content, parameter, value) for parameter in of.scales}


def _scaled(content: Mapping[str, Any], parameter: str, factor: float) -> Any:
    written = value_at(content, parameter)
    if isinstance(written, str):
        try:
            unit = units.unit_of(written)
            return f"{_rounded(factor * units.in_unit(written, unit))!r} {unit}"
        except ValueError as error:
            raise InputError(f"scales: {parameter}: {error}") from None
    if isinstance(written, bool) or not isinstance(written, int | float):
        raise InputError(f"scales: {parameter}: is {written!r}; only numbers can be scaled")
    return _rounded(factor * written)


def _rounded(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")
