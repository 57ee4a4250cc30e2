"""How the condensed matrix is laid out: numbering, pattern, and the solver that has analysed them.

It depends on the mesh, on what is constrained, on which cells keep their constant pressure and on
where skin and socket lie, but on no value: cases of one geometry share it, and MUMPS analyses it
once. A case has the same digits whether it finds a layout or makes it.
"""

from typing import Any

import numpy as np
from dolfinx import cpp, fem, la
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from calfsocket.contact.interface import ContactInterface
from calfsocket.io.fenics import numbering
from calfsocket.io.petsc_options import OPTIONS_PREFIX, defaults
from calfsocket.mechanics.kernels.library import Library
from calfsocket.mechanics.ordering import nested_dissection

IntArray = NDArray[np.int32]

# Unknowns of a cell: displacements, x before y as the loops in C have them, and pressures.
DISPLACEMENTS = [*range(0, 12, 2), *range(1, 12, 2)]
PRESSURE = slice(14, 17)


class Layout:
    """Numbering and pattern of the unknowns outside of cells, with matrix and solver (collective).

    Parameters are as of `condensation.CondensedTangent`; contact counts as it is at present, with
    what lies ahead of it.

    Attributes
    ----------
    keeps_constant : (m,) bool
        As given.
    unknowns : (k,) int
        The owned unknowns outside, in the order of the matrix's rows.
    outside : IndexMap
        Their numbering.
    numbers : (m, 13) int
        Local numbers of the unknowns of each owned cell; -1 where there is none.
    skin_cells, skin_numbers, socket_numbers
        The cell of each skin point, the numbers of its edge, and those of the edges of the socket.
    positions : (m, 13, 13) int
        Places of each cell's block in `values`.
    values : (n,) float
        The matrix's values, with rows of other ranks behind those of this one.
    matrix : PETSc.Mat
        The condensed matrix.
    is_ordered : bool
        Whether the unknowns are in the order of elimination; MUMPS finds one where they are not.
    ksp : PETSc.KSP
        Its solver.
    """

    def __init__(
        self,
        V: fem.FunctionSpace,
        library: Library,
        constrained: NDArray[np.bool_],
        keeps_constant: NDArray[np.bool_],
        contact: ContactInterface | None,
    ) -> None:
        self._comm = V.mesh.comm
        self._library = library
        self._constrained = constrained.copy()
        self.keeps_constant = keeps_constant.copy()
        self._ahead = _edges_ahead(contact)
        self.is_ordered = False
        self._number(V, contact)
        self._lay_out(contact)
        self.ksp = PETSc.KSP().create(self._comm)
        self.ksp.setOptionsPrefix(OPTIONS_PREFIX)
        order = {"pc_factor_mat_ordering_type": "natural"} if self.is_ordered else {}
        with defaults(**order):
            self.ksp.setFromOptions()

    def fits(
        self,
        constrained: NDArray[np.bool_],
        keeps_constant: NDArray[np.bool_],
        contact: ContactInterface | None,
    ) -> bool:
        """Whether it is what would be made of these on the same mesh (collective)."""
        ahead = _edges_ahead(contact)
        same = (
            np.array_equal(constrained, self._constrained)
            and np.array_equal(keeps_constant, self.keeps_constant)
            and np.array_equal(ahead, self._ahead)
        )
        return bool(self._comm.allreduce(same, op=MPI.LAND))

    def assemble(self) -> None:
        """Hand the values to PETSc's matrix (collective)."""
        if self._comm.size > 1:
            self._csr.scatter_reverse()
            starts, columns, end = self._owned
            self.matrix.setValuesCSR(starts, columns, self.values[:end])
        self.matrix.assemble()

    def locate(self, rows: IntArray, columns: IntArray) -> IntArray:
        """Places of blocks among the matrix's values, or why there is none; (n, k, m)."""
        (n, k), m = rows.shape, columns.shape[1]
        positions = np.empty((n, k, m), dtype=np.int32)
        self._library.call("locate", n, k, rows, m, columns, self._starts, self._columns, positions)
        return positions

    def _number(self, V: fem.FunctionSpace, contact: ContactInterface | None) -> None:
        constrained, keeps_constant = self._constrained, self.keeps_constant
        index_map, dofs = V.dofmap.index_map, V.dofmap.list
        is_outside = np.zeros(len(constrained), dtype=bool)
        is_outside[dofs[:, DISPLACEMENTS]] = True
        is_outside[constrained] = False
        is_outside[dofs[keeps_constant, PRESSURE][:, 0]] = True
        self.unknowns = np.flatnonzero(is_outside[: index_map.size_local])
        if self._comm.size == 1:
            self._order(V, contact)
        first = self._comm.exscan(len(self.unknowns)) or 0
        numbers = la.vector(index_map, dtype=np.int64)
        numbers.array[:] = -1
        numbers.array[self.unknowns] = first + np.arange(len(self.unknowns))
        numbers.scatter_forward()
        owner = np.full(len(constrained), self._comm.rank)
        owner[index_map.size_local :] = index_map.owners
        ghosts, owners = numbers.array[index_map.size_local :], owner[index_map.size_local :]
        if contact is not None:
            # The socket's face is a neighbour of all skin, wherever it is owned.
            face = contact.socket.dofs
            socket = contact.along_socket(numbers.array[face])
            ghosts = np.concatenate([ghosts, socket.ravel()])
            owners = np.concatenate([owners, contact.along_socket(owner[face]).ravel()])
        elsewhere = (ghosts >= 0) & (owners != self._comm.rank)
        ghosts, once = np.unique(ghosts[elsewhere], return_index=True)
        self.outside = numbering(
            self._comm, len(self.unknowns), ghosts, owners[elsewhere][once].astype(np.int32)
        )
        n_cells = V.mesh.topology.index_map(2).size_local
        constant = np.where(keeps_constant[:n_cells], dofs[:n_cells, PRESSURE][:, 0], -1)
        of_cells = np.column_stack([dofs[:n_cells, DISPLACEMENTS], constant])
        self.numbers = self._local(np.where(of_cells < 0, -1, numbers.array[of_cells]))
        if contact is None:
            return
        skin = contact.skin.entities[:, 0]
        n_points = contact.parameters.gauss_points
        self.skin_cells = np.repeat(skin, n_points)
        on_skin = self._local(numbers.array[contact.skin.dofs]).reshape(-1, 6)
        self.skin_numbers = np.repeat(on_skin, n_points, axis=0)
        self.socket_numbers = self._local(socket)

    def _order(self, V: fem.FunctionSpace, contact: ContactInterface | None) -> None:
        """Sort the unknowns as they are best eliminated, where one rank has them all.

        The order is that of the mesh's vertices. A node between two of them, which has no other
        neighbours than theirs, comes before both, and a cell's constant pressure behind the first
        vertex of its cell: alone it meets nothing but 1/K.
        """
        x, vertices = V.dofmap.list[:, DISPLACEMENTS[:6]], V.dofmap.list[:, DISPLACEMENTS[:3]]
        cliques = [vertices]
        if contact is not None:
            skin = vertices[contact.skin.entities[:, 0]]
            socket = contact.along_socket(contact.socket.dofs)[:, [0, 2]]
            cliques += [np.column_stack([skin, socket[edges]]) for edges in self._ahead.T]
        place = nested_dissection(cliques)
        self.is_ordered = place is not None
        if place is None:
            return
        of_cells = 3 * place[vertices]
        rank = np.zeros(len(self._constrained), dtype=np.int64)
        rank[x[:, 3:]] = np.minimum(of_cells[:, [1, 0, 0]], of_cells[:, [2, 2, 1]])
        rank[vertices] = of_cells + 1
        rank[V.dofmap.list[:, DISPLACEMENTS[6:]]] = rank[x]
        rank[V.dofmap.list[:, PRESSURE][:, 0]] = of_cells.min(axis=1) + 2
        self.unknowns = self.unknowns[np.argsort(rank[self.unknowns], kind="stable")]

    def _local(self, numbers: NDArray[np.int64]) -> IntArray:
        """Local numbers outside of global ones; -1 remains."""
        there = numbers >= 0
        local = np.full(numbers.shape, -1, dtype=np.int32)
        local[there] = self.outside.global_to_local(numbers[there])
        return local

    def _lay_out(self, contact: ContactInterface | None) -> None:
        """Lay the pattern out for the cells and for the contact that lies ahead."""
        pattern = cpp.la.SparsityPattern(self._comm, [self.outside, self.outside], [1, 1])
        for numbers in self.numbers:
            there = numbers[numbers >= 0]
            pattern.insert(there, there)
        if contact is not None:
            self._add_pattern_of(contact, pattern)
        pattern.finalize()
        self._csr = la.matrix_csr(pattern)
        self.values = np.asarray(self._csr.data, dtype=np.float64)
        self._starts = np.asarray(self._csr.indptr, dtype=np.int64)
        self._columns = np.asarray(self._csr.indices, dtype=np.int32)
        self.positions = self.locate(self.numbers, self.numbers)
        rows = self.outside.size_local
        end = self._starts[rows]
        starts = self._starts[: rows + 1].astype(PETSc.IntType)
        if self._comm.size == 1:
            # PETSc looks at the values where they are.
            self.matrix = PETSc.Mat().createAIJWithArrays(
                (rows, rows), (starts, self._columns, self.values), comm=self._comm
            )
            return
        columns = self._csr.index_map(1).local_to_global(self._columns[:end])
        self._owned = starts, columns.astype(PETSc.IntType), end
        size = (rows, self.outside.size_global)
        self.matrix = PETSc.Mat().createAIJ((size, size), comm=self._comm)
        self.matrix.setPreallocationCSR((starts, self._owned[1], self.values[:end]))

    def _add_pattern_of(self, contact: ContactInterface, pattern: Any) -> None:
        ahead = self._ahead
        for numbers in self.socket_numbers[np.unique(ahead)]:  # that another rank may own
            there = numbers[numbers >= 0]
            pattern.insert(there, there)
        n_points = contact.parameters.gauss_points
        for cell, edges in zip(self.skin_cells[::n_points], ahead, strict=True):
            skin = self.numbers[cell]
            socket = np.unique(self.socket_numbers[edges])
            skin, socket = skin[skin >= 0], socket[socket >= 0]
            pattern.insert(skin, socket)
            pattern.insert(socket, skin)


def _edges_ahead(contact: ContactInterface | None) -> NDArray[np.int64]:
    return np.empty((0, 0), dtype=np.int64) if contact is None else contact.edges_ahead()
