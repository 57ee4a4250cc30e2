"""What the parts of a source are called: labels of a map by its table, outlines by their names."""

import csv
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeVar, get_args

from calfsocket.io.errors import InputError
from calfsocket.io.schema import misspelt, read_text
from calfsocket.meshes.limb import Limb, Tissue

#: Names that say the tissue, too; besides those of the reference calf's regions.
_TISSUE_OF = {
    "skin": "skin", "fat": "fat", "muscle": "muscle", "fascia": "fascia", "vessel": "vessel",
    "bone": "bone", "tibia": "bone", "fibula": "bone", "femur": "bone", "patella": "bone",
}  # fmt: skip
#: For what is not the limb: a table, a wrap, air.
IGNORED = "ignore"
#: Marrow of the tibia; the name of another bone may stand before it.
CAVITY = "_cavity"
#: Regions of this name are tendons; the other fascia lies between all that is named.
_TENDON = "tendon"
_SIDE = re.compile(r"^(left|right)_|_(left|right)$")
_NUMBER = re.compile(r"_?\d+$")

Side = Literal["left", "right"]
_Key = TypeVar("_Key")


@dataclass(frozen=True)
class Meaning:
    """What a label is: a region of its own name, or more of a tissue.

    Attributes
    ----------
    region, tissue : str
        Labels of the same region are one.
    side : {"left", "right"}, optional
        Of the body, where the name says it: ``left_tibia``, ``tibia_left``.
    """

    region: str
    tissue: str
    side: Side | None = None

    @property
    def is_region(self) -> bool:
        """Whether it is a belly, a vessel or a tendon, and not only some of a tissue."""
        if self.tissue == "fascia":
            return _TENDON in self.region
        return self.tissue == "vessel" or (self.tissue == "muscle" and self.region != self.tissue)


def tissue_of(region: str) -> str:
    """Return the tissue that a name tells: "soleus", "muscle_3" or "calf_muscle", a muscle."""
    known = _known()
    last = region.rpartition("_")[2]
    return (
        known.get(region)
        or known.get(_NUMBER.sub("", region))
        or (last if last in get_args(Tissue) else "")
    )


def _known() -> dict[str, str]:
    """Return the tissues of names."""
    return {each.name: str(each.tissue) for each in Limb.reference().regions} | _TISSUE_OF


def read_table(path: Path) -> dict[int, Meaning]:
    """Read a table of labels: CSV, ``label,region`` or ``label,region,tissue`` a line.

    Raises
    ------
    InputError
        When a line is not understood; it names the line.
    """
    found: dict[int, Meaning] = {}
    rows = csv.reader(read_text(path).lstrip("\ufeff").splitlines())
    for number, row in enumerate(rows, start=1):
        words = [word.strip() for word in row]
        if not any(words) or words[0].startswith("#") or words[0].lower() in ("label", "value"):
            continue
        place = f"{path}, line {number}"
        if len(words) not in (2, 3) or not words[0].isdigit():
            raise InputError(f"{place}: is not label,region or label,region,tissue: 3,tibia, say")
        label = int(words[0])
        if label in found:
            raise InputError(f"{place}: label {label} is listed twice; list it once")
        found[label] = meaning(place, ":".join(words[1:]))
    if not found:
        raise InputError(f"{path}: lists no labels; write a line such as 3,tibia for each")
    return found


def meaning(place: str, name: str) -> Meaning:
    """Return what a part is by its name, ``region`` or ``region:tissue``.

    Raises
    ------
    InputError
        When the name tells no tissue; it begins with the place.
    """
    found = find_meaning(name)
    if found:
        return found
    word = (name.partition(":")[2] or name).strip()
    raise InputError(f"{place}: what tissue is '{word}'? {names_like(word)}")


def names_like(word: str) -> str:
    """Return the name that was probably meant, or what is allowed, for messages."""
    near = misspelt(spelt(word), {*get_args(Tissue), *_known()})
    if near:
        return f"did you mean '{near}'?"
    return (
        f"allowed are {', '.join(dict.fromkeys((*get_args(Tissue), *_TISSUE_OF)))}, the names of"
        f" the reference calf's regions, such as soleus, and {IGNORED}"
    )


def find_meaning(name: str) -> Meaning | None:
    """Return what a part is by its name; None where the name does not tell."""
    name, _, tissue = (spelt(word) for word in name.partition(":"))
    word = _SIDE.search(name)
    side: Side | None = None
    if word:
        side = word[1] or word[2]  # type: ignore[assignment]
        name = _SIDE.sub("", name)
    tissue = tissue or tissue_of(name)
    if IGNORED in (name, tissue):
        return Meaning(IGNORED, IGNORED, side)
    if name.endswith(CAVITY):
        tissue = "bone"
    return Meaning(name, tissue, side) if name and tissue in get_args(Tissue) else None


def spelt(name: str) -> str:
    """Return a name as regions have it."""
    return re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")


def of_one_side(
    meanings: Mapping[_Key, Meaning], side: Side | None, what: str
) -> tuple[dict[_Key, Meaning], Side | None]:
    """Return the parts of one limb, those of the other one ignored, and the side that they state.

    Raises
    ------
    InputError
        When there are both sides and none was asked for.
    """
    sides = {each.side for each in meanings.values() if each.side}
    if len(sides) == 2 and not side:
        raise InputError(
            f"{what}: names parts of a left and of a right limb; add --side left or --side right"
        )
    chosen = side or next(iter(sides), None)
    ours = {
        label: each if each.side in (None, chosen) else Meaning(IGNORED, IGNORED, each.side)
        for label, each in meanings.items()
    }
    return ours, chosen if sides else None
