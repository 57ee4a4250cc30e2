"""How Newton's method converges: in every solve, and at a solution (theory: pages/tangent.md)."""

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from petsc4py import PETSc

from calfsocket.contact.friction import STATUS_NAMES
from calfsocket.io.petsc_options import DEFAULT_OPTIONS
from calfsocket.mechanics.newton import Newton, System
from calfsocket.mechanics.problem import Problem
from calfsocket.verification.report import Check

TOLERANCE = float(DEFAULT_OPTIONS["snes_atol"])
"""N/mm."""

LAST_ITERATIONS = 2

LEAST_CONTRACTION = 1e-2
"""Of a last iteration; where C is 100 mm/N it is reached from 1e-4 N/mm."""

PROBES = tuple(1e-2 * 0.5**k for k in range(7))
"""|F| from which the order at a solution is measured, N/mm."""


class Iterate(NamedTuple):
    """Newton's method before an iteration, and at its end."""

    norm: float  #: of the residual, N/mm
    contact: NDArray[np.int64]  #: `contact_numbers` of the skin points
    evaluations: int  #: residuals computed so far; a whole step takes one


Solve = list[Iterate]
"""One Newton solve."""


@contextmanager
def recording() -> Iterator[list[Solve]]:
    """Record every Newton solve of the body, of whatever problem, on one rank."""
    solves: list[Solve] = []

    def note(newton: Newton, snes: PETSc.SNES, iteration: int, norm: float) -> None:
        if iteration == 0:
            solves.append([])
        contact = contact_numbers(newton.problem)
        solves[-1].append(Iterate(norm, contact, snes.getFunctionEvaluations()))

    Newton.observers.append(note)
    try:
        yield solves
    finally:
        Newton.observers.remove(note)


def converged(solve: Solve) -> bool:
    """Whether the last residual is below the tolerance."""
    return solve[-1].norm < TOLERANCE


def last_iterations(solves: list[Solve]) -> pd.DataFrame:
    """Tabulate the last two iterations of converged solves; none where one begins at its solution.

    Columns are the number of the solve; |F| before and after, N/mm; how many contact points change
    their status or edge; whether the line search cut the step; whether it is the last of its solve;
    and whether it is smooth, that is, shows Newton's method alone: a whole step, contact the same,
    |F| above the tolerance.
    """
    types = {
        "solve": int,
        "before": float,
        "after": float,
        "changes": int,
        "cut": bool,
        "last": bool,
    }
    rows = [
        (
            number,
            before.norm,
            after.norm,
            np.count_nonzero(before.contact != after.contact),
            after.evaluations - before.evaluations > 1,
            after is solve[-1],
        )
        for number, solve in enumerate(solves)
        if converged(solve)
        for before, after in list(pairwise(solve))[-LAST_ITERATIONS:]
    ]
    found = pd.DataFrame(rows, columns=list(types)).astype(types)
    smooth = (found.after > TOLERANCE) & (found.changes == 0) & ~found.cut
    return found.assign(smooth=smooth)


def largest_factor(found: pd.DataFrame) -> float:
    """Largest C = |F| after over |F|^2 before of the smooth iterations, mm/N."""
    smooth = found[found.smooth]
    return float((smooth.after / smooth.before**2).max()) if len(smooth) else 0.0


def last_contraction(found: pd.DataFrame) -> float:
    """Largest |F| after over before of a last iteration that rounding lets go far enough."""
    far = found[found["last"] & (found.before > TOLERANCE / LEAST_CONTRACTION)]
    return float((far.after / far.before).max()) if len(far) else 0.0


def newton_checks(solves: list[Solve]) -> list[Check]:
    """Judge all solves of a subject; nothing where there are none."""
    if not solves:
        return []
    name = (
        f"Newton, {sum(map(converged, solves))} of {len(solves)} solves converge: |F| after the "
        "last iteration over before, worst"
    )
    worst = last_contraction(last_iterations(solves))
    return [Check(name, worst, LEAST_CONTRACTION, "quadratic convergence")]


def probe_at(problem: System, x: PETSc.Vec, direction: NDArray[np.float64]) -> pd.DataFrame:
    """Take one Newton iteration from each of a few points closer and closer to a solution.

    They lie from the solution x, which stays, along a direction that is zero at constrained
    unknowns, where |F| is near `PROBES`. Columns are |F| before and after, N/mm: where statuses and
    edges of contact are those of the solution, and |F| after is above the tolerance.
    """
    newton = Newton(problem)
    f, start = x.duplicate(), newton.x

    def norm_at(size: float) -> float:
        start.array[:] = x.array_r + size * direction
        problem.residual(start, f)
        return float(f.norm())

    norm_at(0.0)
    contact = contact_numbers(problem)
    small = 1e-6 / np.abs(direction).max()
    per_size = norm_at(small) / small
    pairs = []
    for probe in PROBES:
        before = norm_at(probe / per_size)
        same = np.array_equal(contact, contact_numbers(problem))
        newton.iterate()
        problem.residual(start, f)
        after = float(f.norm())
        if same and after > TOLERANCE:
            pairs.append((before, after))
    return pd.DataFrame(pairs, columns=["before", "after"])


def contact_numbers(problem: Any) -> NDArray[np.int64]:
    """Edge and status of each skin point at the last residual; empty where there is no contact."""
    if not (isinstance(problem, Problem) and problem.has_contact):
        return np.zeros(0, dtype=np.int64)
    state = problem.contact.state()
    return len(STATUS_NAMES) * state.projection.edge + state.traction.status
