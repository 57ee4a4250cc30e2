"""Bodies without contact: prescribed displacements and loads, on any number of ranks."""

import json
import sys
from pathlib import Path

import pytest
import ufl
from mpi4py import MPI

from calfsocket.io.errors import ConvergenceError, InputError
from calfsocket.materials.laws import Hencky
from calfsocket.materials.material_set import MaterialSet
from calfsocket.mechanics.constraints import Constraint
from calfsocket.mechanics.foundation import Foundation
from calfsocket.mechanics.problem import Problem
from calfsocket.mechanics.stepping import LoadStepper, LoadSteps
from calfsocket.meshes import tags
from calfsocket.meshes.rings import ring_mesh

LAYERS = [("bone", 10.0, 14.0), ("fascia", 14.0, 15.0), ("skin", 15.0, 20.0)]
CORE, SKIN = tags.TIBIA_MEDULLARY, tags.SKIN_SURFACE
STRETCH = 1.05


def turned(x):
    """A turn and a stretch."""
    return 0.02 * x[[1, 0]] * [[-1.0], [1.0]] + (STRETCH - 1.0) * x


def pulled(comm, loads=LoadSteps(first=0.5, largest=0.5)):  # noqa: B008
    """Rings whose skin is turned and stretched, their core fixed; solved."""
    laws = MaterialSet.paper("separate").tissue_laws()
    section = ring_mesh(comm, LAYERS, None, 2.0)
    constraints = [Constraint(CORE), Constraint(SKIN, values=turned)]
    problem = Problem(section, {name: laws[name] for name in section.regions}, constraints)
    stepper = LoadStepper(problem, loads)
    stepper.run()
    return stepper


def describe(comm):
    stepper = pulled(comm)
    problem = stepper.problem
    force, torque = problem.reaction(SKIN)
    _, other = problem.reaction(CORE)
    return {
        "newton": [step.newton.iterations for step in stepper.steps],
        "torque": torque,
        "both": torque + other,
        "volume": problem.smallest_volume_ratio()[0],
        "modes": stepper.newton.negative_modes(),
        "force": float(abs(force).max()),
    }


@pytest.fixture(scope="module")
def one():
    return describe(MPI.COMM_SELF)


def test_what_is_prescribed_is_reached_in_few_iterations_and_balanced(one):
    assert max(one["newton"]) <= 6
    assert abs(one["torque"]) > 1e-3
    assert abs(one["both"]) < 1e-8
    assert one["modes"] == 0


@pytest.mark.parametrize("ranks", [2, 3])
def test_ranks_agree(ranks, one, mpirun):
    several = json.loads(mpirun(ranks, [Path(__file__)], timeout=120))
    assert several["newton"] == one["newton"]
    for key in ("torque", "volume"):
        assert several[key] == pytest.approx(one[key], rel=1e-9), key


def test_a_body_force_is_carried_by_its_foundation():
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
    stepper = pulled(MPI.COMM_SELF, (0.2, 1.0))
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
    problem = pulled(MPI.COMM_SELF).problem
    assert not problem.has_contact
    with pytest.raises(ValueError, match="no contact"):
        problem.contact  # noqa: B018


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"largest": -1.0}, "LoadSteps: largest: is -1.0; it must be greater than 0"),
        ({"first": 0.5}, "first 0.5 and largest 0.25 must not fall"),
        ({"cutback": 1.0}, "cutback: is 1.0; it must be less than 1"),
        ({"bigest": 0.5}, "unknown key 'bigest'"),
    ],
)
def test_load_steps_that_make_no_sense_are_refused(wrong, message):
    with pytest.raises(InputError, match=message):
        LoadSteps(**wrong)


if __name__ == "__main__":
    found = describe(MPI.COMM_WORLD)
    if MPI.COMM_WORLD.rank == 0:
        json.dump(found, sys.stdout)
