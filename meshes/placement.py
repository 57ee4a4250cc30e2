"""How a socket sits on a limb before anything is meshed, and whether it can be donned at all."""

from contextlib import nullcontext
from dataclasses import dataclass

import numpy as np
import shapely

from calfsocket.io.errors import InputError, error_context
from calfsocket.meshes.curves import Array, ClosedCurve
from calfsocket.meshes.limb import Limb, limb_curves
from calfsocket.meshes.socket import Socket

#: Distance of the points of the skin that are looked at, mm.
SKIN_STEP = 0.25
#: Distance of the points that stand for the other curves, mm.
CURVE_STEP = 0.1


@dataclass(frozen=True)
class Placement:
    """A socket on a limb, both undeformed; an overlap is negative where the skin is clear of it."""

    area_reduction: float  #: area within the inner face over that of the limb, 1 minus that
    perimeter_reduction: float  #: the same of the perimeters
    touching: float  #: share of the skin that lies outside the inner face and will be pressed
    smallest_overlap: float  #: how deep the skin lies in the socket, mm
    mean_overlap: float
    largest_overlap: float
    smallest_angle: float  #: anatomical angle of the smallest overlap, degrees
    largest_angle: float
    squeezed: float  #: greatest depth as a share of the tissue from the skin to the nearest bone


def check_placement(socket: Socket, limb: Limb, name: str = "") -> Placement:
    """Measure how a socket sits on a limb, and refuse what cannot be solved.

    Raises
    ------
    InputError
        In one line, with `name` in front and where: a face that crosses itself, a wall that folds
        over, a socket beside the limb, one that does not press on it, or one whose
        inner face reaches into bone.

    Notes
    -----
    Short of bone no depth separates what is solved from what is not (measured in NOTE.md). The
    reference sockets have a `squeezed` of 0.15 (TC), 0.09 (TSB) and 0.25 (HS).
    """
    with error_context(f"socket {name}") if name else nullcontext():
        return _placement(socket, limb)


def _placement(socket: Socket, limb: Limb) -> Placement:
    loops = limb_curves(limb)
    skin = loops[limb.contact_boundary]
    inner, _ = socket.faces(limb)
    at = limb.frame.at
    points = skin.evaluate(skin.sample(SKIN_STEP))
    face = inner.evaluate(inner.sample(CURVE_STEP))
    if not shapely.Polygon(face).intersects(shapely.Polygon(points)):
        distance = shapely.LinearRing(face).distance(shapely.LinearRing(points))
        raise InputError(
            f"lies beside the limb, {distance:.1f} mm away, centred at"
            f" {at(face.mean(axis=0))}; use the limb's frame, whose origin is inside the limb"
        )
    overlap = _distance(points, face)
    overlap[shapely.contains_xy(shapely.Polygon(face), *points.T)] *= -1
    least, most = int(np.argmin(overlap)), int(np.argmax(overlap))
    if overlap[most] <= 0:
        raise InputError(
            f"does not press on the limb: its inner face is at least {-overlap[most]:.2f} mm away"
            f" from the skin (closest at {at(points[most])}); make it smaller"
        )
    squeezed = overlap / _soft_tissue(points, limb, loops)
    worst = int(np.argmax(squeezed))
    if squeezed[worst] >= 1:
        raise InputError(
            f"reaches into bone: it presses {overlap[worst]:.1f} mm deep at"
            f" {at(points[worst])}, where the bone has"
            f" {overlap[worst] / squeezed[worst]:.1f} mm of soft tissue over it; make it larger or"
            " move it"
        )
    return Placement(
        area_reduction=1 - inner.area / skin.area,
        perimeter_reduction=1 - inner.perimeter / skin.perimeter,
        touching=float(np.mean(overlap > 0)),
        smallest_overlap=float(overlap[least]),
        mean_overlap=float(np.mean(overlap)),
        largest_overlap=float(overlap[most]),
        smallest_angle=float(limb.frame.angle(points[least])),
        largest_angle=float(limb.frame.angle(points[most])),
        squeezed=float(squeezed[worst]),
    )


def _distance(points: Array, polygon: Array) -> Array:
    """Return the distance of points from a closed polygon, shape (n,)."""
    edges = shapely.linestrings(np.stack([polygon, np.roll(polygon, -1, axis=0)], axis=1))
    nearest = shapely.STRtree(np.asarray(edges)).query_nearest(
        shapely.points(points), return_distance=True, all_matches=False
    )
    return np.asarray(nearest[1])


def _soft_tissue(points: Array, limb: Limb, loops: dict[str, ClosedCurve]) -> Array:
    """Return the distance from points of the skin to what does not give way, shape (n,), mm."""
    hard = [region.outer for region in limb.regions if region.tissue == "bone"]
    hard.append(limb.fixed_boundary)
    distances = [
        _distance(points, loops[name].evaluate(loops[name].sample(CURVE_STEP))) for name in hard
    ]
    return np.min(distances, axis=0)
