"""A closed outline as somebody drew it: pieces joined to a polygon, and that checked."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, ClassVar, Self

import numpy as np
import shapely
from pydantic import Field
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from calfsocket.io.errors import InputError
from calfsocket.io.quantity import Written
from calfsocket.io.schema import Strict, nearest
from calfsocket.io.units import LENGTH
from calfsocket.meshes.curves import SAME_POINT, Array, self_crossing, xy
from calfsocket.meshes.fairing import TOLERANCE

#: Pieces are joined where their ends are at most this far apart, mm.
JOINT = 0.01
#: What a scanner resolves, mm: how far an outline may leave its plane, and how far two ends may be
#: apart that meet no other.
RESOLVED = 0.05
#: Width and height of an outline, mm. A leg is 60 to 250 mm thick; lengths in m, cm or inch taken
#: for mm fall below the range, lengths in micrometres above.
EXTENT = (30.0, 500.0)
#: Distance of the points that stand for curves and for straight lines between them, mm. With the
#: largest turn below, a spline through them is within 0.02 mm of a corner that it rounds off.
STEP = 0.25
#: Largest turn from one side to the next, degrees.
MAX_TURN = 30.0
#: Longest loop of an outline that noise is taken to have made, mm.
NOISE_LOOP = 5.0
#: Points of one outline. More are no shape but a cloud, or a file of another kind.
MAX_POINTS = 50_000
#: Curves of a drawing that a message lists.
_LISTED = 6
#: Units in mm.
UNITS = {"mm": 1.0, "m": 1000.0, "inch": 25.4, "cm": 10.0, "micrometres": 1e-3}


class OutlineFile(Strict):
    """How an outline is read from a file.

    Attributes
    ----------
    tolerance : float
        How far the curve may be from an outline that is too rough to be taken as it is, mm.
    layer, curve : str, optional
        Which curve of a drawing is meant: its layer, its handle (DXF) or id (SVG).
    """

    tolerance: Annotated[float, Written(LENGTH, "0.2 mm"), Field(gt=0, le=2)] = TOLERANCE
    layer: str | None = None
    curve: str | None = None
    extent: ClassVar[tuple[float, float]] = EXTENT  #: width and height that it may have, mm


@dataclass(frozen=True)
class Piece:
    """A part of an outline without branches."""

    place: str  #: in the file, e.g. "LINE 2F"
    points: Array  #: (n, 2) or (n, 3), mm: vertices; of a curve, points near it from end to end
    name: str = ""  #: its handle or id
    label: str = ""  #: what else it is called
    layer: str = ""
    sample: Callable[[], Array] | None = None  #: points of a curve at most `STEP` apart
    problem: str = ""  #: why it cannot be part of an outline

    @property
    def places(self) -> list[str]:
        """Place of each point."""
        if self.sample or len(self.points) == 2:
            return [self.place] * len(self.points)
        return [f"{self.place}, vertex {i}" for i in range(1, len(self.points) + 1)]

    @property
    def line(self) -> shapely.LineString:
        """The piece as straight lines."""
        return shapely.LineString(self.sample() if self.sample else self.points[:, :2])

    def dense(self) -> "Piece":
        """Return the same piece with points at most `STEP` apart."""
        points = shapely.get_coordinates(shapely.segmentize(self.line, STEP))
        return replace(self, points=points, sample=lambda: points)

    def reversed(self) -> "Piece":
        """Return the same piece from its end to its start."""
        sample = self.sample
        back = (lambda: sample()[::-1]) if sample else None
        return replace(self, points=self.points[::-1], sample=back)


@dataclass(frozen=True)
class Drawn:
    """A closed polygon: points on the outline, in the order of the file, the first not repeated."""

    path: Path
    points: Array  #: (n, 2), mm
    places: Sequence[str]  #: of each point in the file, e.g. "line 12"
    unit: str = ""  #: what the file says of it, for errors

    @classmethod
    def of(
        cls,
        path: Path,
        points: Array,
        places: Sequence[str],
        unit: str = "",
        extent: tuple[float, float] = EXTENT,
    ) -> Self:
        """Leave out the points that stand on the one before them, as programs write them."""
        sides = np.linalg.norm(points - np.roll(points, 1, axis=0), axis=1)
        keep = np.flatnonzero(sides > SAME_POINT)
        drawn = cls(path, points[keep], [places[i] for i in keep], unit)
        number = len(keep)
        if number >= 4:
            check_extent(path, drawn.points, extent, unit)
        else:
            raise InputError(
                f"{path}: has {number} {'point' if number == 1 else 'points'}; a closed curve"
                " needs at least 4, a socket a few dozen"
            )
        if number > MAX_POINTS:
            raise InputError(
                f"{path}: has {number} points, more than {MAX_POINTS}; give one outline"
                " with a point about every millimetre"
            )
        drawn.check_crossing()
        return drawn

    def check_crossing(self) -> None:
        """Raise an InputError where the outline crosses itself other than by noise."""
        crossing = self_crossing(self.points)
        if crossing is None:
            return
        following = np.roll(self.points, -1, axis=0)
        sides = shapely.linestrings(np.stack([self.points, following], axis=1))
        meet = np.flatnonzero(shapely.distance(sides, shapely.Point(crossing)) < SAME_POINT)
        length = np.linalg.norm(following - self.points, axis=1)
        between = length[meet[0] : meet[-1]].sum() if meet.size else np.inf
        if min(between, length.sum() - between) > NOISE_LOOP:
            raise InputError(
                f"{self.path}, {self.place_near(crossing)}: the outline crosses or touches itself"
                f" near {xy(crossing)}; list its points in order, once around"
            )

    def corner(self) -> str:
        """Return where the outline has a corner, and what to do; empty where it has none."""
        sides = np.roll(self.points, -1, axis=0) - self.points
        before = np.roll(sides, 1, axis=0)
        cross = before[:, 0] * sides[:, 1] - before[:, 1] * sides[:, 0]
        turn = np.abs(np.rad2deg(np.arctan2(cross, np.sum(before * sides, axis=1))))
        sharpest = int(np.argmax(turn))
        if turn[sharpest] <= MAX_TURN + 1e-6:  # twelve points on a circle turn by 30 degrees
            return ""
        return (
            f"{self.places[sharpest]}: the outline turns by {turn[sharpest]:.0f} degrees at"
            f" {xy(self.points[sharpest])}; at most {MAX_TURN:g} are possible: round the corner"
            " off, or add points"
        )

    def place_near(self, point: Array) -> str:
        """Return the place of the nearest point."""
        return self.places[int(np.argmin(np.linalg.norm(self.points - point, axis=1)))]


def check_extent(path: Path, points: Array, allowed: tuple[float, float], unit: str = "") -> None:
    """Raise an InputError unless width and height of points, mm, lie in the range allowed."""
    with np.errstate(over="ignore"):
        size = np.ptp(points[:, :2], axis=0)
        low, high = allowed
        if low <= size.min() and size.max() <= high:
            return
        meant = [
            name
            for name, factor in UNITS.items()
            if max(low, 1.0) <= factor * size.min() and factor * size.max() <= high
        ]
    remedy = f"{unit}, correct that" if unit else "give lengths in mm"
    hint = f" (drawn in {' or '.join(meant)}?)" if meant and not unit else ""
    raise InputError(
        f"{path}: the outline is {size[0]:.3g} x {size[1]:.3g} mm{hint}; allowed are"
        f" {low:g} to {high:g} mm: {remedy}"
    )


def check_flat(path: Path, heights: Array, otherwise: str = "") -> None:
    """Raise an InputError unless points lie in a plane of constant z, mm."""
    rise = float(np.ptp(heights)) if heights.size else 0.0
    if rise > RESOLVED:
        raise InputError(
            f"{path}: the outline extends {rise:.3g} mm out of its plane, more than {RESOLVED} mm;"
            f" turn it into the x-y plane, or project it there{otherwise}"
        )


def joined(path: Path, pieces: Sequence[Piece], unit: str, file: OutlineFile) -> Drawn:
    """Join the pieces of the chosen outline, in any order and direction, to a closed polygon.

    Where one of them is curved, all are followed closely; where all are straight lines, their
    vertices are what was drawn.

    Raises
    ------
    InputError
        When they are more or less than one closed outline.
    """
    pieces = _on_layer(path, pieces, file.layer)
    wrong = [piece for piece in pieces if piece.problem]
    pieces = [piece for piece in pieces if not piece.problem]
    # Before lines of any length are cut into short ones.
    everything = np.concatenate([piece.points[:, :2] for piece in pieces] or [np.zeros((1, 2))])
    if np.ptp(everything, axis=0).max() > 10 * EXTENT[1]:
        check_extent(path, everything, file.extent, unit)
    pieces = [piece for piece in pieces if np.ptp(piece.points, axis=0).max() > SAME_POINT]
    groups = connected(pieces)
    if wrong and not file.curve:
        others = f", or choose the outline ({_how(groups)}): {_listed(groups)}" if groups else ""
        raise InputError(f"{path}, {wrong[0].place}: {wrong[0].problem}{others}")
    if not groups:
        raise InputError(f"{path}: the drawing is empty; draw one closed outline")
    loop = _loop(path, _chosen(path, groups, file))
    check_flat(path, np.concatenate([piece.points[:, 2:] for piece in loop]))
    if any(piece.sample for piece in loop):
        loop = [piece.dense() for piece in loop]
    points = np.concatenate([piece.points[:-1, :2] for piece in loop])
    places = [place for piece in loop for place in piece.places[:-1]]
    return Drawn.of(path, points, places, unit, file.extent)


def _on_layer(path: Path, pieces: Sequence[Piece], layer: str | None) -> Sequence[Piece]:
    layers = {piece.layer for piece in pieces if piece.layer}
    if layer is not None and layer not in layers:
        raise InputError(
            f"{path}: no layer '{layer}';"
            f" {nearest(layer, layers) if layers else 'the drawing has none'}"
        )
    return [piece for piece in pieces if layer is None or piece.layer == layer]


def connected(pieces: Sequence[Piece]) -> list[list[Piece]]:
    """Return the pieces that hang together, curve by curve."""
    if not pieces:
        return []
    label = connected_components(_meetings(pieces), directed=False)[1][::2]
    found: dict[int, list[Piece]] = {}
    for number, piece in zip(label, pieces, strict=True):
        found.setdefault(int(number), []).append(piece)
    return list(found.values())


def _chosen(path: Path, groups: Sequence[list[Piece]], file: OutlineFile) -> list[Piece]:
    """Return the pieces of the one curve that is there or was chosen."""
    if file.curve is not None:
        every = groups
        groups = [group for group in groups if any(p.name == file.curve for p in group)]
        if not groups:
            raise InputError(f"{path}: no curve '{file.curve}'; there are {_listed(every)}")
    if not any(map(is_closed, groups)):
        return [piece for group in groups for piece in group]  # open: which is said
    if len(groups) > 1:
        raise InputError(
            f"{path}: contains {len(groups)} outlines ({_listed(groups)}); keep the inner face"
            f" only, or choose it ({_how(groups)})"
        )
    return groups[0]


def _listed(groups: Sequence[Sequence[Piece]]) -> str:
    """Describe the curves of a drawing."""

    def words(group: Sequence[Piece]) -> str:
        length = sum(piece.line.length for piece in group)
        layer = f" on layer '{group[0].layer}'" if group[0].layer else ""
        return f"{group[0].place}{layer}, {length:.0f} mm{'' if is_closed(group) else ', open'}"

    more = f"; and {len(groups) - _LISTED} more" if len(groups) > _LISTED else ""
    return "; ".join(map(words, groups[:_LISTED])) + more


def _how(groups: Sequence[Sequence[Piece]]) -> str:
    """Return how the first of several curves would be chosen."""
    first = groups[0][0]
    layers = {piece.layer for group in groups for piece in group}
    named = [group for group in groups if any(piece.name == first.name for piece in group)]
    ways = [f"curve = '{first.name}'"] if first.name and len(named) == 1 else []
    ways += [f"layer = '{first.layer}'"] if first.layer and len(layers) > 1 else []
    if len(named) > 1 and first.name:
        return f"break {first.place} apart first" + (f"; or {ways[0]}" if ways else "")
    return f"e.g. {' or '.join(ways)}" if ways else "by an id that you give it"


def _ends(pieces: Sequence[Piece]) -> Array:
    """Return the ends of pieces: piece i has the ends 2 i and 2 i + 1."""
    return np.array([piece.points[[0, -1], :2] for piece in pieces]).reshape(-1, 2)


def _meetings(pieces: Sequence[Piece]) -> coo_array:
    """Return which ends meet, and which belong to one piece, as a graph of the ends."""
    near = _near(_ends(pieces))
    here, column = np.nonzero(near >= 0)
    starts = np.arange(0, len(near), 2)
    rows = np.concatenate([here, starts])
    columns = np.concatenate([near[here, column], starts + 1])
    return coo_array((np.ones(len(rows)), (rows, columns)), shape=(len(near), len(near)))


def _near(ends: Array) -> np.ndarray:
    """Return up to two others that each end meets, (n, 2), -1 where there is none."""
    number = len(ends)
    found = cKDTree(ends).query(ends, k=3, distance_upper_bound=JOINT)[1]
    found[(found == np.arange(number)[:, None]) | (found == number)] = -1
    near = -np.sort(-found, axis=1)[:, :2]
    loose = np.flatnonzero(near[:, 0] < 0)
    if len(loose) > 1:
        gap, other = (each[:, 1] for each in cKDTree(ends[loose]).query(ends[loose], k=2))
        mutual = (other[other] == np.arange(len(loose))) & (gap <= RESOLVED)
        near[loose[mutual], 0] = loose[other[mutual]]
    return near


def is_closed(group: Sequence[Piece]) -> bool:
    """Return whether pieces that hang together have no loose end."""
    return bool((_near(_ends(group))[:, 0] >= 0).all())


def _loop(path: Path, pieces: Sequence[Piece]) -> list[Piece]:
    """Return pieces in the order and direction in which they make a closed outline."""
    ends = _ends(pieces)
    near = _near(ends)
    branched = np.flatnonzero(near[:, 1] >= 0)
    if branched.size:
        first = branched[0]
        other = next(end for end in near[first] if end // 2 != first // 2)
        raise InputError(
            f"{path}, {pieces[first // 2].place}: meets {pieces[other // 2].place} and others at"
            f" {xy(ends[first])}; remove the branches"
        )
    loose = np.flatnonzero(near[:, 0] < 0)
    if loose.size:
        *others, last = loose
        gap = np.linalg.norm(ends[others] - ends[last], axis=1).min()
        raise InputError(
            f"{path}, {pieces[last // 2].place}: the outline is open at {xy(ends[last])}: the"
            f" nearest end is {gap:.3g} mm away; close it, to {RESOLVED} mm"
        )
    end = 0
    loop: list[Piece] = []
    while len(loop) < len(pieces):
        piece = pieces[end // 2]
        loop.append(piece.reversed() if end % 2 else piece)
        end = int(near[end ^ 1, 0])
    return loop
