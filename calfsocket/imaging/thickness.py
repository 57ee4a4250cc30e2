"""How thick the layers of a limb are, measured between its curves."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely

from calfsocket.imaging.landmarks import Ring
from calfsocket.imaging.reference import Reference
from calfsocket.meshes.curves import Array
from calfsocket.meshes.limb import Limb

#: Distance of the points at which thickness is measured, mm.
_STEP = 0.5
#: What is thicker than this, mm, is the corner between three bellies or the place of a vessel.
_WIDEST = 1.6


@dataclass(frozen=True)
class Thickness:
    """Thickness of a layer, mm."""

    smallest: float
    median: float


def thickness(limb: Limb) -> dict[str, Thickness]:
    """Measure the layers of a limb with the atlas's regions.

    Returns
    -------
    dict of str to Thickness
        ``skin``, ``fat``; ``crural fascia`` between bellies and fat, ``septa`` between bellies,
        ``sheaths`` between bellies and bones: distances from points of a curve to the nearest
        other one.
    """
    atlas = Reference.of(limb)
    skin, inner = atlas.skin_ring, atlas.rings[atlas.fat.outer]
    found = {
        "skin": _of(_distance(inner, skin)),
        "fat": _of(_distance(atlas.envelope, inner)),
    }
    kinds = {
        "crural fascia": [atlas.envelope],
        "sheaths": [atlas.ring(name) for name in atlas.bones],
    }
    others = [atlas.ring(name) for name in atlas.inlays]
    bellies = {name: atlas.ring(name) for name in atlas.bellies}
    measured: dict[str, list[Array]] = {"crural fascia": [], "septa": [], "sheaths": []}
    for name, ring in bellies.items():
        rings = kinds | {"septa": [each for other, each in bellies.items() if other != name]}
        distance = {kind: _nearest(ring, each) for kind, each in rings.items()}
        least = np.min([*distance.values(), _nearest(ring, others)], axis=0)
        for kind, values in distance.items():
            measured[kind].append(values[(values == least) & (values < _WIDEST)])
    for kind, parts in measured.items():
        values = np.concatenate(parts)
        if len(values):
            found[kind] = _of(values)
    return found


def _of(values: Array) -> Thickness:
    return Thickness(float(values.min()), float(np.median(values)))


def _points(ring: Ring) -> Array:
    return ring.at(ring.even(max(int(ring.length / _STEP), 16)))


def _distance(ring: Ring, other: Ring) -> Array:
    points = shapely.points(_points(ring))
    return np.asarray(shapely.distance(points, shapely.LinearRing(other.points)))


def _nearest(ring: Ring, others: list[Ring]) -> Array:
    """Return the distances of a ring's points from the nearest other one, up to `_WIDEST`."""
    points = _points(ring)
    found = np.full(len(points), np.inf)
    ends = [np.stack([each.points, np.roll(each.points, -1, axis=0)], axis=1) for each in others]
    if ends:
        sides: Any = shapely.linestrings(np.concatenate(ends))
        (place, _), distance = shapely.STRtree(sides).query_nearest(
            shapely.points(points), max_distance=_WIDEST, return_distance=True, all_matches=False
        )
        found[place] = distance
    return found
