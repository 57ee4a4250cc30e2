"""Tasks of rank 0 alone, such as reading a file, and failures that all ranks learn of."""

from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar, cast

from calfsocket.io.errors import CalfsocketError, in_one_line

if TYPE_CHECKING:
    from mpi4py import MPI


Value = TypeVar("Value")


def on_first_rank(comm: "MPI.Intracomm", task: Callable[[], Value]) -> Value:
    """Run a task on rank 0, such as reading a file, and return its value on all ranks.

    Collective.

    Raises
    ------
    Exception
        On rank 0, if the task raises one.
    CalfsocketError
        On the other ranks, if it does.
    """
    value: Value | None = None
    failure: Exception | None = None
    if comm.rank == 0:
        try:
            value = task()
        except Exception as error:
            failure = error
    if comm.size > 1:  # MPI would pack it and unpack it for rank 0, too
        sent = comm.bcast((value, for_others(failure)), root=0)
        if comm.rank > 0:
            value, failure = sent
    if failure:
        raise failure
    return cast(Value, value)


def agree(comm: "MPI.Intracomm", failure: Exception | None) -> None:
    """Raise the failure of the first rank that has one on all ranks; a rank's own there.

    Collective.
    """
    first = next(filter(None, comm.allgather(for_others(failure))), None)
    if failure or first:
        raise failure or first  # type: ignore[misc]


def for_others(failure: Exception | None) -> CalfsocketError | None:
    """Return a failure as other ranks learn of it: unforeseen ones in one line."""
    if failure is None or isinstance(failure, CalfsocketError):
        return failure
    return CalfsocketError(in_one_line(failure))
