"""A socket with a mesh that was made elsewhere and is solved as it is."""

from pathlib import Path
from typing import Any

import numpy as np

import calfsocket
from calfsocket.imaging.mesh.body import laid_onto, packed, read_body, ring
from calfsocket.imaging.mesh.plane_mesh import ON_CURVE, plane_mesh
from calfsocket.imaging.mesh.sets import Sets
from calfsocket.imaging.plane import Plane
from calfsocket.imaging.source import sha256
from calfsocket.io.errors import InputError, error_context
from calfsocket.meshes import limb as meshes
from calfsocket.meshes import tags
from calfsocket.meshes.curves import ClosedCurve, through
from calfsocket.meshes.socket import MeshedSocket, MeshProvenance, Socket


def socket_of_mesh(
    path: Path | str,
    limb: meshes.Limb,
    sets: Sets | Path | str | None = None,
    *,
    units: str = "mm",
    data: str | None = None,
    geometry: Socket | Path | str | None = None,
    tolerance: float = ON_CURVE,
    **socket: Any,
) -> MeshedSocket:
    """Make a socket of the mesh of its wall; parameters as of `calfsocket.Socket.from_mesh`.

    Raises
    ------
    InputError
        One line: file, place, and what to do.
    """
    read, parts = read_body(path, sets, units, data, keep=tags.SOCKET)
    mesh = plane_mesh(read, parts.of, list(parts.regions), units, _plane_of(limb))
    loops = mesh.loops
    if len(loops) != 2:
        raise InputError(
            f"{path}: the socket has {len(loops) - 1} holes, and a wall has one, for the limb; "
            "correct its set"
        )
    outer, inner = loops
    remarks = list(mesh.remarks)
    if geometry is not None:
        mesh = laid_onto(mesh, _faces(geometry, limb), tolerance, remarks)
    faces = {tags.SOCKET_INNER: inner, tags.SOCKET_OUTER: outer}
    rings = {name: ring(mesh, loop) for name, loop in faces.items()}
    with error_context(path):
        own_mesh = packed(
            mesh,
            np.full(len(mesh.cells), tags.SOCKET_ID),
            {tags.SOCKET: tags.SOCKET_ID},
            # Along the inner face as gmsh has it, counter-clockwise.
            {
                tags.SOCKET_INNER: inner.sides[::-1][:, [1, 0, 2]],
                tags.SOCKET_OUTER: outer.sides,
            },
        )
        area = outer.area + inner.area
        length = sum(through(each).perimeter for each in rings.values()) / 2
        given: dict[str, Any] = {"name": Path(path).stem} | socket
        return MeshedSocket(
            wall_thickness=round(area / length, 4),
            mesh=own_mesh,
            inner=rings[tags.SOCKET_INNER],
            outer=rings[tags.SOCKET_OUTER],
            source=MeshProvenance(
                file=read.path.name,
                sha256=sha256(read.path),
                program=f"calfsocket {calfsocket.__version__}",
                notes=tuple(remarks),
            ),
            **given,
        )


def _plane_of(limb: meshes.Limb) -> Plane:
    """Return the plane of a limb's section in the axes of its source, or its own."""
    source = limb.source
    if source is None or source.origin is None or source.normal is None:
        return Plane(np.zeros(3), np.eye(3)[0], np.eye(3)[1])
    up = None if source.anterior is None else np.array(source.anterior)
    return Plane.square_to(np.array(source.normal), np.array(source.origin), up)


def _faces(geometry: Socket | Path | str, limb: meshes.Limb) -> dict[str, ClosedCurve]:
    socket = geometry if isinstance(geometry, Socket) else Socket.read(geometry)
    return dict(zip(("inner", "outer"), socket.faces(limb), strict=True))
