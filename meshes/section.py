"""The section of a limb in a socket: two bodies, overlapping in space, in one mesh."""

import tempfile
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import minimize_scalar

from calfsocket.io.errors import InputError
from calfsocket.io.system import gmsh
from calfsocket.meshes import gmsh_model, sizing, store, tags
from calfsocket.meshes.curves import ClosedCurve
from calfsocket.meshes.given import joined
from calfsocket.meshes.limb import Limb, limb_curves
from calfsocket.meshes.lining import Lining, fitted
from calfsocket.meshes.placement import check_liner_between, check_size_of_rest
from calfsocket.meshes.plate import Plate, add_plate
from calfsocket.meshes.quality import quality_table
from calfsocket.meshes.refinement import RefinedSizes, Refinement
from calfsocket.meshes.sizing import MeshSize, SizeField, Sizes
from calfsocket.meshes.smoothing import smooth
from calfsocket.meshes.socket import MeshedSocket, Socket
from calfsocket.meshes.triangles import EQUILATERAL_AREA, SUBDIVISION, TriangleMesh

if TYPE_CHECKING:
    import pandas as pd
    from mpi4py import MPI

    from calfsocket.meshes.distributed import SectionMesh


def section_mesh(
    comm: "MPI.Comm",
    limb: Limb,
    socket: Socket,
    size: MeshSize,
    liner: Lining | None = None,
    refinement: Refinement | None = None,
    again: bool = True,
) -> "SectionMesh":
    """Mesh a limb, a liner and a socket on rank 0 of `comm` and distribute it over its ranks.

    With a refinement, `size` has its number of triangles. Unless it is to be made `again`, a mesh
    without one that was made before is taken from the user's cache.

    Raises
    ------
    InputError
        On every rank, when the data cannot be meshed.
    """
    from calfsocket.meshes.distributed import distribute  # dolfinx, which a mesh file does without

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
    """Mesh a limb and a socket on this process; the same input gives the same arrays.

    A body with a mesh of its own keeps it.
    """
    check_size_of_rest(limb, socket, size)
    check_liner_between(limb, socket, liner)
    given = []
    if limb.mesh is not None:
        given.append(limb.mesh.triangles(limb.region_tags))
    if isinstance(socket, MeshedSocket):
        given.append(socket.mesh.triangles({tags.SOCKET: tags.SOCKET_ID}))
    if len(given) == 2:
        return joined(*given)
    with _Section(limb, socket, liner, refinement).meshed(size) as mesh:
        made = smooth(mesh)
    if not given:
        return made
    return joined(given[0], made) if limb.mesh is not None else joined(made, given[0])


def write_section(path: Path | str, limb: Limb, socket: Socket, size: MeshSize) -> "pd.DataFrame":
    """Write the mesh, with its names, as a gmsh file; return the table of `quality_table`.

    The file appears whole or not at all, and the same input gives the same bytes.
    """
    path = Path(path)
    if limb.mesh is not None or isinstance(socket, MeshedSocket):
        raise InputError("has a mesh of its own; write the case by `calfsocket export` instead")
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
    """A limb, a socket and perhaps a liner between them, to be meshed.

    One of the two bodies may have a mesh of its own; it is left out.
    """

    def __init__(
        self,
        limb: Limb,
        socket: Socket,
        liner: Lining | None = None,
        refinement: Refinement | None = None,
    ) -> None:
        self._limb, self._liner = limb, liner
        self._has_limb = limb.mesh is None
        self._has_socket = not isinstance(socket, MeshedSocket)
        self._fit = fit = fitted(limb, socket, liner)
        self._loops = limb_curves(limb)
        faces, meets, loops = [fit.inner, fit.outer], limb.contact_boundary, self._loops
        if liner is not None and fit.lining is not None:
            if liner.bonded == "limb":
                meets = tags.LINER_SURFACE
                loops = {**loops, meets: fit.lining}
            else:
                faces.insert(0, fit.lining)
        socket_faces = sizing.SocketSizes(*faces, skin=loops[meets])
        #: On the limb's side, and on the socket's, of those that are meshed here.
        self._body_sizes: list[Sizes] = []
        if self._has_limb:
            self._body_sizes.append(sizing.LimbSizes(loops, meets))
        if self._has_socket:
            self._body_sizes.append(socket_faces)
        #: Of a refined mesh, in which both are meshed here.
        self._faces_to_match: sizing.SocketSizes | None = None
        if refinement is not None:
            wanted = refinement.limb, refinement.socket
            self._body_sizes = [
                RefinedSizes(refinement.first, own, its)
                for own, its in zip(self._body_sizes, wanted, strict=True)
            ]
            self._faces_to_match = socket_faces
        self._fields: tuple[MeshSize | None, list[SizeField]] = (None, [])

    @contextmanager
    def meshed(self, size: MeshSize) -> Iterator[TriangleMesh]:
        """Give the mesh, its nodes as gmsh has them, while gmsh has it as its model."""
        with ExitStack() as model:

            def generate(trial: MeshSize) -> None:
                model.close()  # that of the trial before
                model.enter_context(gmsh_model.session("section"))
                self.generate(trial)

            trials: list[TriangleMesh] = []

            def count(trial: MeshSize) -> int:
                generate(trial)
                trials.append(gmsh_model.extract())
                return len(trials[-1].cells)

            size.for_triangles(count, lambda trial: self._room(trials[-1], trial))
            if not trials:
                generate(size)
            gmsh_model.curve()  # the last one alone
            yield gmsh_model.extract()

    def _sizes(self, size: MeshSize) -> list[SizeField]:
        """Sizes on the limb's side and on the socket's; those of the last size are kept."""
        if size != self._fields[0]:
            fields = [sizes.field(size) for sizes in self._body_sizes]
            if self._faces_to_match is not None:
                on_limb, on_socket = fields
                fields = [on_limb, self._faces_to_match.matched(on_socket, on_limb, size)]
            self._fields = size, fields
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
        """Mesh in the current gmsh model, with named physical groups and straight triangles.

        A liner shares its nodes with what it is bonded to. The nodes are gmsh's, before `smooth`.
        """
        limb, fit, liner = self._limb, self._fit, self._liner
        surfaces: dict[str, int] = {}
        boundaries: dict[str, list[int]] = {}
        if self._has_limb:
            surfaces, boundaries = _add_limb(limb, self._loops)
        limb_surfaces, socket_surfaces = list(surfaces.values()), list[int]()
        if self._has_socket:
            inner_edge = [gmsh_model.add_loop(fit.inner)]
            outer_edge = [gmsh_model.add_loop(fit.outer)]
            surfaces[tags.SOCKET] = gmsh_model.add_region(outer_edge, inner_edge)
            socket_surfaces.append(surfaces[tags.SOCKET])
            boundaries |= {tags.SOCKET_INNER: inner_edge, tags.SOCKET_OUTER: outer_edge}
        if liner is not None and fit.lining is not None:
            edge = [gmsh_model.add_loop(fit.lining)]
            boundaries[tags.LINER_SURFACE] = edge
            if liner.bonded == "limb":
                surfaces[tags.LINER] = gmsh_model.add_region(edge, boundaries[tags.SKIN_SURFACE])
                limb_surfaces.append(surfaces[tags.LINER])
            else:
                surfaces[tags.LINER] = gmsh_model.add_region(inner_edge, edge)
                socket_surfaces.append(surfaces[tags.LINER])
        bodies = [parts for parts in (limb_surfaces, socket_surfaces) if parts]
        fields = list(zip(self._sizes(size), bodies, strict=True))
        with tempfile.TemporaryDirectory() as folder:
            gmsh_model.mesh(
                surfaces,
                boundaries,
                lambda: [_add_size(folder, field, parts) for field, parts in fields],
                limb.region_tags,
                curved=False,
            )


def plated_limb_mesh(comm: "MPI.Comm", limb: Limb, plate: Plate, size: MeshSize) -> "SectionMesh":
    """Mesh a limb and a plate that touches its hindmost point from behind, on all ranks."""
    from calfsocket.meshes.distributed import distribute

    return distribute(comm, lambda: build_plated_limb(limb, plate, size))


def build_plated_limb(limb: Limb, plate: Plate, size: MeshSize) -> TriangleMesh:
    """Mesh a limb and a plate behind it on this process."""
    if limb.mesh is not None:
        raise InputError("limb: has a mesh of its own, which no plate is meshed to; give outlines")
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
