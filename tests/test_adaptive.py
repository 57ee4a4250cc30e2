"""Meshes that a first solution refines: sizes, numbers, and the same mesh wherever it is made."""

import hashlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from scipy.spatial import cKDTree

from calfsocket.contact.parameters import Contact
from calfsocket.io.errors import ConvergenceError, InputError
from calfsocket.materials.material_set import MaterialSet
from calfsocket.mechanics.load_steps import LoadSteps
from calfsocket.meshes import refinement
from calfsocket.meshes.limb import limb_curves
from calfsocket.meshes.quality import areas
from calfsocket.meshes.refinement import MOST_REFINED, FirstError, RefinedSizes, Refinement
from calfsocket.meshes.section import build
from calfsocket.meshes.sizing import (
    ADAPTIVE_TRIANGLES,
    FEWEST_ADAPTIVE,
    SIZES,
    AdaptiveSize,
    LimbSizes,
    any_size,
    checked_size,
    mesh_size,
)
from calfsocket.meshes.tags import SKIN_SURFACE, SOCKET, SOCKET_INNER
from calfsocket.meshes.triangles import SUBDIVISION, TriangleMesh
from calfsocket.simulation.prepared import Prepared
from calfsocket.simulation.simulation import Monitor, Simulation
from tiny_study import tiny_limb, tiny_socket

SIZE = AdaptiveSize("adaptive", 3000, SIZES["coarse"])


@pytest.fixture(scope="module")
def first() -> TriangleMesh:
    return build(tiny_limb(), tiny_socket("A"), SIZE.first)


def bodies(mesh: TriangleMesh) -> list[np.ndarray]:
    socket = mesh.cell_tags == mesh.regions[SOCKET]
    return [np.flatnonzero(~socket), np.flatnonzero(socket)]


def error_near(mesh: TriangleMesh, x: float, y: float) -> np.ndarray:
    """Errors in the limb that fall off around a place."""
    middle = mesh.points[mesh.cells[:, :3]].mean(axis=1)
    error = 1e-3 + np.exp(-(np.hypot(*(middle - (x, y)).T) ** 2) / 4.0)
    error[bodies(mesh)[1]] = 0.0
    return error


def refined(mesh: TriangleMesh, error: np.ndarray, size: AdaptiveSize = SIZE) -> Refinement:
    return Refinement.of(FirstError(mesh.coordinates, error, bodies(mesh)), size)


def sides(mesh: TriangleMesh) -> np.ndarray:
    """Sides of equilateral triangles with the areas of a mesh's."""
    return np.sqrt(4 / np.sqrt(3) * areas(mesh.coordinates))


# --- names


def test_names_say_how_many_triangles():
    assert any_size("adaptive") == AdaptiveSize("adaptive", ADAPTIVE_TRIANGLES)
    assert checked_size("adaptive-040000") == AdaptiveSize("adaptive-40000", 40_000)
    assert checked_size(SIZE) is SIZE


@pytest.mark.parametrize("word", ["adaptive-", "adaptive-x", "adaptive-6e4", "adaptive--30000"])
def test_names_that_say_nothing_are_refused(word):
    with pytest.raises(InputError, match=r"no mesh size 'adaptive.*adaptive"):
        any_size(word)


def test_too_few_triangles_are_refused():
    few = FEWEST_ADAPTIVE - 1
    with pytest.raises(
        InputError, match=f"adaptive-{few}: {few} triangles; give {FEWEST_ADAPTIVE} to"
    ):
        any_size(f"adaptive-{few}")


def test_a_second_mesh_has_half_or_twice_as_many():
    half = any_size("adaptive").second(0)
    assert (half.triangles, half.name) == (30_000, "half the triangles of adaptive")
    assert any_size("adaptive-30000").second(0).triangles == 60_000


def test_a_mesh_alone_cannot_be_refined():
    with pytest.raises(InputError, match=r"refined by a solution.*give coarse, medium, paper or a"):
        mesh_size("adaptive")


# --- sizes


def test_sides_follow_the_error(first):
    """Eight times the error, half the side: it falls with the third power."""
    error = np.ones(len(first.cells))
    error[::2] = 8.0
    given = FirstError(first.coordinates, error, [np.arange(len(error))] * 2)
    found = Refinement.of(given, SIZE).limb
    ratio = found.sizes.reshape(len(error), -1)[:, 0] / sides(first)
    np.testing.assert_allclose(ratio[1::2], 2.0 * ratio[::2][: len(ratio[1::2])])
    # each triangle becomes as many as have its area
    assert np.sum(ratio**-2.0) == pytest.approx(SIZE.triangles, rel=0.03)


def test_sides_become_at_most_so_many_times_smaller(first):
    error = error_near(first, 9.0, 0.0)
    error[0] = 1e3 * error.max()
    found = refined(first, error, replace(SIZE, triangles=300_000)).limb.sizes.reshape(
        -1, len(SUBDIVISION)
    )[:, 0]
    ratio = sides(first)[bodies(first)[0]] / found
    assert ratio.max() == pytest.approx(MOST_REFINED)
    assert ratio.min() < 0.8 * MOST_REFINED


def test_the_last_digits_of_a_solution_do_not_reach_the_sides(first):
    error = error_near(first, 9.0, 0.0)
    noise = 1 + 1e-12 * np.random.default_rng(1).normal(size=len(error))
    exact, noisy = (refined(first, each) for each in (error, error * noise))
    assert np.unique(exact.limb.sizes).size > 20
    np.testing.assert_array_equal(exact.limb.sizes, noisy.limb.sizes)
    np.testing.assert_array_equal(exact.socket.sizes, noisy.socket.sizes)


def test_without_an_error_the_field_is_that_of_the_first_mesh(first):
    none = refined(first, np.zeros(len(first.cells)))
    before = LimbSizes(limb_curves(tiny_limb()), tiny_limb().contact_boundary)
    field = RefinedSizes(SIZE.first, before, none.limb).field(SIZE.first)
    assert np.all(field.values <= before.field(SIZE.first).values)


def test_triangles_are_small_where_the_error_is(first):
    at = (9.0, 0.0)
    wanted = refined(first, error_near(first, *at))
    mesh = build(tiny_limb(), tiny_socket("A"), SIZE.final, None, wanted)
    assert len(mesh.cells) == pytest.approx(SIZE.triangles, rel=0.1)
    assert len(mesh.cells) <= SIZE.triangles
    limb = bodies(mesh)[0]
    middle = mesh.points[mesh.cells[limb, :3]].mean(axis=1)
    asked = wanted.limb.sizes[cKDTree(wanted.limb.points).query(middle)[1]]
    found = sides(mesh)[limb]
    near = np.hypot(*(middle - at).T) < 2.0
    far = np.hypot(*(middle + at).T) < 2.0
    assert np.median(found[near]) < 0.4 * np.median(found[far])
    # the factor by which all sizes are scaled is the same near and far
    factor = np.median(found[near] / asked[near])
    assert 0.6 < factor < 1.5
    assert np.percentile(found[near] / asked[near] / factor, [2, 98]) == pytest.approx(1, abs=0.5)


def edges(mesh: TriangleMesh, boundary: str) -> tuple[np.ndarray, np.ndarray]:
    """Middles of the edges of a boundary, and their lengths."""
    ends = mesh.points[mesh.facets[mesh.facet_tags == mesh.boundaries[boundary], :2]]
    return ends.mean(axis=1), np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)


def test_the_socket_has_edges_no_longer_than_those_of_the_skin_that_it_meets(first):
    """It has no error of its own; what it does not resolve, the skin's shear shows."""
    wanted = refined(first, error_near(first, 12.5, 0.0))
    mesh = build(tiny_limb(), tiny_socket("A"), SIZE.final, None, wanted)
    (on_skin, skin), (on_face, face) = (edges(mesh, name) for name in (SKIN_SURFACE, SOCKET_INNER))
    opposite = skin[cKDTree(on_skin).query(on_face, 3)[1]].max(axis=1)
    assert skin.min() < 0.4 * skin.max()
    assert np.max(face / opposite) < 1.5  # 2 at least, and up to 8, without


def test_the_same_errors_give_the_same_mesh(first):
    def made() -> bytes:
        wanted = refined(first, error_near(first, 0, 9))
        mesh = build(tiny_limb(), tiny_socket("A"), SIZE.final, None, wanted)
        return mesh.points.tobytes() + mesh.cells.tobytes()

    assert made() == made()


# --- simulations


def simulated(**given) -> Simulation:
    given = {"socket": tiny_socket("C"), "mesh_size": SIZE, "comm": MPI.COMM_SELF} | given
    return Simulation(tiny_limb(), materials=MaterialSet.paper("combined"), **given)


class Remarks(Monitor):
    def __init__(self) -> None:
        self.texts: list[str] = []

    def message(self, text: str, load: float | None, milestone: bool = False) -> None:
        self.texts.append(text)


def test_a_case_is_solved_on_the_mesh_that_its_first_solution_refines():
    remarks = Remarks()
    result = simulated().solve(remarks)
    assert result.solved
    assert 0.9 * SIZE.triangles <= len(result.fields.cells) <= SIZE.triangles
    assert result.record.seconds["first solution"] > 0.0
    assert "first solution, mesh coarse" in remarks.texts
    assert result.record.checks.cells == len(result.fields.cells)


def test_cases_share_a_refined_mesh_only_where_all_is_the_same(monkeypatch):
    made = []
    original = Refinement.of
    monkeypatch.setattr(
        refinement.Refinement, "of", lambda *given: (made.append(1), original(*given))[1]
    )
    prepared = Prepared()
    for friction in (0.4, 0.4, 0.2):
        simulated(contact=Contact(friction=friction)).solve(prepared=prepared)
    assert len(made) == 2
    assert simulated().geometry != simulated(contact=Contact(friction=0.2)).geometry
    assert (
        simulated(mesh_size="coarse").geometry
        == simulated(mesh_size="coarse", contact=Contact(friction=0.2)).geometry
    )


def test_a_first_solution_that_stops_refines_as_of_there():
    remarks = Remarks()
    stopped = simulated(contact=Contact(friction=0.0), steps=LoadSteps(smallest=0.05))
    try:
        result = stopped.solve(remarks)
    except ConvergenceError as error:  # the second one may stop, too
        result = error.result
    assert any("first solution stopped" in text for text in remarks.texts)
    assert len(result.fields.cells) <= SIZE.triangles


PROGRAM = """
import hashlib, sys
sys.path.insert(0, {tests!r})
from mpi4py import MPI
from test_adaptive import digest, simulated
found = digest(simulated(comm=MPI.COMM_WORLD).solve())
if MPI.COMM_WORLD.rank == 0:
    print(found)
"""


def digest(result) -> str:
    fields = result.fields
    parts = fields.points.tobytes() + fields.cells.tobytes()
    return hashlib.sha256(parts).hexdigest()


def test_the_mesh_is_the_same_on_any_number_of_ranks(mpirun):
    program = PROGRAM.format(tests=str(Path(__file__).parent))
    assert len({mpirun(n, ["-c", program]).strip() for n in (1, 2, 3)}) == 1
