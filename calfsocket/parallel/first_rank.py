"""Work of the first rank alone, such as writing a file."""

from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar, cast

from calfsocket.io.errors import InputError

if TYPE_CHECKING:
    from mpi4py import MPI


Value = TypeVar("Value")


def on_first_rank(comm: "MPI.Intracomm", task: Callable[[], Value]) -> Value:
    """Do something on rank 0, such as reading a file, and give all ranks what it returns.

    Collective.

    Raises
    ------
    InputError
        On all ranks, where the task refuses the input.
    """
    value: Value | None = None
    refusal: InputError | None = None
    if comm.rank == 0:
        try:
            value = task()
        except InputError as error:
            refusal = error
    value, refusal = comm.bcast((value, refusal), root=0)
    if refusal is not None:
        raise refusal
    return cast(Value, value)
