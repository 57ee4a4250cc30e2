"""How large the triangles are, and where."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates
from scipy.spatial import cKDTree

from calfsocket.io.errors import InputError
from calfsocket.io.schema import nearest
from calfsocket.meshes.curves import Array, ClosedCurve

#: Distance of the points that stand for a curve, mm.
SAMPLE_STEP = 0.1
#: Spacing of the grid on which the size is given to gmsh, mm.
GRID_STEP = 0.25
#: Points of that grid, along each side, that are searched together for what is near.
BLOCK = 8
#: Points of curves that are not divided any further in a search: some 2 mm of a curve.
TOGETHER = 24
#: Numbers of triangles that may be asked for: with fewer the thin layers are meshed badly.
FEWEST_TRIANGLES, MOST_TRIANGLES = 7000, 1_000_000
#: Name of the size that a solution refines, and how many triangles it may have unless it says so.
ADAPTIVE, ADAPTIVE_TRIANGLES = "adaptive", 60_000
#: With fewer triangles than this the first mesh could hardly be refined.
FEWEST_ADAPTIVE = 20_000
#: Side lengths of the first trial mesh, in those of "paper".
TRIAL_FACTOR = 2.0
#: How close to the number of triangles trial meshes come, and how many there are after the first.
COUNT_TOLERANCE, TRIALS = 0.03, 4


@dataclass(frozen=True)
class MeshSize:
    """Parameters of the element size; lengths of triangle sides in mm.

    On a curve the size is ``gap_fraction`` times the distance to the nearest other curve, but at
    least ``smallest`` and at most ``on_curves`` (``on_skin`` on the contact surface), and never
    more than ``curvature_fraction`` times the radius of curvature. From there it grows by
    ``growth`` per mm of distance, up to ``largest``.

    With a number of ``triangles``, limb and socket together, these are only the shape of the field:
    `for_triangles` scales it so that the mesh has about so many.
    """

    name: str
    gap_fraction: float
    curvature_fraction: float
    smallest: float
    on_curves: float
    on_skin: float
    growth: float
    largest: float
    socket_inner: float
    socket_outer: float
    triangles: int | None = None

    def scaled(self, factor: float) -> "MeshSize":
        """Every triangle's side times a factor; this size is then final."""
        lengths = {
            field.name: factor * getattr(self, field.name)
            for field in fields(self)
            if field.name not in ("name", "triangles")
        }
        return replace(self, triangles=None, **lengths)

    def for_triangles(
        self, count: Callable[["MeshSize"], int], room: Callable[["MeshSize"], float]
    ) -> "MeshSize":
        """Return the final size, that of the last mesh that was counted.

        Equilateral triangles of a size would fill the section with a number of them that grows
        with 1/f^2 when every length is scaled by f. Along the curves a mesh needs some more for
        each edge, whose number grows with 1/f. A coarse mesh says how many; the next one mostly
        has the number that is asked for within `COUNT_TOLERANCE`. Where it has not, up to `TRIALS`
        follow a power of f through the last two.

        Parameters
        ----------
        count : callable
            Returns how many triangles a mesh of a size has.
        room : callable
            Returns how many equilateral triangles of a size would fill the section.
        """
        if self.triangles is None:
            return self
        factor = TRIAL_FACTOR
        found = count(self.scaled(factor))
        power = None
        for _ in range(TRIALS):
            excess = found / self.triangles
            if abs(excess - 1.0) < COUNT_TOLERANCE:
                break
            before, had = factor, found
            if power is None:
                area = room(self.scaled(factor)) * factor**2
                along = max(found * factor - area / factor, 0.0)
                # The grid of the field changes the room a little.
                near = self._factor(area, along)
                factor = self._factor(room(self.scaled(near)) * near**2, along)
            else:
                factor *= excess ** (1.0 / power)
            found = count(self.scaled(factor))
            power = float(np.clip(np.log(had / found) / np.log(factor / before), 1.0, 4.0))
        return self.scaled(factor)

    def second(self, cells: int) -> "MeshSize":
        """Return the size of a second mesh, with half as many triangles as this one has.

        With twice as many where half were fewer than `FEWEST_TRIANGLES`. Sizes have the same shape.
        """
        part, word = _part(cells, FEWEST_TRIANGLES)
        name = f"{word} the triangles of {self.name}"
        if self.triangles is None:
            return replace(self.scaled(part**-0.5), name=name)
        return replace(self, name=name, triangles=round(part * self.triangles))

    def _factor(self, area: float, along: float) -> float:
        """Return the factor f at which area / f^2 + along / f is the number of triangles."""
        assert self.triangles is not None
        root = np.sqrt(along**2 + 4.0 * area * self.triangles)
        return float((along + root) / (2.0 * self.triangles))


SIZES = {
    size.name: size
    for size in (
        #        name     gap   curv small curves skin grow large  inner outer
        MeshSize("coarse", 1.70, 0.6, 0.70, 1.70, 1.70, 1.00, 6.0, 1.70, 2.20),
        MeshSize("medium", 1.00, 0.6, 0.50, 1.10, 1.00, 0.75, 5.0, 1.10, 1.60),
        MeshSize("paper", 0.57, 0.6, 0.28, 0.85, 0.60, 0.60, 4.5, 0.70, 1.15),
    )
}


@dataclass(frozen=True)
class AdaptiveSize:
    """A mesh that a solution on the size ``first`` refines where its errors are.

    Limb and socket together have at most about so many ``triangles``.
    """

    name: str
    triangles: int
    first: MeshSize = SIZES["medium"]

    @property
    def final(self) -> MeshSize:
        """Size of the refined mesh: a number of triangles."""
        # Trial meshes come as close as this from either side.
        triangles = round(self.triangles / (1.0 + COUNT_TOLERANCE))
        return replace(self.first, name=self.name, triangles=triangles)

    def second(self, _: int) -> "AdaptiveSize":
        """Return the size of a second mesh, with half or twice as many triangles, refined anew."""
        part, word = _part(self.triangles, FEWEST_ADAPTIVE)
        name = f"{word} the triangles of {self.name}"
        return replace(self, name=name, triangles=round(part * self.triangles))


def _part(cells: int, fewest: int) -> tuple[float, str]:
    """Return which part of its triangles a second mesh has, and the word for it."""
    return (0.5, "half") if cells >= 2 * fewest else (2.0, "twice")


def any_size(name: str) -> MeshSize | AdaptiveSize:
    """Return the size of this name, for this number of triangles, or refined by a solution.

    Raises
    ------
    InputError
        For another name, or a number that is too small for the outlines or too large to solve.
    """
    if name in SIZES:
        return SIZES[name]
    if name == ADAPTIVE:
        return AdaptiveSize(name, ADAPTIVE_TRIANGLES)
    kind, dash, number = name.rpartition("-")
    adaptive = kind == ADAPTIVE
    if not (number.isascii() and number.isdigit() and (adaptive or not dash)):
        near = nearest(name, [*SIZES, ADAPTIVE])
        raise InputError(f"size: no mesh size '{name}'; {near}, or a number of triangles")
    triangles, fewest = int(number), FEWEST_ADAPTIVE if adaptive else FEWEST_TRIANGLES
    if not fewest <= triangles <= MOST_TRIANGLES:
        about = f"{name}: " if adaptive else ""
        raise InputError(f"size: {about}{triangles} triangles; give {fewest} to {MOST_TRIANGLES}")
    if adaptive:
        return AdaptiveSize(f"{ADAPTIVE}-{triangles}", triangles)
    return replace(SIZES["paper"], name=str(triangles), triangles=triangles)


def mesh_size(name: str) -> MeshSize:
    """Return the size of this name, or for this number of triangles, that needs no solution.

    Raises
    ------
    InputError
        As of `any_size`, and for a mesh that a solution refines.
    """
    return unrefined(any_size(name))


def unrefined(size: MeshSize | AdaptiveSize) -> MeshSize:
    """Return a size where a mesh is made without a solution.

    Raises
    ------
    InputError
        For a mesh that a solution refines.
    """
    if isinstance(size, AdaptiveSize):
        raise InputError(
            f"size: a mesh of size '{size.name}' is refined by a solution, and there is none here; "
            f"give {', '.join(SIZES)} or a number of triangles"
        )
    return size


def checked_size(size: str | int | MeshSize | AdaptiveSize) -> MeshSize | AdaptiveSize:
    """Return a mesh size by its name or by a number of triangles.

    Raises
    ------
    InputError
        If there is none of this name, or the number is outside its range.
    """
    if isinstance(size, MeshSize | AdaptiveSize):
        return size
    if isinstance(size, bool) or not isinstance(size, str | int):
        raise InputError(
            f"mesh size: is {size!r}; give {', '.join([*SIZES, ADAPTIVE])}, or a number of "
            "triangles"
        )
    try:
        return any_size(str(size))
    except InputError as error:
        raise InputError(f"mesh {error}") from None


def named_size(name: str) -> MeshSize:
    """Return the size of this name; a number of triangles is none."""
    if name not in SIZES:
        raise InputError(f"size: no mesh size '{name}'; {nearest(name, SIZES)}")
    return SIZES[name]


@dataclass(frozen=True)
class SizeField:
    """Element size on a regular grid, mm."""

    origin: Array  #: lower left corner, (2,)
    values: Array  #: at origin + GRID_STEP * (i, j), (n_x, n_y)

    def at(self, points: Array) -> Array:
        """Return the size at points (n, 2), linear between those of the grid; (n,)."""
        return np.asarray(
            map_coordinates(self.values, ((points - self.origin) / GRID_STEP).T, order=1)
        )

    def write(self, path: Path) -> None:
        """Write the binary file that gmsh's field `Structured` reads: a grid one layer thick."""
        with path.open("wb") as file:
            # numpy's tofile would not say why it cannot write.
            file.write(np.array([*self.origin, 0.0, GRID_STEP, GRID_STEP, 1.0]).tobytes())
            file.write(np.array([*self.values.shape, 1], dtype=np.int32).tobytes())
            file.write(np.asarray(self.values, dtype=np.float64).tobytes())


class Sizes(Protocol):
    """Element sizes of a body."""

    def field(self, size: MeshSize) -> SizeField:
        """Return the field of a size."""


class LimbSizes:
    """Element sizes of a limb, from its curves; `contact` names the skin's outline."""

    def __init__(self, loops: Mapping[str, ClosedCurve], contact: str) -> None:
        parameters = [curve.sample(SAMPLE_STEP) for curve in loops.values()]
        curves = list(zip(loops.values(), parameters, strict=True))
        self._curves = [curve.evaluate(t) for curve, t in curves]
        with np.errstate(divide="ignore"):
            radii = [1 / np.abs(curve.curvature(t)) for curve, t in curves]
        self._around = Surroundings(np.concatenate(self._curves))
        self._radius = np.concatenate(radii)
        self._on_skin = np.repeat([name == contact for name in loops], [*map(len, radii)])

    def field(self, size: MeshSize) -> SizeField:
        """Return the field of a size."""
        most = np.where(self._on_skin, size.on_skin, size.on_curves)
        gap = self._gaps(most.max() / size.gap_fraction)
        wanted = np.clip(size.gap_fraction * gap, size.smallest, most)
        sizes = np.minimum(wanted, size.curvature_fraction * self._radius)
        return self._around.spread(sizes, size)

    def _gaps(self, reach: float) -> Array:
        """Return the distance of each point from the nearest other curve, within a reach."""
        reach *= 1.0 + 1e-9  # what is left out is larger than the reach itself
        every = np.concatenate(self._curves)
        x, y = every.T.copy()
        curve = np.repeat(np.arange(len(self._curves)), [*map(len, self._curves)])
        gaps = []
        for number, points in enumerate(self._curves):
            (left, low), (right, high) = points.min(axis=0) - reach, points.max(axis=0) + reach
            around = (left < x) & (x < right) & (low < y) & (y < high) & (curve != number)
            gaps.append(_tree(every[around]).query(points, distance_upper_bound=reach)[0])
        return np.concatenate(gaps)


class SocketSizes:
    """Element sizes of a socket, from its faces; a liner's inner face comes first.

    `skin` is the outline that the first of them meets.
    """

    def __init__(self, *faces: ClosedCurve, skin: ClosedCurve) -> None:
        points = [curve.evaluate(curve.sample(SAMPLE_STEP)) for curve in faces]
        self._on_face = [len(each) for each in points]
        self._around = Surroundings(np.concatenate(points))
        self._first_face, self._skin = points[0], skin

    def field(self, size: MeshSize) -> SizeField:
        """Return the field of a size."""
        wanted = [size.socket_inner] * (len(self._on_face) - 1) + [size.socket_outer]
        return self._around.spread(np.repeat(wanted, self._on_face), size)

    def matched(self, field: SizeField, limb: SizeField, size: MeshSize) -> SizeField:
        """Return a field of the socket, no larger at the skin than that of the limb is there.

        The face of a socket is stiff and a chain of edges. Skin that sticks to it follows its
        motion, which is quadratic on each edge and has kinks between them: where sides of the skin
        are shorter than the socket's, they see these kinks, and its shear goes up and down with
        them.
        """
        sizes = np.full(sum(self._on_face), size.largest)
        on_skin = self._skin.evaluate(self._skin.sample(SAMPLE_STEP))
        opposite = on_skin[_tree(on_skin).query(self._first_face)[1]]
        sizes[: self._on_face[0]] = limb.at(opposite)
        values = np.minimum(field.values, self._around.spread(sizes, size).values)
        return replace(field, values=values)


def _tree(points: Array) -> cKDTree:
    """Return points to search; they lie along curves, where splitting at medians costs more."""
    return cKDTree(points, leafsize=TOGETHER, balanced_tree=False, compact_nodes=False)


class Surroundings:
    """A grid, of its own or of another field, and to each of its points the nearest of others."""

    def __init__(self, points: Array, like: SizeField | None = None) -> None:
        if like is None:
            origin = points.min(axis=0) - 2 * GRID_STEP
            shape = tuple(np.ceil((points.max(axis=0) - origin) / GRID_STEP).astype(int) + 3)
        else:
            origin, shape = like.origin, like.values.shape
        self._origin = origin
        axes = [origin[i] + GRID_STEP * np.arange(shape[i]) for i in (0, 1)]
        self._grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        self._tree = _tree(points)
        self._reach = 0.0  # of what is known of the nearest points

    def _within(self, reach: float) -> tuple[Array, NDArray[np.intp]]:
        """Distance and number of the point that is nearest to each of the grid, within a reach.

        Blocks of the grid that are farther away are left out.
        """
        shape = self._grid.shape[:2]
        first = np.ix_(*(np.arange(0, n, BLOCK) for n in shape))
        last = np.ix_(*(np.minimum(np.arange(0, n, BLOCK) + BLOCK, n) - 1 for n in shape))
        middle = 0.5 * (self._grid[first] + self._grid[last])
        # Half the diagonal of a block is less than this.
        bound = reach + BLOCK * GRID_STEP
        is_near = np.isfinite(self._tree.query(middle, distance_upper_bound=bound)[0])
        is_near = np.repeat(np.repeat(is_near, BLOCK, axis=0), BLOCK, axis=1)
        is_near = is_near[: shape[0], : shape[1]]
        distance, nearest = np.full(shape, np.inf), np.full(shape, self._tree.n)
        distance[is_near], nearest[is_near] = self._tree.query(
            self._grid[is_near], distance_upper_bound=reach
        )
        return distance, nearest

    def spread(self, sizes: Array, size: MeshSize) -> SizeField:
        """Let the size grow away from the points, as steeply as allowed and no steeper."""
        # Farther away than this, no point has a say.
        reach = (size.largest - sizes.min()) / size.growth
        if reach > self._reach:
            self._reach = reach * (1.0 + 1e-9)  # scaled sizes have the same one, but for rounding
            self._distance, self._nearest = self._within(self._reach)
        sizes = np.append(sizes, size.largest)  # where nothing is near, at an infinite distance
        values = np.minimum(sizes[self._nearest] + size.growth * self._distance, size.largest)
        values[self._distance >= reach] = size.largest
        # The nearest point need not be the one that asks for the smallest size: pass the limit on
        # from grid point to grid point until nothing changes any more.
        diagonal = np.sqrt(2.0)
        steps = [(1, 0, 1.0), (0, 1, 1.0), (1, 1, diagonal), (1, -1, diagonal)]
        while True:
            before = values.copy()
            for i, j, length in steps:
                a = values[i:, max(j, 0) : values.shape[1] + min(j, 0)]
                b = values[: values.shape[0] - i, max(-j, 0) : values.shape[1] - max(j, 0)]
                rise = size.growth * GRID_STEP * length
                np.minimum(a, b + rise, out=a)
                np.minimum(b, a + rise, out=b)
            if np.max(before - values) < 1e-3 * values.min():
                return SizeField(self._origin, values)
