"""The curves of a limb, and the check that they are nested as its regions say."""

from itertools import combinations, permutations
from pathlib import Path

import numpy as np
import shapely
from scipy.interpolate import PchipInterpolator
from scipy.spatial import cKDTree

from calfsocket.io.errors import InputError
from calfsocket.meshes import curves
from calfsocket.meshes.curves import Array, ClosedCurve
from calfsocket.meshes.data import EllipseCurve, Limb, OffsetCurve, SplineCurve

#: Curves closer than this, mm, are taken for touching: no element would fit between them.
MIN_GAP = 0.1
#: Distance of the points at which curves are compared, mm.
SAMPLE_STEP = 0.1
#: Number of points by which it is told whether a curve crosses itself.
CROSSING_POINTS = 2000


def limb_curves(limb: Limb) -> dict[str, ClosedCurve]:
    """Return the curves that bound regions, by name; unused ones of the file are left out."""
    used = {name for region in limb.regions for name in region.loops}
    made: dict[str, ClosedCurve] = {}

    def make(name: str) -> ClosedCurve:
        if name in made:
            return made[name]
        curve = limb.curves[name]
        if isinstance(curve, SplineCurve):
            made[name] = curves.through(curve.points)
        elif isinstance(curve, EllipseCurve):
            made[name] = curves.ellipse(curve.center, curve.semi_axes, curve.angle_deg)
        elif isinstance(curve, OffsetCurve):
            made[name] = curves.offset(make(curve.of), _inward(limb, curve))
        return made[name]

    return {name: make(name) for name in limb.curves if name in used}


def polar_angle(points: Array) -> Array:
    """Return the polar angle about the origin in degrees, 0 <= angle < 360."""
    return np.rad2deg(np.arctan2(points[..., 1], points[..., 0])) % 360.0


def _inward(limb: Limb, curve: OffsetCurve) -> curves.Distance:
    """Return the distance (negative: inward) by which an offset curve is moved."""
    layers = limb.layers
    if curve.law == "skin":
        return lambda points: np.full(len(points), -layers.skin_thickness)
    angles, thickness = np.array(layers.fat_thickness).T
    # Two turns more than one make the interpolation, which is local, periodic.
    fat = PchipInterpolator(
        np.concatenate([angles - 360, angles, angles + 360]), np.tile(thickness, 3)
    )
    return lambda points: -(layers.skin_thickness + fat(polar_angle(points)))


def check_loops(limb: Limb, source: Path) -> None:
    """Raise an InputError unless curves are simple, disjoint and nested as the regions say."""
    loops = limb_curves(limb)
    samples = {name: curve.evaluate(curve.sample(SAMPLE_STEP)) for name, curve in loops.items()}
    for name, curve in loops.items():
        if curve.area <= 0:
            raise InputError(f"{source}: curves.{name}: runs clockwise; reverse its points")
        crossing = crossing_of(curve)
        if crossing is not None:
            raise InputError(
                f"{source}: curves.{name}: crosses itself at {at(crossing)}; move its points apart"
            )
    if not inside(np.zeros(2), samples[limb.contact_boundary]):
        raise InputError(
            f"{source}: curves.{limb.contact_boundary}: does not go round the origin, about which"
            " angles are measured; shift all curves so that it does"
        )
    trees = {name: cKDTree(points) for name, points in samples.items()}
    for name, other in combinations(samples, 2):
        gaps = trees[name].query(samples[other], distance_upper_bound=MIN_GAP)[0]
        if gaps.min() < MIN_GAP:
            nearest = samples[other][np.argmin(gaps)]
            raise InputError(
                f"{source}: curves.{name}: comes within {gaps.min():.3f} mm of '{other}' at"
                f" {at(nearest)}; keep curves {MIN_GAP} mm apart"
            )
    # Curves that do not touch lie inside one another wholly or not at all: one point tells.
    for region in limb.regions:
        place = f"{source}: regions.{region.name}"
        for hole in region.holes:
            if not inside(samples[hole][0], samples[region.outer]):
                raise InputError(f"{place}: hole '{hole}' is not inside '{region.outer}'")
        for hole, other in permutations(region.holes, 2):
            if inside(samples[hole][0], samples[other]):
                raise InputError(f"{place}: hole '{hole}' lies inside hole '{other}'")


def inside(point: Array, polygon: Array) -> bool:
    """Return whether a point is inside a polygon: a ray to +x crosses it an odd number of times."""
    start, end = polygon, np.roll(polygon, -1, axis=0)
    straddles = (start[:, 1] > point[1]) != (end[:, 1] > point[1])
    start, end = start[straddles], end[straddles]
    fraction = (point[1] - start[:, 1]) / (end[:, 1] - start[:, 1])
    crossing = start[:, 0] + fraction * (end[:, 0] - start[:, 0])
    return bool(np.sum(crossing > point[0]) % 2)


def self_crossing(polygon: Array) -> Array | None:
    """Return a point where a closed polygon crosses or touches itself, shape (2,), if it does."""
    ring = shapely.LinearRing(polygon)
    if ring.is_simple:
        return None
    # Such as "Self-intersection[1.5 2]".
    reason = shapely.is_valid_reason(shapely.Polygon(ring))
    return np.array([float(number) for number in reason.split("[")[1].rstrip("]").split()])


def crossing_of(curve: ClosedCurve) -> Array | None:
    """Return a point where a curve crosses or touches itself, shape (2,), if it does."""
    return self_crossing(curve.evaluate(curve.sample(curve.perimeter / CROSSING_POINTS)))


def at(point: Array) -> str:
    """Return a point as people read it: its polar angle and its coordinates."""
    x, y = np.round(point, 2) + 0.0  # no -0
    return f"{round(float(polar_angle(point))) % 360} degrees, ({x:.2f}, {y:.2f}) mm"
