"""The active set of contact: on which branch each skin point is while Newton's method iterates.

Coulomb's law and a socket of several edges are smooth in pieces: a point is open, sticks, slips
forwards or slips backwards, and its partner is on one edge of the socket. Newton's method with full
steps takes each piece for the whole, and can then go to and fro between two of them for ever:

- A slipping point has no tangential stiffness of its own. The linear problem lets it pass by its
  equilibrium, it slips the other way next, and its neighbours with it: back and forth, farther and
  farther. The change of direction has sticking on its way, so a point that would turn round
  **sticks for one iteration**, at whatever shear holds it; that solution then tells the direction.
- The first iteration of a step that begins at the last equilibrium turns and bends what later
  ones correct. The error in slip, of second order, is larger than the slip where friction is low,
  so that statuses read off there are noise. If many would differ from those of the last
  equilibrium, points have the **statuses of the last equilibrium** once more; without friction,
  they stick once more. A start ahead of it, along the secant, has the statuses of the last
  equilibrium from the beginning.
- Slip spreads along the skin from iteration to iteration: where it ends, points that still stick
  take over what the slipping ones let go, and exceed the limit next, half as many each time. So a
  zone of slip that grows by some points **spreads as far again at once** (`spread`).
- Where a zone of slip becomes shorter than it was in the last equilibrium, the slip of too many
  points turns round: a third of those by which it **retreats keep slipping** (`retreat`).
- A deformed socket has slight kinks between its edges, over which contact traction jumps. A point
  in balance on neither side **stays on the edge** that it has come to, a little beyond its end.

What a point is held back from shows in the residual, which is that of the branch it is on. So no
residual counts as small before all points are on the branch of their own (`ActiveSet.release`).
"""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from calfsocket.contact.friction import OPEN, SLIP, STICK

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

FEW_CHANGES = 0.05
"""Share of the points in contact whose status may change in the first iteration of a step. Steps at
a friction of 0.4 stay below 0.02; at 0.1 a third of the points would change, to come back later."""

MOST_CHANGES = 0.5
"""Share of the points in contact up to which changes count as slip that spreads. Where more change
at once, the socket as a whole has turned."""

SETTLED = 0.1
"""Share of the points in contact that may change their branch in an iteration which counts as one
of tissues rather than of contact."""

EXTENSION, FARTHER, FARTHEST = 1e-3, 10.0, 0.05
"""Share of half an edge by which a point that goes to and fro may stay beyond its end, the factor
on it with each time that it does so again, and the largest. The first is about a micrometre, over
which a kink of the socket does not show in the traction's leading digits. A soft liner has larger
kinks, between which points go to and fro over tens of micrometres; over the farthest, a kink of 5
degrees makes a gap of 0.2 % of an edge's length."""


class ActiveSet:
    """Branches and edges of the skin points of all ranks, while Newton's method iterates.

    Outside of `iterating` every point is on the branch of its own. Those that the equilibrium was
    found with on the edge that they had come to are still on it, until they `leave`: on the other
    one they would be out of balance.

    Parameters
    ----------
    comm : MPI.Intracomm
        Communicator of the skin points.
    free : bool
        Whether there is no friction.

    Attributes
    ----------
    equilibrium : (n,) or None
        Branches of the last equilibrium, as of `friction.branches`, for this rank's skin points.
    unsettled : int
        Iterations of the last solve that began with more points on another branch than `SETTLED`.
    """

    def __init__(self, comm: MPI.Intracomm, free: bool = False) -> None:
        self.equilibrium: IntArray | None = None
        self._comm, self._free = comm, free
        self._order: IntArray | None = None  # of all points along the skin
        self._clear()
        self._ahead = False
        self.unsettled = 0

    def _clear(self) -> None:
        self._count: int | None = None  # of the linearisations in this solve
        self._branches: IntArray | None = None  # of the last linearisation
        self._edge: IntArray | None = None  # of the last linearisation
        self._left: IntArray | None = None  # the one that each point was on before, or -1
        self._ahead_of_slip: NDArray[np.bool_] | None = None  # points that slip spreads to now
        self._spread: NDArray[np.bool_] | None = None  # and those that it did in this solve
        self._returns: IntArray | None = None  # how often each point went back to the one it left
        self._stay: tuple[IntArray, FloatArray] | None = None  # of those that do: see `returning`
        self._holding = self._released = False

    def line_up(self, place: NDArray[np.float64], least: int) -> None:
        """Tell where this rank's points lie along the skin, so that slip can spread (collective).

        It does where it grows by `least` points, those of an edge: shear is not resolved within.
        """
        everywhere = np.concatenate(self._comm.allgather(place))
        self._order, self._least = np.argsort(everywhere, kind="stable"), least
        first = self._comm.exscan(len(place)) or 0
        self._mine = slice(first, first + len(place))

    @contextmanager
    def iterating(self, ahead: bool) -> Iterator[None]:
        """Keep points from going to and fro in the body, which is one solve with full steps.

        It begins at the last equilibrium, or `ahead` of it.
        """
        self._clear()
        self._count, self._ahead, self.unsettled = 0, ahead, 0
        try:
            yield
        finally:
            stay = self._stay
            self._clear()
            self._stay = stay

    @property
    def is_iterating(self) -> bool:
        """Whether points may be held back."""
        return self._count is not None

    def branches(self, own: IntArray) -> IntArray:
        """Return the branches that points are on, who would be on `own` (collective)."""
        if not self.is_iterating or self._released:
            return own
        assumed = self._assumed(own)
        self._holding = not np.array_equal(assumed, own)
        return assumed

    def _assumed(self, own: IntArray) -> IntArray:
        if self.equilibrium is not None and self._count == 0 and not self._ahead:
            # No point has moved yet; whether its shear is at the limit is a matter of rounding.
            return np.where(own == OPEN, OPEN, STICK)
        if self.equilibrium is not None and self._count == (0 if self._ahead else 1):
            both = (own != OPEN) & (self.equilibrium != OPEN)
            held = STICK if self._free and not self._ahead else self.equilibrium
            before = np.where(both, held, own)
            if self._ahead or self._many(before != own, own != OPEN):
                return before
        if self._branches is None:
            return own
        turning = (np.abs(own) == SLIP) & (own == -self._branches)
        now = np.where(turning, STICK, own)
        if self.equilibrium is not None and not self._ahead:
            return now  # fronts are not known well enough to go by what they have moved
        return self._with_spread_slip(self._branches, now)

    def _many(
        self, changing: NDArray[np.bool_], of: NDArray[np.bool_], share: float = FEW_CHANGES
    ) -> bool:
        """Whether more than a share of the points change (collective)."""
        mine = np.array([np.count_nonzero(changing), np.count_nonzero(of)])
        changes, points = self._comm.allreduce(mine)
        return bool(changes > share * points)

    def _with_spread_slip(self, before: IntArray, now: IntArray) -> IntArray:
        """Let slip spread ahead or retreat less, each point once in a solve (collective)."""
        self._ahead_of_slip = np.zeros(len(now), dtype=bool)
        if self._order is None or self._many(before != now, now != OPEN, MOST_CHANGES):
            return now
        pair = np.concatenate(self._comm.allgather(np.stack([before, now], axis=1)))
        branches_before, branches_now = pair[self._order].T
        along = spread(branches_before, branches_now, self._least)
        if self._ahead:  # of an equilibrium, in which zones of slip have their ends
            along = retreat(branches_before, along, self._least)
        everywhere = np.empty_like(along)
        everywhere[self._order] = along
        further = everywhere[self._mine]
        newly = further != now
        if self._spread is not None:
            newly &= ~self._spread
        self._ahead_of_slip = newly
        return np.where(newly, further, now)

    def returning(self, edge: IntArray) -> tuple[IntArray, FloatArray]:
        """Return the edge that points are on which go back to the one they left; -1 elsewhere.

        And how far beyond its end they may stay on it, as a share of half an edge.
        """
        if self._edge is not None and self._returns is not None:
            stay = np.where((edge == self._left) & (edge != self._edge), self._edge, -1)
            self._stay = stay, np.minimum(EXTENSION * FARTHER**self._returns, FARTHEST)
        if self._stay is None:
            return np.full(len(edge), -1), np.zeros(len(edge))
        return self._stay

    def leave(self) -> None:
        """Let points leave the edges on which the last equilibrium was found."""
        self._stay = None

    def linearised(self, branches: IntArray, edge: IntArray) -> None:
        """Take note of what the tangent was computed with."""
        if self._count is None:
            return
        self._count += 1
        if self._branches is not None:
            self.unsettled += self._many(branches != self._branches, branches != OPEN, SETTLED)
        before = edge if self._edge is None else self._edge
        left = np.full(len(edge), -1) if self._left is None else self._left
        returns = np.zeros_like(edge) if self._returns is None else self._returns
        self._returns = returns + ((edge == left) & (edge != before))
        # Some iterations may pass on one edge before a point goes back.
        self._left = np.where(edge != before, before, left)
        self._branches, self._edge = branches, edge
        if self._ahead_of_slip is not None:
            known = self._spread
            self._spread = self._ahead_of_slip if known is None else known | self._ahead_of_slip
        if self._count == 1 and not self._ahead and self.equilibrium is not None:
            # All points stick there; it is those that slipped until then which may turn round.
            self._branches = self.equilibrium
        self._released = False

    def release(self) -> bool:
        """Put all points on their own branch; return whether any was not (collective)."""
        self._released = bool(self._comm.allreduce(self._holding, op=MPI.LOR))
        self._holding = False
        return self._released


def spread(before: IntArray, now: IntArray, least: int) -> IntArray:
    """Return the branches with slip spread further, for points in order along the skin.

    Ahead of the end of a zone of slip, where points stick, the shear exceeds its limit by
    K / sqrt(r) - B sqrt(r) over the distance r, as ahead of a crack. K vanishes at the end that the
    zone has in equilibrium; a distance d behind it, K = B d / 2. So points exceed the limit up to
    r = d / 2, and slip has to go on by as much again. A zone that opens between sticking points,
    over a length of 2 r, has 2 c = 2 sqrt(2) r in equilibrium if the excess D is a parabola: K = 0
    where the integral of D / sqrt(c^2 - x^2) over the zone vanishes.

    Parameters
    ----------
    before, now : (n,)
        Branches of the last linearisation, and those that points would be on now.
    least : int
        Fewest points by which a zone grows that spreads.
    """
    wanted = []
    for direction in (SLIP, -SLIP):
        wants = np.zeros(len(now), dtype=bool)
        sticks = (before == STICK) & (now == STICK)
        for first, end in _runs((before == STICK) & (now == direction)):
            slips = [0 <= i < len(now) and before[i] == direction for i in (first - 1, end)]
            grown = end - first
            if grown < least or all(slips):
                continue
            reach = grown if any(slips) else round(0.5 * (np.sqrt(2.0) - 1.0) * grown)
            if not slips[0]:
                low = max(first - reach, 0)
                wants[low:first] |= np.logical_and.accumulate(sticks[low:first][::-1])[::-1]
            if not slips[1]:
                wants[end : end + reach] |= np.logical_and.accumulate(sticks[end : end + reach])
        wanted.append(wants)
    forwards, backwards = wanted
    result = np.where(forwards & ~backwards, SLIP, now)
    return np.where(backwards & ~forwards, -SLIP, result)


def retreat(before: IntArray, now: IntArray, least: int) -> IntArray:
    """Return the branches with slip kept where it retreats too far, for points along the skin.

    Let the excess of shear over a zone from -b to b have become a parabola that keeps the part from
    -c to c slipping. If all of it went on, its slip would be a multiple of

        sqrt(b^2 - x^2) (b^2 - x^2 - 3/2 (b^2 - c^2)),

    which turns round beyond x0, 3 c^2 = 2 x0^2 + b^2: where a zone becomes a little shorter, at
    half as many points again as will stick.

    Parameters
    ----------
    before, now, least
        As of `spread`.
    """
    result = now.copy()
    for direction in (SLIP, -SLIP):
        for first, end in _runs(before == direction):
            rest = first + np.flatnonzero(now[first:end] == direction)
            if not len(rest):
                continue  # all of it has turned round: there is no telling how much will slip
            low, high = int(rest[0]), int(rest[-1]) + 1
            left = low - first if np.all(now[first:low] == STICK) else 0
            right = end - high if np.all(now[high:end] == STICK) else 0
            if left + right < least:
                continue
            whole, kept = end - first, high - low
            back = (whole - np.sqrt((2.0 * kept**2 + whole**2) / 3.0)) / (whole - kept)
            result[first + round(back * left) : low] = direction
            result[high : end - round(back * right)] = direction
    return result


def _runs(marked: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and one past the last index of each run of marked ones."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], marked, [False]])))
    return [(int(first), int(end)) for first, end in edges.reshape(-1, 2)]
