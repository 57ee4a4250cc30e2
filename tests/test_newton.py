"""Full steps first, and a line search where they fail: on an equation with both in its range."""

import numpy as np
import pytest
from petsc4py import PETSc

from calfsocket.mechanics.newton import Newton

FULL_STEPS_FAIL = 3.0  # Newton's full steps on atan(x) run away from |x| > 1.392


class Arctangent:
    """atan(x) = 0."""

    def create_vector(self):
        return PETSc.Vec().createSeq(1)

    def create_matrix(self):
        return PETSc.Mat().createAIJ((1, 1), csr=([0, 1], [0], [1.0]))

    def residual(self, x, f):
        f.array[:] = np.arctan(x.array_r)

    def tangent(self, x, A):
        with np.errstate(over="ignore"):  # where it runs away
            A.setValue(0, 0, 1.0 / (1.0 + x.array_r[0] ** 2))
        A.assemble()


def solve(start, full_steps_first):
    norms = []
    solver = Newton(Arctangent(), lambda k, norm: norms.append((k, norm)), full_steps_first)
    solver.x.array[:] = start
    result = solver.solve()
    return result, norms, solver.x.array_r[0]


@pytest.mark.parametrize("full_steps_first", [False, True])
def test_it_is_solved_from_far_away(full_steps_first):
    result, norms, x = solve(FULL_STEPS_FAIL, full_steps_first)
    assert result.converged and abs(x) < 1e-9
    # The search begins where the full steps began, and reports its own steps alone.
    assert result.history[0] == pytest.approx(np.arctan(FULL_STEPS_FAIL))
    assert [k for k, _ in norms].count(0) == (2 if full_steps_first else 1)
    assert result.iterations == sum(k > 0 for k, _ in norms)


def test_near_by_one_attempt_is_enough():
    result, norms, _ = solve(1.0, full_steps_first=True)
    assert result.converged
    assert [k for k, _ in norms].count(0) == 1


def test_a_line_search_of_the_users_is_the_only_one():
    options = PETSc.Options()
    options["calfsocket_snes_linesearch_type"] = "basic"
    try:
        result, norms, _ = solve(FULL_STEPS_FAIL, full_steps_first=True)
    finally:
        del options["calfsocket_snes_linesearch_type"]
    assert not result.converged
    assert [k for k, _ in norms].count(0) == 1


class Parabola(Arctangent):
    """slope x + x^2 = 0: Newton's method squares x, or halves it where the slope is 0."""

    def __init__(self, slope):
        self.slope, self.tangents = slope, 0

    def residual(self, x, f):
        f.array[:] = (self.slope + x.array_r) * x.array_r

    def tangent(self, x, A):
        self.tangents += 1
        A.setValue(0, 0, self.slope + 2.0 * x.array_r[0])
        A.assemble()


@pytest.mark.parametrize(
    ("slope", "start", "iterations", "tangents"),
    [
        (1.0, 2e-4, 2, 1),  # from 4e-8, the old tangent leaves 2e-11
        (1.0, 1e-3, 2, 2),  # 1e-6 is too far from the tolerance
        (0.0, 1e-4, 2, 2),  # a residual of 3e-9 that the iteration has not reduced enough
    ],
)
def test_the_last_iteration_has_the_tangent_of_the_one_before(slope, start, iterations, tangents):
    problem = Parabola(slope)
    solver = Newton(problem)
    solver.x.array[:] = start
    result = solver.solve()
    assert result.converged and result.iterations == iterations
    assert problem.tangents == tangents


class StiffParabola(Arctangent):
    """A stiff parabola, N/mm."""

    def residual(self, x, f):
        f.array[:] = 1e8 * (x.array_r**2 - 2.0)

    def tangent(self, x, A):
        A.setValue(0, 0, 2e8 * x.array_r[0])
        A.assemble()


class Constant(Arctangent):
    """5e-9 N/mm everywhere."""

    def residual(self, x, f):
        f.array[:] = 5e-9


def test_what_rounding_leaves_of_a_residual_is_no_failure():
    """The last digit of x changes the residual by 6e-8 N/mm."""
    solver = Newton(StiffParabola(), full_steps_first=True)
    solver.x.array[:] = 1.5
    result = solver.solve()
    assert result.converged and result.iterations <= 6
    assert 1e-9 < result.residual < 1e-7
    assert solver.x.array_r[0] == pytest.approx(np.sqrt(2.0), rel=1e-15)


def test_a_small_residual_that_rounding_does_not_explain_is_a_failure():
    solver = Newton(Constant(), full_steps_first=True)
    solver.searches = False
    solver.x.array[:] = 1.5
    assert not solver.solve().converged
