"""The command ``report``: tables, figures and page of a study made again."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from calfsocket.commands import OK
from calfsocket.parallel.first_rank import on_first_rank

if TYPE_CHECKING:
    from mpi4py import MPI

    from calfsocket.report.damage import DamageThresholds

HELP = "make tables, figures and page of a solved study"
DESCRIPTION = """\
Write tables, figures, the scoreboard and report.html of a study, from its files alone; a study that
is not complete gets what it allows.
"""
EPILOG = ""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="e.g. results")
    limits = parser.add_argument_group("damage thresholds, % (default: those of the literature)")
    limits.add_argument(
        "--muscle-shear", type=float, default=50.0, metavar="PCT", help="default: %(default)g"
    )
    limits.add_argument(
        "--fascia-strain", type=float, default=27.0, metavar="PCT", help="default: %(default)g"
    )


def run(comm: "MPI.Intracomm", arguments: argparse.Namespace) -> int:
    """Write the report and print where."""
    from calfsocket.report.damage import DamageThresholds

    thresholds = DamageThresholds(arguments.muscle_shear, arguments.fascia_strain)
    on_first_rank(comm, lambda: print(write(arguments.folder, thresholds)))
    return OK


def write(folder: Path, thresholds: "DamageThresholds | None" = None) -> Path:
    """Write the report of a folder of results, with what the paper adds; return its page."""
    from calfsocket.paper.guest import guest
    from calfsocket.report.write import write_report
    from calfsocket.simulation.results import load_results

    return write_report(load_results(folder), [guest], thresholds)
