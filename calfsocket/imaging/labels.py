"""Surfaces of the regions of a label map, without its stray voxels and holes."""

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

import numpy as np
import pyvista
from numpy.typing import NDArray
from scipy import ndimage

from calfsocket.imaging.source import Source, sha256
from calfsocket.imaging.surface import Shell, check_size
from calfsocket.imaging.volume import MOST_LABELS, Volume, read_volume
from calfsocket.io.errors import InputError
from calfsocket.io.schema import nearest, read_text
from calfsocket.meshes.limb import Tissue

#: Names that say the tissue, too.
_TISSUE_OF = {
    "skin": "skin", "fat": "fat", "muscle": "muscle", "fascia": "fascia", "vessel": "vessel",
    "bone": "bone", "tibia": "bone", "fibula": "bone", "femur": "bone", "patella": "bone",
}  # fmt: skip
#: For what is not the limb: a table, a wrap, air.
_IGNORED = "ignore"
#: Marrow of the tibia; the name of another bone may stand before it.
_CAVITY = "_cavity"
#: Largest number of a label.
_LARGEST_LABEL = 100_000
#: A second piece of a region with more than this share of the first is no stray voxel.
_SECOND_PIECE = 0.2
#: Tissues beneath the fat: all of them together are the muscle envelope.
_DEEP = ("muscle", "fascia", "bone", "vessel")


@dataclass(frozen=True)
class Meaning:
    """What a label is: a region of its own name, or more of a tissue."""

    region: str
    tissue: str


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
        label, region = int(words[0]), words[1].lower().replace(" ", "_").replace("-", "_")
        tissue = words[2].lower() if len(words) == 3 and words[2] else _TISSUE_OF.get(region, "")
        if region == _IGNORED or region.endswith(_CAVITY):
            tissue = region if region == _IGNORED else "bone"
        elif tissue not in get_args(Tissue):
            known = dict.fromkeys((*get_args(Tissue), *_TISSUE_OF))
            hint = nearest(tissue or region, known)
            raise InputError(f"{place}: what tissue is '{tissue or region}'? {hint}")
        if label in found:
            raise InputError(f"{place}: label {label} is listed twice; list it once")
        found[label] = Meaning(region, tissue)
    if not found:
        raise InputError(f"{path}: lists no labels; write a line such as 3,tibia for each")
    return found


def read_labels(
    path: Path | str,
    table: Path | str | None,
    voxel: tuple[float, float, float] | None = None,
) -> Source:
    """Read a label map and make surfaces of its regions.

    Parameters
    ----------
    path
        NIfTI, NRRD, MetaImage, or a stack of pictures.
    table
        CSV that says what the labels are (`read_table`).
    voxel
        Size of a voxel, mm, for pictures.

    Raises
    ------
    InputError
        When a file cannot be read, a label is not listed, or a region is missing or in pieces.
    """
    path = Path(path)
    meanings = read_table(Path(table)) if table else {}
    volume = read_volume(path, voxel)
    here = _present(volume, meanings, table)
    used = {label: each for label, each in here.items() if each.region != _IGNORED}
    if all(each.tissue in ("bone", "vessel") for each in used.values()):
        raise InputError(f"{path}: has bones and vessels alone; label skin or flesh too")
    remarks: list[str] = []

    def shell(name: str, labels: Sequence[int], filled: bool = True) -> Shell:
        return Shell(name, _surface(volume, name, labels, filled, remarks), path)

    skin = shell("skin", list(used))
    check_size(f"{path}: skin", skin.surface, "mm")
    bones, cavities, regions = {}, {}, {}
    for region in dict.fromkeys(each.region for each in used.values()):
        labels = [label for label, each in used.items() if each.region == region]
        tissue = used[labels[0]].tissue
        if region.endswith(_CAVITY):
            cavities[region.removesuffix(_CAVITY)] = shell(region, labels)
        elif tissue == "bone":
            inner = [label for label, each in used.items() if each.region == region + _CAVITY]
            bones[region] = shell(region, [*labels, *inner])
        elif tissue in ("muscle", "vessel") and region != tissue:
            regions[region] = (tissue, shell(region, labels))
    tissues = {each.tissue for each in used.values()}
    muscle = None
    if "muscle" in tissues and "fat" in tissues:
        deep = [label for label, each in used.items() if each.tissue in _DEEP]
        muscle = shell("muscle", deep)
    files = {path.name: _hash(path)} | ({Path(table).name: sha256(Path(table))} if table else {})
    return Source(
        names=path.name,
        files=files,
        skin=skin,
        bones=bones,
        cavities={bone: each for bone, each in cavities.items() if bone in bones},
        muscle=muscle,
        regions=regions,
        superior=volume.superior,
        anterior=volume.anterior,
        voxel=volume.affine[:, :3],
        remarks=tuple(remarks),
    )


def _hash(path: Path) -> str:
    """Return the hash of a file, or of the hashes of a folder's files."""
    if not path.is_dir():
        return sha256(path)
    import hashlib

    names = sorted(each for each in path.iterdir() if each.is_file())
    return hashlib.sha256("".join(map(sha256, names)).encode()).hexdigest()


def _present(
    volume: Volume, meanings: dict[int, Meaning], table: Path | str | None
) -> dict[int, Meaning]:
    """Return the meanings of the labels that the map has."""
    low, high = int(volume.labels.min()), int(volume.labels.max())
    known = low >= 0 and high <= _LARGEST_LABEL
    counts = np.zeros(high + 1 if known else 1, dtype=np.int64)
    if known:  # slice by slice, which needs no room
        for each in np.moveaxis(volume.labels, -1, 0):
            counts += np.bincount(each.ravel(), minlength=len(counts))
    values = np.flatnonzero(counts)
    if not len(values) or len(values) > MOST_LABELS:
        number = f"{len(values)} different values" if len(values) else "values"
        raise InputError(
            f"{volume.path}: has {number} from {low} to {high}: an image, not labels; segment it"
            " first"
        )
    size = abs(float(np.linalg.det(volume.affine[:, :3]))) / 1000
    found = {int(value): counts[value] * size for value in values if value}
    if not found:
        raise InputError(f"{volume.path}: is empty: all its voxels are 0")
    if table is None:
        listed = ", ".join(f"{label} ({cm3:.0f} cm3)" for label, cm3 in list(found.items())[:12])
        raise InputError(
            f"{volume.path}: what are its labels {listed}? add --labels FILE.csv with a line such"
            " as 1,skin for each"
        )
    missing = [label for label in found if label not in meanings]
    if missing:
        raise InputError(
            f"{table}: does not list label {missing[0]} of {volume.path}"
            f" ({found[missing[0]]:.1f} cm3); add a line such as {missing[0]},skin, or"
            f" {missing[0]},{_IGNORED}"
        )
    return {label: meanings[label] for label in found}


def _surface(
    volume: Volume, name: str, labels: Sequence[int], filled: bool, remarks: list[str]
) -> pyvista.PolyData:
    """Return the surface half way between voxels inside and outside of a region."""
    wanted = np.zeros(int(volume.labels.max()) + 1, dtype=bool)
    wanted[list(labels)] = True
    mask = wanted[volume.labels]
    if not mask.any():
        raise InputError(f"{volume.path}: has no voxels of {name}")
    slices, offset = [], []
    for axis in range(3):
        along = np.flatnonzero(mask.any(axis=tuple(i for i in range(3) if i != axis)))
        slices.append(slice(along[0], along[-1] + 1))
        offset.append(along[0] - 1)
    body = np.pad(_cleaned(volume, name, mask[tuple(slices)], filled, remarks), 1)
    grid = pyvista.ImageData(dimensions=body.shape)
    grid.point_data["inside"] = body.astype(np.uint8).ravel(order="F")
    surface = grid.contour([0.5], scalars="inside", method="flying_edges")
    indices = surface.points.astype(float) + offset
    surface.points = indices @ volume.affine[:, :3].T + volume.affine[:, 3]
    surface.clear_data()
    return surface


def _cleaned(
    volume: Volume, name: str, mask: NDArray[np.bool_], filled: bool, remarks: list[str]
) -> NDArray[np.bool_]:
    """Return the largest piece of a region, without holes, and say what was dropped."""
    pieces, number = ndimage.label(mask)
    if number > 1:
        sizes = np.bincount(pieces.ravel())[1:]
        largest = int(np.argmax(sizes))
        others = np.delete(sizes, largest)
        if others.max() > _SECOND_PIECE * sizes[largest]:
            raise InputError(
                f"{volume.path}: {name} is in pieces of {sizes[largest]} and {others.max()} voxels;"
                " give one limb, with one piece of each bone"
            )
        remarks.append(f"{name}: {others.sum()} stray voxels in {len(others)} islands left out")
        mask = pieces == largest + 1
    del pieces
    if filled:
        # What the outside does not reach; ten times as fast as `binary_fill_holes`.
        around = ndimage.label(~np.pad(mask, 1))[0]
        whole = (around != around[0, 0, 0])[1:-1, 1:-1, 1:-1]
        holes = int(whole.sum() - mask.sum())
        if holes:
            remarks.append(f"{name}: {holes} voxels of holes filled")
        mask = whole
    return np.asarray(mask)
