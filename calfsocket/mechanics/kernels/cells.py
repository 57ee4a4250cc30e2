"""What the loops over cells in C need of the element and of the laws, as plain arrays."""

from typing import Any

import basix
import numpy as np
from dolfinx import fem
from numpy.typing import NDArray

from calfsocket.forms.element import QUADRATURE_DEGREE, section_element
from calfsocket.io.fenics import cell_nodes
from calfsocket.materials.fields import LawFields
from calfsocket.materials.stress_free import StressFree
from calfsocket.mechanics.kernels import library as native
from calfsocket.mechanics.kernels.laws import parameter_list
from calfsocket.meshes.quality import determinant

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]

# Quadrature points and shape functions of a displacement component, filled up to whole vectors.
EIGHT = 8
# Nodes of a cell with quadratic geometry.
NODES = 6


def quadrature() -> tuple[FloatArray, FloatArray]:
    """Points (n, 2) and weights (n,) of the element's quadrature on the reference triangle."""
    points, weights = basix.make_quadrature(basix.CellType.triangle, QUADRATURE_DEGREE)
    return np.asarray(points), np.asarray(weights)


def reference_element(V: fem.FunctionSpace) -> FloatArray:
    """Lay out the reference element at the points of `quadrature` as cells.h has it.

    Raises
    ------
    ValueError
        If the mesh's geometry is not quadratic, for which those loops are made.
    """
    points, weights = quadrature()
    displacement, pressure = section_element().sub_elements
    scalar = displacement.sub_elements[0]
    (node,) = set(V.mesh.ufl_domain().ufl_coordinate_element().sub_elements)
    if node.dim != NODES:
        raise ValueError(f"cells have {node.dim} nodes, not {NODES}")
    table = scalar.tabulate(1, points)
    shape, *gradient = np.pad(table, ((0, 0), (0, 0), (0, EIGHT - table.shape[2])))
    vertices = pressure.tabulate(0, points)[0]

    def by_points(values: FloatArray) -> FloatArray:
        """Points come last, the last one in the place of those that are missing."""
        filled = np.pad(values, [(0, EIGHT - len(values))] + [(0, 0)] * (values.ndim - 1), "edge")
        return np.moveaxis(filled, 0, -1)

    parts = [
        np.pad(weights, (0, EIGHT - len(weights))),
        by_points(np.stack(node.tabulate(1, points)[1:], axis=-1)),
        by_points(np.stack(table[1:], axis=-1)),
        by_points(np.column_stack([np.ones(len(points)), vertices[:, 1:]])),
        shape,
        np.stack(gradient, axis=1),
    ]
    return np.concatenate([part.ravel() for part in parts])


class CellLoops:
    """Residuals and tangents of the tissues, by the loops in C over this rank's cells.

    Parameters
    ----------
    w : fem.Function
        Displacement (mm) and scaled pressure in the space of `forms.element.section_element`.
    fields : LawFields
        The laws.
    foundation : (fem.Function, fem.Function), optional
        Stiffness of an elastic foundation in each cell (DG0, N/mm^3), and where it is at rest (in
        w's space).

    Attributes
    ----------
    library : native.Library
        Compiled functions, those that need no law among them.
    """

    def __init__(
        self,
        w: fem.Function,
        fields: LawFields,
        foundation: tuple[fem.Function, fem.Function] | None = None,
    ) -> None:
        V = w.function_space
        self._w, self._foundation = w, foundation
        self._element = reference_element(V)
        self._laws = []
        for tag, material in fields.materials.items():
            kind = material.law_form, len(material.coefficients)
            cells = fields.tags.find(tag)
            addresses = [
                (f.x.array.ctypes.data, f.function_space.dofmap.list.ctypes.data)
                for f in parameter_list(material)
            ]
            self._laws.append(
                (
                    native.library(V.mesh.comm, kind),
                    cells[cells < V.mesh.topology.index_map(2).size_local],
                    np.array(addresses, dtype=np.int64),
                )
            )
        self.library = self._laws[0][0]
        self._fields = fields  # whose arrays the addresses are
        self._stress_free: tuple[int, FloatArray | None] = (0, None)

    def add_residuals(self, values: FloatArray) -> None:
        """Add the part of the owned cells to all local unknowns, ghosts included; N/mm."""
        self._run("add_residuals", values)

    def add_tangents(
        self,
        keeps_constant: NDArray[np.uint8],
        positions: IntArray,
        inverse: FloatArray,
        coupling: FloatArray,
        values: FloatArray,
    ) -> None:
        """Add condensed tangents to a matrix's values; see `condensation.CondensedTangent`."""
        self._run("add_tangents", keeps_constant, positions, inverse, coupling, values)

    def _run(self, name: str, *arguments: NDArray[Any]) -> None:
        V, foundation, anchor = self._w.function_space, None, None
        if self._foundation:
            stiffness, at_rest = self._foundation
            foundation = stiffness.x.array[stiffness.function_space.dofmap.list[:, 0]]
            anchor = at_rest.x.array
        stress_free = self._stress_free_state()
        for library, cells, addresses in self._laws:
            library.call(
                name,
                len(cells),
                cells,
                self._element,
                V.mesh.geometry.x,
                cell_nodes(V.mesh),
                self._w.x.array,
                V.dofmap.list,
                addresses,
                foundation,
                anchor,
                stress_free,
                *arguments,
            )

    def _stress_free_state(self) -> FloatArray | None:
        """G^-1 and det G at the points of the owned cells as cells.h has it, None where G = I."""
        state = self._fields.stress_free
        if state.changes != self._stress_free[0]:
            self._stress_free = state.changes, self._lay_out(state)
        return self._stress_free[1]

    def _lay_out(self, state: StressFree) -> FloatArray | None:
        if state.tensor is None:
            return None
        G = state.at(quadrature()[0])
        numbers = [*np.moveaxis(np.linalg.inv(G).reshape(*G.shape[:2], 4), 2, 0), determinant(G)]
        values = np.stack(numbers, axis=1)
        filled = np.pad(values, [(0, 0), (0, 0), (0, EIGHT - values.shape[2])], "edge")
        return np.ascontiguousarray(filled)
