"""Sweeps: cases of a study file with some parameters changed, and labels for their names."""

import copy
import itertools
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pydantic import model_validator

from calfsocket.io.errors import InputError
from calfsocket.io.schema import Strict, nearest
from calfsocket.study.absent import refuse_word
from calfsocket.study.names import Name

Changes = Mapping[str, Any]
"""Dotted name of a parameter -> value as the file has it."""

MAY_CHANGE = ("model", "layers", "liner", "steps", "sockets", "materials", "laws", "loads")
LONGEST_LABEL = 80
LONGEST_WORD = 24
MOST_POINTS = 1000


class Sweep(Strict):
    """Parameters with their values, in one of three ways.

    Attributes
    ----------
    grid : mapping, optional
        Lists of values by parameter: all combinations.
    list : mapping, optional
        Lists of values by parameter, all of one length: one after the other.
    variants : mapping, optional
        Name of a variant -> parameters with one value each; the study without changes comes first.
    """

    grid: dict[str, Any] | None = None
    list: dict[str, Any] | None = None
    variants: dict[Name, dict[str, Any]] | None = None

    @model_validator(mode="after")
    def _one_way(self) -> "Sweep":
        if sum(way is not None for way in (self.grid, self.list, self.variants)) != 1:
            raise ValueError("give one of grid, list and variants")
        return self


@dataclass(frozen=True)
class Point:
    """A point of a sweep: what differs from the file; without a label its values are its name."""

    changes: Changes
    label: str | None = None
    row: int | None = None
    """Of the design of uncertain inputs."""


def flat(tables: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Return values by dotted name: in TOML, names that are not quoted make tables in tables."""
    found: dict[str, Any] = {}
    for key, value in tables.items():
        if isinstance(value, Mapping) and value:
            found |= flat(value, f"{prefix}{key}.")
        else:
            found[f"{prefix}{key}"] = value
    return found


def points(sweep: Sweep | None) -> list[Point]:
    """Return the points of a sweep in the order of its values, the last parameter changing fastest.

    Raises
    ------
    InputError
        If a parameter has no list of values, or lists that must have one length do not.
    """
    if sweep is None:
        return [Point({})]
    if sweep.variants is not None:
        return [Point({}, "")] + [
            Point(flat(changes), name) for name, changes in sweep.variants.items()
        ]
    way, tables = ("grid", sweep.grid) if sweep.grid is not None else ("list", sweep.list)
    values = flat(tables or {})
    if not values:
        raise InputError(f"sweep.{way}: is empty; add a parameter with a list of values")
    for name, several in values.items():
        if not isinstance(several, list) or not several:
            raise InputError(
                f"sweep.{way}.{name}: is {several!r}; give a list of values, e.g. [0.2, 0.4]"
            )
        if len({repr(value) for value in several}) < len(several):
            raise InputError(f"sweep.{way}.{name}: a value is listed twice; list each value once")
    lengths = {name: len(several) for name, several in values.items()}
    if way == "list" and len(set(lengths.values())) > 1:
        counts = ", ".join(f"{name} has length {n}" for name, n in lengths.items())
        raise InputError(f"sweep.list: {counts}; give lists of equal length, or use sweep.grid")
    count, rows = (
        (math.prod(lengths.values()), itertools.product(*values.values()))
        if way == "grid"
        else (max(lengths.values()), zip(*values.values(), strict=True))
    )
    if count > MOST_POINTS:
        raise InputError(f"sweep.{way}: more than {MOST_POINTS} points; split the sweep")
    return [Point(dict(zip(values, row, strict=True))) for row in rows]


def reaching(changes: Changes, socket: str, materials: str) -> dict[str, Any]:
    """Return the changes without those of other sockets or material sets than a case has."""
    of_case = {"sockets": socket, "materials": materials}
    found = {}
    for name, value in changes.items():
        top, *rest = name.split(".")
        if top not in of_case or not rest or rest[0] == of_case[top]:
            found[name] = value
    return found


def applied(content: Mapping[str, Any], changes: Changes) -> dict[str, Any]:
    """Return the content of a study file with some parameters changed.

    Raises
    ------
    InputError
        If a parameter does not exist.
    """
    changed: dict[str, Any] = copy.deepcopy(dict(content))
    for name, value in changes.items():
        first, *rest = name.split(".")
        refuse_word(first)
        if first not in MAY_CHANGE or not rest:
            raise InputError(f"{name}: unknown parameter; {nearest(first, MAY_CHANGE)}")
        if first in ("sockets", "materials") and rest[0] not in content.get(first, {}):
            known = content.get(first, {})
            hint = nearest(rest[0], known) if known else f"add a table [{first}.{rest[0]}]"
            raise InputError(f"{name}: the file does not define '{rest[0]}'; {hint}")
        if first == "loads" and "loads" not in changed:
            raise InputError(f"{name}: the file has no stages of loading; add [[loads]]")
        place: Any = changed.setdefault(first, {})
        *way, last = rest
        for part in way:
            key = _key(name, place, part)
            place = place.setdefault(key, {}) if isinstance(place, dict) else place[key]
        place[_key(name, place, last)] = copy.deepcopy(value)
    return changed


def value_at(content: Mapping[str, Any], name: str) -> Any:
    """Return the value of a parameter in the content of a study file.

    Raises
    ------
    InputError
        If the file does not have it.
    """
    place: Any = content
    for part in name.split("."):
        if isinstance(place, list):
            part = _key(name, place, part)
        elif not isinstance(place, Mapping) or part not in place:
            raise InputError(f"{name}: the file has no such value; write it there")
        place = place[part]
    return place


def _key(name: str, place: Any, part: str) -> Any:
    """Return the key or the index that a part of a dotted name means in a table or a list."""
    if isinstance(place, dict):
        return part
    if not isinstance(place, list):
        raise InputError(f"{name}: goes beyond a single value; end the name at the parameter")
    if not part.isdecimal() or int(part) >= len(place):
        raise InputError(
            f"{name}: '{part}' is not an index of a list of {len(place)}; indices start at 0"
        )
    return int(part)


class Labels:
    """Labels that distinguish cases with changed parameters, made for the names of folders.

    Parameters
    ----------
    names : iterable of str
        All parameters that any case or the sweep changes.
    points : sequence of Point
        Of the sweep: values that make no short word are numbered in their order.
    """

    def __init__(self, names: Iterable[str], points: Sequence[Point]) -> None:
        every = sorted(set(names))
        self._short = {name: _short(name, every) for name in every}
        self._words: dict[tuple[str, str], str] = {}
        for name in points[0].changes:
            swept = [point.changes[name] for point in points]
            values = dict.fromkeys(map(repr, swept))
            written = {repr(value): _word(value) for value in swept}
            clear = len(set(written.values())) == len(values) and "" not in written.values()
            for number, value in enumerate(values, 1):
                self._words[name, value] = written[value] if clear else f"value-{number}"

    def of(self, changes: Changes, number: int) -> str:
        """Return the changes of a case as one word; if it is too long, the number of its point."""
        text = ",".join(
            f"{self._short[name]}={self._words.get((name, repr(value)), _word(value))}"
            for name, value in changes.items()
        )
        return text if len(text) <= LONGEST_LABEL else f"point-{number}"


def _short(name: str, every: Sequence[str]) -> str:
    """Return the last words of a dotted name, as few as distinguish it from the others."""
    words = name.split(".")
    for number in range(1, len(words)):
        tail = words[-number:]
        alike = sum(other.split(".")[-number:] == tail for other in every)
        if not tail[0].isdecimal() and alike == 1:
            return ".".join(tail)
    return name


def _word(value: Any) -> str:
    """Write a value with letters that a folder's name may have; empty where that is impossible."""
    if isinstance(value, list):
        return "+".join(map(_word, value))
    text = str(value).replace("%", "pct")
    word = re.sub(r"[^A-Za-z0-9.+_-]", "", text)
    return word if isinstance(value, str | int | float) and len(word) <= LONGEST_WORD else ""
