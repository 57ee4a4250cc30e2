"""The section of a limb in a socket: two bodies, overlapping in space, in one mesh."""

import tempfile
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
import pandas as pd
from mpi4py import MPI
from scipy.optimize import minimize_scalar

from calfsocket.io.errors import InputError
from calfsocket.io.system import gmsh
from calfsocket.meshes import gmsh_model, sizing, store, tags
from calfsocket.meshes.curves import ClosedCurve
from calfsocket.meshes.distributed import SectionMesh, distribute
from calfsocket.meshes.limb import Limb, limb_curves
from calfsocket.meshes.lining import Lining, fitted
from calfsocket.meshes.plate import Plate, add_plate
from calfsocket.meshes.quality import quality_table
from calfsocket.meshes.refinement import RefinedSizes, Refinement
from calfsocket.meshes.sizing import MeshSize, SizeField, Sizes
from calfsocket.meshes.smoothing import smooth
from calfsocket.meshes.socket import Socket
from calfsocket.meshes.triangles import EQUILATERAL_AREA, SUBDIVISION, TriangleMesh


def section_mesh(
    comm: MPI.Comm,
    limb: Limb,
    socket: Socket,
    size: MeshSize,
    liner: Lining | None = None,
    refinement: Refinement | None = None,
    again: bool = True,
) -> SectionMesh:
    """Mesh a limb, a liner and a socket on rank 0 of `comm` and distribute it over its ranks.

    With a refinement, `size` has its number of triangles. Unless it is to be made `again`, a mesh
    without one that was made before is taken from the user's cache.

    Raises
    ------
    InputError
        On every rank, when the data cannot be meshed.
    """

    def make() -> TriangleMesh:
        return build(limb, socket, size, liner, refinement)

    if again or refinement:
        return distribute(comm, make)
    return distribute(comm, lambda: store.stored(store.name_of(limb, socket, size, liner), make))


def build(
    limb: Limb,
    socket: Socket,
    size: MeshSize,
    liner: Lining | None = None,
    refinement: Refinement | None = None,
) -> TriangleMesh:
    """Mesh a limb and a socket on this process; the same input gives the same arrays."""
    with _Section(limb, socket, liner, refinement).meshed(size) as mesh:
        return smooth(mesh)


def write_section(path: Path | str, limb: Limb, socket: Socket, size: MeshSize) -> pd.DataFrame:
    """Write the mesh, with its names, as a gmsh file; return the table of `quality_table`.

    The file appears whole or not at all, and the same input gives the same bytes.
    """
    path = Path(path)
    if path.suffix != ".msh":
        raise InputError(f"{path}: meshes are gmsh files; use a name that ends in .msh")
    if not path.parent.is_dir():
        raise InputError(f"{path}: no folder {path.parent}; create it first")
    with (
        _Section(limb, socket).meshed(size) as mesh,
        tempfile.TemporaryDirectory(dir=path.parent) as folder,
    ):
        mesh = smooth(mesh)
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


class _Section:
    """A limb, a socket and perhaps a liner between them, to be meshed."""

    def __init__(
        self,
        limb: Limb,
        socket: Socket,
        liner: Lining | None = None,
        refinement: Refinement | None = None,
    ) -> None:
        self._limb, self._liner = limb, liner
        self._fit = fit = fitted(limb, socket, liner)
        self._loops = limb_curves(limb)
        faces, meets, loops = [fit.inner, fit.outer], limb.contact_boundary, self._loops
        if liner is not None and fit.lining is not None:
            if liner.bonded == "limb":
                meets = tags.LINER_SURFACE
                loops = {**loops, meets: fit.lining}
            else:
                faces.insert(0, fit.lining)
        self._limb_sizes: Sizes = sizing.LimbSizes(loops, meets)
        self._socket_faces = sizing.SocketSizes(*faces, skin=loops[meets])
        self._socket_sizes: Sizes = self._socket_faces
        self._is_refined = refinement is not None
        if refinement is not None:
            self._limb_sizes = RefinedSizes(refinement.first, self._limb_sizes, refinement.limb)
            self._socket_sizes = RefinedSizes(
                refinement.first, self._socket_sizes, refinement.socket
            )
        self._fields: tuple[MeshSize | None, tuple[SizeField, SizeField] | None] = (None, None)

    @contextmanager
    def meshed(self, size: MeshSize) -> Iterator[TriangleMesh]:
        """Give the mesh, its nodes as gmsh has them, while gmsh has it as its model."""
        found: list[TriangleMesh] = []
        with ExitStack() as model:

            def count(trial: MeshSize) -> int:
                model.close()  # that of the trial before
                model.enter_context(gmsh_model.session("section"))
                self.generate(trial)
                found.append(gmsh_model.extract())
                return len(found[-1].cells)

            size.for_triangles(count, lambda trial: self._room(found[-1], trial))
            if not found:
                count(size)
            yield found[-1]

    def _sizes(self, size: MeshSize) -> tuple[SizeField, SizeField]:
        """Sizes on the limb's side and on the socket's; those of the last size are kept."""
        if size != self._fields[0] or self._fields[1] is None:
            on_limb, on_socket = self._limb_sizes.field(size), self._socket_sizes.field(size)
            if self._is_refined:
                on_socket = self._socket_faces.matched(on_socket, on_limb, size)
            self._fields = size, (on_limb, on_socket)
            return on_limb, on_socket
        return self._fields[1]

    def _room(self, mesh: TriangleMesh, size: MeshSize) -> float:
        """Return how many equilateral triangles of a size have the area of a mesh."""
        with_socket = [tags.SOCKET]
        if self._liner is not None and self._liner.bonded == "socket":
            with_socket.append(tags.LINER)
        of_socket = np.isin(mesh.cell_tags, [mesh.regions[name] for name in with_socket])
        corners = mesh.points[mesh.cells[:, :3]]
        a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        area = 0.5 * np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
        points = np.einsum("qv,mvc->mqc", SUBDIVISION, corners)
        density = np.empty(len(area))
        for field, at in zip(self._sizes(size), (~of_socket, of_socket), strict=True):
            wanted = field.at(points[at].reshape(-1, 2)).reshape(-1, len(SUBDIVISION))
            density[at] = (wanted**-2.0).mean(axis=1)
        return float((area * density).sum() / EQUILATERAL_AREA)

    def generate(self, size: MeshSize) -> None:
        """Mesh in the current gmsh model, with named physical groups.

        A liner shares its nodes with what it is bonded to. The nodes are gmsh's, before `smooth`.
        """
        limb, fit, liner = self._limb, self._fit, self._liner
        surfaces, boundaries = _add_limb(limb, self._loops)
        limb_surfaces = list(surfaces.values())
        inner_edge, outer_edge = [gmsh_model.add_loop(fit.inner)], [gmsh_model.add_loop(fit.outer)]
        surfaces[tags.SOCKET] = gmsh_model.add_region(outer_edge, inner_edge)
        socket_surfaces = [surfaces[tags.SOCKET]]
        if liner is not None and fit.lining is not None:
            edge = [gmsh_model.add_loop(fit.lining)]
            boundaries[tags.LINER_SURFACE] = edge
            if liner.bonded == "limb":
                surfaces[tags.LINER] = gmsh_model.add_region(edge, boundaries[tags.SKIN_SURFACE])
                limb_surfaces.append(surfaces[tags.LINER])
            else:
                surfaces[tags.LINER] = gmsh_model.add_region(inner_edge, edge)
                socket_surfaces.append(surfaces[tags.LINER])
        on_limb, on_socket = self._sizes(size)
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
        field = sizing.LimbSizes(loops, limb.contact_boundary).field(size)
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
