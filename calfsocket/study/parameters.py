"""Parameters of a study file by their dotted names: to change them, and to tell cases apart."""

import copy
import itertools
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from calfsocket.io.errors import InputError
from calfsocket.io.schema import nearest
from calfsocket.study.document import SweepTable

Changes = Mapping[str, Any]
"""Dotted name -> value as the file has it."""

MAY_CHANGE = ("model", "steps", "sockets", "materials", "laws")
LONGEST_LABEL = 80
LONGEST_WORD = 24
MOST_POINTS = 1000


def flat(tables: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Give dotted names: TOML makes tables in tables of names that are not quoted."""
    found: dict[str, Any] = {}
    for key, value in tables.items():
        if isinstance(value, Mapping) and value:
            found |= flat(value, f"{prefix}{key}.")
        else:
            found[f"{prefix}{key}"] = value
    return found


def points(sweep: SweepTable | None) -> list[Changes]:
    """Give the points of a sweep in the order of its values, the last parameter the quickest.

    Raises
    ------
    InputError
        When a parameter has no list of values, or lists of one length are needed and are not.
    """
    if sweep is None:
        return [{}]
    way, tables = ("grid", sweep.grid) if sweep.grid is not None else ("list", sweep.list)
    values = flat(tables or {})
    if not values:
        raise InputError(f"sweep.{way}: is empty; give parameters with lists of values")
    for name, several in values.items():
        if not isinstance(several, list) or not several:
            raise InputError(
                f"sweep.{way}.{name}: is {several!r}; give a list of values, e.g. [0.2, 0.4]"
            )
        if len({repr(value) for value in several}) < len(several):
            raise InputError(f"sweep.{way}.{name}: a value stands there twice; give each once")
    lengths = {name: len(several) for name, several in values.items()}
    if way == "list" and len(set(lengths.values())) > 1:
        told = ", ".join(f"{name} has {n}" for name, n in lengths.items())
        raise InputError(f"sweep.list: {told} values; give lists of one length, or use sweep.grid")
    number = 1
    for length in lengths.values() if way == "grid" else [0]:
        number *= length
    if number > MOST_POINTS or max(lengths.values()) > MOST_POINTS:
        raise InputError(f"sweep.{way}: more than {MOST_POINTS} points; sweep in parts")
    together = zip(*values.values(), strict=True) if way == "list" else None
    rows = together or itertools.product(*values.values())
    return [dict(zip(values, row, strict=True)) for row in rows]


def reaching(changes: Changes, socket: str, materials: str) -> dict[str, Any]:
    """Leave out what changes other sockets or sets than those of a case."""
    own = {"sockets": socket, "materials": materials}
    found = {}
    for name, value in changes.items():
        top, *rest = name.split(".")
        if top not in own or not rest or rest[0] == own[top]:
            found[name] = value
    return found


def applied(content: Mapping[str, Any], changes: Changes) -> dict[str, Any]:
    """Return the content of a study file with some of its parameters changed.

    Raises
    ------
    InputError
        When a name leads nowhere.
    """
    changed: dict[str, Any] = copy.deepcopy(dict(content))
    for name, value in changes.items():
        first, *rest = name.split(".")
        if first not in MAY_CHANGE or not rest:
            raise InputError(f"{name}: no such parameter; {nearest(first, MAY_CHANGE)}")
        if first in ("sockets", "materials") and rest[0] not in content.get(first, {}):
            known = content.get(first, {})
            hint = nearest(rest[0], known) if known else f"add a table [{first}.{rest[0]}]"
            raise InputError(f"{name}: the file defines no '{rest[0]}'; {hint}")
        place: Any = changed.setdefault(first, {})
        *way, last = rest
        for part in way:
            place = _step(name, place, part)
        if isinstance(place, list):
            place[_index(name, place, last)] = copy.deepcopy(value)
        elif isinstance(place, dict):
            place[last] = copy.deepcopy(value)
        else:
            raise InputError(f"{name}: leads through a value; name a parameter")
    return changed


def _step(name: str, place: Any, part: str) -> Any:
    if isinstance(place, list):
        return place[_index(name, place, part)]
    if not isinstance(place, dict):
        raise InputError(f"{name}: leads through a value; name a parameter")
    return place.setdefault(part, {})


def _index(name: str, place: Sequence[Any], part: str) -> int:
    if not part.isdecimal() or int(part) >= len(place):
        raise InputError(f"{name}: '{part}' is no place in a list of {len(place)}; count from 0")
    return int(part)


class Labels:
    """Words of a folder's name that tell cases with changed parameters apart.

    Parameters
    ----------
    names : iterable of str
        All parameters that any case or the sweep changes.
    points : sequence of mapping
        Of the sweep: values that make no short word are counted in their order.
    """

    def __init__(self, names: Iterable[str], points: Sequence[Changes]) -> None:
        every = sorted(set(names))
        self._short = {name: _short(name, every) for name in every}
        self._words: dict[tuple[str, str], str] = {}
        for name in points[0]:
            values = dict.fromkeys(repr(point[name]) for point in points)
            written = {repr(point[name]): _word(point[name]) for point in points}
            clear = len(set(written.values())) == len(values) and "" not in written.values()
            for number, value in enumerate(values, 1):
                self._words[name, value] = written[value] if clear else f"value-{number}"

    def of(self, changes: Changes, number: int) -> str:
        """Tell the changes of a case in one word, or only the number of its point."""
        text = ",".join(
            f"{self._short[name]}={self._words.get((name, repr(value)), _word(value))}"
            for name, value in changes.items()
        )
        return text if len(text) <= LONGEST_LABEL else f"point-{number}"


def _short(name: str, every: Sequence[str]) -> str:
    """Give the last words of a dotted name, as few as tell it from the others."""
    words = name.split(".")
    for number in range(1, len(words)):
        tail = words[-number:]
        alike = sum(other.split(".")[-number:] == tail for other in every)
        if not tail[0].isdecimal() and alike == 1:
            return ".".join(tail)
    return name


def _word(value: Any) -> str:
    """Write a value with the letters that names of folders may have; empty where it is no word."""
    if isinstance(value, list):
        return "+".join(map(_word, value))
    text = str(value).replace("%", "pct")
    word = re.sub(r"[^A-Za-z0-9.+_-]", "", text)
    return word if isinstance(value, str | int | float) and len(word) <= LONGEST_WORD else ""
