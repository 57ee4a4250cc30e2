"""What the plate presses: the compound of layers and compartments, or the limb's own section."""

from dataclasses import dataclass

from mpi4py import MPI

from calfsocket.meshes import tags
from calfsocket.meshes.compound import Compound, compound_mesh
from calfsocket.meshes.distributed import SectionMesh
from calfsocket.meshes.limb import Limb
from calfsocket.meshes.plate import Plate
from calfsocket.meshes.section import plated_limb_mesh
from calfsocket.meshes.sizing import MeshSize

LIMB_PLATE = Plate(width=90.0, edge_radius=8.0, thickness=12.0)
"""Wider than the limb's flank that it presses, so that its edges stay clear of the skin, mm."""

LIMB_STROKE = 8.0
"""A sixth of what lies between the calf's skin and the bones, mm."""


@dataclass(frozen=True)
class Specimen:
    """A piece of tissue and the plate that presses it."""

    name: str  #: "compound" or "limb"
    section: SectionMesh
    """Tissues and plate (region "socket"), which touch in a point or a line."""
    tissues: dict[str, str]  #: tissue of each region
    direction: tuple[float, float]  #: unit vector of the plate's way into the tissue
    stroke: float  #: length of that way, mm


def compound_specimen(comm: MPI.Comm, compound: Compound, size: MeshSize) -> Specimen:
    """Mesh a compound, pressed from above (collective)."""
    section = compound_mesh(comm, compound, size)
    return Specimen("compound", section, compound.tissues, (0.0, -1.0), compound.stroke)


def limb_specimen(comm: MPI.Comm, limb: Limb, size: MeshSize) -> Specimen:
    """Mesh a limb, pressed from behind while its tibia is constrained (collective)."""
    section = plated_limb_mesh(comm, limb, LIMB_PLATE, size)
    tissues = limb.tissues | {tags.SOCKET: tags.SOCKET}
    return Specimen("limb", section, tissues, (0.0, 1.0), LIMB_STROKE)
