"""Areas between curves: widths carved out of them, corners rounded, smooth curves around them."""

import numpy as np
import shapely
from scipy.ndimage import gaussian_filter1d
from shapely.geometry.base import BaseGeometry

from calfsocket.imaging.landmarks import Ring
from calfsocket.meshes import curves
from calfsocket.meshes.curves import Array, ClosedCurve

#: Distance of the points of a boundary while it is smoothed, mm, and by how much (one standard
#: deviation of the Gaussian): more than the facets of the areas, less than any radius that is kept.
_STEP, _BLUR = 0.1, 0.25
#: Distance of the first points of a curve, mm, and how far it may leave the smoothed boundary, mm.
_FIRST, _TOLERANCE = 6.0, 0.02
#: Sides of a quarter of a circle.
_SIDES = 12


def polygon(ring: Ring) -> shapely.Polygon:
    """Return the area within a closed polygon; one that touches itself loses the smaller part."""
    area = shapely.Polygon(ring.points)
    return area if area.is_valid else largest(shapely.make_valid(area))


def largest(area: BaseGeometry) -> shapely.Polygon:
    """Return the largest part of an area; an empty polygon where there is none."""
    parts = [part for part in shapely.get_parts(area) if part.geom_type == "Polygon"]
    return max(parts, key=lambda part: part.area, default=shapely.Polygon())


def band(points: Array, widths: Array) -> BaseGeometry:
    """Return all places within the given distances of a closed line, (n, 2) and (n,), mm.

    From point to point the width changes evenly: the larger of the two all along would take half a
    per cent of the atlas's bellies and give it to the fascia between them, which would get 6 %
    thicker.
    """
    discs = shapely.buffer(shapely.points(points), widths, quad_segs=_SIDES)
    pairs = shapely.multipolygons(np.stack([discs, np.roll(discs, -1)], axis=1))
    return shapely.union_all(shapely.convex_hull(pairs))


def rounded(area: BaseGeometry, radius: float) -> shapely.Polygon:
    """Return an area without spurs narrower than twice a radius, its corners rounded to it."""
    opened = area.buffer(-radius, quad_segs=_SIDES).buffer(radius, quad_segs=_SIDES)
    return largest(opened)


def curve_around(area: shapely.Polygon) -> ClosedCurve:
    """Return a smooth curve along the outer boundary of an area, with few points."""
    ring = Ring(outside(area))
    even = ring.at(ring.even(max(int(ring.length / _STEP), 64)))
    blurred = _blurred(even)
    # What the blur takes off curved sides is given back; it would add 0.3 % to the atlas's fascia.
    smooth = Ring(blurred + _blurred(even - blurred))
    number = len(even)
    kept = np.linspace(0, number, max(int(ring.length / _FIRST), 8), endpoint=False).astype(int)
    while True:
        curve = curves.through(smooth.points[kept])
        ends = np.append(kept, number)
        # A point's parameter: its share of the way between the two that are kept.
        t = np.interp(smooth.along[:-1], smooth.along[ends], curve.knots)
        away = np.sum((smooth.points - curve.evaluate(t)) * curve.normal(t), axis=1)
        poor = np.flatnonzero(np.abs(away) > _TOLERANCE)
        if not poor.size:
            return curve
        interval = np.unique(np.searchsorted(kept, poor, side="right") - 1)
        more = np.union1d(kept, (ends[interval] + ends[interval + 1]) // 2)
        if len(more) == len(kept):
            return curve  # every point of the boundary is kept there
        kept = more


def _blurred(points: Array) -> Array:
    return np.asarray(gaussian_filter1d(points, _BLUR / _STEP, axis=0, mode="wrap"))


def curve_of(body: shapely.Polygon, number: int = 24) -> ClosedCurve:
    """Return a curve through points of a small smooth area's boundary: nothing is rounded off."""
    ring = Ring(outside(body))
    return curves.through(ring.at(ring.even(number)))


def outside(area: shapely.Polygon) -> Array:
    """Return the corners of an area's outer boundary, counter-clockwise, each once, (n, 2)."""
    points: Array = shapely.get_coordinates(area.exterior)[:-1]
    if not area.exterior.is_ccw:
        points = points[::-1]
    apart = np.linalg.norm(points - np.roll(points, 1, axis=0), axis=1)
    return np.asarray(points[apart > curves.SAME_POINT])
