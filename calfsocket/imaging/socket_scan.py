"""A socket's own scan, and what it leaves in the sections of a limb."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyvista
import shapely

import calfsocket
from calfsocket.imaging import registration
from calfsocket.imaging.mesh.plane_mesh import ON_CURVE
from calfsocket.imaging.mesh.socket import socket_of_mesh
from calfsocket.imaging.plane import Plane, cut
from calfsocket.imaging.registration import Face, Motion, Registration, Skin
from calfsocket.imaging.section import (
    SKIN_RADII,
    TOLERANCE,
    check_tolerance,
    counter_clockwise,
    smooth_outline,
    xyz,
)
from calfsocket.imaging.source import sha256
from calfsocket.imaging.surface import Shell, as_surface, check_size, read_shells
from calfsocket.io.errors import InputError, error_context
from calfsocket.meshes import socket as meshes
from calfsocket.meshes.curves import Array
from calfsocket.meshes.levels import LimbLevels, sections
from calfsocket.meshes.limb import Limb
from calfsocket.meshes.socket import MeshedSocket, SectionOutline, Sections, SocketProvenance

#: Distance of the points on a skin's outline, mm.
_STEP = 2.0
#: Pieces with less than this share of the area of the largest are debris, in space and in a plane.
_CRUMB = 0.05
#: Share of the area of a scan that faces the axis, and that faces away, if it has a wall.
_TWO_FACES = 0.2
#: An inner outline encloses at least this share of what the outer one does.
_HOLLOW = 0.3


@dataclass(frozen=True)
class SocketScan:
    """The surface of a socket.

    Attributes
    ----------
    path : Path
    surface : PolyData
        All of it, mm.
    inner : PolyData
        Its inner face, normals outward.
    walled : bool
        Whether it has an outer face, too.
    """

    path: Path
    surface: pyvista.PolyData
    inner: pyvista.PolyData
    walled: bool


def read_socket_scan(path: Path | str, units: str = "mm") -> SocketScan:
    """Read a socket's surface: its inner face, open at the brim, or a shell with inner and outer.

    Raises
    ------
    InputError
        When the file cannot be read, or is no socket.
    """
    path = Path(path)
    shells = read_shells([path], units)
    large = [each for each in shells if each.surface.area > _CRUMB * shells[0].surface.area]
    check_size(str(path), large[0].surface.points, units, "socket")
    if len(large) > 2 or (len(large) == 2 and not _nested(*large)):
        raise InputError(
            f"{path}: has {len(large)} surfaces that are not one in the other; give one socket"
        )
    surface = as_surface(pyvista.merge([each.surface for each in large]))
    if len(large) == 2:
        least = min(large, key=lambda each: _radius(each.surface))
        return SocketScan(path, surface, _facing_out(least.surface), True)
    inner, walled = _inner_face(large[0].surface)
    return SocketScan(path, surface, inner, walled)


def _nested(one: Shell, other: Shell) -> bool:
    """Return whether the centre of each surface lies in the box of the other."""
    boxes = [np.array(each.surface.bounds).reshape(3, 2) for each in (one, other)]
    centres = [box.mean(axis=1) for box in boxes]
    return all(
        bool(np.all((box[:, 0] < centre) & (centre < box[:, 1])))
        for box, centre in zip(boxes, centres[::-1], strict=True)
    )


def _outward(surface: pyvista.PolyData) -> tuple[pyvista.PolyData, Array, Array]:
    """Return a surface whose triangles turn one way, their areas, and their normals' radial part.

    The radius is that from its axis, to which its normals are nearly square.
    """
    turned = surface.compute_normals(
        point_normals=False, consistent_normals=True, split_vertices=False
    )
    area = turned.compute_cell_sizes(length=False, volume=False)["Area"]
    normals = np.asarray(turned["Normals"], dtype=float)
    axis = np.linalg.eigh((normals * area[:, None]).T @ normals)[1][:, 0]
    arms = turned.cell_centers().points - np.average(
        turned.cell_centers().points, axis=0, weights=area
    )
    arms = arms - np.outer(arms @ axis, axis)
    arms = arms / np.maximum(np.linalg.norm(arms, axis=1), 1e-9)[:, None]
    return turned, np.asarray(area), np.asarray(np.sum(arms * normals, axis=1))


def _radius(surface: pyvista.PolyData) -> float:
    """Return the mean distance of a surface from the mean of its points."""
    return float(np.linalg.norm(surface.points - surface.points.mean(axis=0), axis=1).mean())


def _facing_out(surface: pyvista.PolyData) -> pyvista.PolyData:
    turned, area, radial = _outward(surface)
    return _as_seen_from(turned, behind=bool(np.sum(area * radial) < 0))


def _as_seen_from(surface: pyvista.PolyData, behind: bool) -> pyvista.PolyData:
    """Return points and triangles alone, which turn the other way as seen from behind."""
    triangles = surface.faces.reshape(-1, 4)[:, 1:]
    return pyvista.PolyData.from_regular_faces(
        surface.points, triangles[:, ::-1] if behind else triangles
    )


def _inner_face(surface: pyvista.PolyData) -> tuple[pyvista.PolyData, bool]:
    """Return the inner face of a surface, and whether it has an outer one, too."""
    turned, area, radial = _outward(surface)
    facing = [area[radial * sign > 0.2].sum() / area.sum() for sign in (1, -1)]
    if min(facing) < _TWO_FACES:
        return _facing_out(surface), False
    # Normals of a body point out of it: on a wall's inner face, to the axis.
    points = turned.points - turned.points.mean(axis=0)
    corners = points[turned.faces.reshape(-1, 4)[:, 1:]]
    volume = np.linalg.det(corners).sum()
    to_axis = radial * np.sign(volume) < -0.2
    face = as_surface(turned.extract_cells(np.flatnonzero(to_axis)))
    return _as_seen_from(face, behind=bool(volume > 0)), True


def skin_of(limbs: Sequence[Limb]) -> Skin:
    """Return points of the skin of a limb's sections in the axes of its source.

    Raises
    ------
    InputError
        When it is not known where a section lies.
    """
    points, length = [], 0.0
    for limb in limbs:
        plane, curve = plane_of(limb), limb.skin
        flat = curve.evaluate(curve.sample(_STEP))
        points.append(plane.origin + flat @ np.stack([plane.x, plane.y]))
        length += curve.perimeter
    axis = np.mean([plane_of(limb).normal for limb in limbs], axis=0)
    return Skin(np.concatenate(points), axis / np.linalg.norm(axis), length)


def plane_of(limb: Limb) -> Plane:
    """Return the plane of a section in the axes of the limb's source."""
    source = limb.source
    if source is None or source.origin is None or source.normal is None or source.anterior is None:
        raise InputError(
            f"{limb.title}: was drawn, so that where it lies in the limb is not known, and a scan"
            " of a socket cannot be laid on it; make it from a scan or a label map by `limb`"
        )
    return Plane.square_to(
        np.array(source.normal), np.array(source.origin), np.array(source.anterior)
    )


def laid(
    scan: SocketScan,
    limbs: Sequence[Limb],
    register: registration.Register = "icp",
    shift: Sequence[float] = (0.0, 0.0, 0.0),
    rotate: float = 0.0,
) -> Registration:
    """Return how a scan lies on a limb; the parameters are those of `Socket.from_scan`."""
    moved = bool(rotate) or any(shift)
    if register == "icp" and moved:
        raise InputError(
            f"{scan.path}: a shift or a turn is given, and register is icp, which finds both; give"
            " register none with them"
        )
    skin = skin_of(limbs)
    with error_context(scan.path):
        face = Face(scan.inner)
        if register == "icp":
            return registration.registered(face, skin)
        motion = Motion.about(skin.axis, rotate, skin.centre, np.asarray(shift, dtype=float))
        return registration.fixed(face, skin, motion if moved else Motion.none())


def outline(
    scan: SocketScan, motion: Motion, limb: Limb, tolerance: float = TOLERANCE
) -> SectionOutline:
    """Return what a scan leaves in a limb's section.

    Raises
    ------
    InputError
        Where it does not reach the section, or its inner face is not closed there.
    """
    plane = plane_of(limb)
    assert limb.source is not None
    check_tolerance(tolerance)
    at = f"{scan.path}, {limb.source.level or 'a plane'}"
    found = cut(pyvista.PolyData(motion(scan.surface.points), faces=scan.surface.faces), plane)
    if found.gap:
        assert found.place is not None
        raise InputError(
            f"{at}: the socket is open by {found.gap:.3g} mm near {xyz(plane, found.place)} of the"
            " limb: the brim, or a hole; choose levels where it goes all around"
        )
    if not found.bodies:
        raise InputError(f"{at}: lies outside the socket; choose levels that it reaches")
    body, *others = found.bodies
    if any(other.area > _CRUMB * body.area for other in others):
        raise InputError(f"{at}: the socket is in {len(found.bodies)} parts there; choose another")
    whole = shapely.Polygon(body.exterior)
    inner = whole
    if scan.walled:
        holes = sorted((shapely.Polygon(hole) for hole in body.interiors), key=lambda h: -h.area)
        if not holes or holes[0].area < _HOLLOW * whole.area:
            raise InputError(f"{at}: the socket is solid there; choose levels above its inside")
        inner = holes[0]
    smooth = smooth_outline(counter_clockwise(inner), tolerance, at, SKIN_RADII)
    curve = smooth.curve
    wall = None
    if scan.walled:
        points = shapely.points(curve.evaluate(curve.sample(_STEP)))
        wall = round(float(np.median(shapely.distance(points, whole.exterior))), 3)
    knots = curve.evaluate(curve.knots[:-1])
    source = limb.source
    assert source.origin and source.normal and source.anterior
    return SectionOutline(
        level=source.level,
        origin=source.origin,
        normal=source.normal,
        anterior=source.anterior,
        points=tuple((round(float(x), 5), round(float(y), 5)) for x, y in knots),
        deviation_mm=round(smooth.deviation_mm, 4),
        wall_mm=wall,
    )


def cut_for(
    scan: SocketScan,
    limbs: Sequence[Limb],
    place: Registration,
    register: registration.Register,
    tolerance: float = TOLERANCE,
    **socket: Any,
) -> Sections:
    """Cut a scan at each section of a limb; those that it does not reach are left out, and noted.

    Parameters
    ----------
    **socket
        `name`, `title` and `wall_thickness` of the socket.

    Raises
    ------
    InputError
        When it reaches none.
    """
    found, left_out = [], []
    for limb in limbs:
        try:
            found.append(outline(scan, place.motion, limb, tolerance))
        except InputError as error:
            left_out.append(str(error))
    if not found:
        raise InputError(left_out[0])
    source = SocketProvenance(
        file=scan.path.name,
        sha256=sha256(scan.path),
        registration=register,
        rotation=tuple(_triple(row) for row in place.motion.rotation),  # type: ignore[arg-type]
        shift=_triple(place.motion.shift),
        gap_mm=round(place.gap, 4),
        gap_error_mm=round(place.gap_error, 4),
        rms_mm=round(place.rms, 4),
        largest_mm=round(place.largest, 4),
        covered=round(place.covered, 4),
        tolerance_mm=tolerance,
        program=f"calfsocket {calfsocket.__version__}",
        notes=tuple(f"left out: {line}" for line in left_out),
    )
    socket.setdefault("name", scan.path.stem)
    return Sections(sections=tuple(found), source=source, **socket)


def _triple(vector: Array) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in np.round(vector, 7) + 0.0)
    return x, y, z


class Socket(meshes.Socket):
    """A socket around a limb: of the paper, from a file, an outline, its own scan, or a mesh.

    Attributes
    ----------
    name : str
        What cases, tables and folders call it; in a study file that is the name of its table.
    title : str
        Its name in words, for reports.
    wall_thickness : float
        From the inner face outward along its normal, mm.
    modulus, poisson : float, optional
        Young's modulus, MPa, and Poisson's ratio of the wall, in the place of the material set's.
    """

    @staticmethod
    def from_scan(
        path: Path | str,
        limb: Limb | LimbLevels | Sequence[Limb],
        *,
        register: registration.Register = "icp",
        shift: Sequence[float] = (0.0, 0.0, 0.0),
        rotate: float = 0.0,
        units: str = "mm",
        tolerance: float = TOLERANCE,
        **socket: Any,
    ) -> Sections:
        """Cut a socket from its own scan at the sections of a limb.

        Parameters
        ----------
        path
            STL, PLY, OBJ, VTP or AOP: the inner face, open at the brim, or a shell with both faces.
        limb
            Made from a scan or a label map: one section, or those of a limb of many levels.
        register
            "icp": its inner face is laid on the limb's skin, with an even gap between them; where
            it lies on it already to the deviations that remain, it stays. "none": it stays in any
            case, or is moved by `rotate` and `shift`.
        shift, rotate
            mm in the axes of the limb's source, and degrees about the limb's axis before that.
        units
            Of the scan: mm, cm, m or inch.
        tolerance
            Largest distance of the curves from the scan, mm.
        **socket
            `name`, `title`, and `wall_thickness`, which counts where the scan has one face.

        Raises
        ------
        InputError
            One line: file, level, place, and what to do.
        """
        limbs = sections(limb) if isinstance(limb, Limb | LimbLevels) else tuple(limb)
        scan = read_socket_scan(path, units)
        place = laid(scan, limbs, register, shift, rotate)
        return cut_for(scan, limbs, place, register, tolerance, **socket)

    @staticmethod
    def from_mesh(
        path: Path | str,
        limb: Limb,
        sets: Mapping[str, Any] | Path | str | None = None,
        *,
        units: str = "mm",
        data: str | None = None,
        geometry: meshes.Socket | Path | str | None = None,
        tolerance: float = ON_CURVE,
        **socket: Any,
    ) -> MeshedSocket:
        """Make a socket of a mesh of its wall, which is solved as it is.

        Parameters
        ----------
        path
            A file as of `Limb.from_mesh`, in the axes of the file that the limb was made of.
        limb
            That it is for.
        sets
            As of `Limb.from_mesh`: what is "socket". By default a set of that name.
        units, data
            As of `Limb.from_mesh`.
        geometry
            A socket, or its file: straight sides between nodes of its faces are laid onto them.
        tolerance
            Largest distance of those nodes from the faces, mm.
        **socket
            `name` (that of the file by default), `title`, `modulus` and `poisson`.

        Raises
        ------
        InputError
            One line: file, place, and what to do.
        """
        return socket_of_mesh(
            path,
            limb,
            sets,
            units=units,
            data=data,
            geometry=geometry,
            tolerance=tolerance,
            **socket,
        )
