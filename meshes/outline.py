"""Outlines of sockets from files: the points of a closed periodic spline in the limb's frame."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calfsocket.io.errors import InputError
from calfsocket.io.files import kind_of
from calfsocket.meshes import curves, fairing
from calfsocket.meshes.curves import Array, Point, xy
from calfsocket.meshes.drawn import Drawn, OutlineFile
from calfsocket.meshes.outline_csv import read_csv
from calfsocket.meshes.outline_dxf import dxf_pieces, read_dxf
from calfsocket.meshes.outline_svg import read_svg, svg_pieces

#: Readers by the extension of the file's name.
READERS = {".csv": read_csv, ".dxf": read_dxf, ".svg": read_svg}
#: Readers of drawings with many curves, which have layers, labels and ids.
DRAWINGS = {".dxf": dxf_pieces, ".svg": svg_pieces}
#: Points up to this number are taken as they are. Meshing takes 1.3 s with 400, 1.7 s with 1000.
MANY_POINTS = 1000
#: Largest distance, mm, of a spline through fewer points from those left out: the first that can be
#: kept. Waves of 0.002 mm change the largest contact pressure by 2 %; what was measured to 0.01 mm
#: and written down every 0.1 mm cannot be followed more closely.
TOLERANCES = (1e-4, 1e-3, 1e-2)


@dataclass(frozen=True)
class ReadOutline:
    """The inner face of a socket as read from a file."""

    points: tuple[Point, ...]  #: mm, counter-clockwise, for `curves.through`
    #: Largest distance, mm, of the curve from an outline that had to be smoothed; 0 where not.
    deviation: float = 0.0


def read_outline(path: Path | str, file: OutlineFile | None = None) -> ReadOutline:
    """Read the inner face of a socket.

    The frame is the limb's, with the origin where the limb's data have it (the calf: the centroid
    of the skin's outline). What was drawn elsewhere is moved by `shift` and `rotation` of
    `socket.Outline`.

    The vertices of straight-sided outlines are points of a smooth curve and kept as they are; what
    has a curve in it is followed to 0.02 mm. Turns of up to 30 degrees are rounded off. Where they
    are sharper, or points crowd, as in a scan, a smooth curve is laid near the outline.

    Parameters
    ----------
    path
        A file that ends in .csv, .dxf or .svg.
    file
        How far that smooth curve may be from vertices and sides of the outline, and which one is
        meant of several curves in a drawing.

    Raises
    ------
    InputError
        When the file cannot be read or contains no such outline; in one line: the file, the place,
        what is allowed and what to do.
    """
    path = Path(path)
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        what = f"{path.suffix} is not an outline format" if path.suffix else "has no extension"
        if kind := kind_of(path):
            what = f"is {kind}, not the outline of a socket"
        raise InputError(f"{path}: {what}; export it as one of {', '.join(READERS)}")
    file = file or OutlineFile()
    points, deviation = _curve_points(reader(path, file), file.tolerance)
    return ReadOutline(tuple((float(x), float(y)) for x, y in points), deviation)


def _curve_points(drawn: Drawn, tolerance: float) -> tuple[Array, float]:
    """Return points of a smooth curve, counter-clockwise, and how far it is from the outline."""
    points = drawn.points
    x, y = points.T
    if np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) < 0:
        points = points[::-1]
    rough = drawn.corner()
    if not rough and (kept := _thinned(points)) is not None:
        return kept, 0.0
    if len(points) < fairing.FEWEST:
        raise InputError(f"{drawn.path}, {rough}")
    smooth, deviation, where = fairing.fair(points, tolerance)
    if deviation <= tolerance:
        return smooth, deviation
    raise InputError(
        f"{drawn.path}, {drawn.place_near(where)}: the outline turns too sharply near {xy(where)}:"
        f" no smooth curve stays within {tolerance:g} mm of it (one is {deviation:.2g} mm off);"
        " round the corner off, add points, or set `tolerance`"
    )


def _thinned(points: Array) -> Array | None:
    """Leave out points that the spline through the others meets anyway, where that can be done."""
    if len(points) <= MANY_POINTS:
        return points
    for tolerance in TOLERANCES:
        kept = _knots(points, tolerance)
        if kept is not None:
            return points[kept]
    return None


def _knots(points: Array, tolerance: float) -> NDArray[np.int64] | None:
    """Return the indices of points through which a spline comes near all others, if few do."""
    number = len(points)
    chord = np.linalg.norm(np.diff(points, axis=0, append=points[:1]), axis=1)
    along = np.append(0.0, np.cumsum(chord))
    kept = np.linspace(0, number, 33)[:-1].astype(int)
    while len(kept) <= MANY_POINTS:
        curve = curves.through(points[kept])
        ends = np.append(kept, number)
        # The parameter of a point left out: its share of the way between the two that stay.
        t = np.interp(along[:-1], along[ends], curve.knots)
        off = points - curve.evaluate(t)
        far = np.abs(np.sum(off * curve.normal(t), axis=1)) > tolerance
        if not far.any():
            return kept
        interval = np.unique(np.searchsorted(kept, np.flatnonzero(far), side="right") - 1)
        kept = np.union1d(kept, (ends[interval] + ends[interval + 1]) // 2)
    return None
