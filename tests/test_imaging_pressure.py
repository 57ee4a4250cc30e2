"""Imported limbs, solved: the pressure of the calf, however the limb lies in its source."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from geometry import LIMB
from phantom import Phantom, turned
from test_imaging_labels import PARTS as LABELLED
from test_imaging_labels import TILTED, nrrd, table

import calfsocket as cs
from calfsocket.materials.material_set import MaterialSet

PARTS = "skin", "tibia", "fibula"
SETS = "separate", "combined"


def solved(limb: cs.Limb, socket: str, materials: str) -> tuple[float, float, float]:
    """Return mean and largest contact pressure, kPa, at the full load, and that over all skin."""
    result = cs.Simulation(
        limb, cs.Socket.reference(socket), MaterialSet.paper(materials), mesh_size="coarse"
    ).solve()
    assert result.solved
    levels = result.contact_levels
    mean = levels["contact_pressure_mean"].value
    over_all = mean * levels["contact_share"].value / 100
    return mean, levels["contact_pressure_max"].value, over_all


def lumped(folder: Path, phantom: Phantom) -> cs.Limb:
    units = "m" if phantom.scale > 1 else "mm"
    return cs.Limb.from_surface(*phantom.write(folder, *PARTS), units=units, tissues="lumped")


@pytest.fixture(scope="module")
def both_ways(tmp_path_factory: pytest.TempPathFactory) -> tuple[cs.Limb, cs.Limb]:
    """A right limb, and the same one as a left limb, turned in space and in metres."""
    other = Phantom(mirrored=True, turn=turned(3), scale=1000.0)
    folder = tmp_path_factory.mktemp("limbs")
    return lumped(folder, Phantom()), lumped(folder, other)


@pytest.mark.parametrize("materials", SETS)
def test_the_same_pressure_however_the_limb_lies(
    both_ways: tuple[cs.Limb, cs.Limb], materials: str
) -> None:
    one, other = (solved(limb, "TSB", materials) for limb in both_ways)
    assert one[0] == pytest.approx(other[0], rel=1e-3)
    assert one[1] == pytest.approx(other[1], rel=2e-2)  # of one point: the meshes differ


@cache
def of_the_calf(materials: str) -> tuple[float, float, float]:
    return solved(LIMB, "HS", materials)


@pytest.mark.slow
@pytest.mark.parametrize("materials", SETS)
@pytest.mark.parametrize(
    "changed", [{}, {"mirrored": True, "turn": turned(3)}], ids=["straight", "left and turned"]
)
def test_the_pressure_of_the_calf_comes_back(tmp_path: Path, changed: dict, materials: str) -> None:
    parts = Phantom(**changed).write(tmp_path, *PARTS, "muscle", "cavity")
    mean, most, _ = solved(cs.Limb.from_surface(*parts), "HS", materials)
    assert mean == pytest.approx(of_the_calf(materials)[0], rel=0.01)
    assert most == pytest.approx(of_the_calf(materials)[1], rel=0.02)


@pytest.mark.slow
def test_noise_hardly_changes_the_pressure(tmp_path: Path) -> None:
    """Where the stiff fascia of Separate bears, waves of 0.04 mm decide what is in contact.

    The mean where there is contact rises with what is lost of it; the mean over all skin does not.
    """
    found = []
    for seed in range(1, 5):
        folder = tmp_path / str(seed)
        folder.mkdir()
        parts = Phantom(noise=0.1, seed=seed).write(folder, *PARTS)
        found.append(solved(cs.Limb.from_surface(*parts), "HS", "separate"))
    means, _, over_all = np.transpose(found)
    true, _, true_over_all = of_the_calf("separate")
    assert means == pytest.approx(np.full(4, true), rel=0.02)
    assert over_all == pytest.approx(np.full(4, true_over_all), rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("materials", SETS)
def test_voxels_do_not_bias_the_pressure(tmp_path: Path, materials: str) -> None:
    """The map has the muscle envelope, between which and the skin the fat lies."""
    labels, affine = Phantom(turn=TILTED).labels((1.0, 1.0, 1.0), *LABELLED)
    limb = cs.Limb.from_labels(nrrd(tmp_path / "a.nrrd", labels, affine), table(tmp_path))
    mean, *_ = solved(limb, "HS", materials)
    assert mean == pytest.approx(of_the_calf(materials)[0], rel=0.02)
