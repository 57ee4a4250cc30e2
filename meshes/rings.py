"""Concentric rings: sections simple enough to have solutions on paper, for verification."""

from collections.abc import Sequence

import gmsh
from mpi4py import MPI

from calfsocket.io.errors import InputError
from calfsocket.meshes import gmsh_model, tags
from calfsocket.meshes.distributed import SectionMesh, distribute
from calfsocket.meshes.triangles import TriangleMesh


def ring_mesh(
    comm: MPI.Comm,
    layers: Sequence[tuple[str, float, float]],
    socket: tuple[float, float] | None,
    h: float,
) -> SectionMesh:
    """Return a layered ring, and a socket ring around it, centred at the origin.

    Parameters
    ----------
    comm
        Ranks to distribute the mesh over.
    layers
        (name, inner radius, outer radius) in mm from the inside out, each starting where the one
        before it ends. The innermost circle is the boundary ``tibia_medullary``, the outermost
        ``skin_surface``; regions get the tags 1, 2, ... in this order.
    socket
        (inner radius, outer radius) in mm, or None. It may overlap the layers: the two bodies
        share no nodes.
    h
        Length of the triangles' sides, mm.
    """
    return distribute(comm, lambda: build(layers, socket, h))


def build(
    layers: Sequence[tuple[str, float, float]], socket: tuple[float, float] | None, h: float
) -> TriangleMesh:
    """Mesh the rings on this process; parameters as in `ring_mesh`."""
    _check(layers, socket, h)
    with gmsh_model.session("rings"):

        def circle(radius: float) -> int:
            edge: int = gmsh.model.occ.addCircle(0.0, 0.0, 0.0, radius)
            return edge

        circles = [circle(layers[0][1])]
        surfaces, edges = {}, {tags.TIBIA_MEDULLARY: [circles[0]]}
        for name, _, outer in layers:
            circles.append(circle(outer))
            surfaces[name] = gmsh_model.add_region(circles[-1], [circles[-2]])
        edges[tags.SKIN_SURFACE] = [circles[-1]]
        if socket is not None:
            inner, outer_face = circle(socket[0]), circle(socket[1])
            surfaces[tags.SOCKET] = gmsh_model.add_region(outer_face, [inner])
            edges |= {tags.SOCKET_INNER: [inner], tags.SOCKET_OUTER: [outer_face]}
        gmsh.model.occ.synchronize()
        region_tags = {name: number for number, (name, _, _) in enumerate(layers, start=1)}
        region_tags[tags.SOCKET] = tags.SOCKET_ID
        gmsh_model.name_regions(surfaces, edges, region_tags, tags.BOUNDARIES)
        gmsh.option.setNumber("Mesh.MeshSizeMin", h)
        gmsh.option.setNumber("Mesh.MeshSizeMax", h)
        gmsh_model.mesh_order2()
        return gmsh_model.extract()


def _check(
    layers: Sequence[tuple[str, float, float]], socket: tuple[float, float] | None, h: float
) -> None:
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
