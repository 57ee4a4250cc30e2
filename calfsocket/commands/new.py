"""The command ``new``: an example of a study file."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from calfsocket.commands import OK
from calfsocket.io.errors import InputError
from calfsocket.parallel.first_rank import on_first_rank

if TYPE_CHECKING:
    from mpi4py import MPI

HELP = "write an example study file to start from"
DESCRIPTION = "Write an example study file with a remark on every key."
EPILOG = ""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument(
        "file",
        type=Path,
        nargs="?",
        default=Path("study.toml"),
        metavar="FILE",
        help="default: %(default)s",
    )


def run(comm: "MPI.Intracomm", arguments: argparse.Namespace) -> int:
    """Write it, and print where."""
    on_first_rank(comm, lambda: write(arguments.file))
    return OK


def write(path: Path) -> None:
    """Write the example; never over a file that is there.

    Raises
    ------
    InputError
        When it cannot be written.
    """
    from calfsocket.study.study import example

    if path.suffix != ".toml":
        raise InputError(f"new: {path}: use a name that ends in .toml")
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(example())
    except FileExistsError:
        raise InputError(f"new: {path} already exists; choose another name") from None
    except OSError as error:
        raise InputError(f"new: {path}: {error.strerror}; name another file") from None
    print(path)
