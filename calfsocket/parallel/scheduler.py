"""Cases side by side: groups of ranks that take the next case as they become free."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from mpi4py import MPI

from calfsocket.parallel.abort import PATIENCE_S

_REPORT = 71


class Scheduler:
    """Splits a communicator into groups of ranks and hands out case numbers.

    Parameters
    ----------
    comm : MPI.Intracomm
        All ranks (collective).
    n_cases : int
        Cases to share out.
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
        n_cases: int,
        ranks_per_case: int | None,
        on_report: Callable[[Any], None],
    ) -> None:
        self._comm = comm
        self._n_cases = n_cases
        self._on_report = on_report
        if ranks_per_case is None:
            self.n_groups = min(comm.size, n_cases)
            colour = comm.rank * self.n_groups // comm.size
        else:
            # Ranks that do not make a whole group join the last one.
            self.n_groups = max(comm.size // ranks_per_case, 1)
            colour = min(comm.rank // ranks_per_case, self.n_groups - 1)
        self.group = MPI.Intracomm(comm.Split(colour, comm.rank))
        self._agreement = MPI.Intracomm(self.group.Dup())  # apart from what a case may leave behind
        # One counter on rank 0, which groups raise without rank 0 taking part.
        size = np.dtype(np.int64).itemsize if comm.rank == 0 else 0
        self._counter = MPI.Win.Allocate(size, disp_unit=8, comm=comm)
        if comm.rank == 0:
            self._counter.Lock(0)
            self._counter.Put(np.zeros(1, dtype=np.int64), 0)
            self._counter.Unlock(0)
        comm.Barrier()

    def next_case(self) -> int | None:
        """Return the next case number for this group, or None when all are given out."""
        taken = np.zeros(1, dtype=np.int64)
        if self.group.rank == 0:
            self._counter.Lock(0)
            self._counter.Fetch_and_op(np.ones(1, dtype=np.int64), taken, 0, op=MPI.SUM)
            self._counter.Unlock(0)
        case = self.group.bcast(int(taken[0]), root=0)
        return case if case < self._n_cases else None

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
        self._counter.Free()
        self._agreement.Free()
        self.group.Free()
