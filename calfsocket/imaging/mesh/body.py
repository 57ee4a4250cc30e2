"""What limbs and sockets of a mesh have in common: their triangles, curved sides and rings."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calfsocket.imaging.mesh.plane_mesh import Loop, PlaneMesh, curved
from calfsocket.imaging.mesh.reader import ReadMesh, read_mesh
from calfsocket.imaging.mesh.sets import Assigned, Sets, assigned, read_sets
from calfsocket.imaging.surface import UNITS, check_size
from calfsocket.io.errors import InputError
from calfsocket.io.schema import nearest
from calfsocket.meshes import tags
from calfsocket.meshes.curves import Array, ClosedCurve, Point
from calfsocket.meshes.given import GivenMesh
from calfsocket.meshes.triangles import TriangleMesh


def read_body(
    path: Path | str,
    sets: Sets | Path | str | None,
    units: str,
    data: str | None,
    keep: str | None = None,
) -> tuple[ReadMesh, Assigned]:
    """Read a file and what its sets are, the regions of a limb or those that are called `keep`."""
    table = read_sets(Path(sets)) if isinstance(sets, Path | str) else sets
    if units not in UNITS:
        raise InputError(f"units: is '{units}'; {nearest(units, UNITS)}")
    read = read_mesh(path, data)
    a, b, c = read.points[read.cells[:, :3]].transpose(1, 0, 2) * UNITS[units]
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    parts = assigned(read, table, area, keep)
    corners = read.points[read.cells[parts.of >= 0, :3]].reshape(-1, 3)
    check_size(str(path), corners * UNITS[units], units, keep or "limb")
    return read, parts


def laid_onto(
    mesh: PlaneMesh, curves: Mapping[str, ClosedCurve], tolerance: float, remarks: list[str]
) -> PlaneMesh:
    """Lay straight sides onto curves, and add to the remarks how many."""
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


def ring(mesh: PlaneMesh, loop: Loop) -> tuple[Point, ...]:
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


def packed(
    mesh: PlaneMesh,
    numbers: NDArray[np.int64],
    regions: Mapping[str, int],
    boundaries: Mapping[str, NDArray[np.int64]],
) -> GivenMesh:
    """Pack a mesh as a limb or a socket holds it.

    Parameters
    ----------
    mesh : PlaneMesh
    numbers : array
        Of each triangle's region.
    regions : mapping
        Numbers of regions by name.
    boundaries : mapping
        Sides, (k, 3), by the name of their boundary.
    """
    of_facets = {name: tags.FACETS[name] for name in boundaries}
    return GivenMesh.of(
        TriangleMesh(
            points=mesh.points,
            cells=mesh.cells,
            cell_tags=np.asarray(numbers, dtype=np.int32),
            facets=np.concatenate(list(boundaries.values())),
            facet_tags=np.repeat(
                list(of_facets.values()), [len(rows) for rows in boundaries.values()]
            ).astype(np.int32),
            regions=dict(regions),
            boundaries=of_facets,
        )
    )
