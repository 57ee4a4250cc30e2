"""A limb, or a socket's wall, with a mesh that was made elsewhere and is solved as it is."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.affinity import translate
from shapely.geometry.base import BaseGeometry

import calfsocket
from calfsocket.imaging.anatomy import Said
from calfsocket.imaging.drawing import front_of, section_of
from calfsocket.imaging.mesh_outlines import outlines_of
from calfsocket.imaging.mesh_reader import ReadMesh, read_mesh
from calfsocket.imaging.mesh_sets import Assigned, Sets, assigned
from calfsocket.imaging.plane import Plane
from calfsocket.imaging.plane_mesh import ON_CURVE, Loop, PlaneMesh, curved, plane_mesh
from calfsocket.imaging.section import TOLERANCE, Section
from calfsocket.imaging.source import sha256
from calfsocket.imaging.surface import UNITS, check_size
from calfsocket.io.errors import InputError, error_context
from calfsocket.io.schema import nearest
from calfsocket.meshes import limb as meshes
from calfsocket.meshes import tags
from calfsocket.meshes.curves import Array, ClosedCurve, Point, through, xy
from calfsocket.meshes.frame import Frame, View
from calfsocket.meshes.given import GivenMesh, area_of, outer_sides, sides
from calfsocket.meshes.limb import Limb, Provenance, limb_curves
from calfsocket.meshes.outline import read_outline
from calfsocket.meshes.socket import MeshedSocket, MeshProvenance, Socket
from calfsocket.meshes.triangles import TriangleMesh

#: An origin that is closer to the middle of the skin than this share of its mean radius stays:
#: polar angles about the two differ by less than 6 degrees.
_CENTRED = 0.1
#: Holes that a message lists.
_LISTED = 6
#: What `fixed` calls all holes.
HOLES = "holes"
#: Names of the curves of a limb with a mesh.
_SKIN, _FIXED = "skin", "fixed"
#: Bones that a limb is fixed in before the others.
_MAIN_BONES = ("tibia", "femur")
Geometry = meshes.Limb | Path | str


@dataclass(frozen=True)
class MeshedLimb:
    """A limb that was made of a mesh.

    Attributes
    ----------
    limb : Limb
    outlines : mapping of str to Array
        Polygons of its outer boundary and its holes, mm, for a picture.
    """

    limb: meshes.Limb
    outlines: Mapping[str, Array]


def limb_of_mesh(
    path: Path | str,
    sets: Sets | None = None,
    *,
    units: str = "mm",
    data: str | None = None,
    said: Said | None = None,
    seen_from: View = "above",
    fixed: str | None = None,
    geometry: Geometry | None = None,
    tolerance: float = ON_CURVE,
) -> MeshedLimb:
    """Make a limb of a mesh; parameters as of `calfsocket.Limb.from_mesh`, `said` its directions.

    Raises
    ------
    InputError
        One line: file, place, and what to do.
    """
    said = said or Said()
    read, parts = _read(path, sets, units, data)
    names = list(parts.regions)
    mesh = plane_mesh(read, parts.of, names, units)
    remarks = list(mesh.remarks)
    loops = mesh.loops
    _check_skin(mesh, loops[0], parts)
    if geometry is not None:
        mesh = _curved(mesh, _curves(geometry), tolerance, remarks)
    facets, hole_of = _fixed(mesh, read, parts, loops, fixed, remarks)
    mesh, frame = _in_frame(mesh, parts, loops[0], said, seen_from, remarks)
    skin = _ring(mesh, loops[0])
    with error_context(path):
        packed = GivenMesh.of(
            TriangleMesh(
                points=mesh.points,
                cells=mesh.cells,
                cell_tags=np.asarray(mesh.regions + 1, dtype=np.int32),
                facets=np.concatenate([loops[0].sides, facets]),
                facet_tags=np.repeat(
                    np.array([tags.FACETS[tags.SKIN_SURFACE], tags.FACETS[tags.TIBIA_MEDULLARY]]),
                    [len(loops[0].sides), len(facets)],
                ).astype(np.int32),
                regions={name: number for number, name in enumerate(names, start=1)},
                boundaries={
                    name: tags.FACETS[name] for name in (tags.SKIN_SURFACE, tags.TIBIA_MEDULLARY)
                },
            )
        )
        limb = Limb.model_validate(
            {
                "title": f"Limb of {read.path.name}",
                "units": "mm, deg",
                "side": said.side,
                "seen_from": frame.view(said.side) if said.side and frame.known else None,
                "axes": {"+x": frame.x, "+y": frame.y} if frame.known else {},
                "fixed_boundary": _FIXED,
                "contact_boundary": _SKIN,
                "curves": {_SKIN: {"type": "spline", "points": skin}},
                "regions": [
                    {
                        "id": number,
                        "name": name,
                        "tissue": parts.regions[name],
                        "holes": [_FIXED] if name == hole_of else [],
                        "origin": "measured",
                    }
                    for number, name in enumerate(names, start=1)
                ],
                "source": _provenance(read, mesh, remarks),
                "mesh": packed,
            }
        )
    outlines = {
        "skin" if number == 0 else f"hole {number}": mesh.points[loop.sides[:, [0, 2]]].reshape(
            -1, 2
        )
        for number, loop in enumerate(loops)
    }
    return MeshedLimb(limb, outlines)


def section_of_mesh(
    path: Path | str,
    sets: Sets | None = None,
    *,
    units: str = "mm",
    data: str | None = None,
    said: Said | None = None,
    seen_from: View = "above",
    tolerance: float = TOLERANCE,
) -> Section:
    """Return the outlines of a mesh's regions alone, as a section that was drawn.

    Raises
    ------
    InputError
        One line: file, place, and what to do.
    """
    read, parts = _read(path, sets, units, data)
    mesh = plane_mesh(read, parts.of, list(parts.regions), units)
    _check_skin(mesh, mesh.loops[0], parts)
    outlines = outlines_of(mesh, read.path, parts.regions)
    axes = np.stack([mesh.plane.x, mesh.plane.y])
    return section_of(outlines, said or Said(), seen_from, tolerance, axes)


def socket_of_mesh(
    path: Path | str,
    limb: meshes.Limb,
    sets: Sets | None = None,
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
    read, parts = _read(path, sets, units, data, keep=tags.SOCKET)
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
        mesh = _curved(mesh, _faces(geometry, limb), tolerance, remarks)
    faces = {tags.SOCKET_INNER: inner, tags.SOCKET_OUTER: outer}
    rings = {name: _ring(mesh, loop) for name, loop in faces.items()}
    with error_context(path):
        packed = GivenMesh.of(
            TriangleMesh(
                points=mesh.points,
                cells=mesh.cells,
                cell_tags=np.full(len(mesh.cells), tags.SOCKET_ID, dtype=np.int32),
                # Along the inner face as gmsh has it, counter-clockwise.
                facets=np.concatenate([inner.sides[::-1][:, [1, 0, 2]], outer.sides]),
                facet_tags=np.repeat(
                    [tags.FACETS[name] for name in faces], [len(inner.sides), len(outer.sides)]
                ).astype(np.int32),
                regions={tags.SOCKET: tags.SOCKET_ID},
                boundaries={name: tags.FACETS[name] for name in faces},
            )
        )
        area = outer.area + inner.area
        length = sum(through(ring).perimeter for ring in rings.values()) / 2
        given: dict[str, Any] = {"name": Path(path).stem} | socket
        return MeshedSocket(
            wall_thickness=round(area / length, 4),
            mesh=packed,
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


def _read(
    path: Path | str, sets: Sets | None, units: str, data: str | None, keep: str | None = None
) -> tuple[ReadMesh, Assigned]:
    if units not in UNITS:
        raise InputError(f"units: is '{units}'; {nearest(units, UNITS)}")
    read = read_mesh(path, data)
    a, b, c = read.points[read.cells[:, :3]].transpose(1, 0, 2) * UNITS[units]
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    parts = assigned(read, sets, area, keep)
    corners = read.points[read.cells[parts.of >= 0, :3]].reshape(-1, 3)
    check_size(str(path), corners * UNITS[units], units, keep or "limb")
    return read, parts


def _plane_of(limb: meshes.Limb) -> Plane:
    """Return the plane of a limb's section in the axes of its source, or its own."""
    source = limb.source
    if source is None or source.origin is None or source.normal is None:
        return Plane(np.zeros(3), np.eye(3)[0], np.eye(3)[1])
    up = None if source.anterior is None else np.array(source.anterior)
    return Plane.square_to(np.array(source.normal), np.array(source.origin), up)


def _check_skin(mesh: PlaneMesh, outer: Loop, parts: Assigned) -> None:
    """Refuse an outer boundary of several tissues."""
    every = sides(mesh.cells).reshape(-1, 3)
    region_at = np.empty(len(mesh.points), dtype=np.int64)
    region_at[every[:, 2]] = np.repeat(mesh.regions, 3)
    tissue_of = list(parts.regions.values())
    found: dict[str, list[int]] = {}
    for number, region in enumerate(region_at[outer.sides[:, 2]]):
        found.setdefault(tissue_of[region], []).append(number)
    if len(found) > 1:
        most = "skin" if "skin" in found else max(found, key=lambda tissue: len(found[tissue]))
        other = next(tissue for tissue in found if tissue != most)
        ends = mesh.points[outer.sides[found[other], :2]]
        length = float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum())
        raise InputError(
            f"{mesh.name}: the outer boundary is {most}, but for {length:.3g} mm at"
            f" {xy(ends[0].mean(axis=0))}, which are {other}; the socket must meet one tissue all"
            " around: complete that set, or correct the table of sets"
        )


def _curved(
    mesh: PlaneMesh, curves: Mapping[str, ClosedCurve], tolerance: float, remarks: list[str]
) -> PlaneMesh:
    if not 0 < tolerance <= 1:
        raise InputError(f"tolerance: is {tolerance:g} mm; it must be more than 0, at most 1")
    mesh, laid, kept = curved(mesh, curves, tolerance)
    if not laid:
        raise InputError(
            f"{mesh.name}: no side has both ends within {tolerance:g} mm of the curves of the"
            " geometry; give the geometry that it was meshed from, in its axes, or none"
        )
    remarks.append(f"{laid} straight sides were laid onto the curves of the geometry")
    if kept:
        remarks.append(f"{kept} sides stay straight, for a triangle would be inverted")
    return mesh


def _curves(geometry: Geometry) -> dict[str, ClosedCurve]:
    if isinstance(geometry, meshes.Limb):
        return limb_curves(geometry)
    path = Path(geometry)
    if path.suffix.lower() == ".json":
        return limb_curves(meshes.Limb.read(path))
    return {path.stem: through(read_outline(path).points)}


def _faces(geometry: Socket | Path | str, limb: meshes.Limb) -> dict[str, ClosedCurve]:
    socket = geometry if isinstance(geometry, Socket) else Socket.read(geometry)
    return dict(zip(("inner", "outer"), socket.faces(limb), strict=True))


def _fixed(
    mesh: PlaneMesh,
    read: ReadMesh,
    parts: Assigned,
    loops: Sequence[Loop],
    wanted: str | None,
    remarks: list[str],
) -> tuple[NDArray[np.int64], str]:
    """Return the sides where the limb is fixed, and the region with the hole if it is one."""
    names, tissues = list(parts.regions), parts.regions
    holes = [(loop, names[_region_at(mesh, loop)]) for loop in loops[1:]]
    if wanted == HOLES:
        if not holes:
            raise InputError(f"{mesh.name}: fixed: there are no holes; name a bone")
        remarks.append(f"fixed at its {len(holes)} holes, as said")
        return np.concatenate([loop.sides for loop, _ in holes]), ""
    if wanted in names:
        found = [(loop, name) for loop, name in holes if name == wanted]
        if found:
            remarks.append(f"fixed at the hole in {wanted}, as said")
            return found[0][0].sides, wanted
        remarks.append(f"fixed at the surface of {wanted}, as said")
        return outer_sides(mesh.cells[mesh.regions == names.index(wanted)]), ""
    if wanted is not None:
        return _of_set(mesh, read, wanted, names, remarks), ""
    in_bone = [(loop, name) for loop, name in holes if tissues[name] == "bone"]
    if in_bone:
        loop, name = min(in_bone, key=lambda each: (not _is_main(each[1]), each[0].area))
        remarks.append(f"fixed at the hole in {name}, its marrow cavity")
        if free := [other for other, _ in holes if other is not loop]:
            remarks.append(f"holes that are free to deform: {_places(free)}")
        return loop.sides, name
    if len(holes) == 1:
        loop, name = holes[0]
        remarks.append(f"fixed at its hole, in {name}, of {-loop.area:.4g} mm^2")
        return loop.sides, name
    if holes:
        places = _places([loop for loop, _ in holes])
        raise InputError(
            f"{mesh.name}: which of its holes is the limb fixed at? they are at {places}: say"
            f" --fixed {HOLES} for all of them, or the name of a set of nodes or edges"
        )
    bones = [name for name, tissue in tissues.items() if tissue == "bone"]
    if not bones:
        raise InputError(
            f"{mesh.name}: has neither bone nor a hole, so that nothing holds it; say where it is"
            " fixed, by the name of a region or of a set of nodes or edges: --fixed NAME"
        )
    area = {name: area_of(mesh.points, mesh.cells[mesh.regions == names.index(name)]).area
            for name in bones}  # fmt: skip
    name = min(bones, key=lambda each: (not _is_main(each), -area[each]))
    remarks.append(f"fixed at the surface of {name}, which has no hole")
    return outer_sides(mesh.cells[mesh.regions == names.index(name)]), ""


def _places(holes: Sequence[Loop]) -> str:
    """Say where holes are, the largest first, and how large."""
    words = [f"{xy(hole.centre)} ({-hole.area:.4g} mm^2)" for hole in holes[::-1]]
    more = f" and {len(words) - _LISTED} more" if len(words) > _LISTED else ""
    return ", ".join(words[:_LISTED]) + more


def _is_main(name: str) -> bool:
    return any(word in name for word in _MAIN_BONES)


def _region_at(mesh: PlaneMesh, loop: Loop) -> int:
    """Return the region that most sides of a hole belong to."""
    every = sides(mesh.cells).reshape(-1, 3)
    inside = np.isin(every[:, 2], loop.sides[:, 2])
    return int(np.bincount(np.repeat(mesh.regions, 3)[inside]).argmax())


def _of_set(
    mesh: PlaneMesh, read: ReadMesh, wanted: str, names: Sequence[str], remarks: list[str]
) -> NDArray[np.int64]:
    same = [name for name in read.edges if name.casefold() == wanted.casefold()]
    if not same:
        known = [*names, *read.edges]
        raise InputError(
            f"{mesh.name}: fixed: has no region and no set of nodes or edges '{wanted}';"
            f" {nearest(wanted, known)}"
        )
    nodes = [mesh.of_node[int(n)] for n in read.edges[same[0]] if int(n) in mesh.of_node]
    every: NDArray[np.int64] = sides(mesh.cells).reshape(-1, 3)
    every = every[np.unique(every[:, 2], return_index=True)[1]]
    found: NDArray[np.int64] = every[np.isin(every[:, :2], nodes).all(axis=1)]
    if not len(found):
        raise InputError(f"{mesh.name}: fixed: '{wanted}' has no edges of the limb's triangles")
    remarks.append(f"fixed at {same[0]}, as said")
    return found


def _in_frame(
    mesh: PlaneMesh,
    parts: Assigned,
    outer: Loop,
    said: Said,
    seen_from: View,
    remarks: list[str],
) -> tuple[PlaneMesh, Frame]:
    """Lay the origin inside the limb, and +y to the front where that is known."""
    skin = shapely.Polygon(mesh.points[outer.sides[:, 0]])
    centre = np.array(skin.centroid.coords[0])
    if np.linalg.norm(centre) < _CENTRED * np.sqrt(skin.area / np.pi):
        centre = np.zeros(2)
    else:
        remarks.append(f"origin: the middle of the skin, at {xy(centre)}")
    bodies: dict[str, BaseGeometry] = {"skin": translate(skin, *-centre)}
    for bone in ("tibia", "fibula"):
        of = [n for n, name in enumerate(parts.regions) if name == bone]
        if of:
            bodies[bone] = translate(
                area_of(mesh.points, mesh.cells[mesh.regions == of[0]]), *-centre
            )
    axes = np.stack([mesh.plane.x, mesh.plane.y])
    front, turn, found = front_of(mesh.name, bodies, said, seen_from, axes)
    remarks[:0] = found
    rotation = np.array([[front[1], -front[0]], [front[0], front[1]]])
    plane = Plane(mesh.plane.origin + centre @ axes, rotation[0] @ axes, rotation[1] @ axes)
    moved = replace(mesh, points=(mesh.points - centre) @ rotation.T, plane=plane)
    return moved, Frame("lateral" if turn > 0 else "medial", "anterior") if turn else Frame()


def _ring(mesh: PlaneMesh, loop: Loop) -> tuple[Point, ...]:
    """Return points of a closed curve along a loop, counter-clockwise.

    Its corners, and the nodes between them where sides are curved.
    """
    a, b, m = mesh.points[loop.sides].transpose(1, 0, 2)
    bent = np.linalg.norm(m - (a + b) / 2, axis=1) > 1e-6 * np.linalg.norm(b - a, axis=1)
    points: Array = np.stack([a, m], axis=1).reshape(-1, 2)
    points = points[np.column_stack([np.ones_like(bent), bent]).ravel()]
    if loop.area < 0:
        points = points[::-1]
    return tuple((float(x), float(y)) for x, y in points)


def _provenance(read: ReadMesh, mesh: PlaneMesh, remarks: Sequence[str]) -> Provenance:
    return Provenance(
        files={read.path.name: sha256(read.path)},
        origin=_triple(mesh.plane.origin),
        normal=_triple(mesh.plane.normal),
        anterior=_triple(mesh.plane.y),
        tolerance_mm=0.0,
        program=f"calfsocket {calfsocket.__version__}",
        found=tuple(remarks),
    )


def _triple(vector: Array) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in np.round(vector, 7) + 0.0)
    return x, y, z
