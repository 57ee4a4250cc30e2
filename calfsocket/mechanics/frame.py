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

from typing import Any

import numpy as np
import ufl
from dolfinx import fem, mesh
from petsc4py import PETSc
from scipy.linalg import null_space

from calfsocket.mechanics.carrier import (
    COMPONENTS,
    NEUTRAL,
    QUARTER,
    CarriedTangent,
    Carrier,
    FloatArray,
)
from calfsocket.meshes.distributed import SectionMesh


class RigidFrame(Carrier):
    """Moves the nodes of a boundary as one body; parameters as of `Carrier`.

    Its unknowns are its place.

    Attributes
    ----------
    centre : (2,) float
        Middle of the area that the undeformed boundary encloses, mm.
    """

    def __init__(
        self, V: fem.FunctionSpace, section: SectionMesh, boundary: str, unknowns: FloatArray
    ) -> None:
        super().__init__(V, section, boundary, unknowns)
        self.constrained = self.dofs
        self.centre = _middle(section, boundary)
        self._arm = self._start - self.centre
        mine = self._arm[self.is_own]
        squares, count = self.comm.allreduce(np.array([np.sum(mine**2), len(mine)]))
        self.radius = float(np.sqrt(squares / count))

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
        U[2] = self._turned @ QUARTER.T
        return U

    def force(self, residual: FloatArray) -> FloatArray:
        """Force (N/mm) and moment (N mm/mm) of a residual of the bodies; (3,) (collective)."""
        mine = np.einsum("knc,nc->k", self.columns[:, self.is_own], residual[self.own])
        return np.asarray(self.comm.allreduce(mine))

    def curvature(self, residual: FloatArray) -> float:
        """Return H of rotation, the derivative of U^T f by it at fixed f (collective)."""
        mine = -np.sum(self._turned[self.is_own] * residual[self.own])
        return float(self.comm.allreduce(mine))

    def add_to(self, values: FloatArray, x: FloatArray, residual: FloatArray) -> None:
        """Write how far its nodes are off their places, and how far the control is missed."""
        values[self.own] = x[self.own] - self.displacement[self.is_own]
        missed = self.equations(self.force(residual))
        if self.extra:
            values[-COMPONENTS:] = missed

    def take(self, x: PETSc.Vec) -> None:
        """Take the place that a vector of unknowns has (collective)."""
        self.place = self.of_all(x.array_r)

    def motion(self, change: PETSc.Vec) -> FloatArray:
        """Return the change of its place by one of the unknowns; (3,) (collective)."""
        return self.of_all(change.array_r)

    def tangent(self, V: fem.FunctionSpace, **parts: Any) -> "FrameTangent":
        """Return a tangent with its border."""
        return FrameTangent(self, V, **parts)


class FrameTangent(CarriedTangent):
    """A condensed tangent with the border of a rigid frame; further parameters as of that."""

    def __init__(self, frame: RigidFrame, V: fem.FunctionSpace, **parts: Any) -> None:
        super().__init__(frame, V, **parts)
        self._frame = frame
        self._rows: FloatArray | None = None
        self._responses: FloatArray | None = None
        self._curvature = 0.0

    def assemble_border(self, residual: FloatArray) -> None:
        """Take the border at the residual's place, after `assemble`; owned values (collective)."""
        self._U = self._frame.columns[:, self._frame.is_own]
        self._curvature = self._frame.curvature(residual)
        self._rows, self._responses = None, None

    @property
    def _row(self) -> FloatArray:
        """K U, which is also the row U^T K: what is carried meets tissues alone; (3, n)."""
        if self._rows is None:
            own = self._frame.own
            self._rows = np.array([self._times(own, column) for column in self._U])
        return self._rows

    def _force(self, row: FloatArray, place: FloatArray) -> FloatArray:
        """Return the equations' change by forces U^T K v, and by a change of place; (3,)."""
        force = row + np.array([0.0, 0.0, self._curvature * place[2]])
        return self._frame.change(force, place)

    def mult(self, matrix: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Tangent times x (collective)."""
        v = x.array_r
        place = self._frame.of_all(v)
        inner = v[: self._size].copy()
        row = self._row  # it needs the vectors
        out = y.array
        out[: self._size] = self._multiplied(inner)
        out[self._frame.own] -= np.einsum("knc,k->nc", self._U, place)
        change = self._force(self._sum(row @ inner), place)
        if self._frame.extra:
            out[self._size :] = change

    def setUp(self, pc: PETSc.PC | None) -> None:
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
        start = self._solved(pc, r[: self._size])
        rows, unit = self._sum(self._row @ responses.T), np.eye(COMPONENTS)
        matrix = np.column_stack([self._force(rows[:, k], unit[k]) for k in range(COMPONENTS)])
        missing = right - self._force(self._sum(self._row @ start), np.zeros(COMPONENTS))
        try:
            place = np.linalg.solve(matrix, missing)
        except np.linalg.LinAlgError:  # on all ranks; Newton's method ends with it
            place = np.full(COMPONENTS, np.nan)
        out = solution.array
        out[: self._size] = start + place @ responses
        if self._frame.extra:
            out[self._size :] = place

    def negative_of_carrier(self) -> int:
        """Count the negative modes of the frame where its place is not prescribed (collective)."""
        self.setUp(None)
        if self._singular:
            return 0
        stiffness = self._sum(self._row @ self._response(None).T)
        stiffness[2, 2] += self._curvature
        scale = self._frame.scale
        free = null_space(self._frame.control.of_place) * scale[:, None]
        within = free.T @ (0.5 * (stiffness + stiffness.T)) @ free
        largest = np.abs(stiffness * np.outer(scale, scale)).max()
        return int(np.count_nonzero(np.linalg.eigvalsh(within) < -NEUTRAL * largest))

    def _response(self, pc: PETSc.PC | None) -> FloatArray:
        """Motion of all by each unknown of the frame; (3, n) (collective)."""
        if self._responses is None:
            found = []
            for column in self._U:
                right = np.zeros(self._size)
                right[self._frame.own] = column
                found.append(self._solved(pc, right))
            self._responses = np.array(found)
        return self._responses


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
