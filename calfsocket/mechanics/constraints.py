"""Constraints: displacements of boundaries that are prescribed, or zero."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from dolfinx import fem
from numpy.typing import NDArray

from calfsocket.meshes.distributed import SectionMesh

Field = Callable[[NDArray[Any]], NDArray[Any]]
"""Vectors at positions, both (2, n)."""


@dataclass(frozen=True)
class Constraint:
    """Displacement components of a boundary that are prescribed.

    Attributes
    ----------
    boundary : str
        Name of the boundary.
    components : tuple of int
        0 for x, 1 for y.
    values : callable, optional
        Displacement in mm at full load, of undeformed positions in mm; it grows in proportion to
        the load. Zero without. `PrescribedMotion` sets values of its own.
    """

    boundary: str
    components: tuple[int, ...] = (0, 1)
    values: Field | None = None


def constrained_unknowns(
    V: fem.FunctionSpace, section: SectionMesh, constraints: Sequence[Constraint]
) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """Find which local unknowns of V are constrained, and their values at full load (collective).

    Ghosts are included. Sub-space 0 of V is the displacement. Where two constraints meet the first
    one counts.
    """
    n = V.dofmap.index_map.size_local + V.dofmap.index_map.num_ghosts
    constrained, values = np.zeros(n, dtype=bool), np.zeros(n)
    for constraint in reversed(constraints):
        facets = section.facet_tags.find(section.boundaries[constraint.boundary])
        for component in constraint.components:
            space = V.sub(0).sub(component)
            collapsed, _ = space.collapse()
            dofs, at = fem.locate_dofs_topological((space, collapsed), 1, facets)
            field = fem.Function(collapsed)
            if constraint.values is not None:
                field.interpolate(lambda x, c=component, f=constraint.values: f(x[:2])[c])
            constrained[dofs], values[dofs] = True, field.x.array[at]
    return constrained, values
