"""What carries a boundary: a translation and a rotation, the force and the moment that it applies.

A carrier has three unknowns of its own, at the end of the first rank's, and three equations that
say which of its force and its place is prescribed (`Control`). `RigidFrame` moves the boundary as
one body, `EvenLoad` leaves it free to deform.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from calfsocket.mechanics.bodies import Body
from calfsocket.mechanics.condensation import CondensedTangent
from calfsocket.meshes.distributed import SectionMesh

FloatArray = NDArray[np.float64]

COMPONENTS = 3
"""Unknowns of a carrier, and components of its place: translation along x and y (mm), rotation
(rad)."""

QUARTER = np.array([[0.0, -1.0], [1.0, 0.0]])
"""Turn by 90 degrees, counter-clockwise."""

NEUTRAL = 1e-7
"""Stiffness of a carrier against its stiffest motion that counts as none: a socket that slips all
around has none against turning, of either sign by rounding."""


@dataclass(frozen=True)
class Control:
    """What is prescribed of a carrier: of_force s (G - force) + of_place (p - place)/s = 0.

    G are its force and moment, p its translation and rotation, and s = (1, 1, 1/r) with the
    carrier's radius r makes them N/mm and mm throughout.

    Attributes
    ----------
    of_force, of_place : (3, 3) float
        A row an equation.
    force : (3,) float
        Force along x and y (N/mm), moment (N mm/mm).
    place : (3,) float
        Translation along x and y (mm), rotation (rad).
    """

    of_force: FloatArray
    of_place: FloatArray
    force: FloatArray
    place: FloatArray

    @classmethod
    def of(
        cls, held: Sequence[bool] | NDArray[np.bool_], force: FloatArray, place: FloatArray
    ) -> "Control":
        """Prescribe the place of the components that are held, and the force of the others."""
        is_held = np.asarray(held, dtype=float)
        return cls(np.diag(1.0 - is_held), np.diag(is_held), force, place)

    @classmethod
    def along(
        cls,
        held: Sequence[bool] | NDArray[np.bool_],
        force: FloatArray,
        place: FloatArray,
        direction: FloatArray,
    ) -> "Control":
        """Prescribe the way along a direction of the forces, whose size along it is unknown.

        Parameters
        ----------
        held, force, place
            As of `of`; of the place of components that are not held its part along the direction
            counts.
        direction : (3,) float
            Of the forces as the equations have them, s G; 0 where the place is held.
        """
        free = np.flatnonzero(~np.asarray(held, dtype=bool))
        unit = direction[free] / np.linalg.norm(direction[free])
        # The first row of the orthogonal matrix is the direction, the others are across it.
        rows = np.linalg.qr(np.column_stack([unit, np.eye(len(free))]))[0].T
        of_force, of_place = np.zeros((2, COMPONENTS, COMPONENTS))
        is_held = np.flatnonzero(held)
        of_place[is_held, is_held] = 1.0
        of_place[free[0], free] = unit
        of_force[np.ix_(free[1:], free)] = rows[1:]
        return cls(of_force, of_place, force, place)


FREE = Control.of((False,) * COMPONENTS, np.zeros(COMPONENTS), np.zeros(COMPONENTS))
"""Without force: the carrier goes where the boundary does."""


class Carrier(ABC):
    """Carries the nodes of a boundary, from where they are when it is made (collective).

    Parameters
    ----------
    V : fem.FunctionSpace
        Space of `forms.element.section_element`.
    section : SectionMesh
        The bodies.
    boundary : str
        Name of the boundary that it carries.
    unknowns : (n,) float
        Local unknowns of V, ghosts included, of the state in which it takes over.

    Attributes
    ----------
    comm : MPI.Intracomm
        Of the mesh.
    dofs : (n, 2) int
        Displacement unknowns of the boundary, ghosts included.
    own, is_own : (m, 2) int, (n,) bool
        Those that this rank owns, and which they are.
    constrained : (k,) int
        Local unknowns, ghosts included, that the linear system leaves to the carrier.
    radius : float
        Root mean square of the nodes' distance from the middle, mm.
    place : (3,) float
        Translation (mm) and rotation (rad) since then, the same on every rank.
    control : Control
        What is prescribed.
    """

    constrained: NDArray[Any]
    radius: float

    def __init__(
        self, V: fem.FunctionSpace, section: SectionMesh, boundary: str, unknowns: FloatArray
    ) -> None:
        self.comm: MPI.Comm = V.mesh.comm
        facets = section.facet_tags.find(section.boundaries[boundary])
        body = Body.of(V, section, list(section.regions))
        there = fem.locate_dofs_topological(V.sub(0).sub(0), 1, facets)
        on = np.isin(body.dofs[:, 0], there)
        self.dofs, self._reference = body.dofs[on], body.reference[on]
        self.is_own = self.dofs[:, 0] < V.dofmap.index_map.size_local
        self.own = self.dofs[self.is_own]
        self._start = self._reference + unknowns[self.dofs]
        self.place: FloatArray = np.zeros(COMPONENTS)
        self.control = FREE

    @property
    def scale(self) -> FloatArray:
        """s, which makes its force N/mm throughout."""
        return np.array([1.0, 1.0, 1.0 / self.radius])

    @property
    def extra(self) -> int:
        """Unknowns of this rank that are the carrier's."""
        return COMPONENTS if self.comm.rank == 0 else 0

    def of_all(self, owned: FloatArray) -> FloatArray:
        """Return on every rank the last three values of the first one's (collective)."""
        mine = owned[-COMPONENTS:].copy() if self.extra else None
        return np.asarray(self.comm.bcast(mine, root=0))

    def equations(self, force: FloatArray) -> FloatArray:
        """Return by how much the control is missed, N/mm or mm; (3,)."""
        control = self.control
        return np.asarray(
            control.of_force @ (self.scale * (force - control.force))
            + control.of_place @ ((self.place - control.place) / self.scale)
        )

    def change(self, force: FloatArray, place: FloatArray) -> FloatArray:
        """Return the change of `equations` by one of force and of place; (3,) or (3, n)."""
        return np.asarray(
            self.control.of_force @ (self.scale * force.T).T
            + self.control.of_place @ (place.T / self.scale).T
        )

    @abstractmethod
    def take(self, x: PETSc.Vec) -> None:
        """Take what a vector of unknowns has (collective)."""

    @abstractmethod
    def force(self, residual: FloatArray) -> FloatArray:
        """Force (N/mm) and moment (N mm/mm), of a residual of the bodies; (3,) (collective)."""

    @abstractmethod
    def motion(self, change: PETSc.Vec) -> FloatArray:
        """Return the change of its place by one of the unknowns; (3,) (collective)."""

    @abstractmethod
    def add_to(self, values: FloatArray, x: FloatArray, residual: FloatArray) -> None:
        """Write the carrier's rows of a problem's residual (collective).

        Parameters
        ----------
        values : (n,) float
            The problem's residual; rows of this rank.
        x : (n,) float
            Unknowns of this rank.
        residual : (m,) float
            Residual of the bodies, N/mm; the forces that hold the nodes.
        """

    @abstractmethod
    def tangent(self, V: fem.FunctionSpace, **parts: Any) -> "CarriedTangent":
        """Return a tangent with its border; `parts` as of `CondensedTangent`."""


class CarriedTangent(CondensedTangent):
    """A condensed tangent with the border of a carrier; further parameters as of that."""

    def __init__(self, carrier: Carrier, V: fem.FunctionSpace, **parts: Any) -> None:
        super().__init__(V, **parts, prescribed=True)
        index_map = V.dofmap.index_map
        self._carrier_comm = carrier.comm
        self._size = index_map.size_local
        self._inner = PETSc.Vec().createMPI(
            (index_map.size_local, index_map.size_global), comm=V.mesh.comm
        )
        self._product, self._solution = self._inner.duplicate(), self._inner.duplicate()

    def assemble_border(self, residual: FloatArray) -> None:
        """Take the border at the residual's place, after `assemble`; owned values (collective)."""
        raise NotImplementedError

    def negative_of_carrier(self) -> int:
        """Count the negative modes that are the carrier's, after `assemble_border` (collective).

        Those of the whole are they and those of the linear system (Haynsworth 1968): of all motions
        of which the control prescribes no place.
        """
        raise NotImplementedError

    def _times(self, at: NDArray[Any], values: FloatArray) -> FloatArray:
        """Return K v, v with values at constrained unknowns of this rank (collective)."""
        self._inner.set(0.0)
        self._inner.array[at] = values
        return self.columns(self._inner, self._product)

    def _multiplied(self, values: FloatArray) -> FloatArray:
        """Return the rows of K v that are not constrained, of owned values (collective)."""
        self._inner.array[:] = values
        CondensedTangent.mult(self, None, self._inner, self._product)
        return np.array(self._product.array_r)

    def _solved(self, pc: PETSc.PC | None, right: FloatArray) -> FloatArray:
        """Solve with K, constrained unknowns as in `right`, of owned values (collective)."""
        self._inner.array[:] = right
        CondensedTangent.apply(self, pc, self._inner, self._solution)
        return np.array(self._solution.array_r)

    def _sum(self, values: FloatArray) -> FloatArray:
        return np.asarray(self._carrier_comm.allreduce(values))
