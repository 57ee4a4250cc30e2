"""How the ranks of a program end together, with one message, when they cannot go on."""

import signal
import sys
import time
from types import FrameType
from typing import TYPE_CHECKING, NoReturn

if TYPE_CHECKING:
    from mpi4py import MPI

_AT_AN_END, _SPEAKING = 72, 73
"""Tags of the messages by which ranks that cannot go on hear of each other."""

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
    for number in (signal.SIGINT, signal.SIGTERM):  # from here on they end this rank in silence
        signal.signal(number, signal.SIG_DFL)
    _tell_the_others(comm, _AT_AN_END)
    if not _another_speaks(comm):
        _tell_the_others(comm, _SPEAKING)
        print(message, file=sys.stderr, flush=True)
    # mpirun passes the message on before it ends the others; if it has asked for the end itself, it
    # does so meanwhile in its own way.
    time.sleep(HEARING_S)
    comm.Abort(code)
    raise SystemExit(code)


def _tell_the_others(comm: "MPI.Intracomm", tag: int) -> None:
    for rank in range(comm.size):
        if rank != comm.rank:
            comm.Isend(b"", dest=rank, tag=tag)


def _another_speaks(comm: "MPI.Intracomm") -> bool:
    """Whether another rank has spoken, or a lower one is about to; it is given the time to."""
    deadline = time.monotonic() + (HEARING_S if comm.rank > 0 else 0.0)
    while True:
        if comm.iprobe(tag=_SPEAKING) or any(
            comm.iprobe(source=rank, tag=_AT_AN_END) for rank in range(comm.rank)
        ):
            time.sleep(2 * HEARING_S)
            return True
        if time.monotonic() >= deadline:
            return False
        time.sleep(0.01)
