"""How a socket sits on a limb before anything is meshed, and whether it can be donned at all."""

from contextlib import nullcontext
from dataclasses import dataclass

import numpy as np
import shapely
from scipy.optimize import least_squares

from calfsocket.io.errors import InputError, error_context
from calfsocket.meshes.curves import Array, ClosedCurve
from calfsocket.meshes.limb import Limb
from calfsocket.meshes.lining import Lining, fitted
from calfsocket.meshes.sizing import SIZES, AdaptiveSize, MeshSize
from calfsocket.meshes.socket import MeshedSocket, Outline, Sections, Socket

#: Distance of the points of the skin that are looked at, mm.
SKIN_STEP = 0.25
#: Distance of the points that stand for the other curves, mm.
CURVE_STEP = 0.1
#: Distance of the points of the skin by which it is found whether a socket holds on to it, mm.
GRIP_STEP = 1.0
#: A socket that takes less than this share of the limb's area may be no smaller than the limb: the
#: skin's outline, scanned with 0.05 mm of noise, encloses its own area to 0.03 %.
NOT_SMALLER = 5e-4
#: Soft tissue and liner are not squeezed to less than this share of their area: on average they
#: would lose more volume than any of them does at any point in the reference sockets (J > 0.74).
LEAST_ROOM = 0.7
#: It presses nowhere if all overlap but this, mm, can be moved away: what a scanner resolves.
NO_GRIP = 0.05
#: A socket that was made elsewhere may lie askew if the depth of the skin in it varies by more than
#: this, rms, mm (0.03 to 0.5 in the reference sockets) ...
UNEVEN = 1.5
#: ... and if another place makes that less than this share of it.
MORE_EVEN = 0.5
#: Turns at which another place is looked for, and then around the best of them, degrees.
TURNS, FINE_TURNS = range(0, 360, 10), range(-9, 10)
#: An outline whose centre is at least this far from the limb's may be drawn in another frame, mm.
OFF_CENTRE = 5.0


@dataclass(frozen=True)
class Placement:
    """A socket on a limb, both undeformed; an overlap is negative where the skin is clear of it.

    With a liner, "the skin" is the surface that meets what is around it: the outer face of a liner
    on the limb; and the "inner face" that of a liner inside the socket.
    """

    area_reduction: float  #: area within the inner face over that of the limb, 1 minus that
    perimeter_reduction: float  #: the same of the perimeters
    touching: float  #: share of the skin that lies outside the inner face and will be pressed
    smallest_overlap: float  #: how deep the skin lies in the socket, mm
    mean_overlap: float
    largest_overlap: float
    smallest_angle: float  #: anatomical angle of the smallest overlap, degrees
    largest_angle: float
    squeezed: float  #: greatest depth as a share of the tissue from the skin to the nearest bone


def check_placement(
    socket: Socket,
    limb: Limb,
    name: str = "",
    floating: bool = True,
    liner: Lining | None = None,
) -> Placement:
    """Measure how a socket sits on a limb, and refuse what cannot be solved.

    Parameters
    ----------
    socket, limb
        Both undeformed.
    name
        Of the socket, for messages.
    floating
        Whether the socket rests on the limb alone, so that it must press from more than one side.
    liner
        Between limb and socket.

    Raises
    ------
    InputError
        In one line, with `name` in front and where: a face that crosses itself, a wall that folds
        over, a socket beside the limb, one that does not press on it or only moves away from it,
        or one whose inner face reaches into bone.

    Notes
    -----
    Short of bone no depth separates what is solved from what is not (measured in NOTE.md). The
    reference sockets have a `squeezed` of 0.15 (TC), 0.09 (TSB) and 0.25 (HS).
    """
    with error_context(f"socket {name}") if name else nullcontext():
        return _placement(socket, limb, floating, liner)


def with_own_mesh(limb: Limb, socket: Socket) -> dict[str, bool]:
    """Return which of limb and socket has a mesh of its own, which is solved as it is."""
    return {"limb": limb.mesh is not None, "socket": isinstance(socket, MeshedSocket)}


def check_size_of_rest(limb: Limb, socket: Socket, size: MeshSize | AdaptiveSize) -> None:
    """Check that a mesh size changes no mesh that a limb or a socket has of its own.

    Raises
    ------
    InputError
        For a number of triangles, and for a mesh that a solution refines.
    """
    own = " and ".join(name for name, has in with_own_mesh(limb, socket).items() if has)
    if own and (isinstance(size, AdaptiveSize) or size.triangles is not None):
        has = "have meshes of their own" if " and " in own else "has a mesh of its own"
        raise InputError(
            f"is {size.name}, but the {own} {has}, which is solved as it is; give"
            f" {', '.join(SIZES)}, the size of what is meshed besides"
        )


def check_liner_between(limb: Limb, socket: Socket, liner: Lining | None) -> None:
    """Check that a liner is bonded to no mesh that a limb or a socket has of its own.

    Raises
    ------
    InputError
        Where it is: it would share the nodes of that mesh.
    """
    own = with_own_mesh(limb, socket)
    if liner is None or not own[liner.bonded]:
        return
    other = "socket" if liner.bonded == "limb" else "limb"
    remedy = f"bond it to the {other}" if not own[other] else "leave the liner out"
    raise InputError(
        f"is '{liner.bonded}', but the {liner.bonded} has a mesh of its own, and a liner shares the"
        f" nodes of what it is bonded to; {remedy}, or import outlines in the place of the mesh"
    )


def _placement(socket: Socket, limb: Limb, floating: bool, liner: Lining | None) -> Placement:
    fit = fitted(limb, socket, liner)
    skin, inner = fit.surface, fit.face
    at = limb.frame.at
    points = skin.evaluate(skin.sample(SKIN_STEP))
    face = inner.evaluate(inner.sample(CURVE_STEP))
    aside = _aside(socket, face, points)
    if not shapely.Polygon(face).intersects(shapely.Polygon(points)):
        distance = shapely.LinearRing(face).distance(shapely.LinearRing(points))
        raise InputError(
            f"lies beside the limb, {distance:.1f} mm away, centred at {at(face.mean(axis=0))};"
            f" use the limb's frame, whose origin is inside the limb{aside}"
        )
    overlap = _overlap(points, face)
    least, most = int(np.argmin(overlap)), int(np.argmax(overlap))
    if overlap[most] <= 0:
        raise InputError(
            f"does not press on the limb: its inner face is at least {-overlap[most]:.2f} mm away"
            f" from the skin (closest at {at(points[most])}); {socket.tighter}{aside}"
        )
    squeezed = overlap / _soft_tissue(points, limb)
    worst = int(np.argmax(squeezed))
    if squeezed[worst] >= 1:
        over = "soft tissue and liner" if fit.surface is fit.lining else "soft tissue"
        thinner = ", or make the liner thinner" if liner else ""
        raise InputError(
            f"reaches into bone: it presses {overlap[worst]:.1f} mm deep at"
            f" {at(points[worst])}, where the bone has"
            f" {overlap[worst] / squeezed[worst]:.1f} mm of {over} over it; make it larger or"
            f" move it{thinner}{aside}"
        )
    area_reduction = 1 - inner.area / skin.area
    if liner and (left := _room_left(limb, skin, inner)) < LEAST_ROOM:
        raise InputError(
            f"leaves soft tissue and a liner of {liner.thickness:g} mm"
            f" {100 * max(left, 0):.0f} % of their area, and they lose"
            " little volume; make the liner thinner or the socket larger"
        )
    if floating and area_reduction < NOT_SMALLER:
        _check_grip(socket, area_reduction, points, face)
    return Placement(
        area_reduction=area_reduction,
        perimeter_reduction=1 - inner.perimeter / skin.perimeter,
        touching=float(np.mean(overlap > 0)),
        smallest_overlap=float(overlap[least]),
        mean_overlap=float(np.mean(overlap)),
        largest_overlap=float(overlap[most]),
        smallest_angle=float(limb.frame.angle(points[least])),
        largest_angle=float(limb.frame.angle(points[most])),
        squeezed=float(squeezed[worst]),
    )


def askew(socket: Socket, limb: Limb) -> str | None:
    """Return in what other place a socket that was made elsewhere fits far better, if in any.

    Turned, moved or mirrored: its file may have other axes than the limb's.
    """
    if not isinstance(socket, Outline | Sections | MeshedSocket):
        return None
    inner = socket.faces(limb)[0]
    skin = limb.skin.evaluate(limb.skin.sample(GRIP_STEP))
    face = inner.evaluate(inner.sample(GRIP_STEP))
    here = _overlap(skin, face)
    if np.std(here) <= UNEVEN:
        return None
    middle, centre = (np.array(shapely.Polygon(each).centroid.coords[0]) for each in (skin, face))
    mirrored, turn, there = _most_even(skin - middle, face - centre)
    if np.std(there) >= MORE_EVEN * np.std(here):
        return None
    x, y = np.round(middle - centre, 1) + 0.0
    words = ["mirrored"] * mirrored
    words += [f"turned by {turn} degrees about its middle"] * (turn != 0)
    words += [f"moved by ({x:g}, {y:g}) mm"] * bool(x or y)
    return (
        f"lies askew on the limb: its inner face is from {here.min():.1f} to {here.max():.1f} mm"
        f" inside the skin; {' and '.join(words)} it would be from {there.min():.1f} to"
        f" {there.max():.1f} mm inside it; check the axes of its file"
    )


def _most_even(skin: Array, face: Array) -> tuple[bool, int, Array]:
    """Find where a face lies most evenly in the skin, both about their middles.

    Returns
    -------
    mirrored, turn, overlap
        Whether it is mirrored, by how many degrees it is turned, and the overlaps there, mm.
    """

    def at(place: tuple[bool, int]) -> Array:
        mirrored, degrees = place
        turn = np.radians(degrees)
        axes = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
        return _overlap(skin, (face * [-1.0 if mirrored else 1.0, 1.0]) @ axes)

    def unevenness(place: tuple[bool, int]) -> float:
        return float(np.std(at(place)))

    coarse = [(mirrored, turn) for mirrored in (False, True) for turn in TURNS]
    mirrored, turn = min(coarse, key=unevenness)
    best = min(((mirrored, turn + more) for more in FINE_TURNS), key=unevenness)
    return mirrored, (best[1] + 180) % 360 - 180, at(best)


def _room_left(limb: Limb, surface: ClosedCurve, face: ClosedCurve) -> float:
    """Return the area within a face over that within a surface, both without what is hard."""
    areas = limb.areas
    soft = sum(areas[region.name] for region in limb.regions if region.tissue != "bone")
    hard = limb.skin.area - soft
    return (face.area - hard) / (surface.area - hard)


def _aside(socket: Socket, face: Array, points: Array) -> str:
    """Return by what shift an outline that is not centred on the limb would be."""
    here, there = (shapely.Polygon(each).centroid.coords[0] for each in (face, points))
    move = np.subtract(there, here)
    if not isinstance(socket, Outline) or np.linalg.norm(move) < OFF_CENTRE:
        return ""
    x, y = np.round(move + socket.shift, 1) + 0.0
    return f"; shift = ['{x:g} mm', '{y:g} mm'] centres it on the limb"


def _check_grip(socket: Socket, lost: float, points: Array, face: Array) -> None:
    """Refuse a floating socket that a rigid motion takes off the limb: nothing would hold it."""
    few = points[:: round(GRIP_STEP / SKIN_STEP)]
    middle = few.mean(axis=0)
    reach = np.linalg.norm(few - middle, axis=1).max()

    def left(motion: Array) -> Array:
        """Return the overlap after the limb has moved by x, y and an arc at its rim, mm."""
        angle = motion[2] / reach
        turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        return _overlap((few - middle) @ turn + middle + motion[:2], face)

    # From a start of 0, steps of the derivative would be 0.
    found = least_squares(lambda m: np.maximum(left(m), 0.0), np.full(3, 1e-3), diff_step=0.01)
    if left(found.x).max() <= NO_GRIP:
        raise InputError(
            f"is not smaller than the limb (area lost {round(100 * lost, 2) + 0.0:.2f} %): resting"
            f" on the limb alone it only moves away, until it presses nowhere; {socket.tighter}, or"
            " constrain it by socket_support = 'outer-fixed'"
        )


def _overlap(points: Array, face: Array) -> Array:
    """Return how deep points lie outside a closed polygon, shape (n,), negative inside it."""
    overlap = _distance(points, np.stack([face, np.roll(face, -1, axis=0)], axis=1))
    overlap[shapely.contains_xy(shapely.Polygon(face), *points.T)] *= -1
    return overlap


def _distance(points: Array, edges: Array) -> Array:
    """Return the distance of points from the nearest of straight edges (n, 2, 2), shape (n,)."""
    tree = shapely.STRtree(np.asarray(shapely.linestrings(edges)))
    nearest = tree.query_nearest(shapely.points(points), return_distance=True, all_matches=False)
    return np.asarray(nearest[1])


def _soft_tissue(points: Array, limb: Limb) -> Array:
    """Return the distance from points of the skin to what does not give way, shape (n,), mm."""
    return _distance(points, limb.hard_edges(CURVE_STEP))
