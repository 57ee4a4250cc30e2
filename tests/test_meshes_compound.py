"""The compound and the plate: dimensions as stated, names, shapes, refused nonsense."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from geometry import LIMB, SKIN
from mesh_measures import area, facets

from calfsocket.io.errors import InputError
from calfsocket.meshes import quality, tags
from calfsocket.meshes.compound import build, load_compound
from calfsocket.meshes.plate import Plate
from calfsocket.meshes.section import build_plated_limb
from calfsocket.meshes.sizing import mesh_size
from calfsocket.meshes.triangles import TriangleMesh

COMPOUND = load_compound()


@pytest.fixture(scope="module")
def mesh() -> TriangleMesh:
    return build(COMPOUND, mesh_size("coarse"))


def nodes(mesh: TriangleMesh, boundary: str) -> np.ndarray:
    return mesh.points[np.unique(facets(mesh, boundary))]


def test_the_compound_has_its_dimensions(mesh: TriangleMesh) -> None:
    width = 3 * (50.0 + 0.78)
    assert COMPOUND.width == pytest.approx(width)
    assert set(mesh.regions) == set(COMPOUND.tissues)
    layers = COMPOUND.layers
    for name in ("skin", "fat", "bone"):
        assert area(mesh, name) == pytest.approx(width * getattr(layers, name), rel=1e-6)
    # A compartment is a parallelogram or trapezium of this area less its rounded corners, which in
    # a corner of the angle a leave r^2 (cot(a/2) - (pi - a)/2).
    lean = math.radians(10.0)
    right = [math.pi / 2 - lean, math.pi / 2 + lean]

    def corners(angles: list[float]) -> float:
        return sum(1.5**2 * (1 / math.tan(a / 2) - (math.pi - a) / 2) for a in angles)

    assert area(mesh, "muscle_2") == pytest.approx(50.0 * 20.0 - corners(2 * right), rel=1e-4)
    assert area(mesh, "muscle_1") == pytest.approx(
        50.0 * 20.0 - corners([*right, math.pi / 2, math.pi / 2]), rel=1e-4
    )
    muscles = sum(area(mesh, name) for name in COMPOUND.muscles)
    assert area(mesh, "fascia") == pytest.approx(width * (0.88 + 20.0 + 0.74) - muscles, rel=1e-6)
    assert area(mesh, "socket") == pytest.approx(
        30.0 * 8.0 - 2 * 5.0**2 * (1 - math.pi / 4), rel=1e-4
    )
    assert len(np.unique(mesh.cells)) == len(mesh.points)  # no stray node
    assert quality.scaled_jacobians(mesh.coordinates).min() > 0.3


def test_the_plate_touches_the_skin_and_boundaries_have_their_places(mesh: TriangleMesh) -> None:
    top = COMPOUND.top
    assert nodes(mesh, tags.SKIN_SURFACE)[:, 1] == pytest.approx(top)
    face = nodes(mesh, tags.SOCKET_INNER)
    assert face[:, 1].min() == pytest.approx(top)
    assert np.ptp(face[face[:, 1] < top + 1e-9, 0]) == pytest.approx(20.0)
    assert nodes(mesh, tags.SOCKET_OUTER)[:, 1].max() == pytest.approx(top + 8.0)
    assert nodes(mesh, tags.TIBIA_MEDULLARY)[:, 1] == pytest.approx(0.0)
    assert np.abs(nodes(mesh, tags.SIDES)[:, 0]) == pytest.approx(COMPOUND.width / 2)


def test_the_plate_touches_the_limb_from_behind() -> None:
    plate = Plate(width=90.0, edge_radius=8.0, thickness=12.0)
    mesh = build_plated_limb(LIMB, plate, mesh_size("coarse"))
    assert mesh.boundaries == tags.BOUNDARIES
    assert set(mesh.regions) == {region.name for region in LIMB.regions} | {tags.SOCKET}
    lowest = SKIN.evaluate(SKIN.sample(0.01))[:, 1].min()
    assert nodes(mesh, tags.SOCKET_INNER)[:, 1].max() == pytest.approx(lowest, abs=1e-4)
    assert nodes(mesh, tags.SOCKET_OUTER)[:, 1].min() == pytest.approx(lowest - 12.0, abs=1e-4)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"stroke": 20.0}, ["stroke", "half of the soft layers"]),
        ({"layers": {"skin": -1.0}}, ["layers.skin"]),
        ({"compartments": {"corner_radius": 6.0}}, ["corner_radius", "quarter"]),
        ({"compartments": {"lean_deg": 60.0}}, ["lean_deg"]),
        ({"plate": {"edge_radius": 9.0}}, ["edge_radius", "thickness"]),
        ({"plates": {}}, ["unknown key 'plates'", "did you mean 'plate'"]),
    ],
)
def test_a_wrong_compound_is_refused_in_one_line(
    change: dict, says: list[str], tmp_path: Path
) -> None:
    content = json.loads(COMPOUND.model_dump_json())
    for key, value in change.items():
        content[key] = content.get(key, {}) | value if isinstance(value, dict) else value
    path = tmp_path / "own.json"
    path.write_text(json.dumps(content))
    with pytest.raises(InputError) as refused:
        load_compound(path)
    message = str(refused.value)
    assert message.startswith(str(path))
    assert "\n" not in message
    for word in says:
        assert word in message
