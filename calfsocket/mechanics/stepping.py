"""Load steps: raise the load of a problem little by little; grow, cut back, extrapolate."""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray
from petsc4py import PETSc

from calfsocket.io.errors import ConvergenceError
from calfsocket.mechanics.diagnosis import explain, last_iterate, observe
from calfsocket.mechanics.load_steps import LoadSteps
from calfsocket.mechanics.newton import Newton, NewtonResult, without_hold
from calfsocket.mechanics.problem import Problem

SMOOTH = 0.06
"""Share of a step by which the secant may miss its end where a path is smooth. From 0.07 on, before
the fascia snaps in HS and TC Separate, a start ahead took 3 to 6 iterations more than it saved."""


@dataclass(frozen=True)
class LoadStep:
    """A converged or failed load step.

    Attributes
    ----------
    number : int
        Counts all steps of the run from 1.
    load : float
        Load aimed at.
    newton : NewtonResult
        How Newton's method ended.
    seconds : float
        Wall time.
    """

    number: int
    load: float
    newton: NewtonResult
    seconds: float


@dataclass(frozen=True)
class Milestone:
    """All that a run needs to continue from its last equilibrium as if it had never stopped.

    Attributes
    ----------
    load, load_before : float
        Loads of the last equilibrium and of the one before it.
    next_step : float
        Size that the next step may have.
    unknowns, unknowns_before : PETSc.Vec
        The two equilibria.
    converged_arc : (n,)
        Slip history of the last one: `Problem.slip_history` that it was found with.
    steps : tuple of LoadStep
        Steps so far.
    bend : float
        Share of the last step by which the secant before it missed its end, per load of the two
        steps together: it grows in proportion to that. Infinite where there was no secant.
    """

    load: float
    load_before: float
    next_step: float
    unknowns: PETSc.Vec
    unknowns_before: PETSc.Vec
    converged_arc: NDArray[Any]
    steps: tuple[LoadStep, ...] = ()
    bend: float = math.inf


Advance = Callable[[float, float], None]
"""Changes a problem, and where Newton's method starts, from one load to another; from a load to
itself it restores what belongs to that load."""


class LoadStepper:
    """Bring a problem from load 0 to load 1.

    Parameters
    ----------
    problem : Problem
        At load 0.
    control : LoadSteps or sequence of float
        Step sizes; or the loads themselves, the last of them 1: then the first step that fails ends
        the run.
    on_iteration : callable, optional
        Called with load, iteration and residual norm (N/mm), on every rank.
    on_step : callable, optional
        Called with each `LoadStep`, converged or not, on every rank.
    on_milestone : callable, optional
        Called with each `Milestone` on every rank; its vectors change when the run continues.
    full_steps_first : bool
        As of `Newton`.

    Attributes
    ----------
    newton : Newton
        Newton's method; its `x` holds the last equilibrium.
    steps : list of LoadStep
        Steps so far, failed ones too.
    """

    def __init__(
        self,
        problem: Problem,
        control: LoadSteps | Sequence[float],
        on_iteration: Callable[[float, int, float], None] | None = None,
        on_step: Callable[[LoadStep], None] | None = None,
        on_milestone: Callable[[Milestone], None] | None = None,
        full_steps_first: bool = True,
    ) -> None:
        self.problem = problem
        self.control = control
        self.steps: list[LoadStep] = []
        self._on_iteration = on_iteration
        self._on_step = on_step
        self.on_milestone = on_milestone
        self._target = 0.0
        monitor = without_hold(self._monitor)
        self.newton = Newton(problem, monitor, full_steps_first, problem.active_set)

    def run(self, start: Milestone | None = None, advance: Advance | None = None) -> None:
        """Raise the load to 1 (collective).

        Parameters
        ----------
        start : Milestone, optional
            An equilibrium of the same problem to continue from; the unloaded state without.
        advance : callable, optional
            Takes the problem to another load; sets `Problem.load` unless given.

        Raises
        ------
        ConvergenceError
            When a step fails at the smallest size. The problem then holds the last converged state.
        """
        problem, x = self.problem, self.newton.x
        advance = advance or self._set_load
        begin = start or Milestone(0.0, 0.0, self._first(), x, x, problem.slip_history)
        load, load_before, step = begin.load, begin.load_before, begin.next_step
        bend = begin.bend
        converged, before = begin.unknowns.copy(), begin.unknowns_before.copy()
        converged.copy(x)
        problem.set_unknowns(x)
        advance(load, load)
        problem.slip_history = begin.converged_arc
        self.steps = list(begin.steps)
        found = start is not None  # an equilibrium, whose slip is not accepted yet
        while load < 1.0:
            target = self._next(load, step)
            # Slip counts from the last converged state; accepting it only now leaves a finished run
            # with the tractions that its equilibrium was found with.
            if found:
                problem.accept()
                found = False
            extrapolated = load > 0 and self._extrapolates(bend * (target - load_before))
            if extrapolated:
                ahead = (target - load) / (load - load_before)
                x.axpy(ahead, converged)
                x.axpy(-ahead, before)
            advance(load, target)
            result = self._take(target, extrapolated)
            if result.converged:
                if load > load_before:
                    ahead = (target - load) / (load - load_before)
                    bend = _miss(before, converged, x, ahead) / (target - load_before)
                converged.copy(before)
                x.copy(converged)
                load_before, load, found = load, target, True
                step = self._grown(step, result, extrapolated)
                if self.on_milestone is not None:
                    arc, steps = problem.slip_history, tuple(self.steps)
                    self.on_milestone(
                        Milestone(load, load_before, step, converged, before, arc, steps, bend)
                    )
                continue
            smaller = self._cut_back(target - load)
            iterate = last_iterate(self.newton, problem, converged) if smaller is None else None
            converged.copy(x)
            problem.set_unknowns(x)
            advance(load, load)
            if iterate is not None:
                if load > 0 or start is not None:
                    problem.revert()  # to the history with which this state was found
                equilibrium = observe(self.newton, problem)
                raise ConvergenceError(explain(equilibrium, load, target, result, iterate))
            assert smaller is not None
            step = smaller

    # -- step sizes -----------------------------------------------------------------------------

    def _extrapolates(self, miss: float) -> bool:
        """Whether to start from the secant, if that will miss by such a share of the step."""
        choice = self.control.extrapolate if isinstance(self.control, LoadSteps) else None
        return miss < SMOOTH if choice == "smooth" else bool(choice)

    def _first(self) -> float:
        return self.control.first if isinstance(self.control, LoadSteps) else 1.0

    def _next(self, load: float, step: float) -> float:
        """Return the load that comes next."""
        if not isinstance(self.control, LoadSteps):
            return next(target for target in self.control if target > load)
        # Even steps to the end rather than a tiny last one.
        remaining = math.ceil((1.0 - load) / step - 1e-9)
        return load + (1.0 - load) / remaining if remaining > 1 else 1.0

    def _grown(self, step: float, result: NewtonResult, extrapolated: bool) -> float:
        control = self.control
        if not isinstance(control, LoadSteps):
            return step
        # A start ahead saves the first iteration. Where the path may cease to be smooth, steps are
        # to be as long as without.
        saved = 1 if extrapolated and control.extrapolate == "smooth" else 0
        # Where slip has its ends takes iterations at any length of the step.
        if result.iterations + saved - result.unsettled <= control.few_iterations:
            return min(control.growth * step, control.largest)
        return step

    def _cut_back(self, step: float) -> float | None:
        """Return the step to try after one that failed, or None to give up."""
        if not isinstance(self.control, LoadSteps):
            return None
        smaller = self.control.cutback * step
        return smaller if smaller >= self.control.smallest else None

    # -- one step -------------------------------------------------------------------------------

    def _set_load(self, _before: float, load: float) -> None:
        self.problem.load = load

    def _take(self, target: float, extrapolated: bool) -> NewtonResult:
        start = time.perf_counter()
        self._target = target
        try:
            result = self.newton.solve(extrapolated)
        except PETSc.Error as error:
            # What Python raised in a callback, Ctrl-C among it, arrives wrapped in PETSc's.
            raise error.__cause__ or error from None
        step = LoadStep(len(self.steps) + 1, target, result, time.perf_counter() - start)
        self.steps.append(step)
        if self._on_step is not None:
            self._on_step(step)
        return result

    def _monitor(self, iteration: int, residual: float) -> None:
        if self._on_iteration is not None:
            self._on_iteration(self._target, iteration, residual)


def _miss(before: PETSc.Vec, converged: PETSc.Vec, end: PETSc.Vec, ahead: float) -> float:
    """Share of the last of two steps by which their secant misses its end (collective)."""
    step = end - converged
    missed = step.copy()
    missed.axpy(-ahead, converged)
    missed.axpy(ahead, before)
    return float(missed.norm() / step.norm()) if step.norm() else math.inf
