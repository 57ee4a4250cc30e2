"""Ends all ranks of a program together, with one message, when some of them cannot continue."""

import signal
import sys
import threading
import time
from types import FrameType
from typing import TYPE_CHECKING, NoReturn

if TYPE_CHECKING:
    from mpi4py import MPI

_FAILED, _REPORTING = 72, 73
"""Tags of the messages by which failed ranks learn of each other."""

PATIENCE_S = 5.0
"""How long a failed rank waits for the others to report the same failure."""

LISTENING_S = 0.5
"""How long a failed rank lets another print the message instead; mpirun kills after a second."""

ARRIVAL_S = 0.05
"""How long the first rank looks for such a message: one probe may only make it arrive."""

REPEAT_S = 0.01
"""After what time a signal is sent again that Python has dropped."""


class Terminated(KeyboardInterrupt):
    """SIGTERM asked the process to end: mpirun sends it after Ctrl-C, and batch systems do."""


def handle_termination() -> None:
    """Make SIGTERM end the program as Ctrl-C does, so that no half-written file is left."""

    def terminate(number: int, frame: FrameType | None) -> None:
        raise Terminated

    signal.signal(signal.SIGTERM, terminate)
    sys.unraisablehook = _repeat_interrupt


def _repeat_interrupt(lost: "sys.UnraisableHookArgs") -> None:
    """Send a signal again that came while an object was freed, where Python drops exceptions."""
    if isinstance(lost.exc_value, KeyboardInterrupt):
        # From another thread, and later: raised in here, it would be dropped as well. To the main
        # thread, for it to wake up where it waits.
        main = threading.main_thread().ident
        threading.Timer(REPEAT_S, signal.pthread_kill, [main, _signal_of(lost.exc_value)]).start()
    else:
        sys.__unraisablehook__(lost)


def _signal_of(interrupt: KeyboardInterrupt) -> signal.Signals:
    return signal.SIGTERM if isinstance(interrupt, Terminated) else signal.SIGINT


def exit_code(interrupt: KeyboardInterrupt) -> int:
    """Return the exit code that shells use for a program ended by this signal."""
    return 128 + _signal_of(interrupt)


def all_arrive(comm: "MPI.Intracomm") -> bool:
    """Return whether all ranks call this within `PATIENCE_S`; `comm` must serve nothing else."""
    everyone = comm.Ibarrier()
    deadline = time.monotonic() + PATIENCE_S
    while not everyone.Test():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.005)
    return True


def abort_all(comm: "MPI.Intracomm", message: str, code: int) -> NoReturn:
    """Abort all ranks, which may be waiting for this one, and print one message.

    If several ranks fail at the same time, the lowest of them prints.
    """
    for number in (signal.SIGINT, signal.SIGTERM):  # from now on they end this rank silently
        signal.signal(number, signal.SIG_DFL)
    _notify_others(comm, _FAILED)
    if not _another_reports(comm):
        _notify_others(comm, _REPORTING)
        print(message, file=sys.stderr, flush=True)
    # Gives mpirun the time to pass the message on; where it asked for the end itself, it ends the
    # ranks meanwhile.
    time.sleep(LISTENING_S)
    comm.Abort(code)
    raise SystemExit(code)


def _notify_others(comm: "MPI.Intracomm", tag: int) -> None:
    for rank in range(comm.size):
        if rank != comm.rank:
            comm.Isend(b"", dest=rank, tag=tag)


def _another_reports(comm: "MPI.Intracomm") -> bool:
    """Return whether another rank has printed, or a lower one is about to."""
    deadline = time.monotonic() + (LISTENING_S if comm.rank > 0 else ARRIVAL_S)
    while True:
        if comm.iprobe(tag=_REPORTING) or any(
            comm.iprobe(source=rank, tag=_FAILED) for rank in range(comm.rank)
        ):
            time.sleep(2 * LISTENING_S)
            return True
        if time.monotonic() >= deadline:
            return False
        time.sleep(0.01)
