"""The command ``picture``: a solved case drawn again."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from calfsocket.commands import OK
from calfsocket.io.errors import InputError
from calfsocket.parallel.first_rank import on_first_rank

if TYPE_CHECKING:
    from mpi4py import MPI

HELP = "redraw the picture of a solved case"
DESCRIPTION = "Redraw the picture of a solved case from its files."
EPILOG = ""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="e.g. results/TC_separate")


def run(comm: "MPI.Intracomm", arguments: argparse.Namespace) -> int:
    """Draw, and print where."""
    from calfsocket.simulation.result import RESULT_FILE, Result

    folder = arguments.folder
    if not (folder / RESULT_FILE).is_file():
        raise InputError(
            f"picture: {folder} contains no {RESULT_FILE}; "
            "name the folder of a solved case, e.g. results/TC_separate"
        )
    on_first_rank(comm, lambda: print(Result.load(folder).draw(folder)))
    return OK
