"""Complete segmentations: all bellies, vessels and layers, as they are."""

from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from phantom import Phantom
from scipy import ndimage
from test_imaging_labels import TILTED, nrrd

import calfsocket as cs
from calfsocket.imaging.thickness import thickness
from calfsocket.io.errors import InputError

REGIONS = cs.Limb.reference().regions
NUMBER = {region.name: region.id for region in REGIONS}
CAVITY = len(REGIONS) + 1
BELLIES = [region.id for region in REGIONS if region.tissue == "muscle"]
BONES = [NUMBER["tibia"], NUMBER["fibula"]]
FAT = [region.id for region in REGIONS if region.name.endswith(("fat", "saphenous_vein"))]
FASCIA = NUMBER["deep_fascia"]
TABLE = "".join(f"{r.id},{r.name}\n" for r in REGIONS).replace(
    "deep_fascia", "deep_fascia,fascia"
) + f"{CAVITY},tibia_cavity\n"  # fmt: skip
VOXEL = 1.0, 1.0, 5.0


@cache
def whole(tilted: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """The calf with all its regions, voxels of 1 x 1 x 5 mm."""
    phantom = Phantom(turn=TILTED if tilted else np.eye(3))
    return phantom.labels(VOXEL, *(region.outer for region in REGIONS), "tibia_medullary")


def given_to(labels: np.ndarray, what: Sequence[int], whom: Sequence[int]) -> np.ndarray:
    """Voxels of some labels become the nearest of others."""
    nearest = ndimage.distance_transform_edt(
        ~np.isin(labels, whom), sampling=VOXEL, return_distances=False, return_indices=True
    )
    return np.where(np.isin(labels, what), labels[tuple(nearest)], labels)


@cache
def touching() -> np.ndarray:
    """No fascia: bellies touch each other and the bones."""
    return given_to(whole()[0], [FASCIA], BELLIES + BONES)


def without_fat() -> np.ndarray:
    """The skin lies on the muscles."""
    return given_to(touching(), FAT, BELLIES)


def with_gaps() -> np.ndarray:
    """A voxel without a label between bellies that touch."""
    labels = touching().copy()
    inside = np.isin(labels, BELLIES)
    for axis in (0, 1):
        other = np.roll(labels, -1, axis)
        labels[inside & np.isin(other, BELLIES) & (labels != other) & (other != 0)] = 0
    return labels


def with_noise() -> np.ndarray:
    """Every 200th voxel has a label of somewhere else."""
    labels, random = touching().copy(), np.random.default_rng(3)
    wrong = random.random(labels.shape) < 0.005
    labels[wrong] = random.integers(0, CAVITY + 1, wrong.sum())
    return labels


def made(folder: Path, labels: np.ndarray, table: str = TABLE, **said: object) -> cs.Limb:
    affine = whole()[1]
    nrrd(folder / "limb.nrrd", labels, affine)
    (folder / "labels.csv").write_text(table)
    return cs.Limb.from_labels(folder / "limb.nrrd", folder / "labels.csv", **said)


def measured(limb: cs.Limb, tissue: str) -> set[str]:
    return {r.name for r in limb.regions if r.tissue == tissue and r.origin == "measured"}


def names(tissue: str) -> set[str]:
    return {region.name for region in REGIONS if region.tissue == tissue}


def notes(limb: cs.Limb) -> str:
    assert limb.source is not None
    return "\n".join((*limb.source.found, *limb.source.notes))


def true_areas() -> dict[str, float]:
    return dict(cs.Limb.reference().areas)


def test_all_regions_come_back(tmp_path: Path) -> None:
    limb = made(tmp_path, whole()[0])
    assert limb.tissues == cs.Limb.reference().tissues
    assert measured(limb, "muscle") == names("muscle")
    assert len(measured(limb, "vessel")) == len(names("vessel"))
    assert thickness(limb)["skin"].median == pytest.approx(1.6, abs=0.15)  # by its own label
    for name, area in true_areas().items():
        if limb.tissues[name] == "muscle":
            assert limb.areas[name] == pytest.approx(area, rel=0.06), name


@pytest.mark.parametrize("septum", [None, 1.2])
def test_bellies_that_touch_get_septa(tmp_path: Path, septum: float | None) -> None:
    limb = made(tmp_path, touching(), septum=septum)
    assert measured(limb, "muscle") == names("muscle")
    wanted = 0.76 if septum is None else septum
    assert thickness(limb)["septa"].median == pytest.approx(wanted, abs=0.05)
    assert f"septa of {wanted:.2g} mm and fascia were cut out of" in notes(limb)


def test_skin_may_lie_on_muscles(tmp_path: Path) -> None:
    limb = made(tmp_path, without_fat())
    assert measured(limb, "muscle") == names("muscle")
    assert thickness(limb)["fat"].median < 0.8
    for name in ("great_saphenous_vein", "small_saphenous_vein"):
        assert f"{name} is left out: the fat is too thin for it" in notes(limb)


@pytest.mark.parametrize("labels", [with_gaps, with_noise], ids=["gaps", "stray voxels"])
def test_gaps_and_stray_voxels_are_cleaned(tmp_path: Path, labels) -> None:
    limb = made(tmp_path, labels())
    assert measured(limb, "muscle") == names("muscle")
    exact = made(tmp_path, touching())
    for name in names("muscle"):
        assert limb.areas[name] == pytest.approx(exact.areas[name], rel=0.25), name
    if labels is with_noise:
        assert "soleus:" in notes(limb) and "stray voxels" in notes(limb)


def test_names_and_numbers_of_the_user(tmp_path: Path) -> None:
    """Bellies that are only muscles with a number, labels that are not consecutive, as floats."""
    values = np.append(0, 100 + 7 * np.arange(1, CAVITY + 1)).astype(np.float32)
    lines = []
    for line in TABLE.splitlines():
        label, name, *tissue = line.split(",")
        name = f"Muscle {label}" if int(label) in BELLIES else name
        lines.append(",".join([f"{values[int(label)]:.0f}", name, *tissue]))
    limb = made(tmp_path, values[touching()], "\n".join(lines))
    assert measured(limb, "muscle") == {f"muscle_{number}" for number in BELLIES}
    assert names("muscle").isdisjoint(limb.tissues)
    assert "none of the atlas's is added" in notes(limb)


def test_a_map_of_some_bellies_is_completed(tmp_path: Path) -> None:
    """Others of the atlas fill what is called flesh; one whose place is taken is left out."""
    labels = touching().copy()
    kept = [NUMBER["soleus"], NUMBER["tibialis_anterior"]]
    labels[np.isin(labels, [each for each in BELLIES if each not in kept])] = CAVITY + 1
    table = TABLE.replace(",soleus", ",calf muscle,muscle") + f"{CAVITY + 1},muscle\n"
    limb = made(tmp_path, labels, table)
    assert measured(limb, "muscle") == {"calf_muscle", "tibialis_anterior"}
    assert "soleus is left out" in notes(limb)
    assert "gastrocnemius_medial_head" in limb.tissues


def test_oblique_voxels(tmp_path: Path) -> None:
    labels, affine = whole(tilted=True)
    nrrd(tmp_path / "limb.nrrd", labels, affine)
    (tmp_path / "labels.csv").write_text(TABLE)
    limb = cs.Limb.from_labels(tmp_path / "limb.nrrd", tmp_path / "labels.csv")
    assert measured(limb, "muscle") == names("muscle")


def test_two_legs_in_one_map(tmp_path: Path) -> None:
    """The left one is the mirror image of the right one."""
    both = np.concatenate([touching()[::-1], touching()])  # x grows to the right
    with pytest.raises(InputError, match="has two limbs; add --side left or --side right"):
        made(tmp_path, both, tissues="lumped")
    left, right = (made(tmp_path, both, side=side, tissues="lumped") for side in ("left", "right"))
    assert (left.side, right.side) == ("left", "right")
    assert left.areas["tibia"] == pytest.approx(right.areas["tibia"], rel=1e-3)


def test_names_of_two_sides(tmp_path: Path) -> None:
    both = np.concatenate([touching()[::-1], touching()])
    middle = len(both) // 2
    both[middle:] += np.where(np.isin(both[middle:], BONES), 50, 0).astype(both.dtype)
    table = TABLE.replace(",tibia\n", ",left_tibia\n").replace(",fibula\n", ",fibula_left\n")
    table += "".join(f"{50 + NUMBER[bone]},right {bone}\n" for bone in ("tibia", "fibula"))
    with pytest.raises(InputError, match="a left and of a right limb; add --side"):
        made(tmp_path, both, table, tissues="lumped")
    limb = made(tmp_path, both, table, side="right", tissues="lumped")
    assert {"tibia", "fibula"} <= set(limb.tissues)
