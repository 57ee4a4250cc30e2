"""One equilibrium at one load: PETSc SNES with MUMPS, and the inertia of its tangent."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Protocol
from weakref import WeakMethod

import numpy as np
from petsc4py import PETSc

from calfsocket.contact.active_set import ActiveSet
from calfsocket.io.petsc_options import DEFAULT_OPTIONS, OPTIONS_PREFIX, defaults

NEAR = 100.0
"""Times the tolerance: of a larger residual neither rounding is the cause, nor is it certain that
contact does not change any more."""

STALLED = 0.5
"""A residual that is more than this share of the one before, and near the tolerance: rounding may
be what is left of it, since Newton's method squares it there."""

LEFT = 0.1
"""Share of the tolerance that the square of a residual over the one before may be, where the
tangent of the iterate before serves again.

An iteration that leaves r of a residual R has met a tangent that changes by some 2 r/R on its way,
so that with the old one the next iteration leaves 2 r^2/R: it converges as with a new one."""


class System(Protocol):
    """What Newton's method needs of a problem; every method is collective."""

    def create_vector(self) -> PETSc.Vec:
        """Return a vector of unknowns, zero."""

    def create_matrix(self) -> PETSc.Mat:
        """Return a matrix with the tangent's pattern."""

    def residual(self, x: PETSc.Vec, f: PETSc.Vec) -> None:
        """Residual f at x, in N/mm."""

    def tangent(self, x: PETSc.Vec, A: PETSc.Mat) -> None:
        """Compute the derivative A of the residual at x."""

    def stability(self, x: PETSc.Vec, A: PETSc.Mat) -> tuple[PETSc.Mat, int]:
        """Return what decides whether the equilibrium x is stable; A is overwritten.

        Returns
        -------
        matrix : PETSc.Mat
            Its symmetric part counts.
        negative : int
            Negative eigenvalues that it has at a stable equilibrium: of the pressures in it.
        """


@dataclass(frozen=True)
class NewtonResult:
    """How one Newton solve ended.

    Attributes
    ----------
    converged : bool
        Whether the residual came below the tolerance.
    iterations : int
        Newton iterations, those without success before a line search was taken included.
    residual : float
        Euclidean norm of the residual in N/mm.
    reason : str
        PETSc's name for why it stopped.
    history : tuple of float
        Residual norm before each iteration of the last attempt, and at its end, in N/mm.
    unsettled : int
        Of the iterations, those that began with many contact points on another branch than before.
    """

    converged: bool
    iterations: int
    residual: float
    reason: str
    history: tuple[float, ...]
    unsettled: int = 0


class Newton:
    """Newton's method for a `System`.

    Parameters
    ----------
    problem : System
        Residual and tangent.
    monitor : callable, optional
        Called with iteration and residual norm (N/mm) at each iteration, on every rank.
    full_steps_first : bool
        Whether to try without a line search first, and with one again from the same start where
        that does not converge. In small load steps a search only cuts steps for the rows of stiff
        tissues, which the next iteration would mend. A search of the user's choice is the only one.
    active_set : ActiveSet, optional
        Keeps contact points from going to and fro between full steps. A search does without: it
        needs one residual for all lengths of a step.

    Attributes
    ----------
    problem : System
        As given.
    x : PETSc.Vec
        Unknowns: where a solve starts, and its last iterate.
    tangent : PETSc.Mat
        The tangent, at the iterate where it was last computed.
    searches : bool
        Whether a line search follows where full steps do not converge. Where there is no
        equilibrium it goes on in tiny steps, so that whoever has another way does without.
    observers : list of callable
        Called at each iteration of every Newton's method of this process, with itself, PETSc's
        SNES, the iteration and the residual norm (N/mm).
    """

    observers: ClassVar[list[Callable[["Newton", PETSc.SNES, int, float], None]]] = []

    def __init__(
        self,
        problem: System,
        monitor: Callable[[int, float], None] | None = None,
        full_steps_first: bool = False,
        active_set: ActiveSet | None = None,
    ) -> None:
        self.problem = problem
        self._active_set = active_set
        self.searches = True
        self._monitor = monitor
        self._history: list[float] = []
        self.x = problem.create_vector()
        self._f = self.x.duplicate()
        self.tangent = problem.create_matrix()
        self._searching = self._create_snes()
        self._first = self._searching
        if full_steps_first and not PETSc.Options(OPTIONS_PREFIX).hasName("snes_linesearch_type"):
            self._first = self._create_snes(snes_linesearch_type="basic")

    def _create_snes(self, **changed: str) -> PETSc.SNES:
        snes = PETSc.SNES().create(self.x.getComm())
        snes.setOptionsPrefix(OPTIONS_PREFIX)
        snes.setFunction(without_hold(self._residual), self._f)
        snes.setJacobian(without_hold(self._tangent), self.tangent)
        snes.setMonitor(without_hold(self._record))
        with defaults(**changed):
            snes.setFromOptions()
        if self.tangent.getType() == PETSc.Mat.Type.PYTHON:
            # A tangent that knows how to solve; PETSc's options are for its own solver then.
            ksp = snes.getKSP()
            ksp.setType(PETSc.KSP.Type.PREONLY)
            ksp.getPC().setType(PETSc.PC.Type.PYTHON)
            ksp.getPC().setPythonContext(self.tangent.getPythonContext())
        return snes

    def _residual(self, snes: PETSc.SNES, x: PETSc.Vec, f: PETSc.Vec) -> None:
        self.problem.residual(x, f)
        norm, tolerance = f.norm(), snes.getTolerances()[1]
        before = self._history[-1] if self._history else math.inf
        if tolerance < norm < NEAR * tolerance and norm > STALLED * before:
            rounding = self._rounding(x, f)
            if norm <= rounding:
                snes.setTolerances(atol=rounding)
                tolerance = rounding
        if self._active_set is None or not self._active_set.is_iterating:
            return
        if norm <= tolerance and self._active_set.release():
            self.problem.residual(x, f)

    def _tangent(self, snes: PETSc.SNES, x: PETSc.Vec, A: PETSc.Mat, _P: PETSc.Mat) -> None:
        """Compute the tangent, unless that of the iterate before leads to the equilibrium.

        Its factors then serve again, too: in the last iteration of most solves.
        """
        tolerance = snes.getTolerances()[1]
        if len(self._history) > 1:
            before, here = self._history[-2:]
            if here <= NEAR * tolerance and here**2 <= LEFT * tolerance * before:
                return
        self.problem.tangent(x, A)

    def _rounding(self, x: PETSc.Vec, f: PETSc.Vec) -> float:
        """Change of the residual f at x by the last digit of each unknown, N/mm (collective).

        A stiff socket that has moved by tens of millimetres has no smaller one.
        """
        near, changed = x.copy(), f.duplicate()
        signs = 1.0 - 2.0 * (np.arange(near.local_size) % 2)  # neighbours apart from each other
        near.array[:] *= 1.0 + signs * np.finfo(float).eps
        self.problem.residual(near, changed)
        changed.axpy(-1.0, f)
        self.problem.residual(x, f)
        return float(changed.norm())

    def solve(self, ahead: bool = False) -> NewtonResult:
        """Solve from the present `x`, which holds the last iterate afterwards (collective).

        It is the last equilibrium, or `ahead` of it.
        """
        start = self.x.copy()
        if self._active_set is None or self._searching is self._first:
            result = self._attempt(self._first)
        else:
            with self._active_set.iterating(ahead):
                result = self._attempt(self._first)
            result = replace(result, unsettled=self._active_set.unsettled)
            if not result.converged:
                self._active_set.leave()
        if result.converged or self._searching is self._first or not self.searches:
            return result
        start.copy(self.x)
        again = self._attempt(self._searching)
        return replace(again, iterations=result.iterations + again.iterations)

    def _attempt(self, snes: PETSc.SNES) -> NewtonResult:
        self._history = []
        tolerance = snes.getTolerances()[1]
        snes.solve(None, self.x)
        snes.setTolerances(atol=tolerance)
        reason = snes.getConvergedReason()
        return NewtonResult(
            converged=reason > 0,
            iterations=snes.getIterationNumber(),
            residual=self._history[-1] if self._history else math.nan,
            reason=_reason_name(reason),
            history=tuple(self._history),
        )

    def factorise(self) -> None:
        """Factorise the tangent at the present `x`, for `correction` (collective)."""
        self.problem.tangent(self.x, self.tangent)
        ksp = self._searching.getKSP()
        ksp.setOperators(self.tangent)
        ksp.setUp()

    def correction(self, residual: PETSc.Vec) -> PETSc.Vec:
        """Return tangent^-1 residual, with the tangent of `factorise` (collective)."""
        step = residual.duplicate()
        self._searching.getKSP().solve(residual, step)
        return step

    def iterate(self) -> None:
        """Take one full iteration from the present `x`, whatever its residual (collective)."""
        residual = self.x.duplicate()
        self.problem.residual(self.x, residual)
        self.factorise()
        self.x.axpy(-1.0, self.correction(residual))

    def negative_modes(self) -> int:
        """Count the negative modes of the equilibrium at the present `x` (collective).

        The number of negative eigenvalues of (A + A^T)/2, A the tissues' tangent with contact as a
        constraint, by Sylvester's law from MUMPS's LDL^T factorisation, minus one for each pressure
        unknown, which a saddle point owns anyway. Zero means a stable equilibrium.
        """
        negative, factor = self.stability()
        factor.destroy()
        return negative

    def stability(self) -> tuple[int, PETSc.PC]:
        """Return the `negative_modes`, and the factorised matrix they are counted of (collective).

        Its rows are those of the tangent's `CondensedTangent.unknowns`.
        """
        matrix, expected = self.problem.stability(self.x, self.tangent)
        symmetric = matrix.transpose(PETSc.Mat())
        # The pattern is symmetric, so that no third matrix is needed: memory is highest here.
        symmetric.axpy(1.0, matrix, PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        symmetric.scale(0.5)
        symmetric.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        pc = PETSc.PC().create(symmetric.getComm())
        pc.setOperators(symmetric)
        pc.setType(PETSc.PC.Type.CHOLESKY)
        pc.setFactorSolverType("mumps")
        pc.setFactorSetUpSolverType()
        factor = pc.getFactorMatrix()
        # Minimum fill: of one factorisation, PORD's analysis is most of the time.
        factor.setMumpsIcntl(7, 2)
        factor.setMumpsIcntl(24, 1)  # detect null pivots, which inertia needs
        factor.setMumpsIcntl(13, 1)  # no ScaLAPACK on the root: it would hide negative pivots
        factor.setMumpsIcntl(14, int(DEFAULT_OPTIONS["mat_mumps_icntl_14"]))
        pc.setUp()
        return int(factor.getInertia()[0]) - expected, pc

    def _record(self, snes: PETSc.SNES, iteration: int, norm: float) -> None:
        self._history.append(float(norm))
        if self._monitor is not None:
            self._monitor(iteration, float(norm))
        for observe in self.observers:
            observe(self, snes, iteration, float(norm))


def without_hold(method: Callable[..., None]) -> Callable[..., None]:
    """Return a function that calls a method and does not keep its object.

    So a solver that nobody holds any more is freed at once, with its mesh, its factors, and 18 of
    the 2048 communicators that MPICH has: what PETSc calls lies where Python's garbage collector
    does not look in the wheel of dolfinx 0.11, and elsewhere it looks late.
    """
    reference = WeakMethod(method)

    def call(*arguments: Any) -> None:
        if (alive := reference()) is not None:
            alive(*arguments)

    return call


def _reason_name(reason: int) -> str:
    for name, value in vars(PETSc.SNES.ConvergedReason).items():
        if value == reason and name.isupper() and name not in ("ITERATING",):
            return name.lower()
    return str(reason)
