"""The indentation test: a plate pressed into a specimen, and its force over its displacement."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from calfsocket.calibration.specimen import Specimen
from calfsocket.contact.parameters import Contact
from calfsocket.io.errors import ConvergenceError, SolveError
from calfsocket.materials.laws import Law
from calfsocket.mechanics.limb_problem import limb_problem
from calfsocket.mechanics.prescribed_motion import PrescribedMotion
from calfsocket.mechanics.stepping import LoadStep, LoadSteps
from calfsocket.meshes import tags

FloatArray = NDArray[np.float64]

STEPS = LoadSteps(first=1.0, largest=1.0, smallest=1 / 32, cutback=0.5)
"""Steps between two points of the curve: one, or by halves where Newton's method fails."""


@dataclass(frozen=True)
class Curve:
    """Force over displacement of the plate, and how it was found."""

    displacement: FloatArray  #: way of the plate, mm, (n,)
    force: FloatArray  #: with which it presses, N per mm of limb length, (n,)
    varied_force: FloatArray  #: with each of m neighbouring laws, N/mm, (m, n)
    negative_modes: NDArray[np.int64]  #: of each equilibrium, (n,); not 0 where it is unstable
    newton_iterations: int  #: over the whole curve
    cutbacks: int


@dataclass
class _Variation:
    """The path of neighbouring laws beside that of the laws at hand."""

    laws: Mapping[str, Law]  #: by region
    arc: FloatArray | None = None  #: its own `Problem.slip_history`, (n,), from the first step on
    force: float = 0.0  #: at the present displacement, N/mm


class Indentation:
    """A specimen with laws by tissue, "socket" the plate's, to be pressed again and again.

    `problem` is in the state of the last point.
    """

    def __init__(self, specimen: Specimen, laws: Mapping[str, Law], contact: Contact) -> None:
        self.specimen = specimen
        self.problem = limb_problem(
            specimen.section, self._by_region(laws), contact, support="outer-fixed"
        )
        self._motion = PrescribedMotion(self.problem, STEPS, on_step=self._on_step)
        self._cutbacks = 0
        self._force_now = 0.0
        self._variations: list[_Variation] = []
        self._states: dict[float, PETSc.Vec] = {}

    def set_laws(self, laws: Mapping[str, Law]) -> None:
        """Replace the parameters of the laws that tissues have."""
        self.problem.set_laws(self._by_region(laws))

    def curve(
        self,
        displacements: FloatArray,
        count_modes: bool = False,
        variations: Sequence[Mapping[str, Law]] = (),
    ) -> Curve:
        """Press from the unloaded state to these displacements, mm, increasing, > 0.

        Newton's method starts from the state that other laws had at the same displacement, if
        there is one. What counts for friction is the path of these laws alone, so that a curve
        depends on earlier ones only within the solver's tolerance.

        Negative modes that are not counted are -1. Equilibria of `variations`, laws by tissue close
        to those at hand, come from one Newton step each, with the factorised tangent of these laws:
        exact to second order in what is varied, friction's path included.

        Raises
        ------
        SolveError
            Where there is no equilibrium on the way.
        """
        self._motion.x.set(0.0)
        self._motion.stepper.steps.clear()
        self._cutbacks = 0
        self._variations = [_Variation(self._by_region(laws)) for laws in variations]
        force, varied, modes = [], [], []
        reached = 0.0
        for displacement in map(float, displacements):
            self._press(displacement - reached, self._states.get(displacement))
            reached = displacement
            force.append(self._force_now)
            varied.append([variation.force for variation in self._variations])
            modes.append(self._motion.stepper.newton.negative_modes() if count_modes else -1)
            self._states[displacement] = self._motion.x.copy()
        return Curve(
            displacements,
            np.array(force),
            np.array(varied).T,
            np.array(modes),
            newton_iterations=self._motion.iterations,
            cutbacks=self._cutbacks,
        )

    def _by_region(self, laws: Mapping[str, Law]) -> dict[str, Law]:
        return {region: laws[tissue] for region, tissue in self.specimen.tissues.items()}

    def _press(self, way: float, start: PETSc.Vec | None) -> None:
        """Move the plate on, where there is a start from it, or else from the present state."""
        dx, dy = self.specimen.direction
        move = [tags.SOCKET], 0.0, (way * dx, way * dy)
        if start is not None:
            with suppress(ConvergenceError):
                self._motion.step(*move, start)
                return
        stepper = self._motion.stepper
        before = len(stepper.steps)
        try:
            self._motion.step(*move)
        except ConvergenceError:
            taken = stepper.steps[before:]
            reached = max((step.load for step in taken if step.newton.converged), default=0.0)
            tried = (taken[-1].load - reached) * way
            raise SolveError(
                f"{self.specimen.name}: no equilibrium within {tried:.3g} mm of the plate's travel"
            ) from None
        self._cutbacks += sum(not step.newton.converged for step in stepper.steps[before:])

    def _on_step(self, step: LoadStep) -> None:
        if step.newton.converged:
            self._force_now = self._force()
            self._vary()

    def _vary(self) -> None:
        """Take the variations to the present displacement."""
        if not self._variations:
            return
        newton, problem = self._motion.stepper.newton, self.problem
        laws, arc = problem.region_laws, problem.slip_history
        newton.factorise()
        residual = newton.x.duplicate()
        for variation in self._variations:
            problem.set_laws(variation.laws)
            if variation.arc is not None:
                problem.slip_history = variation.arc
            problem.residual(newton.x, residual)
            varied = newton.x - newton.correction(residual)
            problem.residual(varied, residual)
            variation.force = self._force()
            variation.arc = problem.contact.settled_arc()
            problem.slip_history = arc
        problem.set_laws(laws)
        problem.set_unknowns(newton.x)

    def _force(self) -> float:
        """Force of the plate at the last residual, N/mm."""
        reaction, _ = self.problem.reaction(tags.SOCKET_OUTER)
        return float(reaction @ self.specimen.direction)
