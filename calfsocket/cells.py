"""What the loops over cells in C need of the element and of the laws, as plain arrays."""

from typing import Any

import basix
import numpy as np
import ufl
from dolfinx import fem, mesh
from numpy.typing import NDArray

from calfsocket.forms.element import QUADRATURE_DEGREE, section_element
from calfsocket.native import Library

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]

# Shape functions of a displacement component, filled up with zeros to whole vectors.
LANES = 8
# Nodes of a cell with quadratic geometry.
NODES = 6
# Of a law: two sets of unknowns, and its parameters.
MOST_COEFFICIENTS = 64


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
    shape, *gradient = np.pad(table, ((0, 0), (0, 0), (0, LANES - table.shape[2])))
    vertices = pressure.tabulate(0, points)[0]
    parts = [
        weights,
        np.stack(node.tabulate(1, points)[1:], axis=-1),
        shape,
        np.stack(gradient, axis=1),
        np.column_stack([np.ones(len(points)), vertices[:, 1:]]),
    ]
    return np.concatenate([part.ravel() for part in parts])


class CellLaw:
    """What a law gives at the points of its cells: a compiled expression and its coefficients.

    Parameters
    ----------
    library : native.Library
        The compiled loops.
    expression : fem.Expression
        At the points of `quadrature`.
    cells : (n,) int
        Owned cells that have the law.
    """

    def __init__(self, library: Library, expression: fem.Expression, cells: IntArray) -> None:
        ufcx = expression.ufcx_expression
        self.kernel = int(library.ffi.cast("intptr_t", ufcx.tabulate_tensor_float64))
        self.cells = np.ascontiguousarray(cells, dtype=np.int32)
        functions = ufl.algorithms.extract_coefficients(expression.ufl_expression)
        self._used = [
            functions[ufcx.original_coefficient_positions[i]] for i in range(ufcx.num_coefficients)
        ]
        addresses = []
        for f in self._used:
            dofs = f.function_space.dofmap.list
            assert f.x.array.dtype == np.float64 and dofs.dtype == np.int32
            assert f.x.array.flags.c_contiguous and dofs.flags.c_contiguous
            addresses.append((f.x.array.ctypes.data, dofs.ctypes.data, dofs.shape[1]))
        self._functions = np.array(addresses, dtype=np.int64)
        assert self._functions[:, 2].sum() <= MOST_COEFFICIENTS

    def arguments(self, element: FloatArray, geometry: mesh.Geometry) -> tuple[Any, ...]:
        """Return what the loops in C begin with; coefficients have their values of then."""
        return (
            self.kernel,
            element,
            len(self.cells),
            self.cells,
            len(self._functions),
            self._functions,
            geometry.x,
            geometry.dofmap,
        )
