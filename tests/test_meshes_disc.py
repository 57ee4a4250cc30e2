"""A disc in a cavity: exact shapes, sizes where asked, refused nonsense."""

import math

import numpy as np
import pytest
from mesh_measures import area, facets

from calfsocket.io.errors import InputError
from calfsocket.meshes import quality, tags
from calfsocket.meshes.disc import DiscInCavity

SIZES = {"radius": 10.0, "core": 7.0, "bore": 12.5, "thickness": 5.0, "h": 0.05, "reach": 0.2}
FLAT = DiscInCavity(**SIZES | {"bore": math.inf})
BORE = DiscInCavity(**SIZES)


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
        edges = mesh.points[facets(mesh, name)]
        lowest = edges[:, :, 1].min()
        assert lowest == pytest.approx(-10.0, abs=1e-4)
        middle, length = edges[:, 2], np.linalg.norm(edges[:, 0] - edges[:, 1], axis=1)
        near = np.linalg.norm(middle - [0.0, -10.0], axis=1) < 0.15
        assert near.sum() >= 5
        assert length[near] == pytest.approx(0.05, rel=0.3)
        assert length.max() > 1.0


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"bore": 10.0}, "core, radius, bore are 7.0, 10.0, 10.0 mm"),
        ({"thickness": 0.0}, "thickness: is 0.0; it must be greater than 0"),
        ({"h": -0.1}, "h: is -0.1; it must be greater than 0"),
    ],
)
def test_wrong_discs_are_refused(change: dict[str, float], expected: str) -> None:
    with pytest.raises(InputError, match=f"DiscInCavity: {expected}"):
        DiscInCavity(**SIZES | change)
