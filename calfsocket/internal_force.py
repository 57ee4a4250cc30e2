"""Internal force of the tissues: the residual without contact, put together cell by cell."""

from collections.abc import Sequence

import numpy as np
from dolfinx import fem
from numpy.typing import NDArray

from calfsocket import native
from calfsocket.cells import CellLaw, reference_element

FloatArray = NDArray[np.float64]


class InternalForce:
    """The residual of `forms.mixed.residual`, by the loops of internal_force.c.

    Parameters
    ----------
    V : fem.FunctionSpace
        Mixed space of `forms.element.section_element`.
    stresses : sequence of (fem.Expression, (n,) int)
        `forms.mixed.stresses` at the points of `cells.quadrature`, and the owned cells that have
        them: each cell once.
    """

    def __init__(
        self, V: fem.FunctionSpace, stresses: Sequence[tuple[fem.Expression, NDArray[np.int32]]]
    ) -> None:
        self._library = native.library(V.mesh.comm)
        self._laws = [CellLaw(self._library, expression, cells) for expression, cells in stresses]
        self._element = reference_element(V)
        self._geometry, self._dofs = V.mesh.geometry, V.dofmap.list

    def add(self, values: FloatArray) -> None:
        """Add the part of the owned cells to all local unknowns, ghosts included; N/mm."""
        for law in self._laws:
            arguments = law.arguments(self._element, self._geometry)
            self._library.call("add_residuals", *arguments, self._dofs, values)
