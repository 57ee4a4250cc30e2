"""Smooth curves through scanned outlines, whose points are uneven and noisy."""

from collections.abc import Iterator, Sequence
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import shapely
from scipy.linalg import eigh
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from calfsocket.meshes import curves
from calfsocket.meshes.curves import Array, ClosedCurve

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

#: How far a smooth curve may be from a rough outline unless the user says so, mm: four times the
#: noise of a good scan, 0.05 mm.
TOLERANCE = 0.2
#: Distance of the knots, mm, and most of them. A bump as narrow as TC's (7 degrees) is followed to
#: 1e-4 mm; closer knots would follow the noise of dense scans.
KNOT_STEP, MOST_KNOTS = 2.0, 250
#: Points that an outline must have before its shape and its noise can be told apart.
FEWEST = 32
#: Smallest radius of curvature of a curve that counts as smooth, mm. A right angle rounded off so
#: leaves its corner by 0.8 mm, so that none is lost within the usual tolerance.
SMALLEST_RADIUS = 2.0
#: Radius, mm, of an arc whose chord a side may be, and the longest such side, mm: the triangles of
#: a scan are up to 8 mm wide. What is longer was drawn straight.
_ARC, _CHORD = 10.0, 8.0
#: Distance of the points at which drawing and curve are compared, mm.
_COMPARED = 0.25
#: Places on the curve that are tried for each point: some 0.02 mm apart.
_PLACES = 20_000
#: Weights of the roughness that are tried, relative to the data's.
_WEIGHTS = np.logspace(-6, 8, 71)
#: How much more a free coefficient counts than by [2]_, against fits that follow the noise [3]_.
_CAUTION = 1.4
#: Standard deviation of normal errors over the median of their sizes.
_SIGMA = 1.4826
#: Times the points are assigned to places on the curve: their own order and distance are noisy.
_ROUNDS = 3


def fair(
    points: Array,
    tolerance: float,
    noise: float = 0.0,
    radius: float = SMALLEST_RADIUS,
    step: float = KNOT_STEP,
) -> tuple[Array, float, Array]:
    r"""Return points of a smooth closed curve near those given.

    A periodic cubic P-spline [1]_, which minimises

    .. math:: \sum_i |x_i - f(t_i)|^2 + \lambda \sum_k |\Delta^3 c_k|^2

    over its coefficients c. :math:`\lambda` is that of the least generalised cross-validation
    [2]_, which leaves the shape and takes the noise, or the next smaller one that keeps the
    tolerance, or the next larger one with which the curve is smooth:
    it does not cross itself, and its radius is nowhere less than `radius`.

    Parameters
    ----------
    points
        A closed polygon, mm, counter-clockwise, at least `FEWEST`.
    tolerance
        Beyond this distance, mm, of the curve from the polygon it is not looked further.
    noise
        Root mean square, mm, of the points' distances from the curve where it is known, as for the
        steps of voxels, which depend on each other: cross-validation would follow them.
    radius
        Smallest radius of curvature of a curve that counts as smooth, mm.
    step
        Distance of the knots, mm.

    Returns
    -------
    points : Array
        For `curves.through`.
    deviation : float
        Largest distance of the curve from vertices and sides of the polygon, mm; of sides, without
        what an arc of `_ARC` over them explains.
    place : Array
        Where.

    References
    ----------
    .. [1] P. H. C. Eilers and B. D. Marx, Statistical Science 11 (1996) 89-121,
       doi:10.1214/ss/1038425655.
    .. [2] P. Craven and G. Wahba, Numerische Mathematik 31 (1979) 377-403,
       doi:10.1007/BF01404567.
    .. [3] Y.-J. Kim and C. Gu, Journal of the Royal Statistical Society B 66 (2004) 337-356,
       doi:10.1046/j.1369-7412.2003.05316.x.
    """
    return next(fair_each(points, tolerance, noise, (radius,), step))


def fair_each(
    points: Array, tolerance: float, noise: float, radii: Sequence[float], step: float
) -> Iterator[tuple[Array, float, Array]]:
    """Yield what `fair` returns for one radius after the other; what they share is done once."""
    sides, arcs = _on_sides(points)
    fit, best, number = _fitted(points, noise, step)

    @cache
    def at(weight: float) -> tuple[Array, ClosedCurve, Array]:
        found = fit.spline(weight)(np.arange(number) / number)
        curve = curves.through(found)
        off = cKDTree(curve.evaluate(curve.sample(0.05))).query(sides)[0]
        return found, curve, np.maximum(off - arcs, 0.0)

    if at(best)[2].max() > tolerance:
        # What is noise on the whole may be shape at one place.
        closer = (float(weight) for weight in _WEIGHTS[_WEIGHTS < best][::-1])
        best = next((weight for weight in closer if at(weight)[2].max() <= tolerance), best)
    for radius in radii:
        for weight in map(float, _WEIGHTS[_WEIGHTS >= best]):
            found, curve, distance = at(weight)
            worst = int(np.argmax(distance))
            if distance[worst] > tolerance or _is_smooth(curve, radius):
                break
        yield found, float(distance[worst]), sides[worst]


def noise_of(points: Array, step: float) -> float:
    """Return the standard deviation, mm, of an outline's points about the curve of `fair`.

    Of normal distances, from their median, which a place where the curve misses the shape does not
    change.
    """
    fit, best, _ = _fitted(points, 0.0, step)
    places = fit.spline(best)(np.linspace(0, 1, _PLACES, endpoint=False))
    return float(_SIGMA * np.median(cKDTree(places).query(points)[0]))


def _fitted(points: Array, noise: float, step: float) -> tuple["_Fit", float, int]:
    """Return the splines near points, the weight of the best one, and the number of its knots."""
    length = shapely.LinearRing(points).length
    share = np.linalg.norm(np.diff(points, axis=0, prepend=points[:1]), axis=1).cumsum() / length
    number = int(np.clip(length / step, 16, MOST_KNOTS))
    for _ in range(_ROUNDS):
        fit = _Fit(points, share, min(number, len(points)))
        best = fit.best(noise)
        places = np.linspace(0, 1, _PLACES, endpoint=False)
        share = places[cKDTree(fit.spline(best)(places)).query(points)[1]]
    return fit, best, number


def _on_sides(points: Array) -> tuple[Array, Array]:
    """Return vertices of a polygon and points between them, and by how much an arc leaves these."""
    closed = np.concatenate([points, points[:1]])
    along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1)))
    even = np.union1d(along[:-1], np.arange(0.0, along[-1], _COMPARED))
    side = np.clip(np.searchsorted(along, even, side="right") - 1, 0, len(along) - 2)
    before, after = even - along[side], along[side + 1] - even
    between = np.column_stack([np.interp(even, along, closed[:, i]) for i in (0, 1)])
    return between, np.where(before + after <= _CHORD, before * after / (2 * _ARC), 0.0)


class _Fit:
    """All P-splines of one assignment of points to places, by the weight of their roughness."""

    def __init__(self, points: Array, share: Array, number: int) -> None:
        self._points, self._number = points, number
        self._knots = np.arange(-3, number + 4) / number
        self._base = base = self._basis(share)
        third = np.roll(np.eye(number), 1, 1) - np.eye(number)
        third = third @ third @ third
        penalty = third.T @ third
        self._moment = base.T @ points
        # Both are diagonal in these; with a little of the penalty, gaps in the data do no harm.
        start = (base.T @ base).toarray() + _WEIGHTS[0] * penalty
        self._scale, self._vectors = eigh(penalty, start)

    def _basis(self, share: Array) -> csr_array:
        """Return the values of the periodic B-splines at shares of the way around."""
        from scipy.interpolate import BSpline

        basis = BSpline.design_matrix(share % 1.0, self._knots, 3).tocoo()
        shape = len(share), self._number
        return csr_array((basis.data, (basis.row, basis.col % self._number)), shape=shape)

    def _coefficients(self, weight: float) -> tuple[Array, float]:
        """Return coefficients, and how many of them the data determine."""
        filter_ = 1 / (1 + (weight - _WEIGHTS[0]) * self._scale)
        coefficients = self._vectors @ (filter_[:, None] * (self._vectors.T @ self._moment))
        return coefficients, float(np.sum(filter_ * (1 - _WEIGHTS[0] * self._scale)))

    def best(self, noise: float) -> float:
        """Return the weight of the least generalised cross-validation, or that of the noise."""

        def misfit(weight: float) -> float:
            off = self._points - self._base @ self._coefficients(weight)[0]
            return float(np.sum(off**2))

        def score(weight: float) -> float:
            free = self._coefficients(weight)[1]
            return misfit(weight) / max(len(self._points) - _CAUTION * free, 1e-9) ** 2

        least = min(map(float, _WEIGHTS), key=score)
        allowed = len(self._points) * noise**2
        explained = [w for w in map(float, _WEIGHTS) if w > least and misfit(w) <= allowed]
        return max([least, *explained])

    def spline(self, weight: float) -> "BSpline":
        """Return the curve over shares of the way around."""
        from scipy.interpolate import BSpline

        coefficients = self._coefficients(weight)[0]
        return BSpline(self._knots, np.concatenate([coefficients, coefficients[:3]]), 3)


def _is_smooth(curve: ClosedCurve, radius: float) -> bool:
    sharpest = np.abs(curve.curvature(curve.sample(0.25))).max()
    return bool(sharpest <= 1 / radius) and curves.crossing_of(curve) is None
