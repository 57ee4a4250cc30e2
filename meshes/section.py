"""The section of a limb in a socket: two bodies, overlapping in space, in one mesh."""

import tempfile
from pathlib import Path

import gmsh
import pandas as pd
from mpi4py import MPI

from calfsocket.errors import InputError
from calfsocket.meshes import gmsh_model, sizing, tags
from calfsocket.meshes.data import Limb, Socket, Sockets, load_limb, load_sockets
from calfsocket.meshes.distributed import SectionMesh, distribute
from calfsocket.meshes.loops import limb_curves
from calfsocket.meshes.quality import quality_table
from calfsocket.meshes.sizing import MeshSize, SizeField
from calfsocket.meshes.smoothing import smooth
from calfsocket.meshes.sockets import socket_faces
from calfsocket.meshes.triangles import TriangleMesh


def section_mesh(comm: MPI.Comm, limb: Limb, socket: Socket, size: MeshSize) -> SectionMesh:
    """Mesh a limb and a socket on rank 0 of `comm` and distribute the mesh over its ranks.

    Raises
    ------
    InputError
        On every rank, when the data cannot be meshed.
    """
    return distribute(comm, lambda: build(limb, socket, size))


def build(limb: Limb, socket: Socket, size: MeshSize) -> TriangleMesh:
    """Mesh a limb and a socket on this process; the same input gives the same arrays."""
    with gmsh_model.session("section"):
        generate(limb, socket, size)
        return smooth(gmsh_model.extract())


def write_section(
    path: Path | str,
    socket_name: str,
    size_name: str,
    limb: Limb | None = None,
    sockets: Sockets | None = None,
) -> pd.DataFrame:
    """Write the mesh, with its names, as a gmsh file; return the table of `quality_table`.

    The limb and the sockets are those of the package unless others are given. The file appears
    whole or not at all, and the same input gives the same bytes.
    """
    path = Path(path)
    limb = limb or load_limb()
    socket = (sockets or load_sockets()).socket(socket_name)
    size = sizing.mesh_size(size_name)
    if path.suffix != ".msh":
        raise InputError(f"{path}: meshes are written as gmsh files; let the name end in .msh")
    if not path.parent.is_dir():
        raise InputError(f"{path}: no folder {path.parent}; create it first")
    with gmsh_model.session("section"), tempfile.TemporaryDirectory(dir=path.parent) as folder:
        generate(limb, socket, size)
        mesh = smooth(gmsh_model.extract())
        gmsh_model.move_nodes(mesh.points)
        unfinished = Path(folder) / path.name
        gmsh.write(str(unfinished))
        unfinished.replace(path)
    inner, outer = socket_faces(socket, limb_curves(limb)[limb.contact_boundary])
    return quality_table(
        mesh,
        {region.name: region.tissue for region in limb.regions} | {tags.SOCKET: tags.SOCKET},
        {region.name: region.area for region in limb.regions}
        | {tags.SOCKET: outer.area - inner.area},
    )


def generate(limb: Limb, socket: Socket, size: MeshSize) -> None:
    """Mesh a limb and a socket in the current gmsh model, with named physical groups.

    The nodes are gmsh's, before `smooth`.
    """
    loops = limb_curves(limb)
    skin = loops[limb.contact_boundary]
    inner, outer = socket_faces(socket, skin)

    edges = {name: gmsh_model.add_loop(curve) for name, curve in loops.items()}
    surfaces = {
        region.name: gmsh_model.add_region(
            edges[region.outer], [edges[hole] for hole in region.holes]
        )
        for region in limb.regions
    }
    inner_edge, outer_edge = gmsh_model.add_loop(inner), gmsh_model.add_loop(outer)
    socket_surface = gmsh_model.add_region(outer_edge, [inner_edge])
    gmsh.model.occ.synchronize()

    gmsh_model.name_regions(
        surfaces | {tags.SOCKET: socket_surface},
        {
            tags.SKIN_SURFACE: edges[limb.contact_boundary],
            tags.SOCKET_INNER: inner_edge,
            tags.SOCKET_OUTER: outer_edge,
            tags.TIBIA_MEDULLARY: edges[limb.fixed_boundary],
        },
        limb.region_tags | {tags.SOCKET: tags.SOCKET_ID},
        tags.BOUNDARIES,
    )
    with tempfile.TemporaryDirectory() as folder:
        _set_size(
            Path(folder),
            [
                (sizing.limb_field(loops, limb.contact_boundary, size), list(surfaces.values())),
                (sizing.socket_field(inner, outer, size), [socket_surface]),
            ],
        )
        gmsh_model.mesh_order2()


def _set_size(folder: Path, bodies: list[tuple[SizeField, list[int]]]) -> None:
    """Make the size of each body the background field on its surfaces and their edges only.

    The bodies overlap in space, so each has a field of its own. gmsh reads the files in `folder`
    when it meshes.
    """
    fields = gmsh.model.mesh.field
    restricted = []
    for number, (size_field, surfaces) in enumerate(bodies):
        path = folder / f"size{number}.bin"
        size_field.write(path)
        structured = fields.add("Structured")
        fields.setString(structured, "FileName", str(path))
        restrict = fields.add("Restrict")
        fields.setNumber(restrict, "InField", structured)
        fields.setNumbers(restrict, "SurfacesList", surfaces)
        restricted.append(restrict)
    smallest = fields.add("Min")
    fields.setNumbers(smallest, "FieldsList", restricted)
    fields.setAsBackgroundMesh(smallest)
