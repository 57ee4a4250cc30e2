r"""How Newton's method converges: in every solve of a subject, and at a solution.

With the exact tangent |F| after an iteration is C |F|^2 before it, close to the solution. Three
things hide that in a run of a few iterations: far from the solution other terms count; below some
1e-9 N/mm, the program's tolerance, rounding does; and a contact point that opens, closes, sticks,
slips, or passes to the next edge of the socket has another residual, with a kink in between. And a
step that would increase |F| is cut by the line search. So what is looked at in every solve is how
far its last iteration goes, and in its last two iterations which ones are whole steps without such
a change, and what C is. The order itself is measured at a solution: |F| after one
iteration from points closer and closer to it.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from calfsocket.contact.friction import STATUS_NAMES
from calfsocket.io.petsc_options import DEFAULT_OPTIONS
from calfsocket.mechanics.newton import Newton, System
from calfsocket.mechanics.problem import Problem
from calfsocket.verification.report import Check

FloatArray = NDArray[np.float64]

TOLERANCE = float(DEFAULT_OPTIONS["snes_atol"])
"""N/mm."""

LAST_ITERATIONS = 2

LEAST_CONTRACTION = 1e-2
"""Of a last iteration; where C is 100 mm/N it is reached from 1e-4 N/mm."""

PROBES = tuple(1e-2 * 0.5**k for k in range(7))
"""|F| from which the order at a solution is measured, N/mm."""


@dataclass
class Solve:
    """One Newton solve, iterate by iterate."""

    norms: list[float] = field(default_factory=list)  #: residual norms, N/mm
    #: status and socket edge of the skin points in one number (`contact_numbers`)
    contact: list[NDArray[np.int64]] = field(default_factory=list)
    #: residuals computed so far; a whole step takes one
    evaluations: list[int] = field(default_factory=list)

    @property
    def converged(self) -> bool:
        """Whether the last residual is below the tolerance."""
        return self.norms[-1] < TOLERANCE

    def changes(self) -> NDArray[np.int64]:
        """Count the contact points whose status or edge changes in each iteration."""
        return np.array(
            [np.count_nonzero(a != b) for a, b in pairwise(self.contact)], dtype=np.int64
        )

    def cuts(self) -> NDArray[np.bool_]:
        """Mark the iterations in which the line search cut the step."""
        return np.diff(self.evaluations) > 1


@contextmanager
def recording() -> Iterator[list[Solve]]:
    """Record every Newton solve of the body, of whatever problem, on one rank."""
    solves: list[Solve] = []

    def note(newton: Newton, snes: PETSc.SNES, iteration: int, norm: float) -> None:
        if iteration == 0:
            solves.append(Solve())
        solves[-1].norms.append(norm)
        solves[-1].contact.append(contact_numbers(newton.problem))
        solves[-1].evaluations.append(snes.getFunctionEvaluations())

    Newton.observers.append(note)
    try:
        yield solves
    finally:
        Newton.observers.remove(note)


@dataclass(frozen=True)
class Iterations:
    """The last two iterations of many solves."""

    #: (n,) residual norms, N/mm
    before: FloatArray
    after: FloatArray
    changes: NDArray[np.int64]  #: (n,) contact points that change their status or edge
    cut: NDArray[np.bool_]  #: (n,) whose step the line search cut
    last: NDArray[np.bool_]  #: (n,) which are the last of their solve

    @classmethod
    def of(cls, solves: list[Solve]) -> "Iterations":
        """Take them from converged solves; ones that begin at their solution have none."""
        rows = []
        for solve in solves:
            n = len(solve.norms) - 1
            changes, cuts = solve.changes(), solve.cuts()
            if solve.converged:
                rows += [
                    (solve.norms[k], solve.norms[k + 1], changes[k], cuts[k], k == n - 1)
                    for k in range(max(0, n - LAST_ITERATIONS), n)
                ]
        before, after, changed, cut, last = np.array(rows, dtype=float).reshape(-1, 5).T
        return cls(before, after, changed.astype(np.int64), cut.astype(bool), last.astype(bool))

    @property
    def smooth(self) -> NDArray[np.bool_]:
        """Which show Newton's method alone: whole steps, contact the same, above the tolerance."""
        return (self.after > TOLERANCE) & (self.changes == 0) & ~self.cut

    @property
    def factor(self) -> FloatArray:
        """C = |F| after over |F|^2 before of the smooth ones, mm/N."""
        return self.after[self.smooth] / self.before[self.smooth] ** 2

    @property
    def last_contraction(self) -> float:
        """Largest |F| after over before of a last iteration that rounding lets go far enough."""
        far = self.last & (self.before > TOLERANCE / LEAST_CONTRACTION)
        return float((self.after[far] / self.before[far]).max(initial=0.0))


def newton_checks(solves: list[Solve]) -> list[Check]:
    """Judge all solves of a subject; nothing where there are none."""
    if not solves:
        return []
    converged = sum(solve.converged for solve in solves)
    return [
        Check(
            f"Newton, {converged} of {len(solves)} solves converge: |F| after the last iteration "
            "over before, worst",
            Iterations.of(solves).last_contraction,
            LEAST_CONTRACTION,
            "quadratic convergence",
        )
    ]


@dataclass(frozen=True)
class Probe:
    """One Newton iteration each from several distances of a solution."""

    #: (n,) |F| before and after it, N/mm; only where statuses and edges of contact are those of the
    #: solution, and |F| after is above the tolerance
    before: FloatArray
    after: FloatArray

    @property
    def order(self) -> float:
        """Slope of log |F| after over log |F| before; NaN with fewer than two."""
        if len(self.before) < 2:
            return np.nan
        return float(np.polyfit(np.log(self.before), np.log(self.after), 1)[0])


def probe_at(problem: System, x: PETSc.Vec, direction: FloatArray) -> Probe:
    """Take one Newton iteration from each of a few points closer and closer to a solution.

    Parameters
    ----------
    problem
        Residual and tangent.
    x : Vec
        The solution; unchanged.
    direction : (n,)
        Away from it, zero at constrained unknowns. It is scaled so that |F| starts near `PROBES`.
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
    return Probe(*np.array(pairs).reshape(-1, 2).T)


def contact_numbers(problem: Any) -> NDArray[np.int64]:
    """Edge and status of each skin point at the last residual; empty where there is no contact."""
    if not (isinstance(problem, Problem) and problem.has_contact):
        return np.zeros(0, dtype=np.int64)
    state = problem.contact.state()
    return len(STATUS_NAMES) * state.projection.edge + state.traction.status
