"""Which set of a mesh is which region: by a table, or by the sets' own names."""

import csv
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calfsocket.imaging.label_table import (
    CAVITY,
    IGNORED,
    Meaning,
    find_meaning,
    names_like,
    spelt,
)
from calfsocket.imaging.mesh.reader import ReadMesh
from calfsocket.io.errors import InputError
from calfsocket.io.schema import misspelt, read_text, read_toml
from calfsocket.meshes import tags
from calfsocket.meshes.curves import Array, xy

#: Of a set that is the socket: left out of a limb.
SOCKETS = (tags.SOCKET, tags.LINER)
#: Sets that a message lists.
_LISTED = 12
_LEFT_OUT = -1
#: Beginning of the sets that `calfsocket export` makes of all regions of a tissue.
_OF_TISSUE = "tissue_"

Sets = Mapping[str, Any]


def read_sets(path: Path) -> dict[str, Any]:
    """Read a table of sets: CSV, ``set,region`` or ``set,region,tissue`` a line, or TOML.

    Raises
    ------
    InputError
        When a line is not understood; it names the line.
    """
    if path.suffix.lower() == ".toml":
        return read_toml(path)
    found: dict[str, Any] = {}
    lines = read_text(path).lstrip("\ufeff").splitlines()
    # Spreadsheets write semicolons where a comma is the decimal sign.
    rows = csv.reader(lines, delimiter="," if any("," in line for line in lines) else ";")
    for number, row in enumerate(rows, start=1):
        words = [word.strip() for word in row]
        if not any(words) or words[0].startswith("#") or words[0].lower() == "set":
            continue
        place = f"{path}, line {number}"
        if len(words) not in (2, 3) or not all(words):
            raise InputError(f"{place}: is not set,region or set,region,tissue: SKIN,skin, say")
        if words[0] in found:
            raise InputError(f"{place}: set '{words[0]}' is listed twice; list it once")
        found[words[0]] = ":".join(words[1:])
    if not found:
        raise InputError(f"{path}: lists no sets; write a line such as SKIN,skin for each")
    return found


@dataclass(frozen=True)
class Assigned:
    """The region of each triangle.

    Attributes
    ----------
    regions : mapping of str to str
        Tissue by region, in the order of the table or the file.
    of : array
        Number of each triangle's region in that order, -1 where it is left out; (m,).
    left_out : mapping of str to str
        What each set is that is left out.
    """

    regions: Mapping[str, str]
    of: NDArray[np.int64]
    left_out: Mapping[str, str]


def assigned(mesh: ReadMesh, sets: Sets | None, area: Array, keep: str | None = None) -> Assigned:
    """Return the region of each triangle.

    Parameters
    ----------
    mesh
        As it was read.
    sets
        What each set is: "skin", "soleus", "calf:muscle", "ignore", or a table with `tissue` and
        `name`. None: by the sets' own names.
    area
        Of each triangle, mm^2.
    keep
        The set of a socket, where that is what is wanted: "socket".

    Raises
    ------
    InputError
        When a set or tissue is not known, or a triangle is in no set or in two regions.
    """
    meanings = _meanings(mesh, sets, area)
    regions: dict[str, str] = {}
    for name, each in meanings.items():
        if each.region != keep if keep else each.tissue in (IGNORED, *SOCKETS):
            continue
        if regions.setdefault(each.region, each.tissue) != each.tissue:
            raise InputError(
                f"{mesh.path}: set '{name}': is {each.tissue}, and another set of the region"
                f" '{each.region}' is {regions[each.region]}; give them different names"
            )
    numbers = {name: number for number, name in enumerate(regions)}
    of = np.full(len(mesh.cells), _LEFT_OUT, dtype=np.int64)
    by = np.full(len(mesh.cells), "", dtype=object)
    for name, meaning in meanings.items():
        inside, number = mesh.sets[name], numbers.get(meaning.region, _LEFT_OUT)
        twice = inside & (by != "") & (of != number)
        if twice.any():
            first = int(np.argmax(twice))
            raise InputError(
                f"{mesh.path}: {twice.sum()} triangles ({area[twice].sum():.4g} mm^2) are both in"
                f" '{by[first]}' and in '{name}', which are different regions; take one of the two"
                " out of the table of sets"
            )
        of[inside], by[inside] = number, name
    none = by == ""
    if keep:
        if not regions:
            raise InputError(
                f"{mesh.path}: which set is the socket? its sets are {listed(mesh, area)}; say it"
                f" by a table of sets, with a line such as NAME,{tags.SOCKET}"
            )
    elif none.any():
        others = {name: each for name, each in mesh.sets.items() if (each & none).any()}
        where = xy(_middle(mesh, int(np.argmax(none))))
        raise InputError(
            f"{mesh.path}: {none.sum()} triangles ({area[none].sum():.4g} mm^2), one at {where} of"
            " the file, are in no set whose tissue is known"
            + (f"; they are in {listed(mesh, area, others)}" if others else "")
            + ": say what they are by a table of sets (--sets), a line SET,REGION,TISSUE or"
            f" SET,{IGNORED} for each"
        )
    if not regions:
        raise InputError(f"{mesh.path}: all its sets are left out; name those of the limb")
    left_out = {name: each.tissue for name, each in meanings.items() if each.region not in regions}
    return Assigned(regions, of, left_out)


def listed(mesh: ReadMesh, area: Array, sets: Mapping[str, Any] | None = None) -> str:
    """Name sets with their areas, for messages."""
    sets = mesh.sets if sets is None else sets
    words = [f"{name} ({area[inside].sum():.4g} mm^2)" for name, inside in sets.items()]
    more = f" and {len(words) - _LISTED} more" if len(words) > _LISTED else ""
    return ", ".join(words[:_LISTED]) + more


def _middle(mesh: ReadMesh, cell: int) -> Array:
    return np.asarray(mesh.points[mesh.cells[cell, :3], :2].mean(axis=0))


def _meanings(mesh: ReadMesh, sets: Sets | None, area: Array) -> dict[str, Meaning]:
    """Return what the sets are, by their names in the file."""
    if sets is None:
        return _by_names(mesh)
    found = {}
    for name, said in sets.items():
        place = f"{mesh.path}: set '{name}'"
        own = _found(name, mesh)
        if own is None:
            near = misspelt(name, mesh.sets)
            raise InputError(
                f"{place}: is not in the file; "
                + (f"did you mean '{near}'?" if near else f"it has {listed(mesh, area)}")
            )
        if own in found:
            raise InputError(f"{place}: is in the table twice; capitals make no difference")
        found[own] = _meaning(place, said)
    return found


def _by_names(mesh: ReadMesh) -> dict[str, Meaning]:
    """Return what sets are whose names tell it, without those that smaller ones make up."""
    found: dict[str, Meaning] = {}
    for name in sorted(mesh.sets, key=lambda name: int(mesh.sets[name].sum())):
        meaning = _known(name)
        if meaning is None:
            continue
        if spelt(name).startswith(_OF_TISSUE):
            inside = mesh.sets[name]
            for each, cells in mesh.sets.items():
                if _known(each) is None and cells.any() and not (cells & ~inside).any():
                    found[each] = replace(meaning, region=spelt(each))
        same = [mesh.sets[each] for each in found if found[each].tissue == meaning.tissue]
        if same and (np.any(same, axis=0) | ~mesh.sets[name]).all():
            continue
        found[name] = meaning
    return {name: found[name] for name in mesh.sets if name in found}


def _found(name: str, mesh: ReadMesh) -> str | None:
    """Return the set of a name; capitals make no difference in Abaqus."""
    if name in mesh.sets:
        return name
    same = [each for each in mesh.sets if each.casefold() == str(name).casefold()]
    return same[0] if len(same) == 1 else None


def _meaning(place: str, said: Any) -> Meaning:
    if isinstance(said, Mapping):
        unknown = [key for key in said if key not in ("tissue", "name")]
        tissue, name = said.get("tissue"), said.get("name", said.get("tissue"))
        if unknown or not isinstance(tissue, str) or not isinstance(name, str):
            raise InputError(f"{place}: give tissue = '...' and, if you like, name = '...'")
        said = f"{name}:{tissue}"
    if not isinstance(said, str):
        raise InputError(f"{place}: is {said!r}; give a region such as 'skin' or 'calf:muscle'")
    meaning = _known(said)
    if meaning is None:
        word = (said.partition(":")[2] or said).strip()
        raise InputError(f"{place}: what tissue is '{word}'? {names_like(word)}")
    return meaning


def _known(name: str) -> Meaning | None:
    """Return what a set is by a name: a socket, a liner, or as in a table of labels."""
    word = spelt(name)
    if word in SOCKETS:
        return Meaning(word, word)
    meaning = find_meaning(name)
    # A marrow cavity is a hole.
    if meaning and meaning.region.endswith(CAVITY):
        return Meaning(IGNORED, IGNORED, meaning.side)
    return meaning
