"""A mesh that was read, as one sound body in its plane: merged, turned, with all its nodes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from calfsocket.imaging.mesh.elements import NONE
from calfsocket.imaging.mesh.reader import ReadMesh
from calfsocket.imaging.plane import Plane
from calfsocket.imaging.surface import UNITS
from calfsocket.io.errors import InputError
from calfsocket.meshes.curves import SAME_POINT, Array, ClosedCurve, xy
from calfsocket.meshes.given import MOST_TRIANGLES, outer_sides, sides
from calfsocket.meshes.quality import scaled_jacobians, smallest_angles

#: How far nodes may leave their plane, mm: what single precision leaves of a limb in metres.
FLAT = 0.01
#: Largest distance, mm, of a node from the curve that it is taken to lie on.
ON_CURVE = 0.02
#: Smallest scaled Jacobian of a triangle: with less, such as two angles of 2 degrees, its stresses
#: mean nothing. Below the second one it is worth a note: the package's own have 0.3 at least.
LEAST_SHAPE, POOR_SHAPE = 0.05, 0.2
#: A hole that is narrower than this, mm, on average is a seam whose sides were not merged.
_SEAM = 0.05
#: The node between the ends of a straight side is as close to its middle, as a share of its length.
_STRAIGHT = 1e-6
#: A straight side is curved where it leaves the curve by less than this share of its length: it
#: turns by less than 75 degrees. A longer chord runs across the region.
_ALONG = 0.16


@dataclass(frozen=True)
class Loop:
    """A closed line of sides with one triangle.

    Attributes
    ----------
    sides : array
        Start, end and middle of each, one after the other; (k, 3).
    area : float
        Enclosed, mm^2; negative of a hole.
    centre : array
        mm.
    """

    sides: NDArray[np.int64]
    area: float
    centre: Array


@dataclass(frozen=True)
class PlaneMesh:
    """Six-node triangles of a body in the plane.

    Attributes
    ----------
    name : str
        Of the file, for messages.
    points : array
        mm, (n, 2).
    cells : array
        Counter-clockwise, (m, 6).
    regions : array
        Number of each triangle's region, (m,).
    names : sequence of str
        Of the regions.
    of_node : mapping of int to int
        Nodes by their numbers in the file.
    plane : Plane
        Where it lies in the file.
    remarks : sequence of str
        What was changed.
    first_order : bool
        Whether no node of the file lies between two corners.
    """

    name: str
    points: Array
    cells: NDArray[np.int64]
    regions: NDArray[np.int64]
    names: Sequence[str]
    of_node: Mapping[int, int]
    plane: Plane
    remarks: Sequence[str]
    first_order: bool

    @property
    def coordinates(self) -> Array:
        """Nodes of each triangle, (m, 6, 2)."""
        return self.points[self.cells]

    def where(self, cell: int) -> str:
        """Say where a triangle lies, for messages."""
        place = self.plane.origin + self.coordinates[cell, :3].mean(axis=0) @ np.stack(
            [self.plane.x, self.plane.y]
        )
        x, y, z = np.round(place, 2) + 0.0
        return f"({x:g}, {y:g}, {z:g}) mm of the file, in {self.names[self.regions[cell]]}"

    @cached_property
    def loops(self) -> list[Loop]:
        """The outer boundary and those of holes, the outer one first.

        Raises
        ------
        InputError
            When the body is in pieces, open seams are in it, or it touches itself.
        """
        self._check_manifold()
        self._check_whole()
        found = [_loop(self.points, rows) for rows in self._chains()]
        found.sort(key=lambda loop: -loop.area)
        for hole in found[1:]:
            length = np.linalg.norm(np.diff(self.points[hole.sides[:, :2]], axis=1), axis=2).sum()
            if -2 * hole.area / length < _SEAM:
                raise InputError(
                    f"{self.name}: is open along a seam of {length / 2:.3g} mm at"
                    f" {xy(hole.centre)}, whose sides share no nodes; merge the nodes of both sides"
                )
        return found

    def _check_manifold(self) -> None:
        every = sides(self.cells).reshape(-1, 3)
        _, inverse, count = np.unique(
            np.sort(every[:, :2], axis=1), axis=0, return_inverse=True, return_counts=True
        )
        of_cell = np.repeat(np.arange(len(self.cells)), 3)
        many = count[inverse] > 2
        if many.any():
            raise InputError(
                f"{self.name}: a side belongs to {count[inverse][many][0]} triangles, at"
                f" {self.where(int(of_cell[np.argmax(many)]))}; triangles lie on each other there"
            )
        # Neighbours run along their side in opposite directions, unless one lies on the other.
        _, again, times = np.unique(every[:, :2], axis=0, return_inverse=True, return_counts=True)
        same = times[again] > 1
        if same.any():
            raise InputError(
                f"{self.name}: two triangles lie on each other at"
                f" {self.where(int(of_cell[np.argmax(same)]))}; remove one of them"
            )

    def _check_whole(self) -> None:
        """Refuse a body in pieces."""
        a, b = self.cells[:, [0, 1]].ravel(), self.cells[:, [1, 2]].ravel()
        n = len(self.points)
        graph = coo_array((np.ones(len(a)), (a, b)), shape=(n, n))
        _, piece = connected_components(graph, directed=False)
        of_cell = piece[self.cells[:, 0]]
        numbers, cells = np.unique(of_cell, return_counts=True)
        if len(numbers) > 1:
            small = numbers[np.argmin(cells)]
            raise InputError(
                f"{self.name}: is in {len(numbers)} pieces that share no nodes; one of"
                f" {cells.min()} triangles is at {self.where(int(np.argmax(of_cell == small)))}:"
                " merge the nodes along its edge, or leave its set out"
            )

    def _chains(self) -> list[NDArray[np.int64]]:
        rows = outer_sides(self.cells)
        leaving = np.bincount(rows[:, 0])
        if leaving.max() > 1:
            place = xy(self.points[np.argmax(leaving)])
            raise InputError(
                f"{self.name}: touches itself in one node at {place}; separate the two sides, or"
                " connect them by an edge"
            )
        after = {int(start): number for number, start in enumerate(rows[:, 0])}
        left, found = set(range(len(rows))), []
        while left:
            number, chain = min(left), []
            while number in left:
                left.remove(number)
                chain.append(number)
                number = after[int(rows[number, 1])]
            found.append(rows[chain])
        return found


def _loop(points: Array, rows: NDArray[np.int64]) -> Loop:
    a, b, m = points[rows].transpose(1, 0, 2)
    # The integral of x y' - y x' along a quadratic side, which Simpson's rule has exactly.
    tangents = (-3 * a + 4 * m - b, b - a, a - 4 * m + 3 * b)
    cross = [
        x[:, 0] * t[:, 1] - x[:, 1] * t[:, 0] for x, t in zip((a, m, b), tangents, strict=True)
    ]
    area = float(np.sum(cross[0] + 4 * cross[1] + cross[2]) / 12)
    return Loop(rows, area, a.mean(axis=0))


def plane_mesh(
    read: ReadMesh,
    of: NDArray[np.int64],
    names: Sequence[str],
    units: str = "mm",
    plane: Plane | None = None,
) -> PlaneMesh:
    """Return triangles of a mesh that was read as one body.

    Parameters
    ----------
    read
        The mesh.
    of
        Number of each triangle's region, -1 of those that are left out.
    names
        Of the regions.
    units
        Of the file.
    plane
        Where it must lie; found from the points by default.

    Raises
    ------
    InputError
        When it is not flat, a triangle is inverted or a needle, or nodes do not fit.
    """
    points, cells = read.points * UNITS[units], read.cells[of >= 0]
    if len(cells) > MOST_TRIANGLES:
        raise InputError(
            f"{read.path}: has {len(cells)} triangles; {MOST_TRIANGLES} at most are solved: mesh it"
            " more coarsely"
        )
    remarks: list[str] = []
    if read.split:
        remarks.append(f"{read.split} quadrilaterals were split along their shorter diagonals")
    kept = np.unique(cells[cells >= 0])
    own = _plane(points[kept])
    _check_flat(str(read.path), points[kept], own)
    if plane is not None:
        _check_same_plane(str(read.path), points[kept], plane)
    plane = plane or own
    flat = plane.flat(points[kept])
    merged, target = _merged(flat)
    if merged:
        remarks.append(f"{merged} nodes within {SAME_POINT:g} mm of others were merged with them")
    numbers = np.full(len(points), NONE, dtype=np.int64)
    numbers[kept] = target
    cells = np.where(cells >= 0, numbers[cells], NONE)
    first_order = not (cells[:, 3:] >= 0).any()
    of = of[of >= 0]
    mesh = PlaneMesh(
        str(read.path), flat, cells, of, names,
        {int(node): int(target[n]) for n, node in enumerate(kept)}, plane, remarks, first_order,
    )  # fmt: skip
    return _sound(_raised(_turned(mesh)))


def _plane(points: Array) -> Plane:
    """Return the plane of points, seen from the positive side of the axis it is most square to."""
    centre = points.mean(axis=0)
    normal = np.linalg.svd((points - centre).T @ (points - centre))[0][:, 2]
    most = int(np.argmax(np.abs(normal)))
    normal = normal * np.sign(normal[most])
    normal[np.abs(normal) < 1e-9] = 0.0  # exact where the plane is that of two axes
    normal /= np.linalg.norm(normal)
    origin = normal * (normal @ centre)
    return Plane.square_to(normal, origin, np.eye(3)[(most + 2) % 3])


def _away(points: Array, plane: Plane) -> float:
    return float(np.abs((points - plane.origin) @ plane.normal).max())


def _check_same_plane(name: str, points: Array, plane: Plane) -> None:
    away = _away(points, plane)
    if away > FLAT:
        raise InputError(
            f"{name}: lies in another plane than the limb's section: its nodes are up to"
            f" {away:.3g} mm off that plane; export both meshes in the same axes, or check --units"
        )


def _check_flat(name: str, points: Array, plane: Plane) -> None:
    away = _away(points, plane)
    if away > FLAT:
        raise InputError(
            f"{name}: is not flat: its nodes leave a plane by up to {away:.3g} mm; give the mesh of"
            " one plane section"
        )


def _merged(points: Array) -> tuple[int, NDArray[np.int64]]:
    """Return how many nodes lie on others, and which node stands for each: the first of them."""
    pairs = cKDTree(points).query_pairs(SAME_POINT, output_type="ndarray")
    n = len(points)
    if not len(pairs):
        return 0, np.arange(n)
    graph = coo_array((np.ones(len(pairs)), pairs.T), shape=(n, n))
    count, group = connected_components(graph, directed=False)
    first = np.full(count, n, dtype=np.int64)
    np.minimum.at(first, group, np.arange(n))
    return n - count, first[group]


def _turned(mesh: PlaneMesh) -> PlaneMesh:
    """Turn clockwise triangles round."""
    none = (np.diff(np.sort(mesh.cells[:, :3], axis=1), axis=1) == 0).any(axis=1)
    if none.any():
        raise InputError(
            f"{mesh.name}: a triangle has two corners in one place at"
            f" {mesh.where(int(np.argmax(none)))}; remove it"
        )
    a, b, c = mesh.points[mesh.cells[:, :3]].transpose(1, 0, 2)
    u, v = b - a, c - a
    clockwise = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0] < 0
    if not clockwise.any():
        return mesh
    cells = np.where(clockwise[:, None], mesh.cells[:, [0, 2, 1, 5, 4, 3]], mesh.cells)
    remark = f"{clockwise.sum()} clockwise triangles were turned round"
    return replace(mesh, cells=cells, remarks=[*mesh.remarks, remark])


def _raised(mesh: PlaneMesh) -> PlaneMesh:
    """Give every side a node between its ends, in the middle where the file has none."""
    every = sides(mesh.cells).reshape(-1, 3)
    ends = np.sort(every[:, :2], axis=1)
    unique, inverse = np.unique(ends, axis=0, return_inverse=True)
    middle = np.full(len(unique), NONE, dtype=np.int64)
    given = every[:, 2] >= 0
    middle[inverse[given]] = every[given, 2]
    other = given & (middle[inverse] != every[:, 2])
    if other.any():
        cell = int(np.argmax(other)) // 3
        raise InputError(
            f"{mesh.name}: two triangles have different nodes on the side that they share, at"
            f" {mesh.where(cell)}; merge the nodes"
        )
    lacking = middle < 0
    middle[lacking] = len(mesh.points) + np.arange(lacking.sum())
    points = np.concatenate([mesh.points, mesh.points[unique[lacking]].mean(axis=1)])
    cells = np.column_stack([mesh.cells[:, :3], middle[inverse].reshape(-1, 3)])
    used, numbers = np.unique(cells, return_inverse=True)
    place = np.full(len(points), NONE, dtype=np.int64)
    place[used] = np.arange(len(used))
    remarks = list(mesh.remarks)
    if mesh.first_order:
        remarks.append("first-order triangles: a node was added in the middle of each side")
    elif lacking.any():
        remarks.append(f"a node was added in the middle of {lacking.sum()} sides")
    return replace(
        mesh,
        points=points[used],
        cells=numbers.reshape(cells.shape),
        of_node={node: int(place[n]) for node, n in mesh.of_node.items()},
        remarks=remarks,
    )


def _sound(mesh: PlaneMesh) -> PlaneMesh:
    """Refuse triangles that are inverted or needles."""
    shape = scaled_jacobians(mesh.coordinates)
    worst = int(np.argmin(shape))
    if shape[worst] < LEAST_SHAPE:
        raise InputError(
            f"{mesh.name}: {_poor(mesh, worst, shape[worst])} at {mesh.where(worst)} (scaled"
            f" Jacobian {shape[worst]:.2f}; {LEAST_SHAPE} at least): mesh it anew"
        )
    if shape[worst] < POOR_SHAPE:
        remark = (
            f"{_poor(mesh, worst, shape[worst])} at {mesh.where(worst)} (scaled Jacobian"
            f" {shape[worst]:.2f}): stresses beside it are uncertain"
        )
        return replace(mesh, remarks=[*mesh.remarks, remark])
    return mesh


def _poor(mesh: PlaneMesh, cell: int, shape: float) -> str:
    """Say what is wrong with a triangle: its corners, or the nodes between them."""
    x = mesh.coordinates[[cell]]
    straight = np.concatenate([x[:, :3], (x[:, :3] + x[:, [1, 2, 0]]) / 2], axis=1)
    if float(scaled_jacobians(straight)[0]) >= POOR_SHAPE:
        what = "is inverted" if shape <= 0 else "is nearly inverted"
        return f"a triangle {what} by a curved side, whose middle node lies too far off,"
    if shape <= 0:
        return "a triangle is inverted"
    return f"a triangle is a needle with an angle of {float(smallest_angles(x)[0]):.1f} degrees"


def curved(
    mesh: PlaneMesh, curves: Mapping[str, ClosedCurve], tolerance: float
) -> tuple[PlaneMesh, int, int]:
    """Lay straight sides on boundaries of regions onto curves that their ends lie on.

    Parameters
    ----------
    mesh
        The mesh.
    curves
        By name, mm, in the mesh's axes.
    tolerance
        Largest distance of a node from the curve that it lies on, mm.

    Returns
    -------
    mesh : PlaneMesh
    laid, kept : int
        How many sides were curved, and how many stay straight, for a triangle would be inverted.
    """
    rows = _between_regions(mesh)
    a, b, m = mesh.points[rows].transpose(1, 0, 2)
    length = np.linalg.norm(b - a, axis=1)
    straight = np.linalg.norm(m - (a + b) / 2, axis=1) < _STRAIGHT * length
    rows, length = rows[straight], length[straight]
    points, moved = mesh.points.copy(), np.zeros(len(rows), dtype=bool)
    for curve in curves.values():
        x = mesh.points[rows]
        foot = np.stack([curve.evaluate(curve.nearest(x[:, i])) for i in range(3)], axis=1)
        away = np.linalg.norm(foot - x, axis=2)
        on = (away[:, :2].max(axis=1) < tolerance) & (away[:, 2] < _ALONG * length) & ~moved
        points[rows[on, 2]] = foot[on, 2]
        moved |= on
    kept = 0
    while True:
        poor = scaled_jacobians(points[mesh.cells]) < LEAST_SHAPE
        back = np.intersect1d(np.unique(mesh.cells[poor, 3:]), rows[moved, 2])
        if not len(back):
            return replace(mesh, points=points), int(moved.sum()), kept
        points[back] = mesh.points[back]
        moved &= ~np.isin(rows[:, 2], back)
        kept += len(back)


def _between_regions(mesh: PlaneMesh) -> NDArray[np.int64]:
    """Return the sides where a region ends, each once."""
    found = [outer_sides(mesh.cells[mesh.regions == n]) for n in np.unique(mesh.regions)]
    every = np.concatenate(found)
    return every[np.unique(every[:, 2], return_index=True)[1]]
