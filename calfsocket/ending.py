"""How the ranks of a program end together, with one message, when they cannot go on."""

import signal
import sys
import time
from types import FrameType
from typing import TYPE_CHECKING, NoReturn

if TYPE_CHECKING:
    from mpi4py import MPI

_LAST_WORD = 72
"""Tag of the messages by which ranks that cannot go on hear of each other."""

PATIENCE_S = 5.0
"""How long a rank that cannot go on waits for the others to say so too."""

HEARING_S = 0.5
"""How long such a rank listens for another that may speak instead; mpirun kills after a second."""


class Terminated(KeyboardInterrupt):
    """The process was asked to end by SIGTERM, as by mpirun after Ctrl-C, or by a batch system."""


def heed_termination() -> None:
    """End on SIGTERM as on Ctrl-C: files that are being written are taken back."""

    def terminate(number: int, frame: FrameType | None) -> None:
        raise Terminated

    signal.signal(signal.SIGTERM, terminate)


def exit_code(interrupt: KeyboardInterrupt) -> int:
    """Exit code of a program that a signal has ended, by the shell's custom."""
    return 128 + (signal.SIGTERM if isinstance(interrupt, Terminated) else signal.SIGINT)


def all_are_here(comm: "MPI.Intracomm") -> bool:
    """Whether all ranks of a communicator that serves nothing else come here within seconds."""
    everyone = comm.Ibarrier()
    deadline = time.monotonic() + PATIENCE_S
    while not everyone.Test():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.005)
    return True


def end_all(comm: "MPI.Intracomm", message: str, code: int) -> NoReturn:
    """End all ranks, which may wait for this one, with one message.

    Of several ranks that cannot go on at the same time, the first one speaks.
    """
    for higher in range(comm.rank + 1, comm.size):
        comm.Isend(b"", dest=higher, tag=_LAST_WORD)
    if not _hears_another(comm):
        print(message, file=sys.stderr, flush=True)
    comm.Abort(code)
    raise SystemExit(code)


def _hears_another(comm: "MPI.Intracomm") -> bool:
    """Whether a lower rank has a last word, too; it is then given the time to say it."""
    if comm.rank == 0:
        return False
    deadline = time.monotonic() + HEARING_S
    while time.monotonic() < deadline:
        if comm.iprobe(tag=_LAST_WORD):
            time.sleep(2 * HEARING_S)
            return True
        time.sleep(0.01)
    return False
