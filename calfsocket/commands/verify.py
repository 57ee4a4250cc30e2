"""The command ``verify``: problems with known answers, and the page that shows them."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from calfsocket.commands import CASE_FAILED, OK
from calfsocket.io.errors import InputError

if TYPE_CHECKING:
    from mpi4py import MPI

HELP = "solve problems with known answers and report the errors"
DESCRIPTION = "Solve problems with known answers and write verification.md, with figures."
EPILOG = ""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument(
        "--out", type=Path, default=Path("docs"), metavar="DIR", help="default: %(default)s"
    )
    parser.add_argument(
        "--only",
        metavar="LIST",
        help="subjects to run, e.g. element,limb; other sections of the page stay (default: all)",
    )
    parser.add_argument(
        "--size",
        default="coarse,medium",
        metavar="LIST",
        help="mesh sizes of the limb, at least two (default: %(default)s)",
    )
    parser.add_argument(
        "--results",
        type=Path,
        default=Path("results/verification"),
        metavar="DIR",
        help="where the limb's runs are, or will be put, in a folder for each size (default: "
        "%(default)s); solve them beforehand on several ranks with `--size SIZE --out DIR/SIZE`",
    )


def run(comm: "MPI.Intracomm", arguments: argparse.Namespace) -> int:
    """Solve and write the page."""
    from calfsocket.simulation.precompile import precompile
    from calfsocket.verification.limb import coarsest_first
    from calfsocket.verification.page import SUBJECTS, chosen_subjects, write_page

    if comm.size > 1:
        raise InputError("verify: runs on one rank; start it without mpirun")
    subjects = chosen_subjects(arguments.only.split(",")) if arguments.only else SUBJECTS
    sizes = coarsest_first(arguments.size.split(","))
    precompile(comm)
    options = {"limb": {"sizes": sizes, "results": arguments.results}}
    return OK if write_page(arguments.out, subjects, options) else CASE_FAILED
