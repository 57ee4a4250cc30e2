"""The front of a scan of the skin alone: by the tibia's crest, or asked for."""

from pathlib import Path

import numpy as np
import pytest
import pyvista
from phantom import Phantom, turned

from calfsocket.imaging.anatomy import Anatomy, Said, find_anatomy
from calfsocket.imaging.limb import imported, read_source
from calfsocket.imaging.plane import Level
from calfsocket.imaging.section import section
from calfsocket.io.errors import InputError


def anatomy_of(folder: Path, phantom: Phantom, **said: str) -> Anatomy:
    units = "m" if phantom.scale > 1 else "mm"
    source = read_source(phantom.write(folder, "skin"), units)
    up = ",".join(map(str, phantom.turn @ [0, 0, 1]))
    return find_anatomy(source, Said(proximal=up, **said))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "changed",
    [
        {},
        {"turn": turned(1)},
        {"mirrored": True, "turn": turned(3)},
        {"taper": (0.6, 1.2), "scale": 1000.0},
        {"taper": (0.5, 0.9), "noise": 0.3},
    ],
    ids=["straight", "turned", "left", "metres", "thin and noisy"],
)
def test_the_side_is_enough(tmp_path: Path, changed: dict) -> None:
    phantom = Phantom(**changed)
    found = anatomy_of(tmp_path, phantom, side="left" if phantom.mirrored else "right")
    assert found.anterior is not None
    angle = np.degrees(np.arccos(found.anterior @ phantom.turn @ [0, 1, 0]))
    assert angle < 12
    (line,) = (line for line in found.found if line.startswith("anterior: assumed"))
    assert "times as sharp as the next one" in line


def test_without_a_side_nothing_is_assumed(tmp_path: Path) -> None:
    assert anatomy_of(tmp_path, Phantom()).anterior is None


@pytest.mark.parametrize("corners", [3, 4])
def test_ridges_that_are_alike_do_not_tell(tmp_path: Path, corners: int) -> None:
    """As sharp over both hamstrings as over the tibia."""
    angle = np.linspace(0, 2 * np.pi, 120, endpoint=False)
    radius = 50 * (1 + 0.08 * np.cos(corners * angle) + 0.01 * np.cos(angle))
    rings = [
        np.column_stack([s * radius * np.cos(angle), s * radius * np.sin(angle), 0 * angle + z])
        for s, z in zip(np.linspace(0.7, 1.1, 30), np.linspace(0, 200, 30), strict=True)
    ]
    grid = np.stack([np.vstack([ring, ring[:1]]) for ring in rings])
    surface = pyvista.StructuredGrid(*np.moveaxis(grid, -1, 0)).extract_surface().triangulate()
    surface.save(tmp_path / "scan.stl")
    source = read_source([tmp_path / "scan.stl"])
    found = find_anatomy(source, Said("right", "+z"))
    assert found.anterior is None
    with pytest.raises(InputError, match=r"no ridge of the skin is sharp enough.*add --anterior"):
        imported(section(source, found, Level.parse("0.5")))
