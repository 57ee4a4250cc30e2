r"""A load that is spread evenly over a boundary, which is free to deform.

With w the undeformed length of each node of the boundary, X where it is when the load takes over, x
where it has come to, and their means over w, the boundary's place is its mean translation and the
rotation theta that fits its nodes best:

    t = mean(x) - mean(X),      tan(theta) = sum w A x x / sum w A . x,      A = X - mean(X).

A force F and a moment M, about mean(x), are the tractions (N/mm for each mm of undeformed length)

    F / sum w  +  M e_z x a / S,      a = R(theta) A,      S = sum w a . x,

linear in the position and turned with the boundary: their resultants are F and M exactly, at any
deformation, and their work is F . dt + M dtheta. With D = d(t, theta)/dx the forces at the nodes
are D^T (F, M), and the moment's change with the shape has the symmetric, exact derivative

    M d(D_theta)/dx = -M/S (w a D_theta^T + D_theta (w a)^T).

Nodes lie at the points of Simpson's rule, so that the nodal forces are those of linear tractions.

Nothing but contact holds the socket, and where that slips all around nothing stops it from turning:
the stiffness K of bodies and contact is singular. The linear system therefore holds three
displacements of two far nodes, and a small one has their rows; with b for the seven columns (the
three, D^T, w a) it needs K^-1 b, one factorisation for seven right-hand sides more.
"""

from typing import Any

import numpy as np
import ufl
from dolfinx import fem, la
from petsc4py import PETSc

from calfsocket.mechanics.carrier import (
    COMPONENTS,
    NEUTRAL,
    QUARTER,
    CarriedTangent,
    Carrier,
    FloatArray,
)
from calfsocket.meshes.distributed import SectionMesh


class EvenLoad(Carrier):
    """Spreads force and moment evenly over a boundary; parameters as of `Carrier`.

    Its unknowns are its force and moment.

    Attributes
    ----------
    load : (3,) float
        Force along x and y (N/mm), moment (N mm/mm).
    pins : (3,) int
        Index of this rank's unknown for each displacement that the linear system holds; -1 where
        another rank owns it.
    """

    def __init__(
        self, V: fem.FunctionSpace, section: SectionMesh, boundary: str, unknowns: FloatArray
    ) -> None:
        super().__init__(V, section, boundary, unknowns)
        self.load: FloatArray = np.zeros(COMPONENTS)
        self._weight = _lengths(V, section, boundary)[self.own[:, 0], None]
        self._length = float(self.comm.allreduce(self._weight.sum()))
        start = self._start[self.is_own]
        self._middle = self._sum(self._weight * start) / self._length
        self._arm = start - self._middle
        squares = self.comm.allreduce(np.sum(self._weight * self._arm**2))
        self.radius = float(np.sqrt(squares / self._length))
        self._fit(start)
        self._choose_pins(V)

    def _sum(self, values: FloatArray) -> FloatArray:
        """Sum over the nodes of all ranks (collective)."""
        return np.asarray(self.comm.allreduce(values.sum(axis=0)))

    def _choose_pins(self, V: fem.FunctionSpace) -> None:
        """Choose both displacements of a node, and one of the farthest from it (collective)."""
        index_map = V.dofmap.index_map
        numbers = index_map.local_to_global(self.own.ravel().astype(np.int32)).reshape(-1, 2)

        def first(size: FloatArray) -> tuple[FloatArray, Any]:
            """Arm and unknowns of the node where something is largest."""
            mine = (-np.inf, 0.0, 0.0, -1, -1)
            if len(size):
                at = int(np.argmax(size))
                (x, y), (one, other) = self._arm[at], numbers[at]
                mine = (float(size[at]), float(x), float(y), int(one), int(other))
            _, x, y, *found = max(self.comm.allgather(mine))
            return np.array([x, y]), found

        arm, both = first(self._arm[:, 0])
        across, other = first(np.linalg.norm(self._arm - arm, axis=1))
        span = np.abs(across - arm)
        chosen = np.array([*both, other[1 if span[0] >= span[1] else 0]], dtype=np.int64)
        here = index_map.global_to_local(chosen)
        self.constrained = here[here >= 0]
        self.pins = np.where(here < index_map.size_local, here, -1)

    def _fit(self, position: FloatArray) -> None:
        """Take the place of nodes at positions, (m, 2) (collective)."""
        middle = self._sum(self._weight * position) / self._length
        cross, dot = self._sum(
            self._weight
            * np.column_stack(
                [
                    np.sum(self._arm @ QUARTER.T * position, axis=1),
                    np.sum(self._arm * position, axis=1),
                ]
            )
        )
        self.place = np.array([*(middle - self._middle), np.arctan2(cross, dot)])
        self._spread = float(np.hypot(cross, dot))

    @property
    def arms(self) -> FloatArray:
        """W a of the owned nodes, mm^2; (m, 2)."""
        cos, sin = np.cos(self.place[2]), np.sin(self.place[2])
        return np.asarray(self._weight * (self._arm @ np.array([[cos, sin], [-sin, cos]])))

    @property
    def rows(self) -> FloatArray:
        """D, the change of the place by the owned nodes; (3, m, 2)."""
        D = np.zeros((COMPONENTS, *self.own.shape))
        D[0, :, 0] = D[1, :, 1] = self._weight[:, 0] / self._length
        D[2] = self.arms @ QUARTER.T / self._spread
        return D

    @property
    def bend(self) -> float:
        """M/S, N/mm^2."""
        return float(self.load[2] / self._spread)

    def force(self, residual: FloatArray) -> FloatArray:
        """Force (N/mm) and moment (N mm/mm) that it applies; (3,)."""
        return self.load.copy()

    def take(self, x: PETSc.Vec) -> None:
        """Take the load and the place that a vector of unknowns has (collective)."""
        values = x.array_r
        self.load = self.of_all(values)
        self._fit(self._reference[self.is_own] + values[self.own])

    def motion(self, change: PETSc.Vec) -> FloatArray:
        """Return the change of its place by one of the unknowns; (3,) (collective)."""
        mine = np.einsum("knc,nc->k", self.rows, change.array_r[self.own])
        return np.asarray(self.comm.allreduce(mine))

    def add_to(self, values: FloatArray, x: FloatArray, residual: FloatArray) -> None:
        """Take its forces off the residual, and write how far the control is missed."""
        owned = self.pins[self.pins >= 0]
        values[owned] = residual[owned]
        values[self.own] -= np.einsum("knc,k->nc", self.rows, self.load)
        if self.extra:
            values[-COMPONENTS:] = self.equations(self.load)

    def tangent(self, V: fem.FunctionSpace, **parts: Any) -> "EvenTangent":
        """Return a tangent with its border."""
        return EvenTangent(self, V, **parts)


_PINS, _LOADS, _ARMS = slice(0, 3), slice(3, 6), 6
"""Columns of `EvenTangent`: the displacements that are held, D^T, w a."""


class EvenTangent(CarriedTangent):
    """A condensed tangent with the border of an even load; further parameters as of that."""

    def __init__(self, carrier: EvenLoad, V: fem.FunctionSpace, **parts: Any) -> None:
        super().__init__(carrier, V, **parts)
        self._carrier = carrier
        self._responses: FloatArray | None = None

    def assemble_border(self, residual: FloatArray) -> None:
        """Take the border at the residual's place, after `assemble`; owned values (collective)."""
        carrier = self._carrier
        self._rows = np.zeros((7, self._size))
        for k, pin in enumerate(carrier.pins):
            at = [pin] if pin >= 0 else []
            self._rows[k] = self._times(np.array(at, dtype=int), np.ones(len(at)))
        for row, values in zip(self._rows[3:], [*carrier.rows, carrier.arms], strict=True):
            row[carrier.own] = values
        self._at_pins = self._own_pins(self._rows[3:])
        self._bend = carrier.bend
        self._responses = None

    def _own_pins(self, values: FloatArray) -> FloatArray:
        """Values at the three pins, known on all ranks (collective)."""
        pins = self._carrier.pins
        return self._sum(np.where(pins >= 0, values[..., pins], 0.0))

    def mult(self, matrix: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Tangent times x (collective)."""
        carrier, v = self._carrier, x.array_r
        load, inner = carrier.of_all(v), v[: self._size].copy()
        found = self._multiplied(inner)
        products = self._sum(self._rows @ inner)
        place, stretch = products[_LOADS], products[_ARMS]
        for pin, force in zip(carrier.pins, products[_PINS], strict=True):
            if pin >= 0:
                found[pin] = force
        found += self._bend * place[2] * self._rows[_ARMS]
        found -= (load - [0.0, 0.0, self._bend * stretch]) @ self._rows[_LOADS]
        y.array[: self._size] = found
        if carrier.extra:
            y.array[self._size :] = carrier.change(load, place)

    def setUp(self, pc: PETSc.PC | None) -> None:
        """Factorise (collective)."""
        super().setUp(pc)
        self._responses = None

    def apply(self, pc: PETSc.PC, residual: PETSc.Vec, solution: PETSc.Vec) -> None:
        """Solve with the factorised tangent and its border (collective).

        With z the motions of the pins, the loads less M/S (w a) . v, and -M/S D_theta . v:
        v = v_0 + K^-1 b z, and the seven equations are the rows of the pins, of the control, and
        the last one's meaning.
        """
        if self._singular:
            solution.set(np.nan)
            return
        carrier, r = self._carrier, residual.array_r
        right, at_pins = carrier.of_all(r), self._own_pins(r)
        responses = self._response(pc)
        start = self._solved(pc, self._without_pins(r[: self._size]))
        P, p = self._sum(self._rows @ responses.T), self._sum(self._rows @ start)
        loads = np.zeros((COMPONENTS, 7))  # change of the loads by z
        loads[:, _LOADS] = np.eye(COMPONENTS)
        loads[2] += self._bend * P[_ARMS]
        last = np.array([0.0, 0.0, self._bend * p[_ARMS]])
        matrix = np.vstack(
            [
                P[_PINS] - np.hstack([np.zeros((3, 3)), self._at_pins.T]),
                carrier.change(loads, P[_LOADS]),
                self._bend * P[5] + np.eye(7)[_ARMS],
            ]
        )
        missing = [
            *(at_pins - p[_PINS]),
            *(right - carrier.change(last, p[_LOADS])),
            -self._bend * p[5],
        ]
        try:
            z = np.linalg.solve(matrix, missing)
        except np.linalg.LinAlgError:  # on all ranks; Newton's method ends with it
            z = np.full(7, np.nan)
        out = solution.array
        out[: self._size] = start + z @ responses
        if carrier.extra:
            out[self._size :] = loads @ z + last

    def negative_of_carrier(self) -> int:
        """Count the negative modes of the pins with the load's own stiffness (collective)."""
        self.setUp(None)
        if self._singular:
            return 0
        P = self._sum(self._rows @ self._response(None).T)
        carrier = self._carrier
        prescribed = carrier.control.of_place / carrier.scale
        prescribed = prescribed[np.abs(prescribed).any(axis=1)]
        # Columns beside the pins: what is prescribed, and the two of the load's own stiffness.
        own = np.eye(4)[2:] if self._bend else np.zeros((0, 4))
        beside = np.vstack([np.pad(prescribed, ((0, 0), (0, 1))), own])
        small = np.zeros((3 + len(beside),) * 2)
        small[:3, :3] = P[_PINS, _PINS]
        small[3:, :3] = beside @ P[3:, _PINS]
        small[:3, 3:] = small[3:, :3].T
        small[3:, 3:] = -beside @ P[3:, 3:] @ beside.T
        if self._bend:
            small[-2, -1] -= 1.0 / self._bend
            small[-1, -2] -= 1.0 / self._bend
        unit = 1.0 / np.sqrt(np.abs(np.diag(small)))
        values = np.linalg.eigvalsh(0.5 * (small + small.T) * np.outer(unit, unit))
        # Of each equation beside the pins one is negative, but of the two of the load together.
        return int(np.count_nonzero(values < -NEUTRAL)) - len(beside) + bool(self._bend)

    def _without_pins(self, values: FloatArray) -> FloatArray:
        found, pins = values.copy(), self._carrier.pins
        found[pins[pins >= 0]] = 0.0
        return found

    def _response(self, pc: PETSc.PC | None) -> FloatArray:
        """K^-1 b: motion of all by each column, the pins held but for theirs; (7, n)."""
        if self._responses is None:
            rights = np.array([self._without_pins(row) for row in self._rows])
            rights[_PINS] = 0.0
            for right, pin in zip(rights, self._carrier.pins, strict=False):
                if pin >= 0:
                    right[pin] = 1.0
            self._responses = np.array([self._solved(pc, right) for right in rights])
        return self._responses


def _lengths(V: fem.FunctionSpace, section: SectionMesh, boundary: str) -> FloatArray:
    """Undeformed length that each node of a boundary stands for, mm, at owned unknowns along x."""
    ds = ufl.Measure("ds", section.mesh, subdomain_data=section.facet_tags)
    v = ufl.TestFunctions(V)[0]
    found = fem.assemble_vector(fem.form(v[0] * ds(section.boundaries[boundary])))
    found.scatter_reverse(la.InsertMode.add)
    return np.array(found.array[: V.dofmap.index_map.size_local])
