"""Bodies for the verification of contact: exact shapes, sizes where asked, refused nonsense."""

import math

import numpy as np
import pytest

from calfsocket.io.errors import InputError
from calfsocket.meshes import quality, tags
from calfsocket.meshes.blocks import DiscInCavity, Rings
from calfsocket.meshes.triangles import TriangleMesh

RINGS = Rings((10.0, 20.0), (20.0, 24.0), 4.0, 2.0, turn=0.4)
FLAT = DiscInCavity(10.0, 7.0, math.inf, 5.0, h=0.05, reach=0.2)
BORE = DiscInCavity(10.0, 7.0, 12.5, 5.0, h=0.05, reach=0.2)


def area(mesh: TriangleMesh, region: str) -> float:
    return quality.areas(mesh.coordinates)[mesh.cell_tags == mesh.regions[region]].sum()


def face(mesh: TriangleMesh, name: str) -> np.ndarray:
    return mesh.facets[mesh.facet_tags == mesh.boundaries[name]]


def test_two_rings_have_their_own_size_and_turn() -> None:
    mesh = RINGS.build()
    assert mesh.regions == {"limb": 1, "socket": tags.SOCKET_ID}
    assert mesh.boundaries == tags.BOUNDARIES
    assert area(mesh, "limb") == pytest.approx(math.pi * (20**2 - 10**2), rel=1e-4)
    assert area(mesh, "socket") == pytest.approx(math.pi * (24**2 - 20**2), rel=1e-4)
    for name, length in (("skin_surface", 4.0), ("socket_inner", 2.0)):
        assert 2 * math.pi * 20 / len(face(mesh, name)) == pytest.approx(length, rel=0.1)
    nodes = mesh.points[face(mesh, "socket_inner")[:, :2]].reshape(-1, 2)
    start = 20.0 * np.array([math.cos(0.4), math.sin(0.4)])
    assert np.linalg.norm(nodes - start, axis=1).min() < 1e-9


@pytest.mark.parametrize("disc", [FLAT, BORE])
def test_a_disc_touches_its_cavity_in_one_point(disc: DiscInCavity) -> None:
    mesh = disc.build()
    assert mesh.boundaries == tags.BOUNDARIES
    assert len(np.unique(mesh.cells)) == len(mesh.points)  # no stray node
    assert quality.scaled_jacobians(mesh.coordinates).min() > 0.3
    assert area(mesh, "limb") == pytest.approx(math.pi * (10**2 - 7**2), rel=1e-4)
    if math.isinf(disc.bore):
        assert area(mesh, "socket") == pytest.approx(35.0 * 32.5 - 25.0 * 22.5, rel=1e-9)
    else:
        assert area(mesh, "socket") == pytest.approx(math.pi * (17.5**2 - 12.5**2), rel=1e-4)
    for name in ("skin_surface", "socket_inner"):
        edges = mesh.points[face(mesh, name)]
        lowest = edges[:, :, 1].min()
        assert lowest == pytest.approx(-10.0, abs=1e-4)
        middle, length = edges[:, 2], np.linalg.norm(edges[:, 0] - edges[:, 1], axis=1)
        near = np.linalg.norm(middle - [0.0, -10.0], axis=1) < 0.15
        assert near.sum() >= 5
        assert length[near] == pytest.approx(0.05, rel=0.3)
        assert length.max() > 1.0


@pytest.mark.parametrize(
    ("make", "expected"),
    [
        (lambda: Rings((0.0, 1.0), (1.0, 2.0), 1.0, 1.0), "limb: radii 0.0 and 1.0"),
        (lambda: Rings((1.0, 2.0), (3.0, 2.0), 1.0, 1.0), "socket: radii 3.0 and 2.0"),
        (lambda: Rings((1.0, 2.0), (2.0, 3.0), 1.0, 0.0), "h_socket is 0.0"),
        (lambda: DiscInCavity(10.0, 7.0, 10.0, 5.0, 0.1, 0.2), "10.0, 10.0 mm"),
        (lambda: DiscInCavity(10.0, 7.0, 12.0, 0.0, 0.1, 0.2), "thickness is 0.0"),
        (lambda: DiscInCavity(10.0, 7.0, 12.0, 5.0, -0.1, 0.2), "h is -0.1"),
    ],
)
def test_wrong_bodies_are_refused(make, expected: str) -> None:
    with pytest.raises(InputError, match=expected):
        make()
