"""A closed outline as somebody drew it, and whether a smooth curve can follow it."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely

from calfsocket.errors import InputError
from calfsocket.meshes.curves import Array

#: Points closer together than this, mm, are one.
SAME_POINT = 1e-3
#: Width and height of an outline, mm. A leg is 60 to 250 mm thick; lengths in m, cm or inch taken
#: for mm fall below the range, lengths in micrometres above.
EXTENT = (30.0, 500.0)
#: Largest turn from one side to the next, degrees. The spline rounds it off; where a drawing is
#: sampled every 0.25 mm this moves it by less than 0.02 mm.
MAX_TURN = 30.0
#: Points of one outline. More are no shape but a cloud, or a file of another kind.
MAX_POINTS = 50_000
#: What lengths may have been meant, in mm.
_OTHER_UNITS = {"m": 1000.0, "inch": 25.4, "cm": 10.0, "micrometres": 1e-3}


@dataclass(frozen=True)
class Drawn:
    """A closed polygon: points on the outline, the first not repeated.

    Attributes
    ----------
    path : Path
        The file, named in errors.
    points : (n, 2)
        In mm, in the order of the file.
    places : sequence of str
        Where in the file each point stands, e.g. "line 12".
    """

    path: Path
    points: Array
    places: Sequence[str]

    def without_repeats(self) -> "Drawn":
        """Drop points that stand on the one before them, as drawing programs leave them."""
        sides = np.linalg.norm(self.points - np.roll(self.points, 1, axis=0), axis=1)
        keep = np.flatnonzero(sides > SAME_POINT)
        return Drawn(self.path, self.points[keep], [self.places[i] for i in keep])

    def check(self) -> None:
        """Raise an InputError unless a smooth closed curve can follow the points."""
        self._check_number()
        self._check_extent()
        self._check_repeats()
        self._check_crossing()
        self._check_turns()

    def _check_number(self) -> None:
        if len(self.points) < 4:
            raise InputError(
                f"{self.path}: has {_count(len(self.points), 'point')}; a closed curve needs 4 or"
                " more, a socket some dozens"
            )
        if len(self.points) > MAX_POINTS:
            raise InputError(
                f"{self.path}: has {len(self.points)} points; at most {MAX_POINTS} are read:"
                " give one outline, a point every millimetre or so"
            )

    def _check_extent(self) -> None:
        size = np.ptp(self.points, axis=0)
        low, high = EXTENT
        if low <= size.min() and size.max() <= high:
            return
        meant = [
            unit
            for unit, factor in _OTHER_UNITS.items()
            if low <= factor * size.min() and factor * size.max() <= high
        ]
        hint = f" (are these {' or '.join(meant)}?)" if meant else ""
        raise InputError(
            f"{self.path}: the outline is {size[0]:.4g} x {size[1]:.4g} mm{hint}; allowed are"
            f" {low:g} to {high:g} mm: give coordinates in mm"
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
        ring = shapely.LinearRing(self.points)
        if not ring.is_simple:
            # "Self-intersection[1.5 2]"
            why = shapely.is_valid_reason(shapely.Polygon(ring))
            x, y = (float(number) for number in why.split("[")[1].rstrip("]").split())
            nearest = int(np.argmin(np.linalg.norm(self.points - [x, y], axis=1)))
            raise InputError(
                f"{self.path}, {self.places[nearest]}: the outline crosses or touches itself near"
                f" ({x:.2f}, {y:.2f}) mm; give its points in order, once round"
            )

    def _check_turns(self) -> None:
        sides = np.roll(self.points, -1, axis=0) - self.points
        before = np.roll(sides, 1, axis=0)
        cross = before[:, 0] * sides[:, 1] - before[:, 1] * sides[:, 0]
        turn = np.abs(np.rad2deg(np.arctan2(cross, np.sum(before * sides, axis=1))))
        sharpest = int(np.argmax(turn))
        if turn[sharpest] > MAX_TURN + 1e-6:
            x, y = self.points[sharpest]
            raise InputError(
                f"{self.path}, {self.places[sharpest]}: the outline turns by"
                f" {turn[sharpest]:.0f} degrees at ({x:.2f}, {y:.2f}) mm; up to {MAX_TURN:g} can be"
                " followed smoothly: round the corner off, or give more points"
            )


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}" + ("" if number == 1 else "s")
