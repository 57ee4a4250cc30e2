"""The section of a limb in a socket: two bodies, overlapping in space, in one mesh."""

import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd
from mpi4py import MPI
from scipy.optimize import minimize_scalar

from calfsocket.io.errors import InputError
from calfsocket.io.system import gmsh
from calfsocket.meshes import gmsh_model, sizing, tags
from calfsocket.meshes.curves import ClosedCurve
from calfsocket.meshes.distributed import SectionMesh, distribute
from calfsocket.meshes.limb import Limb, limb_curves
from calfsocket.meshes.lining import Lining, fitted
from calfsocket.meshes.plate import Plate, add_plate
from calfsocket.meshes.quality import quality_table
from calfsocket.meshes.sizing import MeshSize, SizeField
from calfsocket.meshes.smoothing import smooth
from calfsocket.meshes.socket import Socket
from calfsocket.meshes.triangles import TriangleMesh


def section_mesh(
    comm: MPI.Comm, limb: Limb, socket: Socket, size: MeshSize, liner: Lining | None = None
) -> SectionMesh:
    """Mesh a limb, a liner and a socket on rank 0 of `comm` and distribute it over its ranks.

    Raises
    ------
    InputError
        On every rank, when the data cannot be meshed.
    """
    return distribute(comm, lambda: build(limb, socket, size, liner))


def build(limb: Limb, socket: Socket, size: MeshSize, liner: Lining | None = None) -> TriangleMesh:
    """Mesh a limb and a socket on this process; the same input gives the same arrays."""
    size = final_size(limb, socket, size, liner)
    with gmsh_model.session("section"):
        generate(limb, socket, size, liner)
        return smooth(gmsh_model.extract())


def final_size(limb: Limb, socket: Socket, size: MeshSize, liner: Lining | None = None) -> MeshSize:
    """Replace a size that is a number of triangles by one in mm, by trial meshes."""

    def count(trial: MeshSize) -> int:
        with gmsh_model.session("trial"):
            generate(limb, socket, trial, liner)
            return len(gmsh_model.extract().cells)

    return size.for_triangles(count)


def write_section(path: Path | str, limb: Limb, socket: Socket, size: MeshSize) -> pd.DataFrame:
    """Write the mesh, with its names, as a gmsh file; return the table of `quality_table`.

    The file appears whole or not at all, and the same input gives the same bytes.
    """
    path = Path(path)
    if path.suffix != ".msh":
        raise InputError(f"{path}: meshes are gmsh files; use a name that ends in .msh")
    if not path.parent.is_dir():
        raise InputError(f"{path}: no folder {path.parent}; create it first")
    size = final_size(limb, socket, size)
    with gmsh_model.session("section"), tempfile.TemporaryDirectory(dir=path.parent) as folder:
        generate(limb, socket, size)
        mesh = smooth(gmsh_model.extract())
        gmsh_model.move_nodes(mesh.points)
        unfinished = Path(folder) / path.name
        gmsh.write(str(unfinished))
        unfinished.replace(path)
    inner, outer = socket.faces(limb)
    return quality_table(
        mesh,
        limb.tissues | {tags.SOCKET: tags.SOCKET},
        limb.areas | {tags.SOCKET: outer.area - inner.area},
    )


def generate(limb: Limb, socket: Socket, size: MeshSize, liner: Lining | None = None) -> None:
    """Mesh a limb and a socket in the current gmsh model, with named physical groups.

    A liner shares its nodes with what it is bonded to. The nodes are gmsh's, before `smooth`.
    """
    loops = limb_curves(limb)
    fit = fitted(limb, socket, liner)
    surfaces, boundaries = _add_limb(limb, loops)
    limb_surfaces = list(surfaces.values())
    inner_edge, outer_edge = [gmsh_model.add_loop(fit.inner)], [gmsh_model.add_loop(fit.outer)]
    surfaces[tags.SOCKET] = gmsh_model.add_region(outer_edge, inner_edge)
    socket_surfaces, faces = [surfaces[tags.SOCKET]], [fit.inner, fit.outer]
    meets = limb.contact_boundary
    if liner is not None and fit.lining is not None:
        edge = [gmsh_model.add_loop(fit.lining)]
        boundaries[tags.LINER_SURFACE] = edge
        if liner.bonded == "limb":
            surfaces[tags.LINER] = gmsh_model.add_region(edge, boundaries[tags.SKIN_SURFACE])
            limb_surfaces.append(surfaces[tags.LINER])
            meets = tags.LINER_SURFACE
            loops = {**loops, meets: fit.lining}
        else:
            surfaces[tags.LINER] = gmsh_model.add_region(inner_edge, edge)
            socket_surfaces.append(surfaces[tags.LINER])
            faces.insert(0, fit.lining)
    on_limb = sizing.limb_field(loops, meets, size)
    on_socket = sizing.socket_field(*faces, size=size)
    with tempfile.TemporaryDirectory() as folder:
        gmsh_model.mesh(
            surfaces,
            boundaries | {tags.SOCKET_INNER: inner_edge, tags.SOCKET_OUTER: outer_edge},
            lambda: [
                _add_size(folder, on_limb, limb_surfaces),
                _add_size(folder, on_socket, socket_surfaces),
            ],
            limb.region_tags,
        )


def plated_limb_mesh(comm: MPI.Comm, limb: Limb, plate: Plate, size: MeshSize) -> SectionMesh:
    """Mesh a limb and a plate that touches its hindmost point from behind, on all ranks."""
    return distribute(comm, lambda: build_plated_limb(limb, plate, size))


def build_plated_limb(limb: Limb, plate: Plate, size: MeshSize) -> TriangleMesh:
    """Mesh a limb and a plate behind it on this process."""
    loops = limb_curves(limb)
    skin = loops[limb.contact_boundary]
    t = skin.sample(1.0)
    near = int(np.argmin(skin.evaluate(t)[:, 1]))
    bracket = t[near - 1], t[near], t[(near + 1) % len(t)]
    lowest = minimize_scalar(lambda t: skin.evaluate(t)[1], bracket=bracket, tol=1e-12)
    x, y = skin.evaluate(lowest.x)
    with gmsh_model.session("limb on plate"), tempfile.TemporaryDirectory() as folder:
        surfaces, boundaries = _add_limb(limb, loops)
        limb_surfaces = list(surfaces.values())
        surface, face, back = add_plate(plate, x, y, side=-1)
        field = sizing.limb_field(loops, limb.contact_boundary, size)
        gmsh_model.mesh(
            surfaces | {tags.SOCKET: surface},
            boundaries | {tags.SOCKET_INNER: face, tags.SOCKET_OUTER: back},
            lambda: [
                _add_size(folder, field, limb_surfaces),
                gmsh_model.add_field("Constant", SurfacesList=[surface], VIn=size.socket_outer),
            ],
            limb.region_tags,
        )
        return smooth(gmsh_model.extract())


def _add_limb(
    limb: Limb, loops: Mapping[str, ClosedCurve]
) -> tuple[dict[str, int], dict[str, list[int]]]:
    """Add the regions of a limb; return their surfaces and the edges of the named boundaries."""
    edges = {name: [gmsh_model.add_loop(curve)] for name, curve in loops.items()}
    surfaces = {
        region.name: gmsh_model.add_region(*(edges[loop] for loop in region.loops))
        for region in limb.regions
    }
    return surfaces, {
        tags.SKIN_SURFACE: edges[limb.contact_boundary],
        tags.TIBIA_MEDULLARY: edges[limb.fixed_boundary],
    }


def _add_size(folder: str, size: SizeField, surfaces: list[int]) -> int:
    """Add a size field for some surfaces and their edges only, for the bodies overlap in space.

    gmsh reads its file, in the folder, when it meshes.
    """
    path = Path(folder) / f"{surfaces[0]}.bin"
    size.write(path)
    structured = gmsh_model.add_field("Structured", FileName=str(path))
    return gmsh_model.add_field("Restrict", InField=structured, SurfacesList=surfaces)
