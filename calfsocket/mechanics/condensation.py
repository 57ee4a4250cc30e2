r"""The tangent with the unknowns inside each cell eliminated (static condensation).

Bubbles and pressures couple to nothing outside their cell. With i for what is inside of cells and o
for what is outside, Newton's equation K x = r becomes

    (K_oo - K_oi K_ii^-1 K_io) x_o = r_o - K_oi K_ii^-1 r_i,      x_i = K_ii^-1 (r_i - K_io x_o):

less than half of the unknowns for the direct solver, and an exact solution all the same. K_ii is
5 x 5 in each cell. In a nearly incompressible cell it is close to singular, since the bubble
does not change the cell's volume, and a constant pressure meets nothing but 1/K: there that
constant stays outside. Contact takes the skin's traction from the whole skin cell, so that it has
entries in K_oi, but none in K_io or K_ii.

Unknowns outside have a numbering of their own (`layout.Layout`); constrained ones are left out.
Where displacements are prescribed, with c for the constrained unknowns and x_c for
what their residual asks for, the columns of the condensed matrix that are theirs go to the right:

    S_oo x_o = r_o - K_oi K_ii^-1 r_i - S_oc x_c,    x_i = K_ii^-1 (r_i - K_io x_o - K_ic x_c).

Contact has no part in S_oc: no displacement is prescribed where bodies touch. The loops over cells
are in condensation.c.

Guyan 1965, doi:10.2514/3.2874; Wilson 1974, doi:10.1002/nme.1620080115.
"""

import numpy as np
from dolfinx import fem, la
from numpy.typing import NDArray
from petsc4py import PETSc

from calfsocket.contact.interface import ContactInterface, ContactTangent
from calfsocket.io.petsc_options import defaults
from calfsocket.mechanics.kernels.cells import CellLoops
from calfsocket.mechanics.layout import DISPLACEMENTS, PRESSURE, Layout

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]

INSIDE, OUTSIDE = 5, 13
_BUBBLE = slice(12, 14)
# Unknowns of a cell that stay outside, with the constant pressure in the place of the first one,
# and those inside.
_KEPT = [*DISPLACEMENTS, 14]
_ELIMINATED = [12, 13, 15, 16, 14]

TISSUE_TANGENT = PETSc.Log.Event("TissueTangent")


class CondensedTangent:
    """Tangent of bodies: PETSc's matrix, and its factorisation as preconditioner.

    Parameters
    ----------
    V : fem.FunctionSpace
        Mixed space of `forms.element.section_element`.
    tissues : CellLoops
        The tissues' tangents.
    constrained : (n,) bool
        Markers of constrained local unknowns, ghosts included.
    keeps_constant : (m,) bool
        Local cells, ghosts included, whose constant pressure stays outside.
    contact : ContactInterface, optional
        Contact between the bodies.
    prescribed : bool
        Whether constrained unknowns may be away from their values, so that their columns count.
    layout : Layout, optional
        One of the same mesh that an earlier tangent had; it is taken if it fits, and the two are
        then not for use side by side.

    Attributes
    ----------
    layout : Layout
        Numbering, pattern, matrix and solver.
    inverse : (m, 5, 5)
        K_ii^-1 of the owned cells; in the order bubble, pressure differences, constant pressure.
    coupling : (m, 5, 13)
        K_ii^-1 K_io.
    """

    def __init__(
        self,
        V: fem.FunctionSpace,
        tissues: CellLoops,
        constrained: NDArray[np.bool_],
        keeps_constant: NDArray[np.bool_],
        contact: ContactInterface | None = None,
        prescribed: bool = False,
        layout: Layout | None = None,
    ) -> None:
        self._comm = V.mesh.comm
        self._contact = contact
        self._tissues = tissues
        self._library = tissues.library
        cells = V.mesh.topology.index_map(2)
        p0, *others = V.dofmap.list[:, PRESSURE].T
        self._inside = np.ascontiguousarray(
            np.column_stack([V.dofmap.list[:, _BUBBLE], *others, p0])[: cells.size_local]
        )
        self._V, self._constrained = V, constrained
        self._columns_of_prescribed: _PrescribedColumns | None = None
        if prescribed:
            self._columns_of_prescribed = _PrescribedColumns(V, constrained)
        self.inverse = np.zeros((cells.size_local, INSIDE, INSIDE))
        self.coupling = np.zeros((cells.size_local, INSIDE, OUTSIDE))
        parts = constrained, keeps_constant, contact
        if layout is None or not layout.fits(*parts):
            layout = Layout(V, self._library, *parts)
        self._take(layout)

    def keep(self, keeps_constant: NDArray[np.bool_]) -> None:
        """Choose anew whose constant pressure stays outside: laws may have changed (collective)."""
        if self._comm.allreduce(not np.array_equal(keeps_constant, self.layout.keeps_constant)):
            self._lay_out(keeps_constant)

    def _lay_out(self, keeps_constant: NDArray[np.bool_]) -> None:
        """Lay the matrix out anew, for the contact that lies ahead now (collective)."""
        self.layout.ksp.reset()  # not two factorisations at a time
        self._take(Layout(self._V, self._library, self._constrained, keeps_constant, self._contact))

    def _take(self, layout: Layout) -> None:
        self.layout = layout
        self._keeps_constant = layout.keeps_constant[: len(self._inside)].astype(np.uint8)
        self._vector = la.vector(layout.outside)
        if self._contact is not None:
            n, on_skin = layout.skin_numbers.shape
            on_both = on_skin + layout.socket_numbers.shape[1]
            self._contact_edge = np.full(n, -1)
            self._contact_rows = np.empty((n, on_both), dtype=np.int32)
            self._contact_positions = np.empty((n, on_both, on_both + OUTSIDE), dtype=np.int32)
        self._assembled = False
        self._singular = False
        self._b, self._x = layout.matrix.createVecs()

    @property
    def matrix(self) -> PETSc.Mat:
        """The condensed matrix over the unknowns outside."""
        return self.layout.matrix

    @property
    def ksp(self) -> PETSc.KSP:
        """Solver of the condensed matrix."""
        return self.layout.ksp

    @property
    def unknowns(self) -> NDArray[np.int64]:
        """The owned unknowns outside, in the order of the matrix's rows."""
        return self.layout.unknowns

    # -- assembly -------------------------------------------------------------------------------

    def assemble(self, contact: ContactTangent | None) -> None:
        """Add tissues at their present unknowns, and contact where there is any (collective)."""
        self.layout.values[:] = 0.0
        self._add_tissues()
        if self._columns_of_prescribed is not None:
            self._columns_of_prescribed.assemble(
                self._tissues, self._keeps_constant, self.inverse, self.coupling
            )
        if contact is not None:
            self._assemble_contact(contact)
        self.layout.assemble()
        self._assembled = True

    def _assemble_contact(self, contact: ContactTangent) -> None:
        # T by what is inside and outside of the skin's cell; the constant pressure has its part in
        # all three at the vertices.
        inside = contact.d_traction[:, :, _ELIMINATED]
        inside[:, :, -1] += inside[:, :, 2] + inside[:, :, 3]
        outside = contact.d_traction[:, :, _KEPT]
        outside[:, :, -1] = inside[:, :, -1]
        outside -= inside @ self.coupling[self.layout.skin_cells]
        blocks = np.concatenate([contact.by_motion, contact.by_traction @ outside], axis=2)
        if self._comm.allreduce(self._add_contact(contact.edge, blocks)):
            # The limb slid farther than was thought of.
            self._lay_out(self.layout.keeps_constant)
            self._add_tissues()
            self._add_contact(contact.edge, blocks)
        self._by_traction, self._d_traction_inside = contact.by_traction, inside

    def _add_tissues(self) -> None:
        with TISSUE_TANGENT:
            self._tissues.add_tangents(
                self._keeps_constant,
                self.layout.positions,
                self.inverse,
                self.coupling,
                self.layout.values,
            )

    def _add_contact(self, edge: NDArray[np.int64], blocks: FloatArray) -> int:
        """Add contact to the matrix; return how many entries its pattern lacks."""
        self._locate_contact(edge)
        return int(
            self._library.call(
                "add_at", blocks.size, self._contact_positions, blocks, self.layout.values
            )
        )

    def _locate_contact(self, edge: NDArray[np.int64]) -> None:
        """Find rows and places of the contact points that are at another edge than before."""
        layout = self.layout
        moved = np.flatnonzero(edge != self._contact_edge)
        if len(moved) == 0:
            return
        sides = layout.skin_numbers[moved], layout.socket_numbers[edge[moved]]
        rows = np.concatenate(sides, axis=1)
        columns = np.concatenate([rows, layout.numbers[layout.skin_cells[moved]]], axis=1)
        self._contact_edge[moved] = edge[moved]
        self._contact_rows[moved] = rows
        self._contact_positions[moved] = layout.locate(rows, columns)

    def negative_inside(self) -> int:
        """Count the negative eigenvalues of K_ii, of all cells (collective)."""
        mine = int(np.count_nonzero(np.linalg.eigvalsh(self._invertible()) < 0.0))
        return int(self._comm.allreduce(mine))

    # -- PETSc's matrix -------------------------------------------------------------------------

    def mult(self, _matrix: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Tangent times x (collective).

        With S the condensed matrix and z = x_i + K_ii^-1 K_io x_o in each cell,

            y_o = S x_o + K_oi z,      y_i = K_ii z.
        """
        n_owned = len(self.unknowns)
        v, values = x.array_r, self._vector.array
        self._b.array[:] = v[self.unknowns]
        self.matrix.mult(self._b, self._x)
        values[:n_owned] = v[self.unknowns]
        self._vector.scatter_forward()
        numbers = self.layout.numbers
        there = numbers >= 0
        z = v[self._inside]
        z[:, 2:4] -= z[:, 4:]  # pressure differences
        z[there[:, -1], 4] = 0.0  # a constant pressure that is outside
        z += np.einsum("cio,co->ci", self.coupling, np.where(there, values[numbers], 0.0))
        if self._columns_of_prescribed is not None:
            cells, change = self._columns_of_prescribed.inside(v, self.coupling)
            z[cells] += change
        inside = np.linalg.solve(self._invertible(), z[:, :, None])[:, :, 0]
        outside = np.einsum("cio,ci->co", self.coupling, inside)
        values[:] = 0.0
        values[:n_owned] = self._x.array_r
        np.add.at(values, numbers[there], outside[there])
        if self._columns_of_prescribed is not None:
            self._columns_of_prescribed.add_outside(1.0, v, numbers, values)
        if self._contact is not None:
            self._add_contact_inside(1.0, z[self.layout.skin_cells], values)
        self._vector.scatter_reverse(la.InsertMode.add)
        x.copy(y)  # for the constrained unknowns
        y.array[self.unknowns] = values[:n_owned]
        inside[there[:, -1], 4] = values[numbers[there[:, -1], -1]]
        inside[:, 4] -= inside[:, 2] + inside[:, 3]
        y.array[self._inside] = inside

    def columns(self, v: PETSc.Vec, product: PETSc.Vec) -> FloatArray:
        """Return K v for a v of prescribed unknowns alone (collective).

        Parameters
        ----------
        v : PETSc.Vec
            Zero but for constrained unknowns.
        product : PETSc.Vec
            For what is computed on the way.

        Returns
        -------
        (n,) float
            Owned values. Rows of constrained unknowns, which `mult` does not have, are those of
            the tissues: contact has no part in them.
        """
        assert self._columns_of_prescribed is not None
        CondensedTangent.mult(self, None, v, product)  # without a border
        values = np.array(product.array_r)
        rows = self._columns_of_prescribed.own_rows(v.array_r, self._invertible(), self.coupling)
        at = np.flatnonzero(self._constrained[: len(values)])
        values[at] = rows[at]
        return values

    def _invertible(self) -> FloatArray:
        """K_ii^-1 with 1 in the place of a constant pressure that is outside."""
        blocks = self.inverse.copy()
        blocks[self._keeps_constant.astype(bool), -1, -1] = 1.0
        return blocks

    # -- PETSc's preconditioner -----------------------------------------------------------------

    def setUp(self, _pc: PETSc.PC) -> None:
        """Factorise the condensed matrix (collective)."""
        if not self._assembled:  # PETSc sets up before it asks for the first tangent
            return
        self.ksp.setOperators(self.matrix)
        with defaults():  # MUMPS asks for its options when it first sees the matrix
            self.ksp.setUp()
        self._singular = self.ksp.getPC().getFailedReason() != PETSc.PC.FailedReason.NOERROR
        if self._singular:
            self.ksp.reset()  # PETSc would solve with these factors after the next set-up

    def apply(self, _pc: PETSc.PC, residual: PETSc.Vec, solution: PETSc.Vec) -> None:
        """Solve with the factorised tangent; constrained unknowns are those of the residual.

        Where it is singular the solution is not finite, with which Newton's method ends.
        """
        if self._singular:
            solution.set(np.nan)
            return
        r, values = residual.array_r, self._vector.array
        values[:] = 0.0
        values[: len(self.unknowns)] = r[self.unknowns]
        self._library.call(
            "forward",
            len(self._inside),
            r,
            self._inside,
            self.layout.numbers,
            self.coupling,
            values,
        )
        if self._contact is not None:
            self._add_contact_inside(-1.0, self._alone(r), values)
        if self._columns_of_prescribed is not None:
            self._columns_of_prescribed.add_outside(-1.0, r, self.layout.numbers, values)
        self._vector.scatter_reverse(la.InsertMode.add)
        self._b.array[:] = values[: len(self.unknowns)]
        self.ksp.solve(self._b, self._x)
        values[: len(self.unknowns)] = self._x.array_r
        self._vector.scatter_forward()
        residual.copy(solution)
        x = solution.array
        x[self.unknowns] = values[: len(self.unknowns)]
        self._library.call(
            "backward",
            len(self._inside),
            r,
            self._inside,
            self.layout.numbers,
            self.inverse,
            self.coupling,
            values,
            x,
        )
        if self._columns_of_prescribed is not None:
            cells, change = self._columns_of_prescribed.inside(r, self.coupling)
            change[:, 2:4] += change[:, 4:]  # pressures again, from their differences
            x[self._inside[cells]] -= change

    def _alone(self, r: FloatArray) -> FloatArray:
        """K_ii^-1 r_i in the cell of each skin point; (n, 5)."""
        inside = r[self._inside[self.layout.skin_cells]]
        inside[:, 4] += inside[:, 2] + inside[:, 3]  # what a constant pressure meets
        return np.einsum("nij,nj->ni", self.inverse[self.layout.skin_cells], inside)

    def _add_contact_inside(self, factor: float, inside: FloatArray, values: FloatArray) -> None:
        """Add factor K_oi x_i of contact alone."""
        traction = np.einsum("nci,ni->nc", self._d_traction_inside, inside)
        change = factor * np.einsum("noc,nc->no", self._by_traction, traction)
        there = self._contact_rows >= 0
        np.add.at(values, self._contact_rows[there], change[there])


class _PrescribedColumns:
    """Columns of the condensed matrix that belong to constrained displacements, cell by cell."""

    def __init__(self, V: fem.FunctionSpace, constrained: NDArray[np.bool_]) -> None:
        n_cells = V.mesh.topology.index_map(2).size_local
        dofs = V.dofmap.list[:n_cells, DISPLACEMENTS]
        self.cells = np.flatnonzero(constrained[dofs].any(axis=1))
        self.unknowns, self._constrained = dofs[self.cells], constrained
        self._index_map = V.dofmap.index_map
        self._vector = la.vector(self._index_map)
        self._positions = np.full((n_cells, OUTSIDE, OUTSIDE), -1, dtype=np.int32)
        shape = (len(self.cells), OUTSIDE, OUTSIDE)
        self._matrices = np.zeros(shape)
        self._positions[self.cells] = np.arange(self._matrices.size).reshape(shape)

    def assemble(
        self,
        tissues: CellLoops,
        keeps_constant: NDArray[np.uint8],
        inverse: FloatArray,
        coupling: FloatArray,
    ) -> None:
        """Compute the condensed matrices of those cells."""
        self._matrices[:] = 0.0
        tissues.add_tangents(keeps_constant, self._positions, inverse, coupling, self._matrices)

    def _in_cells(self, v: FloatArray) -> FloatArray:
        """Constrained displacements of the cells, 0 for the others (collective); (k, 12)."""
        values = self._vector.array
        values[: len(v)] = v
        self._vector.scatter_forward()
        return np.where(self._constrained[self.unknowns], values[self.unknowns], 0.0)

    def add_outside(
        self, factor: float, v: FloatArray, numbers: IntArray, values: FloatArray
    ) -> None:
        """Add factor S_oc v_c to the unknowns outside (collective)."""
        change = factor * np.einsum("nij,nj->ni", self._matrices[:, :, :-1], self._in_cells(v))
        rows = numbers[self.cells]
        np.add.at(values, rows[rows >= 0], change[rows >= 0])

    def own_rows(self, v: FloatArray, inverse: FloatArray, coupling: FloatArray) -> FloatArray:
        """Return K_cc v_c at the owned unknowns, zero where not constrained (collective).

        In a cell, K_cc = S_cc + K_ci K_ii^-1 K_ic, and K_ci K_ii^-1 is the transpose of `coupling`.
        """
        cells, moved = self.inside(v, coupling)
        inner = np.linalg.solve(inverse[cells], moved[:, :, None])[:, :, 0]
        rows = np.einsum("nij,nj->ni", self._matrices[:, :-1, :-1], self._in_cells(v))
        rows += np.einsum("nij,ni->nj", coupling[cells][:, :, :-1], inner)
        found, there = la.vector(self._index_map), self._constrained[self.unknowns]
        np.add.at(found.array, self.unknowns[there], rows[there])
        found.scatter_reverse(la.InsertMode.add)
        return np.array(found.array[: len(v)])

    def inside(self, v: FloatArray, coupling: FloatArray) -> tuple[NDArray[np.int64], FloatArray]:
        """Cells, and K_ii^-1 K_ic v_c in them (collective); (k, 5)."""
        inner = coupling[self.cells][:, :, :-1]
        return self.cells, np.einsum("nij,nj->ni", inner, self._in_cells(v))
