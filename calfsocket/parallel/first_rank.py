"""Tasks of rank 0 alone, such as reading a file."""

from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar, cast

from calfsocket.io.errors import CalfsocketError

if TYPE_CHECKING:
    from mpi4py import MPI


Value = TypeVar("Value")


def on_first_rank(comm: "MPI.Intracomm", task: Callable[[], Value]) -> Value:
    """Run a task on rank 0, such as reading a file, and return its value on all ranks.

    Collective.

    Raises
    ------
    CalfsocketError
        On all ranks, if the task raises one.
    """
    value: Value | None = None
    refusal: CalfsocketError | None = None
    if comm.rank == 0:
        try:
            value = task()
        except CalfsocketError as error:
            refusal = error
    value, refusal = comm.bcast((value, refusal), root=0)
    if refusal is not None:
        raise refusal
    return cast(Value, value)
