"""The skin under a liner that is bonded to it: its traction, as contact would have it."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from dolfinx import fem

from calfsocket.contact.interface import ContactInterface, ContactPair, Face, FloatArray
from calfsocket.materials.fields import LawFields
from calfsocket.materials.law import Law
from calfsocket.meshes import tags
from calfsocket.meshes.distributed import SectionMesh


@dataclass(frozen=True)
class BondedTraction:
    """Traction on the skin per undeformed area, MPa, at its points; (n,).

    Pressure is negative where the liner pulls, and shear counts along the skin as in contact.
    """

    pressure: FloatArray
    shear: FloatArray


class BondedSkin(ContactInterface):
    """Skin and liner, which share their nodes, as two sides of one interface.

    It is an interface whose sides stay together: nothing is assembled of it. The traction is that
    of the skin's own stress.
    """

    def __init__(
        self, w: fem.Function, section: SectionMesh, laws: Mapping[str, Law], fields: LawFields
    ) -> None:
        super().__init__(w, section, laws, fields, ContactPair(tags.SKIN_SURFACE, tags.LINER))

    def _sides(
        self,
        V: fem.FunctionSpace,
        section: SectionMesh,
        laws: Mapping[str, Law],
        pair: ContactPair,
    ) -> tuple[str, Face, Face]:
        regions, liner = section.cell_regions(), section.regions[tags.LINER]
        tag = section.boundaries[pair.skin]
        skin, other = (
            Face.of(V, section.facet_tags, tag, side)
            for side in (regions != liner, regions == liner)
        )
        there = section.mesh.comm.allgather({int(regions[cell]) for cell in skin.entities[:, 0]})
        names = {number: name for name, number in section.regions.items()}
        return min(names[number] for part in there for number in part), skin, other

    def traction(self) -> BondedTraction:
        """Return the traction on the skin at the present unknowns (collective)."""
        at = self.chain.project(self.deformed_points(), self.socket_displacement())
        T = self.nominal_traction()
        pressure, shear = (np.sum(T * n, axis=1) for n in (at.normal, at.tangent))
        return BondedTraction(pressure, shear)
