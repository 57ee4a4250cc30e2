"""Where bodies are: positions and displacements of regions, unknown by unknown."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from dolfinx import fem
from numpy.typing import NDArray

from calfsocket.meshes.distributed import SectionMesh

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Body:
    """Displacement unknowns of some regions.

    Not all are values at nodes (the element has a bubble), so positions are given as unknowns, too.

    Attributes
    ----------
    dofs : (n, 2) int
        Local indices of the two components, ghosts included.
    reference : (n, 2) float
        Unknowns of the field that is the undeformed position, mm.
    shift : (n, 2) float
        Unknowns of the field that is 1 everywhere.
    """

    dofs: NDArray[np.int32]
    reference: FloatArray
    shift: FloatArray

    @classmethod
    def of(cls, V: fem.FunctionSpace, section: SectionMesh, regions: Sequence[str]) -> "Body":
        """Collect the displacement unknowns of regions (collective)."""
        tags = [section.regions[name] for name in regions]
        cells = np.flatnonzero(np.isin(section.cell_regions(), tags))
        dofs, reference, shift = [], [], []
        for component in range(2):
            space, parent = V.sub(0).sub(component).collapse()
            position, one = fem.Function(space), fem.Function(space)
            position.interpolate(lambda x, c=component: x[c])
            one.interpolate(lambda x: np.ones(x.shape[1]))
            inside = np.unique(space.dofmap.list[cells])
            # One array, in dolfinx 0.11 in a list.
            dofs.append(np.ravel(parent).astype(np.int32)[inside])
            reference.append(position.x.array[inside])
            shift.append(one.x.array[inside])
        return cls(*(np.stack(values, axis=1) for values in (dofs, reference, shift)))
