"""What a person can ask for: one module a command, `study` being what runs without one.

The modules are imported for their help alone, which should not wait for MPI and dolfinx: heavy
imports stand in the functions that need them.
"""

import argparse
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from mpi4py import MPI

OK, CASE_FAILED, BAD_INPUT = 0, 1, 2
"""Exit codes."""


class Command(Protocol):
    """What each module has.

    Attributes
    ----------
    DESCRIPTION, EPILOG : str
        Its help before and after the options.
    """

    DESCRIPTION: str
    EPILOG: str

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Add the options."""

    def run(self, comm: "MPI.Intracomm", arguments: argparse.Namespace) -> int:
        """Do it (collective); return the exit code.

        Raises
        ------
        InputError
            On all ranks, when the input cannot be used.
        """


class NamedCommand(Command, Protocol):
    """What a command that is called by its name has besides.

    Attributes
    ----------
    HELP : str
        Its line in the list of commands.
    """

    HELP: str
