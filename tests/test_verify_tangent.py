"""The assembled tangent: finite differences, parameters, Newton's order."""

from itertools import pairwise

import numpy as np
import pytest

from calfsocket.verification import newton
from calfsocket.verification.newton import (
    PROBES,
    TOLERANCE,
    Iterate,
    converged,
    largest_factor,
    last_contraction,
    last_iterations,
    probe_at,
    recording,
)
from calfsocket.verification.report import order
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
    assert order(probe.before, probe.after) == pytest.approx(2.0, abs=0.01)
    assert 2 <= len(probe.before) < len(PROBES)
    assert probe.after.min() > TOLERANCE


def test_a_probe_leaves_out_what_crosses_a_kink(monkeypatch):
    """Where contact is never that of the solution, there is nothing to fit."""
    numbers = iter(range(2 * len(PROBES)))
    monkeypatch.setattr(newton, "contact_numbers", lambda problem: np.array([next(numbers)]))
    probe, _ = equilibrium_probe("stick")
    assert len(probe.before) == 0
    assert np.isnan(order(probe.before, probe.after))


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
    probe = probe_at(model, rest, direction)
    assert order(probe.before, probe.after) == pytest.approx(1.0, abs=0.01)


def test_recording_has_iterations_and_changes_of_status(recorded):
    solves = recorded[1]
    assert len(solves) == 1 + len(EQUILIBRIA["mixed"][1])
    assert all(map(converged, solves))
    found = last_iterations(solves)
    assert found["last"].sum() == len(solves)
    assert last_contraction(found) < 1e-2
    assert 0 < largest_factor(found) < 1e3
    changes = [np.any(a.contact != b.contact) for solve in solves for a, b in pairwise(solve)]
    assert any(changes)
    with recording() as later:
        pass
    assert later == []


def solve_of(norms, contact, evaluations):
    return [Iterate(*each) for each in zip(norms, contact, evaluations, strict=True)]


def test_smooth_iterations_are_whole_steps_above_rounding_without_change():
    same, other = np.array([1, 4]), np.array([1, 5])
    norms = [1e-1, 1e-3, 1e-5, 1e-12]
    smooth = solve_of(norms, [same] * 4, [1, 2, 3, 4])
    changing = solve_of(norms, [same, same, other, other], [1, 2, 3, 4])
    cut = solve_of(norms, [same] * 4, [1, 2, 5, 6])
    found = last_iterations([smooth, changing, cut])
    assert found.before.tolist() == 3 * [1e-3, 1e-5]
    assert found.solve.tolist() == [0, 0, 1, 1, 2, 2]
    assert found.smooth.tolist() == [True, False, False, False, False, False]
    assert largest_factor(found) == pytest.approx(10.0)
    assert last_contraction(found) == pytest.approx(1e-7)
    failed = solve_of([1.0, 0.5], [same] * 2, [1, 2])
    nothing = last_iterations([failed])
    assert len(nothing) == largest_factor(nothing) == last_contraction(nothing) == 0
    checks = newton.newton_checks([smooth, failed])
    assert "1 of 2 solves" in checks[0].name
    assert newton.newton_checks([]) == []
