"""The assembled model on a ring: tangent, equilibrium, stability, ranks."""

import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc

from calfsocket.io.errors import SolveError
from calfsocket.materials.material_set import MaterialSet
from calfsocket.mechanics.limb_problem import limb_problem
from calfsocket.mechanics.stepping import LoadStepper, LoadSteps
from calfsocket.meshes import tags
from calfsocket.meshes.rings import ring_mesh
from ring_model import (
    SOCKET,
    SWOLLEN,
    describe,
    describe_pulled,
    pulled_rings,
    ring_model,
    solved_ring,
)


@pytest.fixture(scope="module")
def solved():
    return solved_ring(MPI.COMM_SELF)


def test_ring_equilibrium(solved):
    model = solved.problem
    imbalance, pressing = model.force_balance(solved.newton.x, tags.TIBIA_MEDULLARY)
    line_force = 2 * np.pi * SOCKET[0]
    assert imbalance / pressing < 1e-6
    # The pressure of a ring is uniform: mean times circumference is the pressing force.
    state = model.contact.state()
    pressure = state.traction.pressure
    assert pressure.std() / pressure.mean() < 2e-3
    assert pressing == pytest.approx(pressure.mean() * line_force, rel=1e-2)
    assert model.contact.largest_gap() < 1e-2
    assert model.smallest_volume_ratio()[0] > 0
    assert solved.newton.negative_modes() == 0


def test_slip_counts_from_the_step_before():
    """Accepted when the next step begins, so that a finished run is read as it was solved."""
    model = ring_model(MPI.COMM_SELF, h=6.0)
    stepper = LoadStepper(model, LoadSteps(first=0.4, largest=0.4))
    accept, accepted = model.contact.accept, []
    model.contact.accept = lambda: (accepted.append(model.load), accept())
    stepper.run()
    assert accepted == [step.load for step in stepper.steps[:-1]]
    assert len(accepted) == 2


def test_newton_converges_quadratically(solved):
    for step in solved.steps:
        before, last = step.newton.history[-3:-1]
        assert last < 1e-2 * before
        assert step.newton.converged
        assert step.newton.residual < 1e-9


def test_negative_modes_count_what_makes_an_equilibrium_unstable():
    """A thin stiff ring in soft tissue buckles under hoop compression; Newton does not notice."""
    layers = [("muscle", 14.0, 40.0), ("fascia", 40.0, 40.5), ("fat", 40.5, 46.0)]
    section = ring_mesh(MPI.COMM_SELF, layers, (45.0, 50.0), 2.0)
    laws = MaterialSet.paper("separate").tissue_laws()
    stepper = LoadStepper(
        limb_problem(section, {name: laws[name] for name in section.regions}),
        LoadSteps(first=0.1, largest=0.9),
    )
    stepper.problem.load = 0.1
    assert stepper.newton.solve().converged
    assert stepper.newton.negative_modes() == 0
    stepper.run()
    # A mode of a ring comes twice, as cosine and as sine.
    negative = stepper.newton.negative_modes()
    assert negative > 0
    assert negative % 2 == 0


def test_a_failed_run_keeps_the_last_converged_state():
    model = ring_model(MPI.COMM_SELF, h=6.0)
    found = []
    stepper = LoadStepper(
        model, LoadSteps(first=0.4, largest=0.4, smallest=0.05), on_milestone=found.append
    )
    solve = stepper.newton.solve

    def fails_beyond_half():
        result = solve()
        if model.load > 0.5:
            stepper.newton.x.array[:] = np.nan
            return replace(result, converged=False, reason="diverged_for_the_test")
        return result

    stepper.newton.solve = fails_beyond_half
    with pytest.raises(SolveError, match=r"load 0.4\d+ and 0.5\d+: Newton's method runs away"):
        stepper.run()
    assert 0.4 < model.load < 0.5
    assert np.isfinite(model.w.x.array).all()
    residual = stepper.newton.x.duplicate()
    model.residual(stepper.newton.x, residual)
    assert residual.norm() < 1e-9
    # With the history that it was found with, not with the one that a next step would have had.
    np.testing.assert_array_equal(model.slip_history, found[-1].converged_arc)
    assert np.any(model.contact.settled_arc() != model.slip_history)


def test_petsc_options_reach_the_solver():
    options = PETSc.Options("calfsocket_")
    options["snes_max_it"] = 1
    try:
        stepper = LoadStepper(ring_model(MPI.COMM_SELF, h=6.0), LoadSteps(smallest=0.05))
        with pytest.raises(SolveError, match="max_it"):
            stepper.run()
        # One with full steps, one with a line search.
        assert {step.newton.iterations for step in stepper.steps} == {2}
    finally:
        del options["snes_max_it"]


@pytest.fixture(scope="module")
def one(solved):
    return {
        "ring": describe(solved),
        "swollen": describe(solved_ring(MPI.COMM_SELF, SWOLLEN)),
        "pulled": describe_pulled(pulled_rings(MPI.COMM_SELF)),
    }


@pytest.mark.parametrize("ranks", [pytest.param(2, marks=pytest.mark.slow), 3])
def test_ranks_agree(ranks, one, mpirun):
    program = Path(__file__).with_name("ring_model.py")
    found = json.loads(mpirun(ranks, [os.fspath(program)], timeout=240))
    for key in ("torque", "volume"):  # prescribed displacements, without contact
        assert found["pulled"][key] == pytest.approx(one["pulled"][key], rel=1e-9), key
    assert found["pulled"]["newton"] == one["pulled"]["newton"]
    for limb in ("ring", "swollen"):
        agree(found[limb], one[limb])
    assert one["swollen"]["pressing"] > 1.1 * one["ring"]["pressing"]


def agree(several, one):
    assert several["newton"] == one["newton"]
    assert several["region"] == one["region"]
    assert several["points"] == one["points"]
    for key, tolerance in (
        ("pressing", 1e-9),
        ("volume_ratio", 1e-9),
        ("arc", 1e-12),
        ("pressure", 1e-7),
    ):
        np.testing.assert_allclose(several[key], one[key], rtol=tolerance, err_msg=key)
    np.testing.assert_allclose(several["displacement"], one["displacement"], atol=1e-9)
    np.testing.assert_allclose(several["stress"], one["stress"], atol=1e-5)
