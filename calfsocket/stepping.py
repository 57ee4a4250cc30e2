"""Load steps: release the overclosure little by little; grow, cut back, predict."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

from calfsocket.errors import SolveError
from calfsocket.model import Model
from calfsocket.solver import NewtonResult, Solver


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
    """

    def __init__(
        self,
        model: Model,
        control: StepControl,
        on_iteration: Callable[[float, int, float], None] | None = None,
        on_step: Callable[[LoadStep], None] | None = None,
    ) -> None:
        self.model = model
        self.control = control
        self.steps: list[LoadStep] = []
        self._on_iteration = on_iteration
        self._on_step = on_step
        self.solver = Solver(model, self._monitor, full_steps_first=True)

    def run(self) -> None:
        """Raise the load to 1 (collective).

        Raises
        ------
        SolveError
            When a step fails at the smallest size. The model then holds the last converged state.
        """
        control, contact, x = self.control, self.model.contact, self.solver.x
        load, accepted, step = 0.0, 0.0, control.first
        converged = x.copy()
        before, load_before = converged.copy(), 0.0
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
        result = self.solver.solve()
        step = LoadStep(len(self.steps) + 1, target, result, time.perf_counter() - start)
        self.steps.append(step)
        if self._on_step is not None:
            self._on_step(step)
        return result

    def _monitor(self, iteration: int, residual: float) -> None:
        if self._on_iteration is not None:
            self._on_iteration(self.model.contact.load, iteration, residual)


def _failure(load: float, target: float, result: NewtonResult, region: str) -> str:
    return (
        f"no equilibrium between load {load:.4f} and {target:.4f}: {result.reason} with residual "
        f"{result.residual:.2g} N/mm, most of it in {region}; try another mesh size, a socket "
        "that presses less there, or -calfsocket_snes_linesearch_type bt"
    )
