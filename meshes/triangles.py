"""The mesh as plain arrays: what gmsh made, before it is distributed over MPI ranks."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class TriangleMesh:
    """Six-node triangles in the plane, with named regions and boundaries.

    Parameters
    ----------
    points
        Nodes, shape (n, 2), mm, in gmsh's order.
    cells
        Node indices, shape (m, 6), in gmsh's order: three corners, counter-clockwise, then the
        nodes between corners 0-1, 1-2 and 2-0.
    cell_tags
        Region of each cell, shape (m,).
    facets
        Node indices of the tagged edges, shape (k, 3): two ends, then the node between them.
    facet_tags
        Boundary of each of these edges, shape (k,).
    regions, boundaries
        Name -> tag.
    """

    points: NDArray[np.float64]
    cells: NDArray[np.int64]
    cell_tags: NDArray[np.int32]
    facets: NDArray[np.int64]
    facet_tags: NDArray[np.int32]
    regions: dict[str, int]
    boundaries: dict[str, int]

    @property
    def coordinates(self) -> NDArray[np.float64]:
        """Nodes of each cell, shape (m, 6, 2), mm."""
        return self.points[self.cells]
