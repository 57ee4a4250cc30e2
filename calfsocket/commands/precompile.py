"""The command ``precompile``: forms compiled ahead of the first run."""

import argparse
from typing import TYPE_CHECKING

from calfsocket.commands import OK

if TYPE_CHECKING:
    from mpi4py import MPI

HELP = "compile all forms now instead of in the first run"
DESCRIPTION = "Compile all forms now instead of in the first run."
EPILOG = ""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options, of which there are none."""


def run(comm: "MPI.Intracomm", arguments: argparse.Namespace) -> int:
    """Compile."""
    from calfsocket.simulation.precompile import precompile

    precompile(comm)
    return OK
