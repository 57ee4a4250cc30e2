"""Bodies: prescribed displacements, loads, an elastic foundation, and what is left of them."""

import gc
from weakref import ref

import pytest
import ufl
from mpi4py import MPI

from calfsocket.io.errors import ConvergenceError, InputError
from calfsocket.materials.laws import Hencky
from calfsocket.mechanics.foundation import Foundation
from calfsocket.mechanics.problem import Problem
from calfsocket.mechanics.stepping import LoadStepper, LoadSteps
from calfsocket.meshes.rings import ring_mesh
from ring_model import describe_pulled, pulled_rings, solved_ring


@pytest.fixture(scope="module")
def one():
    return describe_pulled(pulled_rings(MPI.COMM_SELF))


def test_what_is_prescribed_is_reached_in_few_iterations_and_balanced(one):
    assert max(one["newton"]) <= 6
    assert abs(one["torque"]) > 1e-3
    assert abs(one["both"]) < 1e-8
    assert one["modes"] == 0


def test_nothing_keeps_what_was_solved():
    """Even without garbage collection, in which petsc4py has no part in every release."""
    gc.disable()
    try:
        stepper = solved_ring(MPI.COMM_SELF)
        problem = ref(stepper.problem)
        del stepper
        assert problem() is None
    finally:
        gc.enable()


def test_a_body_force_is_held_by_its_foundation():
    """Nothing else holds the ring: b = k u, the same everywhere, without stress."""
    section = ring_mesh(MPI.COMM_SELF, [("ring", 10.0, 20.0)], None, 4.0)
    force, stiffness = 2e-3, 1e-2

    def load(v):
        return ufl.inner(ufl.as_vector((force, 0.0)), v) * ufl.dx(section.mesh)

    problem = Problem(
        section,
        {"ring": Hencky(e=1.0, nu=0.3)},
        loads=[load, load],
        foundation=Foundation({"ring": stiffness}),
    )
    seen = []
    stepper = LoadStepper(
        problem, (0.25, 1.0), on_step=lambda s: seen.append(problem.w.x.array.copy())
    )
    stepper.run()
    body = problem.body()
    for load_share, w in zip((0.25, 1.0), seen, strict=True):
        expected = load_share * 2.0 * force / stiffness * body.shift * [1.0, 0.0]
        assert w[body.dofs] == pytest.approx(expected, abs=1e-8)


def test_fixed_loads_end_at_the_first_failure():
    stepper = pulled_rings(MPI.COMM_SELF, (0.2, 1.0))
    assert [step.load for step in stepper.steps] == [0.2, 1.0]
    problem = stepper.problem
    before = problem.w.x.array.copy()
    stepper.newton.x.set(0.0)
    problem.prescribed *= -1e4
    with pytest.raises(ConvergenceError, match=r"between load 0\.0000 and 0\.2000") as failure:
        stepper.run()
    assert failure.value.result is None
    assert problem.load == 0.0
    assert abs(problem.w.x.array).max() == 0.0 < abs(before).max()


def test_contact_that_is_absent_is_said():
    problem = pulled_rings(MPI.COMM_SELF).problem
    assert not problem.has_contact
    with pytest.raises(ValueError, match="no contact"):
        problem.contact  # noqa: B018


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"largest": -1.0}, "LoadSteps: largest: is -1.0; it must be greater than 0"),
        ({"first": 0.5}, "first 0.5, largest 0.25: they must satisfy"),
        ({"cutback": 1.0}, "cutback: is 1.0; it must be less than 1"),
        ({"bigest": 0.5}, "unknown key 'bigest'"),
    ],
)
def test_load_steps_that_make_no_sense_are_refused(wrong, message):
    with pytest.raises(InputError, match=message):
        LoadSteps(**wrong)
