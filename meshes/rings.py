"""Concentric rings: sections simple enough to have solutions on paper, for verification."""

from collections.abc import Sequence
from itertools import pairwise

from mpi4py import MPI

from calfsocket.io.errors import InputError
from calfsocket.meshes import gmsh_model, tags
from calfsocket.meshes.distributed import SectionMesh, distribute
from calfsocket.meshes.triangles import TriangleMesh

Layer = tuple[str, float, float]
"""Name, inner radius and outer radius, mm."""


def ring_mesh(
    comm: MPI.Comm,
    layers: Sequence[Layer],
    socket: tuple[float, float] | None,
    h: float | tuple[float, float],
    turn: float = 0.0,
    lining: float = 0.0,
) -> SectionMesh:
    """Return a layered ring, and a socket ring around it, centred at the origin.

    Parameters
    ----------
    comm
        Ranks to distribute the mesh over.
    layers
        (name, inner radius, outer radius) in mm from the inside out, each starting where the one
        before it ends. The innermost circle is the boundary ``tibia_medullary``, the outermost
        ``skin_surface``; regions get the tags 1, 2, ... in this order. Outside a last layer
        ``liner`` it is ``liner_surface``, and inside it ``skin_surface``.
    socket
        (inner radius, outer radius) in mm, or None. It may overlap the layers: the two bodies
        share no nodes.
    h
        Length of the triangles' sides, mm, of both bodies or of each.
    turn
        Angle at which the socket's numbering starts, rad: it turns the nodes of its faces.
    lining
        Thickness of a ``liner`` inside the socket, which shares its nodes, mm; 0 without one.
    """
    return distribute(comm, lambda: build(layers, socket, h, turn, lining))


def build(
    layers: Sequence[Layer],
    socket: tuple[float, float] | None,
    h: float | tuple[float, float],
    turn: float = 0.0,
    lining: float = 0.0,
) -> TriangleMesh:
    """Mesh the rings on this process; parameters as in `ring_mesh`."""
    h_limb, h_socket = h if isinstance(h, tuple) else (h, h)
    _check(layers, socket, min(h_limb, h_socket))
    with gmsh_model.session("rings"):
        radii = [layers[0][1], *(outer for _, _, outer in layers)]
        circles = [[gmsh_model.add_circle(radius)] for radius in radii]
        surfaces = {
            name: gmsh_model.add_region(outer, inner)
            for (name, _, _), (inner, outer) in zip(layers, pairwise(circles), strict=True)
        }
        sizes = [(h_limb, list(surfaces.values()))]
        edges = {tags.TIBIA_MEDULLARY: circles[0], tags.SKIN_SURFACE: circles[-1]}
        if layers[-1][0] == tags.LINER:
            edges |= {tags.SKIN_SURFACE: circles[-2], tags.LINER_SURFACE: circles[-1]}
        if socket is not None:
            inner, outer = ([gmsh_model.add_circle(radius, turn=turn)] for radius in socket)
            surfaces[tags.SOCKET] = gmsh_model.add_region(outer, inner)
            edges |= {tags.SOCKET_INNER: inner, tags.SOCKET_OUTER: outer}
            if lining:
                edges[tags.LINER_SURFACE] = [gmsh_model.add_circle(socket[0] - lining, turn=turn)]
                surfaces[tags.LINER] = gmsh_model.add_region(inner, edges[tags.LINER_SURFACE])
            added = [surfaces[name] for name in (tags.SOCKET, tags.LINER) if name in surfaces]
            sizes.append((h_socket, added))
        gmsh_model.mesh(
            surfaces,
            edges,
            lambda: [
                gmsh_model.add_field("Constant", SurfacesList=surfaces, VIn=side)
                for side, surfaces in sizes
            ],
        )
        return gmsh_model.extract()


def _check(layers: Sequence[Layer], socket: tuple[float, float] | None, h: float) -> None:
    """Raise an InputError unless the radii increase from layer to layer without gaps."""
    if not layers:
        raise InputError("rings: no layers; give at least one (name, inner radius, outer radius)")
    names = [name for name, _, _ in layers]
    if len(set(names)) < len(names) or tags.SOCKET in names:
        raise InputError(
            f"rings: layer names {', '.join(names)} must differ, and not be '{tags.SOCKET}'"
        )
    radius = layers[0][1]
    for name, inner, outer in [*layers, *([(tags.SOCKET, *socket)] if socket else [])]:
        if not 0 < inner < outer:
            raise InputError(f"rings: {name}: radii {inner} and {outer} mm; need 0 < inner < outer")
        if name != tags.SOCKET and inner != radius:
            raise InputError(
                f"rings: {name} starts at {inner} mm, not at {radius} mm like its neighbour"
            )
        radius = outer
    if h <= 0:
        raise InputError(f"rings: element size {h} mm; need a positive length")
