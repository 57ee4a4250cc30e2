"""The calf, its curves, and meshes of it that are built once a session."""

from functools import cache

from calfsocket.meshes import section
from calfsocket.meshes.limb import Limb, limb_curves
from calfsocket.meshes.sizing import mesh_size
from calfsocket.meshes.socket import Socket
from calfsocket.meshes.triangles import TriangleMesh

LIMB = Limb.reference()
LOOPS = limb_curves(LIMB)
SKIN = LOOPS["skin_outline"]


@cache
def section_of(socket: str, size: str = "coarse") -> TriangleMesh:
    """Mesh of the calf in a socket of the paper."""
    return section.build(LIMB, Socket.reference(socket), mesh_size(size))
