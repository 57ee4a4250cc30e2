"""Prescribed motion: bodies of a problem are moved, and what they touch gives way."""

from collections.abc import Callable, Sequence

import numpy as np
from petsc4py import PETSc

from calfsocket.mechanics.newton import NewtonResult
from calfsocket.mechanics.problem import Problem
from calfsocket.mechanics.stepping import LoadStep, LoadStepper, LoadSteps, Milestone

AT_ONCE = (1.0,)
"""Load steps of a motion in one step."""


class PrescribedMotion:
    """Moves bodies of a problem at full load, motion by motion.

    Parameters
    ----------
    problem : Problem
        At its start; its load becomes 1.
    control : LoadSteps or sequence of float
        Steps of a motion, as shares of it.
    on_step : callable, optional
        As of `LoadStepper`.

    Attributes
    ----------
    stepper : LoadStepper
        Its `steps` are those of all motions.
    """

    def __init__(
        self,
        problem: Problem,
        control: LoadSteps | Sequence[float] = AT_ONCE,
        on_step: Callable[[LoadStep], None] | None = None,
    ) -> None:
        self.problem = problem
        problem.load = 1.0
        self.stepper = LoadStepper(problem, control, on_step=on_step, full_steps_first=False)
        self._control = control

    @property
    def x(self) -> PETSc.Vec:
        """Unknowns of the last equilibrium, or where Newton's method starts."""
        return self.stepper.newton.x

    @property
    def iterations(self) -> int:
        """Newton iterations of all motions so far."""
        return sum(step.newton.iterations for step in self.stepper.steps)

    def move(
        self, regions: Sequence[str], angle: float = 0.0, shift: tuple[float, float] = (0.0, 0.0)
    ) -> None:
        """Move regions as they are: turn about the origin by `angle` (rad), then shift (mm).

        Where they are constrained they keep the new place; elsewhere it is where Newton's method
        starts.
        """
        problem, x = self.problem, self.x
        problem.set_unknowns(x)
        w, body = problem.w.x.array, problem.body(regions)
        c, s = np.cos(angle), np.sin(angle)
        rotation = np.array([[c, -s], [s, c]])
        moved = (body.reference + w[body.dofs]) @ rotation.T - body.reference
        w[body.dofs] = moved + body.shift * shift
        problem.prescribed[:] = w
        x.array[:] = w[: len(x.array)]

    def solve(self) -> NewtonResult:
        """Find the equilibrium from the present start; slip counts from where it did (collective).

        Raises
        ------
        ConvergenceError
            If there is none.
        """
        stepper = self.stepper
        steps = tuple(stepper.steps)
        stepper.control = AT_ONCE
        stepper.run(advance=lambda before, after: None)
        stepper.steps = [*steps, *stepper.steps]
        return stepper.steps[-1].newton

    def step(
        self,
        regions: Sequence[str],
        angle: float = 0.0,
        shift: tuple[float, float] = (0.0, 0.0),
        start: PETSc.Vec | None = None,
    ) -> NewtonResult:
        """Count slip from the present state, move and solve (collective).

        Parameters
        ----------
        regions, angle, shift
            As of `move`; each step of the control takes its share.
        start : PETSc.Vec, optional
            Where Newton's method starts, in one step.

        Raises
        ------
        ConvergenceError
            If there is no equilibrium on the way; all is then as after the last one.
        """
        problem, stepper = self.problem, self.stepper

        def advance(before: float, after: float) -> None:
            share = after - before
            if share == 0.0:
                problem.prescribed[:] = problem.w.x.array
                return
            self.move(regions, share * angle, (share * shift[0], share * shift[1]))
            if start is not None:
                start.copy(self.x)

        stepper.control = AT_ONCE if start is not None else self._control
        first = stepper.control.first if isinstance(stepper.control, LoadSteps) else 1.0
        here, steps = self.x, tuple(stepper.steps)
        stepper.run(Milestone(0.0, 0.0, first, here, here, problem.slip_history, steps), advance)
        return stepper.steps[-1].newton
