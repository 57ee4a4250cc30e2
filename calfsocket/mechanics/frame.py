r"""A rigid frame that carries a boundary: three unknowns more, and the border of the tangent.

The frame takes a boundary over where it is. Its nodes, at X then, move as one body,

    x = c + t + R(theta) (X - c),

c the frame's centre, t its translation and theta its rotation, counter-clockwise and of any size.
With f the forces that hold the nodes, what is applied to the frame is

    F = sum f,      M = sum (x - c - t) x f,

the moment about the centre where it has come to, which does work on theta. Three equations say what
of these six is prescribed (`Control`). With K the tangent of the bodies, whose rows of carried
unknowns are x = c + t + R (X - c) - X, and U = d(c + t + R (X - c))/d(t, theta), Newton's equations

    K dx = r + U dp on the carried unknowns,     A_f (U^T K dx + H dp) + A_p dp = s,

are solved with one factorisation of K for four right-hand sides: r, and the three columns of U.
H = dU^T/dp f. The equations are exact, so that Newton's method stays quadratic.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from calfsocket.mechanics.bodies import Body
from calfsocket.mechanics.condensation import CondensedTangent
from calfsocket.meshes.distributed import SectionMesh

FloatArray = NDArray[np.float64]

COMPONENTS = 3
"""Unknowns of a frame: translation along x and y (mm), rotation (rad)."""

_QUARTER = np.array([[0.0, -1.0], [1.0, 0.0]])


@dataclass(frozen=True)
class Control:
    """What is prescribed of a frame: of_force s (G - force) + of_place (p - place)/s = 0.

    G are its force and moment, p its translation and rotation, and s = (1, 1, 1/r) with the
    frame's radius r makes them N/mm and mm throughout.

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
"""Without force: the frame goes where the boundary does."""


class RigidFrame:
    """Carries the nodes of a boundary, at where they are when it is made (collective).

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
        Carried displacement unknowns, ghosts included.
    own, is_own : (m, 2) int, (n,) bool
        Those that this rank owns, and which they are.
    centre : (2,) float
        Middle of the area that the undeformed boundary encloses, mm.
    radius : float
        Root mean square of the carried nodes' distance from it, mm.
    place : (3,) float
        Translation (mm) and rotation (rad), the same on every rank.
    control : Control
        What is prescribed.
    """

    def __init__(
        self,
        V: fem.FunctionSpace,
        section: SectionMesh,
        boundary: str,
        unknowns: FloatArray,
    ) -> None:
        self.comm: MPI.Comm = V.mesh.comm
        facets = section.facet_tags.find(section.boundaries[boundary])
        body = Body.of(V, section, list(section.regions))
        there = fem.locate_dofs_topological(V.sub(0).sub(0), 1, facets)
        on = np.isin(body.dofs[:, 0], there)
        self.dofs, self._reference = body.dofs[on], body.reference[on]
        self.is_own = self.dofs[:, 0] < V.dofmap.index_map.size_local
        self.own = self.dofs[self.is_own]
        self.centre = _middle(section, boundary)
        self._arm = self._reference + unknowns[self.dofs] - self.centre
        mine = self._arm[self.is_own]
        squares, count = self.comm.allreduce(np.array([np.sum(mine**2), len(mine)]))
        self.radius = float(np.sqrt(squares / count))
        self.scale = np.array([1.0, 1.0, 1.0 / self.radius])
        self.place: FloatArray = np.zeros(COMPONENTS)
        self.control = FREE

    @property
    def _turned(self) -> FloatArray:
        """Arms R (X - c) of all carried nodes, mm; (n, 2)."""
        cos, sin = np.cos(self.place[2]), np.sin(self.place[2])
        return self._arm @ np.array([[cos, sin], [-sin, cos]])

    @property
    def displacement(self) -> FloatArray:
        """Displacement of all carried nodes at the present place, mm; (n, 2)."""
        return self.centre + self.place[:2] + self._turned - self._reference

    @property
    def columns(self) -> FloatArray:
        """U: displacement of the carried nodes by the place; (3, n, 2)."""
        U = np.zeros((COMPONENTS, *self.dofs.shape))
        U[0, :, 0] = U[1, :, 1] = 1.0
        U[2] = self._turned @ _QUARTER.T
        return U

    def force(self, residual: FloatArray) -> FloatArray:
        """Force (N/mm) and moment (N mm/mm) of a residual of the bodies; (3,) (collective)."""
        mine = np.einsum("knc,nc->k", self.columns[:, self.is_own], residual[self.own])
        return np.asarray(self.comm.allreduce(mine))

    def curvature(self, residual: FloatArray) -> float:
        """Return H of rotation, the derivative of U^T f by it at fixed f (collective)."""
        mine = -np.sum(self._turned[self.is_own] * residual[self.own])
        return float(self.comm.allreduce(mine))

    def equations(self, residual: FloatArray) -> FloatArray:
        """Return by how much the control is missed, N/mm or mm; (3,) (collective)."""
        control, force = self.control, self.force(residual)
        return np.asarray(
            control.of_force @ (self.scale * (force - control.force))
            + control.of_place @ ((self.place - control.place) / self.scale)
        )

    # -- unknowns: those of V, and the place at the end of the first rank's -----------------------

    @property
    def extra(self) -> int:
        """Unknowns of this rank that are the frame's."""
        return COMPONENTS if self.comm.rank == 0 else 0

    def add_to(self, values: FloatArray, x: FloatArray, residual: FloatArray) -> None:
        """Write the rows of the frame: its nodes off their places, and `equations` (collective).

        Parameters
        ----------
        values : (n,) float
            The problem's residual; rows of this rank.
        x : (n,) float
            Unknowns of this rank.
        residual : (m,) float
            Residual of the bodies, N/mm; the forces that hold the nodes.
        """
        values[self.own] = x[self.own] - self.displacement[self.is_own]
        missed = self.equations(residual)
        if self.extra:
            values[-COMPONENTS:] = missed

    def take(self, x: PETSc.Vec) -> None:
        """Take the place that a vector of unknowns has (collective)."""
        self.place = self.of_all(x.array_r)

    def of_all(self, owned: FloatArray) -> FloatArray:
        """Return on every rank the last three values of the first one's (collective)."""
        mine = owned[-COMPONENTS:].copy() if self.extra else None
        return np.asarray(self.comm.bcast(mine, root=0))


class BorderedTangent(CondensedTangent):
    """A condensed tangent with the border of a rigid frame; further parameters as of that."""

    def __init__(self, frame: RigidFrame, V: fem.FunctionSpace, **parts: Any) -> None:
        super().__init__(V, **parts, prescribed=True)
        self._frame = frame
        index_map = V.dofmap.index_map
        self._size = index_map.size_local
        self._inner = PETSc.Vec().createMPI(
            (index_map.size_local, index_map.size_global), comm=V.mesh.comm
        )
        self._product, self._solution = self._inner.duplicate(), self._inner.duplicate()
        self._rows: FloatArray | None = None
        self._responses: FloatArray | None = None
        self._curvature = 0.0

    def assemble_border(self, residual: FloatArray) -> None:
        """Take the border at the residual's place, after `assemble`; owned values (collective)."""
        self._U = self._frame.columns
        self._curvature = self._frame.curvature(residual)
        self._rows, self._responses = None, None

    @property
    def _row(self) -> FloatArray:
        """K U, which is also the row U^T K: what is carried meets tissues alone; (3, n)."""
        if self._rows is None:
            found = []
            for column in self._U:
                self._inner.set(0.0)
                self._inner.array[self._frame.own] = column[self._frame.is_own]
                found.append(self.columns(self._inner, self._product))
            self._rows = np.array(found)
        return self._rows

    def _dot(self, values: FloatArray) -> FloatArray:
        """Return U^T K v, summed over all ranks; (3,) (collective)."""
        return np.asarray(self._frame.comm.allreduce(self._row @ values))

    def _force(self, row: FloatArray, place: FloatArray) -> FloatArray:
        """Return the equations' change by forces U^T K v, and by a change of place; (3,)."""
        frame, control = self._frame, self._frame.control
        force = row + np.array([0.0, 0.0, self._curvature * place[2]])
        return np.asarray(
            control.of_force @ (frame.scale * force) + control.of_place @ (place / frame.scale)
        )

    def mult(self, matrix: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Tangent times x (collective)."""
        v = x.array_r
        place = self._frame.of_all(v)
        inner = v[: self._size].copy()
        self._row  # noqa: B018  (it needs the vectors)
        self._inner.array[:] = inner
        super().mult(matrix, self._inner, self._product)
        change = self._force(self._dot(inner), place)
        out = y.array
        out[: self._size] = self._product.array_r
        out[self._frame.own] -= np.einsum("knc,k->nc", self._U[:, self._frame.is_own], place)
        if self._frame.extra:
            out[self._size :] = change

    def setUp(self, pc: PETSc.PC) -> None:
        """Factorise (collective)."""
        super().setUp(pc)
        self._responses = None

    def apply(self, pc: PETSc.PC, residual: PETSc.Vec, solution: PETSc.Vec) -> None:
        """Solve with the factorised tangent and its border (collective)."""
        if self._singular:
            solution.set(np.nan)
            return
        r = residual.array_r
        right = self._frame.of_all(r)
        responses = self._response(pc)
        start = self._solve(pc, r[: self._size])
        rows = np.array([self._dot(response) for response in responses]).T
        unit = np.eye(COMPONENTS)
        matrix = np.column_stack([self._force(rows[:, k], unit[k]) for k in range(COMPONENTS)])
        missing = right - self._force(self._dot(start), np.zeros(COMPONENTS))
        try:
            place = np.linalg.solve(matrix, missing)
        except np.linalg.LinAlgError:  # on all ranks; Newton's method ends with it
            place = np.full(COMPONENTS, np.nan)
        out = solution.array
        out[: self._size] = start + place @ responses
        if self._frame.extra:
            out[self._size :] = place

    def _response(self, pc: PETSc.PC) -> FloatArray:
        """Motion of all by each unknown of the frame; (3, n) (collective)."""
        if self._responses is None:
            found = []
            for column in self._U:
                right = np.zeros(self._size)
                right[self._frame.own] = column[self._frame.is_own]
                found.append(self._solve(pc, right))
            self._responses = np.array(found)
        return self._responses

    def _solve(self, pc: PETSc.PC, right: FloatArray) -> FloatArray:
        self._inner.array[:] = right
        super().apply(pc, self._inner, self._solution)
        return np.array(self._solution.array_r)


def _middle(section: SectionMesh, boundary: str) -> FloatArray:
    """Middle of the area that an undeformed boundary encloses, mm; (2,) (collective)."""
    domain: mesh.Mesh = section.mesh
    ds = ufl.Measure("ds", domain, subdomain_data=section.facet_tags)
    ds = ds(section.boundaries[boundary])
    x, n = ufl.SpatialCoordinate(domain), ufl.FacetNormal(domain)
    forms = [ufl.dot(x, n) * ds, *(x[i] * ufl.dot(x, n) * ds for i in range(2))]
    mine = [float(np.real(fem.assemble_scalar(fem.form(each)))) for each in forms]
    twice, *moments = domain.comm.allreduce(np.array(mine))
    return np.array(moments) / (1.5 * twice)
