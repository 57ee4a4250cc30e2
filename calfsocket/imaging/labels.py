"""Surfaces of the regions of a label map, without its stray voxels and holes."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pyvista
from numpy.typing import NDArray
from scipy import ndimage

from calfsocket.imaging.label_table import (
    CAVITY,
    IGNORED,
    Meaning,
    Side,
    of_one_side,
    read_table,
)
from calfsocket.imaging.source import Source, sha256
from calfsocket.imaging.surface import Shell, check_size
from calfsocket.imaging.volume import MOST_LABELS, Volume, read_volume
from calfsocket.io.errors import InputError

#: Largest number of a label.
_LARGEST_LABEL = 100_000
#: A second piece of the limb, or of a bone, with more than this share of the first is no stray
#: voxel. Muscles and vessels may be in pieces; those below the second share are stray voxels.
_SECOND_PIECE, _STRAY = 0.2, 0.02
#: Tissues beneath the fat: all of them together are the muscle envelope. Some vessels lie in fat.
_DEEP = ("muscle", "fascia", "bone")
#: Surfaces around several regions, whose stray voxels are those of the regions.
_AROUND = ("muscle", "below the skin")
#: All labels together, in what is reported as cleaned.
_LIMB = "limb"


def read_labels(
    path: Path | str,
    table: Path | str | None,
    voxel: tuple[float, float, float] | None = None,
    side: Side | None = None,
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
    side
        Of the limb that is read, of a map that has both.

    Raises
    ------
    InputError
        When a file cannot be read, a label is not listed, or a region is missing or in pieces.
    """
    path = Path(path)
    meanings = read_table(Path(table)) if table else {}
    volume = read_volume(path, voxel)
    here, stated = of_one_side(_present(volume, meanings, table), side, f"{table}")
    used = {label: each for label, each in here.items() if each.region != IGNORED}
    if all(each.tissue in ("bone", "vessel") for each in used.values()):
        raise InputError(f"{path}: has bones and vessels alone; label skin or flesh too")
    whole = _Bodies(volume, [slice(None)] * 3)
    skin = Shell("skin", whole.limb(list(used), side), path)
    check_size(f"{path}: skin", skin.surface.points, "mm")
    bodies = whole.cropped()

    def shell(name: str, labels: Sequence[int], pieces: bool = False) -> Shell:
        return Shell(name, bodies.surface(name, labels, pieces), path)

    bones, cavities, regions = {}, {}, {}
    for region in dict.fromkeys(each.region for each in used.values()):
        labels = [label for label, each in used.items() if each.region == region]
        first = used[labels[0]]
        if not bodies.has(labels):
            continue  # of the other limb
        if region.endswith(CAVITY):
            cavities[region.removesuffix(CAVITY)] = shell(region, labels)
        elif first.tissue == "bone":
            inner = [label for label, each in used.items() if each.region == region + CAVITY]
            bones[region] = shell(region, [*labels, *inner])
        elif first.is_region:
            regions[region] = (first.tissue, shell(region, labels, pieces=True))
    tissues = {each.tissue for each in used.values()}
    flesh = any(each.region == "muscle" for each in used.values())
    muscle = inner_skin = None
    if "muscle" in tissues and ("fat" in tissues or not flesh):
        deep = [label for label, each in used.items() if each.tissue in _DEEP]
        muscle = shell(_AROUND[0], deep, pieces=True)
    if "skin" in tissues and ("fat" in tissues or muscle):
        below = [label for label, each in used.items() if each.tissue != "skin"]
        inner_skin = shell(_AROUND[1], below, pieces=True)
    files = {path.name: _hash(path)} | ({Path(table).name: sha256(Path(table))} if table else {})
    return Source(
        names=path.name,
        files=files,
        skin=skin,
        bones=bones,
        cavities={bone: each for bone, each in cavities.items() if bone in bones},
        muscle=muscle,
        skin_inner=inner_skin,
        regions=regions,
        superior=volume.superior,
        anterior=volume.anterior,
        side=stated,
        voxel=volume.affine[:, :3],
        remarks=tuple([*whole.remarks(), *bodies.remarks()]),
    )


def _hash(path: Path) -> str:
    """Return the hash of a file, or of the hashes of a folder's files."""
    if not path.is_dir():
        return sha256(path)
    import hashlib

    names = sorted(each for each in path.iterdir() if each.is_file())
    return hashlib.sha256("".join(map(sha256, names)).encode()).hexdigest()


def _present(
    volume: Volume, meanings: Mapping[int, Meaning], table: Path | str | None
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
            f" {missing[0]},{IGNORED}"
        )
    return {label: meanings[label] for label in found}


@dataclass
class _Bodies:
    """The regions of a label map without stray voxels and holes.

    Attributes
    ----------
    volume : Volume
    box : sequence of slice
        The part of it that is looked at.
    stray, holes : dict of str to int
        Voxels that were left out, and filled, by region.
    islands : Counter of str
        Number of pieces that were left out.
    """

    volume: Volume
    box: Sequence[slice]
    stray: Counter[str] = field(default_factory=Counter)
    islands: Counter[str] = field(default_factory=Counter)
    holes: Counter[str] = field(default_factory=Counter)

    def __post_init__(self) -> None:
        self._boxes = ndimage.find_objects(self.volume.labels)

    def has(self, labels: Sequence[int]) -> bool:
        """Return whether the map has voxels with one of some labels."""
        return any(self._boxes[label - 1] for label in labels if label <= len(self._boxes))

    def limb(self, labels: Sequence[int], side: Side | None) -> pyvista.PolyData:
        """Return the surface of all labels together, and forget what lies elsewhere."""
        mask, corner = self._mask(labels)
        pieces, number = ndimage.label(mask)
        sizes = np.bincount(pieces.ravel())[1:]
        large = np.flatnonzero(sizes > _SECOND_PIECE * sizes.max())
        chosen = int(large[0])
        if len(large) == 2:
            chosen = self._of_side(pieces, large, side)
        elif len(large) > 2:
            self._refuse("the limb", sizes)
        if number > 1:
            others = np.delete(sizes, large)
            self.stray[_LIMB], self.islands[_LIMB] = int(others.sum()), len(others)
        mask = self._filled(_LIMB, pieces == chosen + 1)
        self._limb, self._corner = mask, corner
        return self._contour(mask, corner)

    def cropped(self) -> "_Bodies":
        """Return the limb alone."""
        corner, limb = self._corner, self._limb
        box = tuple(
            slice(first, first + size) for first, size in zip(corner, limb.shape, strict=True)
        )
        labels = np.where(limb, self.volume.labels[box], 0)
        affine = self.volume.affine.copy()
        affine[:, 3] += affine[:, :3] @ corner
        return _Bodies(replace(self.volume, labels=labels, affine=affine), box)

    def surface(self, name: str, labels: Sequence[int], pieces: bool) -> pyvista.PolyData:
        """Return the surface half way between voxels inside and outside of a region.

        Parameters
        ----------
        pieces
            Whether it may be in several, as vessels are.
        """
        mask, corner = self._mask(labels)
        found, number = ndimage.label(mask)
        if number > 1:
            sizes = np.bincount(found.ravel())[1:]
            kept = sizes > _STRAY * sizes.max() if pieces else sizes == sizes.max()
            if not pieces and (np.sort(sizes)[-2] > _SECOND_PIECE * sizes.max()):
                self._refuse(name, sizes)
            self.stray[name] = int(sizes[~kept].sum())
            self.islands[name] = int((~kept).sum())
            mask = np.append(False, kept)[found]
        return self._contour(self._filled(name, mask), corner)

    def remarks(self) -> list[str]:
        """Say what was cleaned."""
        found = []
        for name in _AROUND:
            del self.stray[name], self.holes[name]
        for name, number in self.stray.items():
            if number:
                found.append(
                    f"{name}: {_count(number, 'stray voxel')} in"
                    f" {_count(self.islands[name], 'island')} left out"
                )
        found += [
            f"{name}: {_count(n, 'voxel')} of holes filled"
            for name, n in self.holes.items()
            if n and name not in _AROUND
        ]
        return found

    def _mask(self, labels: Sequence[int]) -> tuple[NDArray[np.bool_], NDArray[np.integer]]:
        """Return where labels are, in the smallest box, and its corner."""
        boxes = [self._boxes[label - 1] for label in labels if label <= len(self._boxes)]
        ends = np.array([[(s.start, s.stop) for s in box] for box in boxes if box])
        first, last = ends[..., 0].min(axis=0), ends[..., 1].max(axis=0)
        part = self.volume.labels[tuple(slice(a, b) for a, b in zip(first, last, strict=True))]
        wanted = np.zeros(max(len(self._boxes), *labels) + 1, dtype=bool)
        wanted[list(labels)] = True
        return wanted[part], first

    def _refuse(self, name: str, sizes: NDArray[np.integer]) -> None:
        first, second = np.sort(sizes)[:-3:-1]
        raise InputError(
            f"{self.volume.path}: {name} is in pieces of {first} and {second} voxels;"
            " give one limb, with one piece of each bone"
        )

    def _of_side(
        self, pieces: NDArray[np.integer], large: NDArray[np.integer], side: Side | None
    ) -> int:
        """Return which of two limbs is the one of a side."""
        path, volume = self.volume.path, self.volume
        if volume.superior is None or volume.anterior is None:
            raise InputError(
                f"{path}: has two limbs, and does not say which is the left one; cut one away"
            )
        if side is None:
            raise InputError(f"{path}: has two limbs; add --side left or --side right")
        centres = np.array(ndimage.center_of_mass(pieces > 0, pieces, large + 1))
        right = np.cross(volume.anterior, volume.superior)
        along = centres @ volume.affine[:, :3].T @ right
        return int(large[np.argmax(along) if side == "right" else np.argmin(along)])

    def _filled(self, name: str, mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return a body with all that the outside does not reach."""
        # Ten times as fast as `binary_fill_holes`.
        around = ndimage.label(~np.pad(mask, 1))[0]
        whole = (around != around[0, 0, 0])[1:-1, 1:-1, 1:-1]
        self.holes[name] = int(whole.sum() - mask.sum())
        return np.asarray(whole)

    def _contour(self, mask: NDArray[np.bool_], corner: NDArray[np.integer]) -> pyvista.PolyData:
        body = np.pad(mask, 1)
        grid = pyvista.ImageData(dimensions=body.shape)
        grid.point_data["inside"] = body.astype(np.uint8).ravel(order="F")
        surface = grid.contour([0.5], scalars="inside", method="flying_edges")
        indices = surface.points.astype(float) + corner - 1
        affine = self.volume.affine
        surface.points = indices @ affine[:, :3].T + affine[:, 3]
        surface.clear_data()
        return surface


def _count(number: int, what: str) -> str:
    return f"{number} {what}" if number == 1 else f"{number} {what}s"
