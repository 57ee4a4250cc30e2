"""Work of the first rank alone, such as writing a file."""

from collections.abc import Callable
from typing import TYPE_CHECKING

from calfsocket.errors import InputError

if TYPE_CHECKING:
    from mpi4py import MPI


def on_first_rank(comm: "MPI.Intracomm", task: Callable[[], None]) -> None:
    """Do something on rank 0 (collective).

    Raises
    ------
    InputError
        On all ranks, where the task refuses the input.
    """
    refusal: InputError | None = None
    if comm.rank == 0:
        try:
            task()
        except InputError as error:
            refusal = error
    refusal = comm.bcast(refusal, root=0)
    if refusal is not None:
        raise refusal
