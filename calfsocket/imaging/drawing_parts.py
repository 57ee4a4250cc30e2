"""The parts of a section that was drawn: closed curves by name, of files or of one drawing."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, TypeVar

import shapely

from calfsocket.imaging.label_table import (
    CAVITY,
    IGNORED,
    Meaning,
    Side,
    find_meaning,
    meaning,
    names_like,
    of_one_side,
    spelt,
)
from calfsocket.imaging.source import sha256
from calfsocket.io.errors import InputError
from calfsocket.meshes.drawn import Drawn, OutlineFile, Piece, connected, is_closed, joined
from calfsocket.meshes.limb import Limb
from calfsocket.meshes.outline import DRAWINGS, READERS

_Reader = TypeVar("_Reader")


class _Inner(OutlineFile):
    """How an outline within the skin is read: 2 to 400 mm wide and high."""

    extent: ClassVar[tuple[float, float]] = (2.0, 400.0)


class _Small(OutlineFile):
    """How a muscle or vessel is read, of which crumbs are left out later."""

    extent: ClassVar[tuple[float, float]] = (0.01, 400.0)


@dataclass(frozen=True)
class Parts:
    """What was drawn.

    Attributes
    ----------
    files : dict of str to str
        Hashes.
    meanings : dict of str to Meaning
        By region.
    curves : dict of str to list of Drawn
        Counter-clockwise; one of each region, but for muscles, vessels and tendons.
    side : {"left", "right"}, optional
        Of the body, where names say it.
    remarks : list of str
        What was not used.
    """

    files: dict[str, str]
    meanings: dict[str, Meaning]
    curves: dict[str, list[Drawn]]
    side: Side | None
    remarks: list[str]


def is_drawing(path: Path) -> bool:
    """Return whether a file is read as an outline."""
    return path.suffix.lower() in READERS


def named_files(files: Sequence[Path], said: Mapping[str, str]) -> dict[str, Path] | Path:
    """Return which file is what: as said, or by its name; a single drawing as it is."""
    if len(files) == 1 and not said:
        return files[0]
    found = {}
    for role, name in said.items():
        fits = [path for path in files if name in (str(path), path.name, path.stem)]
        if not fits:
            raise InputError(f"--{role}: no file '{name}'; there are {', '.join(map(str, files))}")
        found[role] = fits[0]
    for path in [path for path in files if path not in found.values()]:
        name = _name_in(path)
        if name in found:
            raise InputError(
                f"{path}: is {name}, and so is {found[name]}; give another name to one"
            )
        found[name] = path
    return found


def read_parts(parts: Mapping[str, Path | str] | Path | str, side: Side | None) -> Parts:
    """Read the files of parts by name, or all parts of a drawing.

    Raises
    ------
    InputError
        When a file or a name is not understood, or the skin is missing.
    """
    remarks: list[str] = []
    if isinstance(parts, Mapping):
        paths = {name: Path(file) for name, file in parts.items()}
        what = ", ".join(map(str, paths.values()))
        meanings = {name: meaning(str(path), name) for name, path in paths.items()}
        files = list(dict.fromkeys(paths.values()))
    else:
        path = Path(parts)
        what, files = str(path), [path]
        if path.suffix.lower() == ".csv":
            raise InputError(f"{path}: is one outline; give those of skin and bones, a file each")
        pieces, unit = _reader(path, DRAWINGS)(path)
        by_name = _by_name(pieces)
        meanings = _of_names(path, by_name, remarks)
    ours, stated = of_one_side(meanings, side, what)
    found: dict[str, Meaning] = {}
    curves: dict[str, list[Drawn]] = {}
    for name, each in ours.items():
        if each.region == IGNORED:
            continue
        found.setdefault(each.region, each)
        if isinstance(parts, Mapping):
            drawn = [_reader(paths[name], READERS)(paths[name], _how(each))]
        else:
            drawn = _drawn(path, by_name[name], unit, each)
        here = curves.setdefault(each.region, [])
        here += map(_counter_clockwise, drawn)
        if len(here) > 1 and not each.is_region:
            raise InputError(f"{here[-1].path}: '{name}' is a second outline of {each.region};"
                             " give one")  # fmt: skip
    if "skin" not in curves:
        raise InputError(f"{what}: which one is the skin? name a file or a layer skin")
    return Parts({each.name: sha256(each) for each in files}, found, curves, stated, remarks)


def _name_in(path: Path) -> str:
    """Return the name of a part that a file's name is, or has among its words."""
    if find_meaning(path.stem):
        return path.stem
    known = {each.name for each in Limb.reference().regions} | {"muscle", f"tibia{CAVITY}"}
    inside = [name for name in known if f"_{name}_" in f"_{spelt(path.stem)}_"]
    if inside:
        return max(sorted(inside), key=len)
    raise InputError(
        f"{path}: what is it? {names_like(path.stem)} (rename it, or say so by --skin, --muscle,"
        " --tibia or --fibula)"
    )


def _reader(path: Path, readers: Mapping[str, _Reader]) -> _Reader:
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise InputError(f"{path}: is no outline; export it as one of {', '.join(readers)}")
    return reader


def _by_name(pieces: Sequence[Piece]) -> dict[str, list[Piece]]:
    """Return the pieces of a drawing by their own name, if that is understood, or by their layer's.

    Pieces without a name have that of where they are in the file.
    """
    found: dict[str, list[Piece]] = {}
    for piece in pieces:
        own = [name for name in (piece.label, piece.name) if name and find_meaning(name)]
        name = own[0] if own else piece.layer or piece.label or piece.name or piece.place
        found.setdefault(name, []).append(piece)
    return found


def _of_names(
    path: Path, by_name: Mapping[str, Sequence[Piece]], remarks: list[str]
) -> dict[str, Meaning]:
    """Return what the names of a drawing say; what has no closed curve may have any name."""
    found = {}
    for name, pieces in by_name.items():
        known = find_meaning(name)
        usable = [piece for piece in pieces if not piece.problem and len(piece.points)]
        if known:
            found[name] = known
        elif any(map(is_closed, connected(usable))):
            meaning(f"{path}, '{name}'", name)
        else:
            remarks.append(f"'{name}': not used, for it has no closed outline")
    return found


def _how(each: Meaning) -> OutlineFile:
    if each.is_region:
        return _Small()
    return OutlineFile() if each.region == "skin" else _Inner()


def _drawn(path: Path, pieces: Sequence[Piece], unit: str, each: Meaning) -> list[Drawn]:
    """Return the closed curves of a name, of which only muscles and vessels may have several."""
    if not each.is_region or any(piece.problem for piece in pieces):
        return [joined(path, pieces, unit, _how(each))]
    return [joined(path, group, unit, _how(each)) for group in connected(pieces)]


def _counter_clockwise(drawn: Drawn) -> Drawn:
    if shapely.LinearRing(drawn.points).is_ccw:
        return drawn
    return Drawn(drawn.path, drawn.points[::-1], drawn.places[::-1], drawn.unit)
