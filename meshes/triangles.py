"""The mesh as plain arrays: what gmsh made, before it is distributed over MPI ranks."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

EQUILATERAL_AREA = np.sqrt(3.0) / 4.0
"""Of a triangle with sides of length 1."""
_PARTS = 5
SUBDIVISION = np.array(
    [
        np.array([3 * _PARTS - i - j, i, j]) / (3 * _PARTS)
        for i in range(1, 3 * _PARTS)
        for j in range(1, 3 * _PARTS - i)
        if i % 3 == j % 3 != 0
    ]
)
"""Barycentric coordinates of the middles of a triangle's 25 equal parts."""


@dataclass(frozen=True)
class TriangleMesh:
    """Six-node triangles in the plane, in gmsh's order, with named regions and boundaries.

    A triangle has three corners, counter-clockwise, then the nodes between corners 0-1, 1-2 and
    2-0; a facet two ends, then the node between them.
    """

    points: NDArray[np.float64]  #: (n, 2), mm
    cells: NDArray[np.int64]  #: nodes of the triangles, (m, 6)
    cell_tags: NDArray[np.int32]  #: region of each, (m,)
    facets: NDArray[np.int64]  #: nodes of the tagged edges, (k, 3)
    facet_tags: NDArray[np.int32]  #: boundary of each, (k,)
    regions: dict[str, int]  #: name -> tag
    boundaries: dict[str, int]

    @property
    def coordinates(self) -> NDArray[np.float64]:
        """Nodes of each cell, shape (m, 6, 2), mm."""
        return self.points[self.cells]
