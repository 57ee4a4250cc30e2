"""Cases side by side: groups of ranks that take the next case as they become free."""

import time
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from mpi4py import MPI

from calfsocket.parallel.abort import PATIENCE_S

_REPORT = 71
FREE = -1
"""Taker of a case that nobody has taken."""


def chosen(families: Sequence[int], takers: Sequence[int], last: int | None) -> int:
    """Return the case for a group whose last one was of a family; -1 when all are taken.

    It goes on with that family. Otherwise it takes the first case of a family that no group is
    busy with, or helps with the one that has the most cases left.
    """
    free = [case for case, taker in enumerate(takers) if taker == FREE]
    if not free:
        return FREE
    left = Counter(families[case] for case in free)
    begun = {family for family, taker in zip(families, takers, strict=True) if taker != FREE}
    if last is not None and left[last]:
        family = last
    else:
        fresh = [each for each in left if each not in begun]
        family = fresh[0] if fresh else left.most_common(1)[0][0]
    return next(case for case in free if families[case] == family)


def number_of_groups(ranks: int, n_cases: int, ranks_per_case: int | None) -> int:
    """Return how many groups solve cases side by side; parameters as of `Scheduler`."""
    return min(ranks, n_cases) if ranks_per_case is None else max(ranks // ranks_per_case, 1)


class Scheduler:
    """Splits a communicator into groups of ranks and hands out case numbers.

    Parameters
    ----------
    comm : MPI.Intracomm
        All ranks (collective).
    families : sequence of int
        Number of the family of each case to share out. A group that has solved a case of a family
        goes on with that family as long as it can: those cases share what was made for the first.
    ranks_per_case : int, optional
        Ranks of a group. If None, one: cases side by side are faster than one case on
        several ranks; more where there are more ranks than cases.
    on_report : callable
        Called on rank 0 of `comm` with each message of any group.

    Attributes
    ----------
    group : MPI.Comm
        The ranks that solve a case together with this one.
    n_groups : int
        Number of groups.
    """

    def __init__(
        self,
        comm: MPI.Intracomm,
        families: Sequence[int],
        ranks_per_case: int | None,
        on_report: Callable[[Any], None],
    ) -> None:
        self._comm = comm
        self._families = list(families)
        n_cases = len(families)
        self._on_report = on_report
        self.n_groups = number_of_groups(comm.size, n_cases, ranks_per_case)
        if ranks_per_case is None:
            colour = comm.rank * self.n_groups // comm.size
        else:
            # Ranks that do not make a whole group join the last one.
            colour = min(comm.rank // ranks_per_case, self.n_groups - 1)
        self.group = MPI.Intracomm(comm.Split(colour, comm.rank))
        self._agreement = MPI.Intracomm(self.group.Dup())  # apart from what a case may leave behind
        self._colour, self._last = colour, -1
        # Who has taken each case, on rank 0; groups write there without rank 0 taking part.
        size = n_cases * np.dtype(np.int64).itemsize if comm.rank == 0 else 0
        self._takers = MPI.Win.Allocate(size, disp_unit=8, comm=comm)
        if comm.rank == 0:
            self._takers.Lock(0)
            self._takers.Put(np.full(n_cases, FREE), 0)
            self._takers.Unlock(0)
        comm.Barrier()

    def next_case(self) -> int | None:
        """Return the next case number for this group, or None when all are given out."""
        case = FREE
        if self.group.rank == 0:
            takers = np.empty(len(self._families), dtype=np.int64)
            self._takers.Lock(0)  # alone, from looking to taking
            self._takers.Get(takers, 0)
            self._takers.Flush(0)
            last = self._families[self._last] if self._last >= 0 else None
            case = chosen(self._families, takers.tolist(), last)
            if case != FREE:
                mine = np.array([self._colour], dtype=np.int64)
                self._takers.Put(mine, 0, target=[case, 1, MPI.INT64_T])
            self._takers.Unlock(0)
        self._last = self.group.bcast(case, root=0)
        return None if self._last == FREE else self._last

    def agree(self, failure: str) -> str:
        """Agree on how a case ended (every rank of the group, once a case).

        `failure` says why this rank could not continue; it is empty where the case went well. All
        ranks return the first rank's failure of those that have one.

        Raises
        ------
        TimeoutError
            On a rank with a failure, when another is still busy with the case, or waits in it for
            this one, after `PATIENCE_S`.
        """
        everyone = self._agreement.Ibarrier()
        start = time.monotonic()
        while not everyone.Test():
            if failure and time.monotonic() - start > PATIENCE_S:
                raise TimeoutError(failure)
            time.sleep(0.005)
        return next(filter(None, self._agreement.allgather(failure)), "")

    def report(self, message: Any) -> None:
        """Send a message to rank 0 of all; only the first rank of each group does."""
        if self.group.rank != 0:
            return
        if self._comm.rank == 0:
            self._on_report(message)
            self.collect()
        else:
            self._comm.send(message, dest=0, tag=_REPORT)

    def collect(self) -> None:
        """Deliver the messages that have arrived on rank 0."""
        while self._comm.iprobe(tag=_REPORT):
            self._on_report(self._comm.recv(tag=_REPORT))

    def finish(self) -> None:
        """Wait for all groups, delivering their messages meanwhile (collective)."""
        everyone = self._comm.Ibarrier()
        while not everyone.Test():
            if self._comm.rank == 0:
                self.collect()
            time.sleep(0.02)
        if self._comm.rank == 0:
            self.collect()
        self._takers.Free()
        self._agreement.Free()
        self.group.Free()
