"""Imported limbs, solved: the pressure of the calf, however the limb lies in its source."""

from functools import cache
from pathlib import Path

import pytest
from geometry import LIMB
from phantom import Phantom, turned

import calfsocket as cs
from calfsocket.materials.material_set import MaterialSet

PARTS = "skin", "tibia", "fibula"
SETS = "separate", "combined"


def mean_and_most(limb: cs.Limb, socket: str, materials: str) -> tuple[float, float]:
    """Return mean and largest contact pressure, kPa, at the full load."""
    result = cs.Simulation(
        limb, cs.Socket.reference(socket), MaterialSet.paper(materials), mesh_size="coarse"
    ).solve()
    assert result.solved
    levels = result.contact_levels
    return levels["contact_pressure_mean"].value, levels["contact_pressure_max"].value


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
    one, other = (mean_and_most(limb, "TSB", materials) for limb in both_ways)
    assert one[0] == pytest.approx(other[0], rel=1e-3)
    assert one[1] == pytest.approx(other[1], rel=2e-2)  # of one point: the meshes differ


@cache
def of_the_calf(materials: str) -> tuple[float, float]:
    return mean_and_most(LIMB, "HS", materials)


@pytest.mark.slow
@pytest.mark.parametrize("materials", SETS)
@pytest.mark.parametrize(
    "changed", [{}, {"mirrored": True, "turn": turned(3)}], ids=["straight", "left and turned"]
)
def test_the_pressure_of_the_calf_comes_back(tmp_path: Path, changed: dict, materials: str) -> None:
    parts = Phantom(**changed).write(tmp_path, *PARTS, "muscle", "cavity")
    mean, most = mean_and_most(cs.Limb.from_surface(*parts), "HS", materials)
    assert mean == pytest.approx(of_the_calf(materials)[0], rel=0.01)
    assert most == pytest.approx(of_the_calf(materials)[1], rel=0.02)
