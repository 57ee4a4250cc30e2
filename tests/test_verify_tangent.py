"""The assembled tangent: finite differences, parameters, Newton's order."""

import numpy as np
import pytest

from calfsocket.verification import newton
from calfsocket.verification.newton import PROBES, TOLERANCE, Iterations, Solve, probe_at, recording
from calfsocket.verification.tangent import (
    EQUILIBRIA,
    KINDS,
    as_it_should,
    difference,
    equilibrium_probe,
    parameter_moves,
    random_direction,
    ring,
    state,
)


@pytest.mark.parametrize("name", KINDS)
def test_tangent_is_the_derivative_of_the_residual(name):
    model, x = state(KINDS[name])
    found = difference(model, x, random_direction(model, x))
    assert found.error < 1e-8
    assert found.switched == 0
    assert set(found.status) == KINDS[name].status


def test_residual_and_tangent_move_with_each_parameter():
    moves = parameter_moves()
    assert as_it_should(moves) == len(moves) == 24


@pytest.fixture(scope="module")
def recorded():
    """Probes of all equilibria, and the solves on the way to the mixed one."""
    with recording() as solves:
        mixed = equilibrium_probe("mixed")
    probes = {name: equilibrium_probe(name) for name in EQUILIBRIA if name != "mixed"}
    return probes | {"mixed": mixed}, solves


@pytest.mark.parametrize("name", EQUILIBRIA)
def test_newton_is_of_second_order(recorded, name):
    probe, status = recorded[0][name]
    assert status == EQUILIBRIA[name][2]
    assert probe.order == pytest.approx(2.0, abs=0.01)
    assert 2 <= len(probe.before) < len(PROBES)
    assert probe.after.min() > TOLERANCE


def test_a_probe_leaves_out_what_crosses_a_kink(monkeypatch):
    """Where contact is never that of the solution, there is nothing to fit."""
    numbers = iter(range(2 * len(PROBES)))
    monkeypatch.setattr(newton, "contact_numbers", lambda problem: np.array([next(numbers)]))
    probe, _ = equilibrium_probe("stick")
    assert len(probe.before) == 0
    assert np.isnan(probe.order)


def test_a_tangent_that_is_not_exact_shows():
    """One per cent off: the order is 1 and the difference is seen."""
    model = ring(KINDS["open"]).problem
    exact = model.tangent

    def scaled(x, A):
        exact(x, A)
        A.getPythonContext().matrix.scale(1.01)
        A.getPythonContext().inverse /= 1.01

    model.tangent = scaled
    rest = model.create_vector()
    direction = random_direction(model, rest)
    assert difference(model, rest, direction).error == pytest.approx(0.01, rel=1e-3)
    assert probe_at(model, rest, direction).order == pytest.approx(1.0, abs=0.01)


def test_recording_has_iterations_and_changes_of_status(recorded):
    solves = recorded[1]
    assert len(solves) == 1 + len(EQUILIBRIA["mixed"][1])
    assert all(solve.converged for solve in solves)
    assert any(solve.changes().any() for solve in solves)
    found = Iterations.of(solves)
    assert found.last.sum() == len(solves)
    assert found.last_contraction < 1e-2
    assert np.all(found.factor < 1e3)
    with recording() as later:
        pass
    assert later == []


def test_smooth_iterations_are_whole_steps_above_rounding_without_change():
    same, other = np.array([1, 4]), np.array([1, 5])
    norms = [1e-1, 1e-3, 1e-5, 1e-12]
    smooth = Solve(norms, [same] * 4, [1, 2, 3, 4])
    changing = Solve(norms, [same, same, other, other], [1, 2, 3, 4])
    cut = Solve(norms, [same] * 4, [1, 2, 5, 6])
    found = Iterations.of([smooth, changing, cut])
    assert found.before.tolist() == 3 * [1e-3, 1e-5]
    assert found.smooth.tolist() == [True, False, False, False, False, False]
    assert found.factor == pytest.approx([10.0])
    assert found.last_contraction == pytest.approx(1e-7)
    failed = Solve([1.0, 0.5], [same] * 2, [1, 2])
    assert len(Iterations.of([failed]).before) == 0
    checks = newton.newton_checks([smooth, failed])
    assert "1 of 2 solves" in checks[0].name
    assert newton.newton_checks([]) == []
