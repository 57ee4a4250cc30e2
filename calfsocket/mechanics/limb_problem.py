"""The limb in its socket as a problem: constraints, contact, and what the socket rests on."""

from collections.abc import Callable, Mapping

from mpi4py import MPI

from calfsocket.contact.expanded import ExpandedSocket
from calfsocket.contact.interface import ContactInterface, ContactPair
from calfsocket.contact.parameters import Contact
from calfsocket.materials.laws import Law
from calfsocket.mechanics.constraints import Constraint
from calfsocket.mechanics.donning import Donning, SocketSupport
from calfsocket.mechanics.foundation import Foundation
from calfsocket.mechanics.problem import Problem
from calfsocket.meshes import tags
from calfsocket.meshes.distributed import SectionMesh

GUIDE_STIFFNESS = 1e-5
"""Foundation in N/mm^3 of a floating socket that does not touch the limb yet; it fades out with the
load."""

SUPPORT_STIFFNESS = 1e-7
"""Foundation of a floating socket in N/mm^3, only where no friction stops it from turning."""


def limb_problem(
    section: SectionMesh,
    laws: Mapping[str, Law],
    contact: Contact | None = None,
    support: SocketSupport = "floating",
    interface: Callable[..., ContactInterface] = ContactInterface,
    fading: Mapping[str, float] | None = None,
    donning: Donning = "gap",
) -> Problem:
    """Make the problem of a limb in a socket (collective).

    What meets in contact are the skin and the socket's inner face or, where the mesh has a liner,
    its free face and the one of the two that it is not bonded to. The limb is constrained at the
    tibia's medullary boundary. Sides of a piece of tissue, where the mesh has them, do not move in
    x.

    Parameters
    ----------
    section : SectionMesh
        Limb and socket.
    laws : mapping of region name to law
        The law of each region, "socket" among them.
    contact : Contact, optional
        Friction and Nitsche stiffness; the paper's unless given.
    support : {"floating", "outer-fixed"}
        Whether the socket rests on the limb alone, or is constrained at its outer face.
    interface : callable
        Makes the contact interface: how the overclosure is released; `ContactInterface` closes the
        gaps in proportion.
    fading : mapping of region name to float, optional
        Stiffness of an elastic foundation that fades out with the load, N/mm^3.
    donning : {"gap", "expanded"}
        Whether gaps are closed in proportion, or the socket starts wide, is moved over the limb and
        let go; the latter has an interface and a foundation of its own.
    """
    contact = contact or Contact()
    if donning == "expanded":
        interface, fading = ExpandedSocket, {tags.SOCKET: GUIDE_STIFFNESS}
    constraints = [Constraint(tags.TIBIA_MEDULLARY)]
    if support == "outer-fixed":
        constraints.append(Constraint(tags.SOCKET_OUTER))
    if tags.SIDES in section.boundaries:
        constraints.append(Constraint(tags.SIDES, (0,)))
    free_to_turn = support == "floating" and contact.friction == 0.0
    lasting = {tags.SOCKET: SUPPORT_STIFFNESS} if free_to_turn else {}
    return Problem(
        section,
        laws,
        constraints,
        contact=ContactPair(*contact_surfaces(section), contact, interface),
        foundation=Foundation(lasting, fading or {}) if lasting or fading else None,
    )


def contact_surfaces(section: SectionMesh) -> tuple[str, str]:
    """Return the boundary of the limb's side in contact, and that of the socket's (collective)."""
    return surfaces_with(tags.LINER in section.regions, bonded_to_limb(section))


def surfaces_with(liner: bool, on_limb: bool) -> tuple[str, str]:
    """Return the names of these boundaries, with or without a liner, on the limb or the socket."""
    return (
        tags.LINER_SURFACE if liner and on_limb else tags.SKIN_SURFACE,
        tags.LINER_SURFACE if liner and not on_limb else tags.SOCKET_INNER,
    )


def bonded_to_limb(section: SectionMesh) -> bool:
    """Whether the mesh has a liner that shares the skin's nodes (collective)."""
    if tags.LINER not in section.regions:
        return False
    topology = section.mesh.topology
    topology.create_connectivity(1, 2)
    facet_to_cell = topology.connectivity(1, 2)
    skin = section.facet_tags.find(section.boundaries[tags.SKIN_SURFACE])
    regions, liner = section.cell_regions(), section.regions[tags.LINER]
    mine = any((regions[facet_to_cell.links(facet)] == liner).any() for facet in skin)
    return bool(section.mesh.comm.allreduce(mine, op=MPI.LOR))
