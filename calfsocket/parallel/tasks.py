"""Tasks side by side, each on the rank that is free next."""

from collections.abc import Callable, Sequence
from typing import TypeVar

from mpi4py import MPI

from calfsocket.parallel.first_rank import agree
from calfsocket.parallel.scheduler import Scheduler

Value = TypeVar("Value")


def side_by_side(
    comm: MPI.Intracomm,
    tasks: Sequence[Callable[[], Value]],
    first: Callable[[], object] = lambda: None,
) -> list[Value]:
    """Run tasks; return their values in order on rank 0, nothing on others (collective).

    `first` is work of rank 0 alone: it does that while others begin with the tasks.

    Raises
    ------
    Exception
        On a rank whose task raises one.
    CalfsocketError
        On the other ranks, if one does.
    """
    one_family = [0] * len(tasks)
    scheduler = Scheduler(comm, one_family, 1, lambda _: None)
    done: dict[int, Value] = {}
    failure: Exception | None = None
    try:
        if comm.rank == 0:
            first()
    except Exception as error:
        failure = error
    while (number := scheduler.next_case()) is not None:
        try:
            done[number] = tasks[number]()
        except Exception as error:
            failure = error
    scheduler.finish()
    agree(comm, failure)
    every = {number: value for part in comm.gather(done) or [] for number, value in part.items()}
    return [every[number] for number in sorted(every)]
