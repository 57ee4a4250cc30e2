"""Rings for verification: exact circles, the names of the section, and refused nonsense."""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from mesh_measures import facets
from mpi4py import MPI

from calfsocket.io.errors import InputError
from calfsocket.meshes import quality, rings, tags

LAYERS = [("bone", 10.0, 20.0), ("fat", 20.0, 40.0)]


def test_areas_and_perimeters_of_a_ring_in_dolfinx() -> None:
    section = rings.ring_mesh(MPI.COMM_SELF, LAYERS, (39.0, 44.0), 2.0)
    assert section.regions == {"bone": 1, "fat": 2, "socket": 100}
    assert section.boundaries == tags.BOUNDARIES
    one = fem.Constant(section.mesh, 1.0)
    dx = ufl.Measure("dx", section.mesh, subdomain_data=section.cell_tags)
    ds = ufl.Measure("ds", section.mesh, subdomain_data=section.facet_tags)

    def integral(measure: ufl.Measure) -> float:
        return fem.assemble_scalar(fem.form(one * measure)) / np.pi

    for name, inner, outer in [*LAYERS, ("socket", 39.0, 44.0)]:
        assert integral(dx(section.regions[name])) == pytest.approx(outer**2 - inner**2, rel=1e-5)
    radii = {"tibia_medullary": 10, "skin_surface": 40, "socket_inner": 39, "socket_outer": 44}
    for name, radius in radii.items():
        assert integral(ds(section.boundaries[name])) == pytest.approx(2 * radius, rel=1e-5)


def test_area_converges_with_the_fourth_power_of_the_size() -> None:
    """Straight sides would lose area like h^2."""
    errors = []
    for h in (4.0, 2.0, 1.0):
        mesh = rings.build(LAYERS, None, h)
        errors.append(abs(quality.areas(mesh.coordinates).sum() - np.pi * (40**2 - 10**2)))
    rates = np.log2(np.divide(errors[:-1], errors[1:]))
    assert rates == pytest.approx(4.0, abs=0.3)


def test_a_ring_without_socket_has_no_socket_boundaries() -> None:
    mesh = rings.build(LAYERS, None, 4.0)
    assert mesh.regions == {"bone": 1, "fat": 2}
    assert set(mesh.boundaries) == {"tibia_medullary", "skin_surface"}


def test_two_rings_have_separate_sizes_and_turns() -> None:
    mesh = rings.build([("limb", 10.0, 20.0)], (20.0, 24.0), (4.0, 2.0), turn=0.4)
    for name, length in (("skin_surface", 4.0), ("socket_inner", 2.0)):
        assert 2 * np.pi * 20 / len(facets(mesh, name)) == pytest.approx(length, rel=0.1)
    ends = facets(mesh, "socket_inner")[:, :2]
    start = 20.0 * np.array([np.cos(0.4), np.sin(0.4)])
    assert np.linalg.norm(mesh.points[ends].reshape(-1, 2) - start, axis=1).min() < 1e-9


@pytest.mark.parametrize(
    ("layers", "socket", "h", "expected"),
    [
        ([], None, 1.0, "no layers"),
        ([("a", 1.0, 2.0), ("a", 2.0, 3.0)], None, 1.0, "layer names a, a must differ"),
        ([("socket", 1.0, 2.0)], None, 1.0, "must differ, and not be 'socket'"),
        ([("a", 0.0, 2.0)], None, 1.0, "a: radii 0.0 and 2.0 mm; need 0 < inner < outer"),
        ([("a", 1.0, 2.0), ("b", 2.5, 3.0)], None, 1.0, "b starts at 2.5 mm, not at 2.0 mm"),
        ([("a", 1.0, 2.0)], (3.0, 3.0), 1.0, "socket: radii 3.0 and 3.0 mm"),
        ([("a", 1.0, 2.0)], None, 0.0, "element size 0.0 mm"),
        ([("a", 1.0, 2.0)], (2.0, 3.0), (1.0, 0.0), "element size 0.0 mm"),
    ],
)
def test_wrong_rings_are_refused(layers: list, socket: tuple | None, h: float, expected: str):
    with pytest.raises(InputError, match=expected):
        rings.build(layers, socket, h)
