"""Loading and unloading in the stretches of a test, and their cycles."""

from dataclasses import dataclass
from itertools import groupby, pairwise
from operator import itemgetter
from typing import Any, Literal, get_args

import numpy as np
from scipy.signal import find_peaks

from calfsocket.materials.modes import Array

Branch = Literal["loading", "unloading"]
BRANCHES: tuple[Branch, ...] = get_args(Branch)

TURN = 0.05
"""Share of the range of stretches by which the stretch must go back to have turned. Normal noise of
0.7 % of the range stays below it in thousands of points; unloading goes further."""


@dataclass(frozen=True)
class Piece:
    """Rows between two turning points, both included."""

    branch: Branch
    cycle: int  #: from 1; tension and compression are counted apart
    rows: Array  #: their numbers


def turning_points(stretch: Array) -> Array:
    """Return the rows at which the stretch turns by more than noise does."""
    least = TURN * np.ptp(stretch)
    ways = [
        (row, sign) for sign in (1, -1) for row in find_peaks(sign * stretch, prominence=least)[0]
    ]
    # Of peaks of the same height, between which there is noise only, the first one is taken.
    return np.array(
        [next(rows)[0] for _, rows in groupby(sorted(ways), key=itemgetter(1))], dtype=int
    )


def pieces(stretch: Array) -> list[Piece]:
    """Part a test at its turning points, and where it passes from compression to tension or back.

    Loading leads away from a stretch of 1, unloading towards it. A test that does not turn is one
    piece, which may run from compression to tension.
    """
    turns = turning_points(stretch)
    ends = [0, *turns.tolist(), len(stretch) - 1]
    spans = [np.arange(a, b + 1) for a, b in pairwise(ends)]
    if len(turns):
        least = TURN * np.ptp(stretch)
        spans = [part for rows in spans for part in _at_one(rows, stretch, least)]
    count: dict[Any, int] = {}
    found = []
    for rows in spans:
        first, last = stretch[rows[[0, -1]]] - 1
        branch: Branch = "loading" if abs(last) > abs(first) else "unloading"
        kind = branch, first + last > 0
        count[kind] = count.get(kind, 0) + 1
        found.append(Piece(branch, count[kind], rows))
    return found


def _at_one(rows: Array, stretch: Array, least: float) -> list[Array]:
    """Part rows where they pass through a stretch of 1; to end beside it is not to pass."""
    first, last = stretch[rows[[0, -1]]] - 1
    if first * last >= 0 or min(abs(first), abs(last)) <= least:
        return [rows]
    passed = int(np.flatnonzero((stretch[rows] - 1) * last > 0)[0])
    return [rows[:passed], rows[passed:]]
