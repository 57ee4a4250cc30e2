"""Outlines of sockets from files: the points of a closed periodic spline in the limb's frame."""

from pathlib import Path

import numpy as np

from calfsocket.errors import InputError
from calfsocket.meshes import curves
from calfsocket.meshes.curves import Array
from calfsocket.meshes.data import Point
from calfsocket.meshes.drawn import Drawn
from calfsocket.meshes.outline_csv import read_csv
from calfsocket.meshes.outline_dxf import read_dxf
from calfsocket.meshes.outline_svg import read_svg

#: Readers by the ending of the file's name.
READERS = {".csv": read_csv, ".dxf": read_dxf, ".svg": read_svg}
#: Points up to this number are taken as they are. A spline with more makes meshing slow.
MANY_POINTS = 400
#: Largest distance, mm, of a spline through fewer points from those left out.
TOLERANCE = 2e-3


def read_outline(path: Path | str) -> tuple[Point, ...]:
    """Read the inner face of a socket.

    The frame is the limb's: x to the lateral side, y to the front, a right leg seen from above,
    with the origin where the limb's data have it (the calf: the centroid of the skin's outline).
    What was drawn elsewhere is moved by `shift` and `rotation` of `data.Outline`.

    Parameters
    ----------
    path
        A file that ends in .csv, .dxf or .svg.

    Returns
    -------
    tuple of (x, y)
        In mm, counter-clockwise, for `curves.through`. The vertices of straight-sided outlines are
        points of a smooth curve and kept as they are; what has a curve in it is followed to
        0.02 mm. Turns of up to 30 degrees are rounded off.

    Raises
    ------
    InputError
        When the file cannot be read or holds no such outline; in one line: the file, the place,
        what is allowed and what to do.
    """
    path = Path(path)
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise InputError(
            f"{path}: {path.suffix or 'no ending'} is no format of outlines; export it as one of"
            f" {', '.join(READERS)}"
        )
    drawn = reader(path)
    drawn.check()
    return tuple((float(x), float(y)) for x, y in _thinned(drawn))


def _thinned(drawn: Drawn) -> Array:
    """Leave out points, counter-clockwise, that the spline through the others meets anyway."""
    points = drawn.points
    x, y = points.T
    if np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) < 0:
        points = points[::-1]
    number = len(points)
    if number <= MANY_POINTS:
        return points
    kept = np.linspace(0, number, 33)[:-1].astype(int)
    while len(kept) <= MANY_POINTS:
        curve = curves.through(points[kept])
        chord = np.linalg.norm(np.diff(points, axis=0, append=points[:1]), axis=1)
        along = np.append(0.0, np.cumsum(chord))
        ends = np.append(kept, number)
        # The parameter of a point left out: its share of the way between the two that stay.
        t = np.interp(along[:-1], along[ends], curve.knots)
        off = points - curve.evaluate(t)
        distance = np.abs(np.sum(off * curve.normal(t), axis=1))
        far = distance > TOLERANCE
        if not far.any():
            return points[kept]
        interval = np.unique(np.searchsorted(kept, np.flatnonzero(far), side="right") - 1)
        middle = (ends[interval] + ends[interval + 1]) // 2
        kept = np.union1d(kept, middle)
    raise InputError(
        f"{drawn.path}: the outline is so rough that {MANY_POINTS} points do not follow it to"
        f" {TOLERANCE} mm; smooth it"
    )
