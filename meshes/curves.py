"""Closed curves: periodic cubic splines, and the ellipses and offsets interpolated by them."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from pydantic import AfterValidator, Field
from scipy.spatial import cKDTree

from calfsocket.io.errors import InputError

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

Array = NDArray[np.float64]
#: A coordinate, mm. No section of a limb is wider; sampling one of 10 km would not end.
Coordinate = Annotated[float, Field(ge=-1000, le=1000)]
Point = tuple[Coordinate, Coordinate]
Thickness = Annotated[float, Field(gt=0, le=1000)]
#: Points of a curve that are closer together than this, mm, are one.
SAME_POINT = 1e-3


def _neighbours_differ(value: tuple[Point, ...]) -> tuple[Point, ...]:
    for point, following in pairwise((*value, value[0])):
        if math.dist(point, following) <= SAME_POINT:
            raise ValueError(f"point {list(point)} is repeated; list each point once")
    return value


#: Points of a closed curve, mm, counter-clockwise, the first not repeated.
Points = Annotated[tuple[Point, ...], Field(min_length=4), AfterValidator(_neighbours_differ)]
#: Points on a curve, mm, shape (n, 2) -> how far to move them outward, mm, shape (n,).
Distance = Callable[[Array], Array]

#: Largest distance, mm, between an offset or ellipse and the spline that stands for it. Ten times
#: smaller moves no area by 0.01 %, and more knots slow OpenCASCADE down.
INTERPOLATION_TOLERANCE = 5e-4
#: Times an interval between knots may be halved; the limb's curves and sockets need 5.
MAX_HALVINGS = 12
#: Distance of the points from which the search for the nearest point starts, mm, and its steps.
FOOT_STEP, FOOT_ITERATIONS = 0.1, 6
#: Number of points by which it is decided whether a curve crosses itself.
CROSSING_POINTS = 2000


@dataclass(frozen=True)
class ClosedCurve:
    """A simple closed curve in the plane, x(t) for t in [0, period], counter-clockwise."""

    spline: "CubicSpline"  #: periodic and C2, with values in mm, shape (2,)

    @property
    def knots(self) -> Array:
        """Knots of the spline, from 0 to the period."""
        return self.spline.x

    @property
    def period(self) -> float:
        """Parameter at which the curve closes."""
        return float(self.spline.x[-1])

    def evaluate(self, t: ArrayLike, derivative: int = 0) -> Array:
        """Return x(t), mm, or a derivative of it, shape (..., 2)."""
        return self.spline(t, derivative)

    def normal(self, t: ArrayLike) -> Array:
        """Return the outward unit normal, shape (..., 2)."""
        velocity = self.evaluate(t, 1)
        tangent = velocity / np.linalg.norm(velocity, axis=-1, keepdims=True)
        return np.stack([tangent[..., 1], -tangent[..., 0]], axis=-1)

    def curvature(self, t: ArrayLike) -> Array:
        """Return the signed curvature, 1/mm, positive where the curve is convex."""
        velocity, acceleration = self.evaluate(t, 1), self.evaluate(t, 2)
        cross = velocity[..., 0] * acceleration[..., 1] - velocity[..., 1] * acceleration[..., 0]
        return cross / np.linalg.norm(velocity, axis=-1) ** 3

    def direction(self, points: Array) -> Array:
        """Return the unit tangents at the nearest points of the curve, shape (n, 2) as `points`."""
        velocity = self.evaluate(self.nearest(points), 1)
        return velocity / np.linalg.norm(velocity, axis=1)[:, None]

    def nearest(self, points: Array) -> Array:
        """Return the parameters of the nearest points of the curve, (n, 2) -> (n,).

        From the nearest of close samples by Newton's method for (x - c(t)) . c'(t) = 0, which
        `FOOT_ITERATIONS` bring to rounding.
        """
        t = self.sample(FOOT_STEP)
        t = t[cKDTree(self.evaluate(t)).query(points)[1]]
        for _ in range(FOOT_ITERATIONS):
            away, velocity = points - self.evaluate(t), self.evaluate(t, 1)
            slope = np.sum(away * self.evaluate(t, 2) - velocity**2, axis=1)
            t = (t - np.sum(away * velocity, axis=1) / slope) % self.period
        return t

    def integrate(self, integrand: Callable[[Array], Array]) -> float:
        """Integrate a function of t over the period with four Gauss points a knot interval."""
        points, weights = np.polynomial.legendre.leggauss(4)
        half = np.diff(self.knots)[:, None] / 2
        t = (self.knots[:-1, None] + half) + half * points
        return float(np.sum(half * weights * integrand(t)))

    @cached_property
    def area(self) -> float:
        """Enclosed area, mm^2: half the integral of x y' - y x', exact for a cubic spline."""

        def integrand(t: Array) -> Array:
            x, velocity = self.evaluate(t), self.evaluate(t, 1)
            return (x[..., 0] * velocity[..., 1] - x[..., 1] * velocity[..., 0]) / 2

        return self.integrate(integrand)

    @cached_property
    def perimeter(self) -> float:
        """Length, mm."""
        return self.integrate(lambda t: np.linalg.norm(self.evaluate(t, 1), axis=-1))

    def sample(self, step: float) -> Array:
        """Return parameters of points at most `step` mm apart along the curve, start included."""
        per_interval = 8
        fraction = np.arange(per_interval) / per_interval
        inner = (self.knots[:-1, None] + np.diff(self.knots)[:, None] * fraction).ravel()
        t = np.append(inner, self.period)
        chords = np.linalg.norm(np.diff(self.evaluate(t), axis=0), axis=1)
        arc = np.append(0.0, np.cumsum(chords))
        # Chords are a little short of arcs: a fifth more points keep the promise.
        count = int(np.ceil(1.2 * arc[-1] / step))
        return np.interp(np.linspace(0.0, arc[-1], count, endpoint=False), arc, t)

    def b_spline(self) -> tuple[int, Array, NDArray[np.int64], Array]:
        """Return degree, knots, multiplicities and control points of the same curve.

        The B-spline is clamped: it interpolates its first control point, which is also the last.
        The outer knots have the multiplicity of a periodic B-spline, the degree, and not one more.
        """
        from scipy.interpolate import make_interp_spline

        ends = self.evaluate([0.0, self.period], 1)
        b_spline = make_interp_spline(
            self.knots,
            self.evaluate(self.knots),
            k=3,
            bc_type=([(1, ends[0])], [(1, ends[1])]),
        )
        multiplicities = np.ones(len(self.knots), dtype=np.int64)
        multiplicities[[0, -1]] = 3
        return 3, self.knots, multiplicities, b_spline.c


def through(points: ArrayLike) -> ClosedCurve:
    """Return the periodic C2 cubic spline through the points, parameter = cumulative chord length.

    The points are counter-clockwise, the first not repeated, mm, shape (n, 2).
    """
    closed = np.asarray(points, dtype=float)
    closed = np.concatenate([closed, closed[:1]])
    chords = np.linalg.norm(np.diff(closed, axis=0), axis=1)
    t = np.append(0.0, np.cumsum(chords))
    return _periodic(t, closed)


def _periodic(t: Array, points: Array) -> ClosedCurve:
    from scipy.interpolate import CubicSpline  # a quarter of a second, which pictures do without

    return ClosedCurve(CubicSpline(t, points, bc_type="periodic"))


def interpolated(exact: Callable[[Array], Array], knots: ArrayLike) -> ClosedCurve:
    """Return a spline through x = `exact`(t), refined until it is within the tolerance.

    Parameters
    ----------
    exact
        The curve, periodic: parameters of shape (n,) -> points in mm of shape (n, 2).
    knots
        Parameters of the first attempt, from 0 to the period, shape (m,). An interval is halved
        while the spline is more than `INTERPOLATION_TOLERANCE` away from `exact` at a quarter,
        half or three quarters of it. Where `exact` is not smooth, a knot saves many others.
    """
    knots = np.asarray(knots, dtype=np.float64)
    for _ in range(MAX_HALVINGS + 1):
        points = exact(knots)
        points[-1] = points[0]  # equal but for rounding; the spline wants it exact
        curve = _periodic(knots, points)
        between = knots[:-1] + np.diff(knots) * np.array([[0.25], [0.5], [0.75]])
        wanted = exact(between.ravel()).reshape(3, -1, 2)
        errors = np.linalg.norm(curve.evaluate(between) - wanted, axis=-1)
        poor = errors.max(axis=0) > INTERPOLATION_TOLERANCE
        if not poor.any():
            return curve
        knots = np.sort(np.concatenate([knots, between[1, poor]]))
    raise InputError("a curve turns too sharply; smooth its points, its offset, or its bumps")


def ellipse(center: ArrayLike, semi_axes: ArrayLike, angle: float) -> ClosedCurve:
    """Return an ellipse; centre and semi-axes (a, b) in mm, `angle` of a from +x in degrees."""
    (a, b), turn = np.asarray(semi_axes, dtype=float), np.deg2rad(angle)
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])

    def exact(t: Array) -> Array:
        local = np.stack([a * np.cos(t), b * np.sin(t)], axis=-1)
        return np.asarray(center, dtype=float) + local @ rotation.T

    return interpolated(exact, np.linspace(0.0, 2 * np.pi, 9))


def offset(curve: ClosedCurve, distance: Distance) -> ClosedCurve:
    """Return a curve moved along its outward normal by a distance; it keeps its parameter."""

    def exact(t: Array) -> Array:
        points = curve.evaluate(t)
        return points + distance(points)[:, None] * curve.normal(t)

    return interpolated(exact, curve.knots)


def polar_angle(points: Array) -> Array:
    """Return the polar angle about the origin in degrees, 0 <= angle < 360."""
    return np.rad2deg(np.arctan2(points[..., 1], points[..., 0])) % 360.0


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


def xy(point: Array) -> str:
    """Return the coordinates of a point for messages, e.g. ``(1.50, -2.00) mm``."""
    x, y = np.round(point, 2) + 0.0  # no -0
    return f"({x:.2f}, {y:.2f}) mm"


def at(point: Array) -> str:
    """Return the polar angle and the coordinates of a point for messages."""
    return f"{round(float(polar_angle(point))) % 360} degrees, {xy(point)}"
