"""Meshes of Abaqus' input files: nodes, plane elements and sets, in parts and instances or flat.

meshio reads neither plane strain (CPE3, CPE6H and the like), nor parts, nor names in small letters,
so that it reads few of the decks that Abaqus/CAE writes.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from calfsocket.imaging.mesh.elements import Block
from calfsocket.io.errors import InputError
from calfsocket.meshes.curves import Array

#: Families of plane elements, before their number of nodes.
_PLANE = re.compile(r"(CPEG|CPE|CPS|CAX|CGAX|DC2D|AC2D|STRI|SFM3D|M3D|R3D|S)(\d)")
#: Those of solids.
_SOLID = re.compile(r"(C3D|CSS|DC3D|AC3D|SC)\d|CCL\d")
#: What makes nodes or elements that the file does not list.
_MAKERS = ("NGEN", "NFILL", "NCOPY", "NMAP", "ELGEN", "ELCOPY", "INCLUDE", "SYSTEM")
_ONCE = "give each a number of its own, or write the deck with parts and instances"
_SHAPES = {3: "triangle", 4: "quad", 6: "triangle6", 8: "quad8"}

Label = tuple[str, int]
"""Part or instance, and number in it."""


@dataclass
class _Scope:
    """What a part, an instance or the file itself lists."""

    nodes: dict[int, Sequence[float]] = field(default_factory=dict)
    elements: dict[int, tuple[str, Sequence[int]]] = field(default_factory=dict)
    node_sets: dict[str, list[Label]] = field(default_factory=dict)
    element_sets: dict[str, list[Label]] = field(default_factory=dict)


@dataclass(frozen=True)
class Deck:
    """The mesh of an input file, with names.

    Attributes
    ----------
    points : Array
        (n, 3), in the file's unit.
    blocks : list of Block
        Plane elements; `sets` are numbers of elements counted through all of them.
    element_sets, node_sets : mapping of str to list of int
    """

    points: Array
    blocks: list[Block]
    element_sets: Mapping[str, list[int]]
    node_sets: Mapping[str, list[int]]


def read_deck(path: Path, text: str) -> Deck:
    """Read the mesh of an input file.

    Raises
    ------
    InputError
        When a line is not understood, or the mesh is solid or made by a keyword.
    """
    scopes, places = _Reader(path).read(text)
    used = {name: scope for name, scope in scopes.items() if scope.elements and name in places}
    points: list[Array] = []
    node_at: dict[Label, int] = {}
    element_at: dict[Label, int] = {}
    blocks: list[Block] = []
    for name, scope in used.items():
        for number, x in scope.nodes.items():
            node_at[name, number] = len(node_at)
            points.append(np.resize([*x, 0.0, 0.0], 3) if len(x) < 3 else np.array(x[:3]))
        if scope.nodes:
            moved = places[name](np.array(points[-len(scope.nodes) :]))
            points[-len(scope.nodes) :] = list(moved)
        by_type: dict[str, list[int]] = {}
        for number, (kind, _) in scope.elements.items():
            by_type.setdefault(kind, []).append(number)
        for kind, numbers in by_type.items():
            rows = []
            for number in numbers:
                for node in scope.elements[number][1]:
                    if (name, node) not in node_at:
                        raise InputError(
                            f"{path}: element {number} has node {node}, which is not listed"
                        )
                rows.append([node_at[name, node] for node in scope.elements[number][1]])
                element_at[name, number] = len(element_at)
            blocks.append(Block(kind, np.array(rows, dtype=np.int64)))
    return Deck(
        np.array(points).reshape(-1, 3),
        blocks,
        _resolved(scopes, used, "element_sets", element_at),
        _resolved(scopes, used, "node_sets", node_at),
    )


def _resolved(
    scopes: Mapping[str, _Scope], used: Mapping[str, _Scope], kind: str, at: Mapping[Label, int]
) -> dict[str, list[int]]:
    """Return sets under names of their own; those of no mesh are left out."""
    found: dict[str, list[int]] = {}
    every = [
        (scope, name, labels)
        for scope, each in scopes.items()
        if scope in used or scope == ""
        for name, labels in getattr(each, kind).items()
    ]
    for scope, name, labels in every:
        several = sum(other == name for _, other, _ in every) > 1
        numbers = [at[label] for label in labels if label in at]
        if numbers:
            found[f"{scope}.{name}" if several and scope else name] = numbers
    return found


class _Reader:
    """Goes through the keywords of a file."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._scopes: dict[str, _Scope] = {"": _Scope()}
        self._parts: dict[str, _Scope] = {}
        self._placed: set[str] = set()
        self._places = {"": _Motion([], [])}
        self._scope, self._scope_name = self._scopes[""], ""

    def read(self, text: str) -> tuple[dict[str, _Scope], dict[str, "_Motion"]]:
        """Return what instances and the file itself list, and where each lies."""
        for number, keyword, words, lines in _keywords(text):
            try:
                self._take(keyword, words, lines)
            except InputError as error:
                raise InputError(f"{self._path}, line {number}: *{keyword}: {error}") from None
            except KeyError as error:
                raise InputError(
                    f"{self._path}, line {number}: *{keyword}: has no {error.args[0]}=...; export"
                    " the mesh again"
                ) from None
            except (ValueError, IndexError) as error:
                raise InputError(
                    f"{self._path}, line {number}: *{keyword}: is not understood ({error});"
                    " export the mesh again"
                ) from None
        loose = [name for name in self._parts if name not in self._placed]
        if loose and not any(scope.elements for scope in self._scopes.values()):
            raise InputError(
                f"{self._path}: no *INSTANCE places the part {loose[0]}; write the deck with its"
                " assembly, or flat, without *PART"
            )
        return self._scopes, self._places

    def _take(self, keyword: str, words: Mapping[str, str], lines: Sequence[str]) -> None:
        if keyword in _MAKERS:
            raise InputError(
                "is not read; write the deck with all nodes and elements, as Abaqus/CAE does"
            )
        match keyword:
            case "PART":
                self._scope = self._parts[words["NAME"].upper()] = _Scope()
                self._scope_name = ""
            case "INSTANCE":
                self._instance(words, lines)
            case "ENDPART" | "ENDINSTANCE":
                self._scope, self._scope_name = self._scopes[""], ""
            case "NODE":
                found = []
                for line in lines:
                    label, *x = _cells(line)
                    place = [_number(word) for word in x]
                    if self._scope.nodes.setdefault(int(label), place) != place:
                        raise InputError(f"node {label} is listed twice, in two places; {_ONCE}")
                    found.append((self._scope_name, int(label)))
                if "NSET" in words:
                    self._scope.node_sets.setdefault(words["NSET"], []).extend(found)
            case "ELEMENT":
                self._elements(words, lines)
            case "NSET" | "ELSET":
                self._set(keyword, words, lines)

    def _instance(self, words: Mapping[str, str], lines: Sequence[str]) -> None:
        name, part = words["NAME"], words.get("PART", "").upper()
        if part and part not in self._parts:
            raise InputError(f"there is no part '{words['PART']}' before it")
        self._scope, self._scope_name = _Scope(), name
        self._scopes[name] = self._scope
        if part:
            of = self._parts[part]
            self._placed.add(part)
            self._scope.nodes = dict(of.nodes)
            self._scope.elements = dict(of.elements)
            for kind in ("node_sets", "element_sets"):
                getattr(self._scope, kind).update(
                    {
                        each: [(name, number) for _, number in labels]
                        for each, labels in getattr(of, kind).items()
                    }
                )
        self._places[name] = _Motion(
            *([_number(word) for word in _cells(line)] for line in [*lines, "", ""][:2])
        )

    def _elements(self, words: Mapping[str, str], lines: Sequence[str]) -> None:
        kind = words["TYPE"].upper()
        if _SOLID.match(kind):
            raise InputError(
                f"{kind} are elements of a solid; give the mesh of one section, of triangles or"
                " quadrilaterals"
            )
        plane = _PLANE.match(kind)
        if not plane:
            return  # springs, rods, points: no part of the section
        count = int(plane[2])
        if count not in _SHAPES:
            raise InputError(f"{kind} are neither triangles nor quadrilaterals of first or second"
                             " order")  # fmt: skip
        numbers = [int(word) for line in lines for word in _cells(line)]
        if len(numbers) % (count + 1):
            raise InputError(f"{kind} have {count} nodes each, and some lines have not")
        found = []
        for first in range(0, len(numbers), count + 1):
            label, *nodes = numbers[first : first + count + 1]
            own = _SHAPES[count], nodes
            if self._scope.elements.setdefault(label, own) != own:
                raise InputError(f"element {label} is listed twice, with other nodes; {_ONCE}")
            found.append((self._scope_name, label))
        if "ELSET" in words:
            self._scope.element_sets.setdefault(words["ELSET"], []).extend(found)

    def _set(self, keyword: str, words: Mapping[str, str], lines: Sequence[str]) -> None:
        kind = "node_sets" if keyword == "NSET" else "element_sets"
        own: dict[str, list[Label]] = getattr(self._scope, kind)
        scope = words.get("INSTANCE", self._scope_name)
        labels: list[Label] = []
        if keyword == "NSET" and "ELSET" in words:  # the nodes of its elements
            for place, number in self._labels(words["ELSET"], scope, "element_sets"):
                elements = (self._scopes[place] if place else self._scope).elements
                if number in elements:
                    labels += [(place, node) for node in elements[number][1]]
        for line in lines:
            cells = _cells(line)
            if "GENERATE" in words:
                first, last, *step = (int(word) for word in cells)
                labels += [(scope, i) for i in range(first, last + 1, step[0] if step else 1)]
                continue
            for word in cells:
                labels += self._labels(word, scope, kind)
        own.setdefault(words[keyword], []).extend(labels)

    def _labels(self, word: str, scope: str, kind: str) -> list[Label]:
        """Return what a number or the name of a set stands for."""
        instance, dot, name = word.rpartition(".")
        if dot and instance in self._scopes:
            scope, word = instance, name
        if word.isdigit():
            return [(scope, int(word))]
        places = [self._scope, self._scopes.get(scope, self._scope)]
        for place in places:
            for other, labels in getattr(place, kind).items():
                if other.upper() == word.upper():
                    return list(labels)
        raise InputError(f"there is no set '{word}' before it")


@dataclass(frozen=True)
class _Motion:
    """How an instance is moved: a shift, then a turn about an axis through two points."""

    shift: Sequence[float]
    turn: Sequence[float]

    def __call__(self, points: Array) -> Array:
        """Move points, (n, 3)."""
        shift = [*self.shift, 0.0, 0.0, 0.0][:3]
        moved = points + shift
        if len(self.turn) < 7:
            return moved
        from scipy.spatial.transform import Rotation

        a, b = np.array(self.turn[:3]), np.array(self.turn[3:6])
        axis = (b - a) / np.linalg.norm(b - a)
        turn = Rotation.from_rotvec(np.deg2rad(self.turn[6]) * axis)
        return np.asarray(turn.apply(moved - a) + a)


def _keywords(text: str) -> Iterator[tuple[int, str, dict[str, str], list[str]]]:
    """Yield keywords: number of the line, name, parameters, and the lines of data."""
    lines = [
        (number, line.strip())
        for number, line in enumerate(text.splitlines(), start=1)
        if line.strip() and not line.startswith("**")
    ]
    at = 0
    while at < len(lines):
        number, line = lines[at]
        at += 1
        if not line.startswith("*"):
            continue
        while line.endswith(",") and at < len(lines):
            line, at = line + lines[at][1], at + 1
        name, *parameters = (word.strip() for word in line[1:].split(","))
        words = {}
        for parameter in parameters:
            key, _, value = parameter.partition("=")
            words[key.strip().upper()] = value.strip().strip('"')
        data = []
        while at < len(lines) and not lines[at][1].startswith("*"):
            data.append(lines[at][1])
            at += 1
        yield number, re.sub(r"\s", "", name.upper()), words, data


def _cells(line: str) -> list[str]:
    return [word for word in (each.strip().strip('"') for each in line.split(",")) if word]


def _number(word: str) -> float:
    return float(word.upper().replace("D", "E"))  # 1.5D-3, as Fortran writes it
