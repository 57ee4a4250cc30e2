"""The table of a label map: what each label is."""

import csv
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

from calfsocket.io.errors import InputError
from calfsocket.io.schema import nearest, read_text
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
_SIDE = re.compile(r"^(left|right)_|_(left|right)$")
_NUMBER = re.compile(r"_?\d+$")

Side = Literal["left", "right"]


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


def tissue_of(region: str) -> str:
    """Return the tissue that a name tells: "soleus" or "muscle_3", a muscle; else nothing."""
    known = {each.name: str(each.tissue) for each in Limb.reference().regions} | _TISSUE_OF
    return known.get(region) or known.get(_NUMBER.sub("", region), "")


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
        found[label] = _meaning(place, words[1], words[2].lower() if len(words) == 3 else "")
    if not found:
        raise InputError(f"{path}: lists no labels; write a line such as 3,tibia for each")
    return found


def _meaning(place: str, name: str, tissue: str) -> Meaning:
    region = re.sub(r"[\s-]+", "_", name.lower())
    word = _SIDE.search(region)
    side: Side | None = None
    if word:
        side = word[1] or word[2]  # type: ignore[assignment]
        region = _SIDE.sub("", region)
    tissue = tissue or tissue_of(region)
    if region == IGNORED or region.endswith(CAVITY):
        tissue = region if region == IGNORED else "bone"
    elif tissue not in get_args(Tissue):
        known = dict.fromkeys((*get_args(Tissue), *_TISSUE_OF))
        raise InputError(
            f"{place}: what tissue is '{tissue or region}'? {nearest(tissue or region, known)}"
        )
    return Meaning(region, tissue, side)


def of_one_side(
    meanings: Mapping[int, Meaning], side: Side | None, what: str
) -> tuple[dict[int, Meaning], Side | None]:
    """Return the labels of one limb, those of the other one ignored, and the side that they state.

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
