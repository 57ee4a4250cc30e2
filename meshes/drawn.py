"""A closed outline as somebody drew it: pieces joined to a polygon, and that checked."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from calfsocket.io.errors import InputError
from calfsocket.meshes.curves import SAME_POINT, Array, self_crossing, xy

#: Pieces are joined where their ends are at most this far apart, mm.
JOINT = 0.01
#: Width and height of an outline, mm. A leg is 60 to 250 mm thick; lengths in m, cm or inch taken
#: for mm fall below the range, lengths in micrometres above.
EXTENT = (30.0, 500.0)
#: Distance of the points that stand for curves and for straight lines between them, mm. With the
#: largest turn below, a spline through them is within 0.02 mm of a corner that it rounds off.
STEP = 0.25
#: Largest turn from one side to the next, degrees.
MAX_TURN = 30.0
#: Points of one outline. More are no shape but a cloud, or a file of another kind.
MAX_POINTS = 50_000
#: What lengths may have been meant, in mm.
_OTHER_UNITS = {"m": 1000.0, "inch": 25.4, "cm": 10.0, "micrometres": 1e-3}


@dataclass(frozen=True)
class Piece:
    """A part of an outline without branches."""

    place: str  #: in the file, e.g. "LINE 2F"
    points: Array  #: (n, 2), mm, ends included: vertices of straight lines, or close together
    curved: bool = False  #: whether the points were sampled from a curve

    @property
    def places(self) -> list[str]:
        """Place of each point."""
        if self.curved or len(self.points) == 2:
            return [self.place] * len(self.points)
        return [f"{self.place}, vertex {i}" for i in range(1, len(self.points) + 1)]

    def dense(self) -> "Piece":
        """Return the same piece with points at most `STEP` apart."""
        sides = np.diff(self.points, axis=0)
        numbers = np.ceil(np.linalg.norm(sides, axis=1) / STEP).astype(int)
        parts = [
            start + side * (np.arange(number) / number)[:, None]
            for start, side, number in zip(self.points, sides, numbers, strict=False)
            if number
        ]
        return Piece(self.place, np.concatenate([*parts, self.points[-1:]]), curved=True)


@dataclass(frozen=True)
class Drawn:
    """A closed polygon: points on the outline, in the order of the file, the first not repeated."""

    path: Path
    points: Array  #: (n, 2), mm
    places: Sequence[str]  #: of each point in the file, e.g. "line 12"
    unit: str = ""  #: what the file says of it, for errors

    def check(self) -> None:
        """Raise an InputError unless a smooth closed curve can follow the points."""
        self._check_number()
        check_extent(self.path, self.points, EXTENT, self.unit)
        self._check_repeats()
        self._check_crossing()
        self._check_turns()

    def _check_number(self) -> None:
        number = len(self.points)
        if number < 4:
            raise InputError(
                f"{self.path}: has {number} {'point' if number == 1 else 'points'}; a closed curve"
                " needs at least 4, a socket a few dozen"
            )
        if number > MAX_POINTS:
            raise InputError(
                f"{self.path}: has {number} points, more than {MAX_POINTS}; give one outline"
                " with a point about every millimetre"
            )

    def _check_repeats(self) -> None:
        sides = np.linalg.norm(self.points - np.roll(self.points, 1, axis=0), axis=1)
        repeated = np.flatnonzero(sides <= SAME_POINT)
        if repeated.size:
            i = repeated[0]
            raise InputError(
                f"{self.path}, {self.places[i]}: repeats the point of {self.places[i - 1]};"
                " give each point once"
            )

    def _check_crossing(self) -> None:
        crossing = self_crossing(self.points)
        if crossing is not None:
            nearest = int(np.argmin(np.linalg.norm(self.points - crossing, axis=1)))
            raise InputError(
                f"{self.path}, {self.places[nearest]}: the outline crosses or touches itself near"
                f" {xy(crossing)}; list its points in order, once around"
            )

    def _check_turns(self) -> None:
        sides = np.roll(self.points, -1, axis=0) - self.points
        before = np.roll(sides, 1, axis=0)
        cross = before[:, 0] * sides[:, 1] - before[:, 1] * sides[:, 0]
        turn = np.abs(np.rad2deg(np.arctan2(cross, np.sum(before * sides, axis=1))))
        sharpest = int(np.argmax(turn))
        if turn[sharpest] > MAX_TURN + 1e-6:  # twelve points on a circle turn by 30 degrees
            raise InputError(
                f"{self.path}, {self.places[sharpest]}: the outline turns by"
                f" {turn[sharpest]:.0f} degrees at {xy(self.points[sharpest])}; at most"
                f" {MAX_TURN:g} are possible: round the corner off, or add points"
            )


def check_extent(path: Path, points: Array, allowed: tuple[float, float], unit: str = "") -> None:
    """Raise an InputError unless width and height of points, mm, lie in the range allowed."""
    with np.errstate(over="ignore"):
        size = np.ptp(points, axis=0)
        low, high = allowed
        if low <= size.min() and size.max() <= high:
            return
        meant = [
            name
            for name, factor in _OTHER_UNITS.items()
            if EXTENT[0] <= factor * size.min() and factor * size.max() <= EXTENT[1]
        ]
    remedy = f"{unit}, correct that" if unit else "give lengths in mm"
    hint = f" (drawn in {' or '.join(meant)}?)" if meant and not unit else ""
    raise InputError(
        f"{path}: the outline is {size[0]:.3g} x {size[1]:.3g} mm{hint}; allowed are"
        f" {EXTENT[0]:g} to {EXTENT[1]:g} mm: {remedy}"
    )


def joined(path: Path, pieces: Sequence[Piece], unit: str = "") -> Drawn:
    """Join pieces, in any order and direction, to one closed polygon.

    Where one of them is curved, all are followed closely; where all are straight lines, their
    vertices are what was drawn.

    Raises
    ------
    InputError
        When they are more or less than one closed outline.
    """
    # Before lines of any length are cut into short ones.
    everything = np.concatenate([piece.points for piece in pieces])
    check_extent(path, everything, (0.0, 10 * EXTENT[1]), unit)
    left = [piece for piece in pieces if np.ptp(piece.points, axis=0).max() > SAME_POINT]
    loops = _loops(path, left)
    if len(loops) != 1:
        found = ", ".join(loop[0].place for loop in loops)
        raise InputError(
            f"{path}: contains {len(loops)} outlines ({found}); keep the inner face only"
        )
    (loop,) = loops
    if any(piece.curved for piece in loop):
        loop = [piece.dense() for piece in loop]
    points = np.concatenate([piece.points[:-1] for piece in loop])
    places = [place for piece in loop for place in piece.places[:-1]]
    # Drawing programs leave points that stand on the one before them.
    sides = np.linalg.norm(points - np.roll(points, 1, axis=0), axis=1)
    keep = np.flatnonzero(sides > SAME_POINT)
    return Drawn(path, points[keep], [places[i] for i in keep], unit)


def _loops(path: Path, pieces: Sequence[Piece]) -> list[list[Piece]]:
    """Return pieces in the order and direction in which they make closed outlines."""
    # Piece i has the ends 2 i and 2 i + 1; every end must meet one other.
    ends = np.array([piece.points[[0, -1]] for piece in pieces]).reshape(-1, 2)
    if not len(ends):
        return []
    tree = cKDTree(ends)
    here = tree.query_ball_point(ends, JOINT, return_length=True)
    if here.max() > 2:
        first, other, *_ = tree.query_ball_point(ends[np.argmax(here)], JOINT, return_sorted=True)
        raise InputError(
            f"{path}, {pieces[first // 2].place}: meets {pieces[other // 2].place} and others at"
            f" {xy(ends[first])}; remove the branches"
        )
    loose = np.flatnonzero(here == 1)
    if loose.size:
        *others, last = loose
        gap = np.linalg.norm(ends[others] - ends[last], axis=1).min()
        raise InputError(
            f"{path}, {pieces[last // 2].place}: the outline is open at {xy(ends[last])}: the"
            f" nearest end is {gap:.3g} mm away; close it, to {JOINT} mm"
        )
    partner = tree.query(ends, k=2)[1].sum(axis=1) - np.arange(len(ends))
    taken = np.zeros(len(pieces), dtype=bool)
    loops = []
    while not taken.all():
        end, loop = 2 * int(np.argmin(taken)), []
        while not taken[end // 2]:
            taken[end // 2] = True
            piece = pieces[end // 2]
            loop.append(replace(piece, points=piece.points[::-1]) if end % 2 else piece)
            end = int(partner[end ^ 1])
        loops.append(loop)
    return loops
