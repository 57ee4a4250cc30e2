"""A limb with a mesh that was made elsewhere and is solved as it is."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from pydantic import ValidationError
from shapely.affinity import translate
from shapely.geometry.base import BaseGeometry

import calfsocket
from calfsocket.imaging.anatomy import Said
from calfsocket.imaging.drawing import front_of, section_of
from calfsocket.imaging.mesh.body import laid_onto, packed, read_body, ring
from calfsocket.imaging.mesh.fixed import fixed_sides
from calfsocket.imaging.mesh.outlines import outlines_of
from calfsocket.imaging.mesh.plane_mesh import ON_CURVE, Loop, PlaneMesh, plane_mesh
from calfsocket.imaging.mesh.reader import ReadMesh
from calfsocket.imaging.mesh.sets import Assigned, Sets
from calfsocket.imaging.plane import Plane
from calfsocket.imaging.section import TOLERANCE, Section
from calfsocket.imaging.source import sha256
from calfsocket.io.errors import InputError, error_context
from calfsocket.io.schema import first_problem
from calfsocket.meshes import limb as meshes
from calfsocket.meshes import tags
from calfsocket.meshes.curves import Array, ClosedCurve, through, xy
from calfsocket.meshes.frame import Frame, View
from calfsocket.meshes.given import area_of, sides
from calfsocket.meshes.limb import Provenance, limb_curves
from calfsocket.meshes.outline import read_outline

#: An origin that is closer to the middle of the skin than this share of its mean radius stays:
#: polar angles about the two differ by less than 6 degrees.
_CENTRED = 0.1
#: Names of the curves of a limb with a mesh.
_SKIN, _FIXED = "skin", "fixed"
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
    sets: Sets | Path | str | None = None,
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
    read, parts = read_body(path, sets, units, data)
    names = list(parts.regions)
    mesh = plane_mesh(read, parts.of, names, units)
    remarks = [*mesh.remarks, *_left_out(parts)]
    loops = mesh.loops
    _check_skin(mesh, loops[0], parts)
    if geometry is not None:
        mesh = laid_onto(mesh, _curves(geometry), tolerance, remarks)
    facets, hole_of = fixed_sides(mesh, read, parts, loops, fixed, remarks)
    mesh, frame = _in_frame(mesh, parts, loops[0], said, seen_from, remarks)
    skin = ring(mesh, loops[0])
    with error_context(path):
        numbers = {name: number for number, name in enumerate(names, start=1)}
        own_mesh = packed(
            mesh,
            mesh.regions + 1,
            numbers,
            {tags.SKIN_SURFACE: loops[0].sides, tags.TIBIA_MEDULLARY: facets},
        )
        limb = _checked(
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
                    for name, number in numbers.items()
                ],
                "source": _provenance(read, mesh, remarks),
                "mesh": own_mesh,
            }
        )
    outlines = {
        "skin" if number == 0 else f"hole {number}": mesh.points[loop.sides[:, [0, 2]]].reshape(
            -1, 2
        )
        for number, loop in enumerate(loops)
    }
    return MeshedLimb(limb, outlines)


def _left_out(parts: Assigned) -> Iterator[str]:
    """Say which sets are no part of the limb."""
    if parts.left_out:
        yield f"left out: {', '.join(parts.left_out)}"
    if tags.LINER in parts.left_out.values():
        yield "a liner is not imported: give the study one, bonded to a socket that is meshed here"


def section_of_mesh(
    path: Path | str,
    sets: Sets | Path | str | None = None,
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
    read, parts = read_body(path, sets, units, data)
    mesh = plane_mesh(read, parts.of, list(parts.regions), units)
    _check_skin(mesh, mesh.loops[0], parts)
    outlines = outlines_of(mesh, read.path, parts.regions)
    axes = np.stack([mesh.plane.x, mesh.plane.y])
    return section_of(outlines, said or Said(), seen_from, tolerance, axes)


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


def _curves(geometry: Geometry) -> dict[str, ClosedCurve]:
    if isinstance(geometry, meshes.Limb):
        return limb_curves(geometry)
    path = Path(geometry)
    if path.suffix.lower() == ".json":
        return limb_curves(meshes.Limb.read(path))
    return {path.stem: through(read_outline(path).points)}


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


def _checked(content: dict[str, Any]) -> meshes.Limb:
    """Build a limb; what does not fit, such as its directions, is said in a line."""
    try:
        return meshes.Limb.model_validate(content)
    except ValidationError as error:
        raise InputError(first_problem(content, error)) from None


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
