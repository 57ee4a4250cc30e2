"""Load steps: release the overclosure little by little; grow, cut back, predict."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray
from petsc4py import PETSc

from calfsocket.io.errors import SolveError
from calfsocket.mechanics.newton import NewtonResult, Solver
from calfsocket.mechanics.problem import Model


@dataclass(frozen=True)
class StepControl:
    """How the load grows from 0 to 1.

    Attributes
    ----------
    first : float
        First step of the load.
    largest : float
        Largest step. Long steps may carry a socket on a stiff fascia past the point where the
        fascia buckles, to an unstable equilibrium that Newton's method does not notice.
    smallest : float
        A step that fails at this size ends the run.
    growth : float
        Factor on the step when Newton needed at most `few_iterations`.
    few_iterations : int
        See `growth`.
    cutback : float
        Factor on the step after a failure.
    predict : bool
        Start Newton from the secant through the last two states.
    """

    first: float = 0.1
    largest: float = 0.25
    smallest: float = 1e-3
    growth: float = 1.5
    few_iterations: int = 5
    cutback: float = 0.4
    predict: bool = False


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
    """All that a run needs to go on from its last equilibrium as if it had never stopped.

    Attributes
    ----------
    load, load_before : float
        Loads of the last equilibrium and of the one before it.
    next_step : float
        Size that the next step may have.
    unknowns, unknowns_before : PETSc.Vec
        The two equilibria.
    converged_arc : (n,)
        Slip history of the last one: `ContactInterface.converged_arc` that it was found with.
    steps : tuple of LoadStep
        Steps so far.
    """

    load: float
    load_before: float
    next_step: float
    unknowns: PETSc.Vec
    unknowns_before: PETSc.Vec
    converged_arc: NDArray[Any]
    steps: tuple[LoadStep, ...] = ()


class Stepper:
    """Bring a model from load 0 to load 1.

    Parameters
    ----------
    model : Model
        At load 0.
    control : StepControl
        Step sizes.
    on_iteration : callable, optional
        Called with load, iteration and residual norm (N/mm), on every rank.
    on_step : callable, optional
        Called with each `LoadStep`, converged or not, on every rank.
    on_milestone : callable, optional
        Called with each `Milestone` on every rank; its vectors change when the run goes on.
    """

    def __init__(
        self,
        model: Model,
        control: StepControl,
        on_iteration: Callable[[float, int, float], None] | None = None,
        on_step: Callable[[LoadStep], None] | None = None,
        on_milestone: Callable[[Milestone], None] | None = None,
    ) -> None:
        self.model = model
        self.control = control
        self.steps: list[LoadStep] = []
        self._on_iteration = on_iteration
        self._on_step = on_step
        self._on_milestone = on_milestone
        self.solver = Solver(model, self._monitor, full_steps_first=True)

    def run(self, start: Milestone | None = None) -> None:
        """Raise the load to 1 (collective).

        Parameters
        ----------
        start : Milestone, optional
            Where an earlier run of the same model had come to; load 0 without.

        Raises
        ------
        SolveError
            When a step fails at the smallest size. The model then holds the last converged state.
        """
        control, contact, x = self.control, self.model.contact, self.solver.x
        start = start or Milestone(0.0, 0.0, control.first, x, x, contact.converged_arc)
        load, load_before, step = start.load, start.load_before, start.next_step
        converged, before = start.unknowns.copy(), start.unknowns_before.copy()
        converged.copy(x)
        self.model.set_unknowns(x)
        contact.load, contact.converged_arc = load, start.converged_arc
        self.steps = list(start.steps)
        accepted = 0.0
        while load < 1.0:
            # Even steps to the end rather than a tiny last one.
            remaining = math.ceil((1.0 - load) / step - 1e-9)
            target = load + (1.0 - load) / remaining if remaining > 1 else 1.0
            # Slip counts from the last converged state; accepting it only now leaves a finished run
            # with the tractions that its equilibrium was found with.
            if load > accepted:
                contact.accept()
                accepted = load
            if control.predict and load > 0:
                ahead = (target - load) / (load - load_before)
                x.axpy(ahead, converged)
                x.axpy(-ahead, before)
            result = self._take(target)
            if result.converged:
                converged.copy(before)
                x.copy(converged)
                load_before, load = load, target
                if result.iterations <= control.few_iterations:
                    step = min(control.growth * step, control.largest)
                self._mark(
                    Milestone(
                        load,
                        load_before,
                        step,
                        converged,
                        before,
                        contact.converged_arc,
                        tuple(self.steps),
                    )
                )
                continue
            if not math.isfinite(x.norm()):
                converged.copy(x)
            region = self.model.least_balanced_region(x)
            converged.copy(x)
            self.model.set_unknowns(x)
            contact.load = load
            step = control.cutback * (target - load)
            if step < control.smallest:
                if load > 0:
                    contact.revert()  # to the history with which this state was found
                raise SolveError(_failure(load, target, result, region))

    def _take(self, target: float) -> NewtonResult:
        start = time.perf_counter()
        self.model.contact.load = target
        try:
            result = self.solver.solve()
        except PETSc.Error as error:
            # What Python raised in a callback, Ctrl-C among it, arrives wrapped in PETSc's.
            raise error.__cause__ or error from None
        step = LoadStep(len(self.steps) + 1, target, result, time.perf_counter() - start)
        self.steps.append(step)
        if self._on_step is not None:
            self._on_step(step)
        return result

    def _mark(self, milestone: Milestone) -> None:
        if self._on_milestone is not None:
            self._on_milestone(milestone)

    def _monitor(self, iteration: int, residual: float) -> None:
        if self._on_iteration is not None:
            self._on_iteration(self.model.contact.load, iteration, residual)


def _failure(load: float, target: float, result: NewtonResult, region: str) -> str:
    return (
        f"no equilibrium between load {load:.4f} and {target:.4f}: {result.reason} with residual "
        f"{result.residual:.2g} N/mm, most of it in {region}; try another mesh size, a socket "
        "that presses less there, or -calfsocket_snes_linesearch_type l2"
    )
