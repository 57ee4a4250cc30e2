"""The assembled tangent: finite differences, parameters, Newton's order."""

import numpy as np
import pytest

from calfsocket.verification.newton import Iterations, probe_at, recording
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


@pytest.mark.parametrize("name", EQUILIBRIA)
def test_newton_is_of_second_order(name):
    probe, status = equilibrium_probe(name)
    assert status == EQUILIBRIA[name][2]
    assert probe.order == pytest.approx(2.0, abs=0.01)


def test_a_tangent_that_is_not_exact_shows():
    """One per cent off: the order is 1 and the difference is seen."""
    model = ring(KINDS["stick"])
    exact = model.tangent

    def scaled(x, A):
        exact(x, A)
        A.scale(1.01)

    model.tangent = scaled
    _, x = state(KINDS["stick"])
    direction = random_direction(model, x)
    assert difference(model, x, direction).error == pytest.approx(0.01, rel=1e-3)
    rest = model.create_vector()
    model.contact.load = 0.0  # no contact pressure: at rest
    assert probe_at(model, rest, direction).order == pytest.approx(1.0, abs=0.01)


def test_recording_tells_iterations_and_changes_of_status():
    with recording() as solves:
        equilibrium_probe("mixed")
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
