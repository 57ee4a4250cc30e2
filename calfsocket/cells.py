"""What the loops of condensation.c need of the element and of the laws, as plain arrays."""

from typing import Any

import basix
import numpy as np
import ufl
from dolfinx import fem
from numpy.typing import NDArray

from calfsocket.forms.element import QUADRATURE_DEGREE, section_element

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]

# Shape functions of a displacement component, filled up with zeros to whole vectors.
LANES = 8
# Nodes of a cell with quadratic geometry.
NODES = 6


def quadrature() -> tuple[FloatArray, FloatArray]:
    """Points (n, 2) and weights (n,) of the element's quadrature on the reference triangle."""
    points, weights = basix.make_quadrature(basix.CellType.triangle, QUADRATURE_DEGREE)
    return np.asarray(points), np.asarray(weights)


def reference_element(V: fem.FunctionSpace) -> FloatArray:
    """Lay out the reference element at the points of `quadrature` as condensation.c has it.

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
    """Moduli of a law in its cells: the compiled expression and its coefficients."""

    def __init__(self, ffi: Any, expression: fem.Expression, cells: IntArray) -> None:
        ufcx = expression.ufcx_expression
        self.kernel = int(ffi.cast("intptr_t", ufcx.tabulate_tensor_float64))
        self.cells = np.ascontiguousarray(cells, dtype=np.int32)
        functions = ufl.algorithms.extract_coefficients(expression.ufl_expression)
        used = [
            functions[ufcx.original_coefficient_positions[i]] for i in range(ufcx.num_coefficients)
        ]
        self._values = [(f.x.array, f.function_space.dofmap.list[cells]) for f in used]

    def coefficients(self) -> FloatArray:
        """Present values in each cell, one after the other; (n, k)."""
        return np.concatenate([values[dofs] for values, dofs in self._values], axis=1)
