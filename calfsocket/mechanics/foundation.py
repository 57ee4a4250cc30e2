"""Elastic foundation: springs from every point of some regions to where it is at rest."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from dolfinx import fem
from numpy.typing import NDArray

from calfsocket.meshes.distributed import SectionMesh


@dataclass(frozen=True)
class Foundation:
    """Stiffness of an elastic foundation by region, in N/mm^3; none in regions without a name here.

    Attributes
    ----------
    lasting : mapping of region name to float
        The same at every load.
    fading : mapping of region name to float
        At load 0; it falls in proportion, to nothing at full load.
    """

    lasting: Mapping[str, float] = field(default_factory=dict)
    fading: Mapping[str, float] = field(default_factory=dict)


class FoundationTerm:
    """An elastic foundation on a mesh: force -k (u - u0) per volume.

    Attributes
    ----------
    stiffness : fem.Function
        k at the present load, constant in each cell, N/mm^3.
    anchor : fem.Function
        Unknowns with the displacement u0 at which it is at rest, mm: that of the last `rest`, and
        below full load alone; what lasts is at rest in the undeformed place.
    """

    def __init__(self, foundation: Foundation, section: SectionMesh, V: fem.FunctionSpace) -> None:
        self.stiffness = fem.Function(fem.functionspace(section.mesh, ("DG", 0)))
        self.anchor = fem.Function(V)
        self._lasting, self._fading = (
            self._by_region(section, values) for values in (foundation.lasting, foundation.fading)
        )
        self._rest = np.zeros_like(self.anchor.x.array)
        self.set_load(0.0)

    def set_load(self, load: float) -> None:
        """Reduce the fading part to its stiffness at a load, 0 to 1."""
        self._load = load
        self.stiffness.x.array[:] = self._lasting + (1.0 - load) * self._fading
        self.anchor.x.array[:] = self._rest if load < 1.0 else 0.0

    def rest(self, unknowns: NDArray[np.float64]) -> None:
        """Take local unknowns, ghosts included, as those at rest."""
        self._rest[:] = unknowns
        self.set_load(self._load)

    def _by_region(self, section: SectionMesh, values: Mapping[str, float]) -> NDArray[np.float64]:
        by_cell = np.zeros_like(self.stiffness.x.array)
        for name, value in values.items():
            by_cell[section.cell_tags.find(section.regions[name])] = value
        return by_cell
