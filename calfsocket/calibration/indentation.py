"""The indentation test: a plate pressed into a specimen, and its force over its displacement."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from calfsocket.calibration.specimen import Specimen
from calfsocket.contact.nitsche import ContactParameters
from calfsocket.io.errors import SolveError
from calfsocket.materials.laws import Law
from calfsocket.mechanics.prescribed_motion import Drive, DrivenModel
from calfsocket.meshes import tags

FloatArray = NDArray[np.float64]

SMALLEST_SHARE = 1 / 32
"""Part of a way between two points of the curve below which halving it is given up."""


@dataclass(frozen=True)
class Curve:
    """Force over displacement of the plate, and how it was found.

    Attributes
    ----------
    displacement : (n,)
        Way of the plate, mm.
    force : (n,)
        Force with which it presses, N per mm of limb length.
    varied_force : (m, n)
        Force with each of m neighbouring laws, N/mm.
    negative_modes : (n,)
        Negative modes of each equilibrium; not 0 where it is unstable.
    newton_iterations, cutbacks : int
        Over the whole curve.
    """

    displacement: FloatArray
    force: FloatArray
    varied_force: FloatArray
    negative_modes: NDArray[np.int64]
    newton_iterations: int
    cutbacks: int


class _Variation:
    """The path of neighbouring laws beside that of the laws at hand.

    Attributes
    ----------
    laws : mapping of region name to law
        As for `Model.set_laws`.
    arc : (n,), optional
        Its own `ContactInterface.converged_arc`; the common one before the first step.
    force : float
        At the present displacement, N/mm.
    """

    def __init__(self, laws: Mapping[str, Law]) -> None:
        self.laws = laws
        self.arc: FloatArray | None = None
        self.force = 0.0


class Indentation:
    """A specimen with its laws, ready to be pressed again and again.

    Parameters
    ----------
    specimen : Specimen
        Tissues and plate.
    laws : mapping of tissue name to law
        "socket" is the plate's.
    contact : ContactParameters
        Friction and Nitsche stiffness.

    Attributes
    ----------
    model : DrivenModel
        In the state of the last point.
    """

    def __init__(
        self, specimen: Specimen, laws: Mapping[str, Law], contact: ContactParameters
    ) -> None:
        self.specimen = specimen
        self.model = DrivenModel(
            specimen.section, self._by_region(laws), contact, socket_support="outer-fixed"
        )
        self.model.contact.load = 1.0  # there is no overclosure that could be released
        self._drive = Drive(self.model)
        self._cutbacks = 0
        self._force_now = 0.0
        self._variations: list[_Variation] = []
        self._states: dict[float, PETSc.Vec] = {}

    def set_laws(self, laws: Mapping[str, Law]) -> None:
        """Give tissues other parameters of the laws that they have."""
        self.model.set_laws(self._by_region(laws))

    def curve(
        self,
        displacements: FloatArray,
        count_modes: bool = False,
        variations: Sequence[Mapping[str, Law]] = (),
    ) -> Curve:
        """Press from the unloaded state to these displacements, mm, one after the other.

        Newton's method starts from the state that other laws had at the same displacement, if
        there is one. What counts for friction is the path of these laws alone, so that a curve
        depends on earlier ones only within the solver's tolerance.

        Parameters
        ----------
        displacements : (n,)
            Increasing, > 0.
        count_modes : bool
            Whether to count negative modes; -1 stands for those not counted.
        variations : sequence of mappings of tissue name to law
            Laws close to those at hand. Their equilibria come from one Newton step each, with the
            factorised tangent of these laws: exact to second order in what is varied, friction's
            path included.

        Raises
        ------
        SolveError
            Where there is no equilibrium on the way.
        """
        self._release()
        self._variations = [_Variation(self._by_region(laws)) for laws in variations]
        force, varied, modes = [], [], []
        reached = 0.0
        for displacement in map(float, displacements):
            way = displacement - reached
            guess = self._states.get(displacement)
            if guess is None or not self._try(way, guess):
                self._press(way, smallest=SMALLEST_SHARE * way)
            reached = displacement
            force.append(self._force_now)
            varied.append([variation.force for variation in self._variations])
            modes.append(self._drive.solver.negative_modes() if count_modes else -1)
            self._states[displacement] = self._drive.solver.x.copy()
        return Curve(
            displacements,
            np.array(force),
            np.array(varied).T,
            np.array(modes),
            newton_iterations=sum(result.iterations for result in self._drive.results),
            cutbacks=self._cutbacks,
        )

    def _by_region(self, laws: Mapping[str, Law]) -> dict[str, Law]:
        return {region: laws[tissue] for region, tissue in self.specimen.tissues.items()}

    def _release(self) -> None:
        self._drive.solver.x.set(0.0)
        self._drive.results.clear()
        self._cutbacks = 0

    def _press(self, way: float, smallest: float) -> None:
        """Move the plate on; where Newton's method fails, by half of the way twice."""
        if self._try(way):
            return
        self._cutbacks += 1
        if 0.5 * way < smallest:
            raise SolveError(
                f"{self.specimen.name}: no equilibrium within {way:.3g} mm of the plate's way"
            )
        for _ in range(2):
            self._press(0.5 * way, smallest)

    def _try(self, way: float, guess: PETSc.Vec | None = None) -> bool:
        """Move the plate on and tell whether there is an equilibrium; if not, all is as before."""
        drive, model = self._drive, self.model
        x = drive.solver.x
        before = x.copy()
        model.set_unknowns(x)
        model.contact.accept()
        dx, dy = self.specimen.direction
        drive.move([tags.SOCKET], shift=(way * dx, way * dy))
        if guess is not None:
            guess.copy(x)
        try:
            drive.solve()
        except SolveError:
            before.copy(x)
            return False
        self._force_now = self._force()
        self._vary()
        return True

    def _vary(self) -> None:
        """Take the variations to the present displacement."""
        if not self._variations:
            return
        solver, model = self._drive.solver, self.model
        laws, arc = model.region_laws, model.contact.converged_arc
        solver.factorise()
        residual = solver.x.duplicate()
        for variation in self._variations:
            model.set_laws(variation.laws)
            if variation.arc is not None:
                model.contact.converged_arc = variation.arc
            model.residual(solver.x, residual)
            varied = solver.x - solver.correction(residual)
            model.residual(varied, residual)
            variation.force = self._force()
            variation.arc = model.contact.settled_arc()
            model.contact.converged_arc = arc
        model.set_laws(laws)
        model.set_unknowns(solver.x)

    def _force(self) -> float:
        """Force of the plate at the last residual, N/mm."""
        reaction, _ = self.model.reaction(tags.SOCKET_OUTER)
        return float(reaction @ self.specimen.direction)
