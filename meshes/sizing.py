"""How large the triangles are, and where."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from calfsocket.io.errors import InputError
from calfsocket.io.schema import nearest
from calfsocket.meshes.curves import Array, ClosedCurve

#: Distance of the points that stand for a curve, mm.
SAMPLE_STEP = 0.1
#: Spacing of the grid on which the size is given to gmsh, mm.
GRID_STEP = 0.25
#: Numbers of triangles that may be asked for: with fewer the thin layers are meshed badly.
FEWEST_TRIANGLES, MOST_TRIANGLES = 7000, 1_000_000
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

    def for_triangles(self, count: Callable[["MeshSize"], int]) -> "MeshSize":
        """Return the final size; `count` returns how many triangles a mesh of a size has.

        A field that is scaled by a factor f has about 1/f^2 as many triangles, fewer where the
        outlines ask for small ones anyway. Trial meshes, the first one coarse, end within
        `COUNT_TOLERANCE`, or after `TRIALS`.
        """
        if self.triangles is None:
            return self
        factor, power = TRIAL_FACTOR, 2.0
        found = count(self.scaled(factor))
        for _ in range(TRIALS):
            excess = found / self.triangles
            if abs(excess - 1.0) < COUNT_TOLERANCE:
                break
            before, had = factor, found
            factor *= excess ** (1.0 / power)
            found = count(self.scaled(factor))
            power = float(np.clip(np.log(had / found) / np.log(factor / before), 1.0, 4.0))
        return self.scaled(factor)


SIZES = {
    size.name: size
    for size in (
        #        name     gap   curv small curves skin grow large  inner outer
        MeshSize("coarse", 1.70, 0.6, 0.70, 1.70, 1.70, 1.00, 6.0, 1.70, 2.20),
        MeshSize("medium", 1.00, 0.6, 0.50, 1.10, 1.00, 0.75, 5.0, 1.10, 1.60),
        MeshSize("paper", 0.57, 0.6, 0.28, 0.85, 0.60, 0.60, 4.5, 0.70, 1.15),
    )
}


def mesh_size(name: str) -> MeshSize:
    """Return the size of this name, or for this number of triangles.

    Raises
    ------
    InputError
        For another name, or a number that is too small for the outlines or too large to solve.
    """
    if name in SIZES:
        return SIZES[name]
    if name.isascii() and name.isdigit():
        if not FEWEST_TRIANGLES <= int(name) <= MOST_TRIANGLES:
            raise InputError(f"size: {name} triangles; give {FEWEST_TRIANGLES} to {MOST_TRIANGLES}")
        return replace(SIZES["paper"], name=str(int(name)), triangles=int(name))
    raise InputError(
        f"size: no mesh size '{name}'; {nearest(name, SIZES)}, or a number of triangles"
    )


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

    def write(self, path: Path) -> None:
        """Write the binary file that gmsh's field `Structured` reads: a grid one layer thick."""
        with path.open("wb") as file:
            # numpy's tofile would not say why it cannot write.
            file.write(np.array([*self.origin, 0.0, GRID_STEP, GRID_STEP, 1.0]).tobytes())
            file.write(np.array([*self.values.shape, 1], dtype=np.int32).tobytes())
            file.write(np.asarray(self.values, dtype=np.float64).tobytes())


def limb_field(loops: Mapping[str, ClosedCurve], contact: str, size: MeshSize) -> SizeField:
    """Return the element size of the limb, from its curves; `contact` names the skin's outline."""
    parameters = {name: curve.sample(SAMPLE_STEP) for name, curve in loops.items()}
    points = {name: loops[name].evaluate(t) for name, t in parameters.items()}
    sizes = []
    for name, curve in loops.items():
        others = np.concatenate([p for other, p in points.items() if other != name])
        gap = cKDTree(others).query(points[name])[0]
        with np.errstate(divide="ignore"):
            radius = 1 / np.abs(curve.curvature(parameters[name]))
        most = size.on_skin if name == contact else size.on_curves
        wanted = np.clip(size.gap_fraction * gap, size.smallest, most)
        sizes.append(np.minimum(wanted, size.curvature_fraction * radius))
    return _spread(np.concatenate(list(points.values())), np.concatenate(sizes), size)


def socket_field(*faces: ClosedCurve, size: MeshSize) -> SizeField:
    """Return the element size of the socket, from its faces; a liner's inner face comes first."""
    points = [curve.evaluate(curve.sample(SAMPLE_STEP)) for curve in faces]
    wanted = [size.socket_inner] * (len(faces) - 1) + [size.socket_outer]
    sizes = [np.full(len(p), h) for p, h in zip(points, wanted, strict=True)]
    return _spread(np.concatenate(points), np.concatenate(sizes), size)


def _spread(points: Array, sizes: Array, size: MeshSize) -> SizeField:
    """Let the size grow away from points on curves, as steeply as allowed and no steeper."""
    origin = points.min(axis=0) - 2 * GRID_STEP
    shape = np.ceil((points.max(axis=0) - origin) / GRID_STEP).astype(int) + 3
    axes = [origin[i] + GRID_STEP * np.arange(shape[i]) for i in (0, 1)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    # Farther away than this, no curve has a say; the tree then returns an infinite distance.
    reach = (size.largest - sizes.min()) / size.growth
    distance, nearest_point = cKDTree(points).query(grid, distance_upper_bound=reach)
    sizes = np.append(sizes, size.largest)
    values = np.minimum(sizes[nearest_point] + size.growth * distance, size.largest)
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
            return SizeField(origin, values)
