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
  equilibrium, points have the **statuses of the last equilibrium** once more. A start ahead of it,
  along the secant, has the statuses of the last equilibrium from the beginning.
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

IntArray = NDArray[np.int64]

FEW_CHANGES = 0.05
"""Share of the points in contact whose status may change in the first iteration of a step. Steps at
a friction of 0.4 stay below 0.02; at 0.1 a third of the points would change, to come back later."""


class ActiveSet:
    """Branches and edges of the skin points of all ranks, while Newton's method iterates.

    It changes nothing outside of `iterating`: there every point is on the branch of its own.

    Attributes
    ----------
    equilibrium : (n,) or None
        Branches of the last equilibrium, as of `friction.branches`, for this rank's skin points.
    """

    def __init__(self, comm: MPI.Comm) -> None:
        self.equilibrium: IntArray | None = None
        self._comm = comm
        self._clear()
        self._ahead = False

    def _clear(self) -> None:
        self._count: int | None = None  # of the linearisations in this solve
        self._branches: IntArray | None = None  # of the last linearisation
        self._edge: IntArray | None = None  # of the last linearisation
        self._left: IntArray | None = None  # the one that each point was on before, or -1
        self._holding = self._released = False

    @contextmanager
    def iterating(self, ahead: bool) -> Iterator[None]:
        """Keep points from going to and fro in the body, which is one solve with full steps.

        It begins at the last equilibrium, or `ahead` of it.
        """
        self._clear()
        self._count, self._ahead = 0, ahead
        try:
            yield
        finally:
            self._clear()

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
            before = np.where(both, self.equilibrium, own)
            if self._ahead or self._many(before != own, own != OPEN):
                return before
        if self._branches is None:
            return own
        turning = (np.abs(own) == SLIP) & (own == -self._branches)
        return np.where(turning, STICK, own)

    def _many(self, changing: NDArray[np.bool_], of: NDArray[np.bool_]) -> bool:
        """Whether so many points change that their statuses tell nothing yet (collective)."""
        mine = np.array([np.count_nonzero(changing), np.count_nonzero(of)])
        changes, points = self._comm.allreduce(mine)
        return bool(changes > FEW_CHANGES * points)

    def returning(self, edge: IntArray) -> IntArray:
        """Return the edge that points are on which go back to the one they left; -1 elsewhere."""
        if self._edge is None:
            return np.full(len(edge), -1)
        return np.where((edge == self._left) & (edge != self._edge), self._edge, -1)

    def linearised(self, branches: IntArray, edge: IntArray) -> None:
        """Take note of what the tangent was computed with."""
        if self._count is None:
            return
        self._count += 1
        before = edge if self._edge is None else self._edge
        left = np.full(len(edge), -1) if self._left is None else self._left
        # Some iterations may pass on one edge before a point goes back.
        self._left = np.where(edge != before, before, left)
        self._branches, self._edge = branches, edge
        if self._count == 1 and not self._ahead and self.equilibrium is not None:
            # All points stick there; it is those that slipped until then which may turn round.
            self._branches = self.equilibrium
        self._released = False

    def release(self) -> bool:
        """Put all points on their own branch; return whether any was not (collective)."""
        self._released = bool(self._comm.allreduce(self._holding, op=MPI.LOR))
        self._holding = False
        return self._released
