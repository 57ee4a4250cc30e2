"""Vessels and tendons: carried by the map to their places, not changed in size."""

from collections.abc import Mapping

import numpy as np
import shapely
from shapely.affinity import affine_transform
from shapely.geometry.base import BaseGeometry

from calfsocket.imaging.correspondence import Correspondence
from calfsocket.imaging.landmarks import Ring
from calfsocket.imaging.reference import Reference
from calfsocket.imaging.smooth_map import SmoothMap
from calfsocket.meshes.curves import Array

#: What separates a vessel from the next curve, mm: in the atlas at least 0.53.
CLEARANCE = 0.5
#: The same in the fat, from skin and fascia.
IN_FAT = 0.4
#: Rounds in which vessels that are too close move apart; a dozen do nearly always.
_ROUNDS = 60
#: Factors by which a vessel is made smaller where it has no room, and the smallest area, mm^2.
_SMALLER, SMALLEST_AREA = 0.9, 1.0


def carried(ring: Ring, smooth: SmoothMap) -> shapely.Polygon:
    """Return an area where the map takes its centre, turned as the map turns it there."""
    center, gradient = smooth.with_gradient(ring.centroid[None])
    u, _, v = np.linalg.svd(gradient[0])
    return shapely.Polygon((ring.points - ring.centroid) @ (u @ v).T + center[0])


def below_skin(
    ring: Ring, atlas: Reference, found: Correspondence, thickness: float
) -> shapely.Polygon:
    """Return a vein at the same share of the fat's thickness, and to the skin as in the atlas.

    `thickness` is that of the section's skin, mm.
    """
    center = ring.centroid
    s = atlas.skin_ring.nearest(center[None])
    t = found.on_skin(s, atlas.skin_ring)
    skin, envelope = found.rings["skin"], found.rings["envelope"]
    depth = np.linalg.norm(center - atlas.skin_ring.at(s)[0]) - atlas.skin_thickness
    share = depth / (atlas.depth(s)[0] - atlas.skin_thickness)
    above = skin.at(t)[0]
    down = envelope.points[envelope.tree.query(above)[1]] - above
    fat = np.linalg.norm(down) - thickness
    place = above + down / np.linalg.norm(down) * (thickness + share * fat)
    (x, y), (u, v) = atlas.skin_ring.tangent(s)[0], skin.tangent(t)[0]
    turn = np.array([[x * u + y * v, y * u - x * v], [x * v - y * u, x * u + y * v]])
    return shapely.Polygon((ring.points - center) @ turn.T + place)


def apart(
    bodies: Mapping[str, shapely.Polygon],
    room: shapely.Polygon,
    solids: Mapping[str, shapely.Polygon],
    fixed: Mapping[str, shapely.Polygon],
) -> dict[str, shapely.Polygon]:
    """Move areas until none is closer than `CLEARANCE` to another, to a solid or to the edge.

    Parameters
    ----------
    bodies : mapping of str to Polygon
        What is moved.
    room : Polygon
        Within which they stay.
    solids, fixed : mapping of str to Polygon
        Bones, and areas of the same kind, that stay where they are.

    Returns
    -------
    dict of str to Polygon
        Those that found a place; one that did not is left out.
    """
    found = dict(bodies)
    edge = room.exterior
    for _ in range(_ROUNDS):
        moves = {name: np.zeros(2) for name in found}
        names = list(found)
        for i, name in enumerate(names):
            for other in names[i + 1 :]:
                push = _push(found[name], found[other])
                moves[name] += push / 2
                moves[other] -= push / 2
            for body in (*solids.values(), *fixed.values()):
                moves[name] += _push(found[name], body)
            if not room.contains(found[name]) or edge.distance(found[name]) < CLEARANCE:
                inward = _center(room) - _center(found[name])
                moves[name] += 0.2 * inward / np.linalg.norm(inward)
        if not any(move.any() for move in moves.values()):
            break
        found = {name: _moved(body, moves[name]) for name, body in found.items()}
    return {name: body for name, body in found.items() if not moves[name].any()}


def _push(body: shapely.Polygon, other: shapely.Polygon) -> Array:
    """Return how a body moves to be clear of another one, mm, (2,)."""
    distance = body.distance(other)
    if distance >= CLEARANCE - 1e-9:
        return np.zeros(2)
    if distance > 0:
        near, far = shapely.get_coordinates(shapely.shortest_line(body, other))
        return np.asarray(near - far) / distance * (CLEARANCE + 0.02 - distance)
    away = _center(body) - _center(other)
    length = np.linalg.norm(away)
    return 0.3 * away / length if length > 0 else np.array([0.3, 0.0])


def _center(body: BaseGeometry) -> Array:
    return np.array(body.centroid.coords[0])


def _moved(body: shapely.Polygon, by: Array, scale: float = 1.0) -> shapely.Polygon:
    x, y = _center(body)
    return affine_transform(
        body, [scale, 0, 0, scale, by[0] + (1 - scale) * x, by[1] + (1 - scale) * y]
    )


def in_fat(
    vein: shapely.Polygon, inner: shapely.Polygon, envelope: BaseGeometry | None
) -> shapely.Polygon | None:
    """Return a vein moved, and made smaller if it must be, to lie in the fat.

    Parameters
    ----------
    vein : Polygon
        Where the map takes it.
    inner : Polygon
        What lies below the skin.
    envelope : BaseGeometry, optional
        What the vein may not touch: muscles, where they have been measured, or bones.

    Returns
    -------
    Polygon, optional
        Nothing where even one of `SMALLEST_AREA` has no room.
    """
    scale = 1.0
    while vein.area * scale**2 >= SMALLEST_AREA:
        trial = _moved(vein, np.zeros(2), scale)
        for _ in range(_ROUNDS):
            move = np.zeros(2)
            grown = trial.buffer(IN_FAT)
            if not inner.contains(grown):
                outside = grown.difference(inner)
                inward = _center(inner) - np.array(outside.centroid.coords[0])
                move += 0.1 * inward / np.linalg.norm(inward)
            if envelope is not None and trial.distance(envelope) < IN_FAT:
                near, far = shapely.get_coordinates(shapely.shortest_line(trial, envelope))
                outward = near - far
                if not outward.any():
                    outward = _center(trial) - _center(envelope)
                move += 0.1 * outward / np.linalg.norm(outward)
            if not move.any():
                return trial
            trial = _moved(trial, move)
        scale *= _SMALLER
    return None
