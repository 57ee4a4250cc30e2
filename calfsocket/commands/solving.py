"""What the commands that solve a study have in common."""

import argparse
import logging
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from calfsocket.commands import CASE_FAILED, OK, report
from calfsocket.commands.options import Options
from calfsocket.io.errors import InputError
from calfsocket.parallel.first_rank import on_first_rank

if TYPE_CHECKING:
    from mpi4py import MPI
    from rich.console import Console

    from calfsocket.study.study import Study

log = logging.getLogger("calfsocket")


def add_running(parser: Options, out: Path | None) -> None:
    """Add how to run a study; `out` is where results go by default, None where its file says."""
    parser.add_argument(
        "--out",
        type=Path,
        default=out,
        metavar="DIR",
        help=f"default: {'the folder that FILE names' if out is None else '%(default)s'}",
    )
    parser.add_argument(
        "--overwrite", action="store_true", help="replace results made with other settings"
    )
    parser.add_argument(
        "--resume",
        action="store_true",
        help="keep the cases that an earlier run into DIR has solved, and go on with those that "
        "it had begun from their last equilibrium",
    )
    parser.add_argument(
        "--ranks-per-case",
        type=int,
        metavar="N",
        help="ranks that solve one case together (default: cases side by side)",
    )
    parser.add_argument(
        "--profile", action="store_true", help="say where the time goes, and write profile.csv"
    )
    parser.add_argument("--no-pictures", action="store_true", help="do not draw the cases")
    parser.add_argument(
        "--no-report", action="store_true", help="do not write the report at the end"
    )


def check_ranks(comm: "MPI.Intracomm", ranks_per_case: int | None) -> None:
    """Refuse groups of ranks that cannot be made.

    Raises
    ------
    InputError
        On all ranks.
    """
    if ranks_per_case is not None and not 1 <= ranks_per_case <= comm.size:
        raise InputError(
            f"--ranks-per-case: {ranks_per_case}; give 1 to {comm.size}, the number of "
            "ranks that mpirun started"
        )


def solve(comm: "MPI.Intracomm", studies: Sequence["Study"], arguments: argparse.Namespace) -> int:
    """Solve studies one after the other, and write the report of the first (collective).

    Returns
    -------
    int
        Exit code.
    """
    from rich.console import Console

    from calfsocket.simulation import profile
    from calfsocket.study.runner import attempt
    from calfsocket.study.study import check_folder, run_study

    if arguments.resume and arguments.overwrite:
        raise InputError("--resume, --overwrite: keep the results or replace them; give one")
    for each in studies:
        on_first_rank(comm, partial(check_folder, each, arguments.overwrite))
    console = Console(stderr=True)
    if comm.rank == 0:
        _log_to(console)
    solved = []
    try:
        for each in studies:
            log.info("results go to %s", each.out)
            study = replace(each, profile=arguments.profile)
            solved.append(
                run_study(comm, study, arguments.ranks_per_case, console, arguments.resume)
            )
            if comm.rank == 0 and arguments.profile:
                with attempt(f"no profile of {each.out}"):
                    console.print(profile.table(each.out))
    except KeyboardInterrupt as interrupt:
        raise type(interrupt)(
            f"interrupted; what is finished is whole in {each.out}, and the same command with "
            "--resume goes on"
        ) from None
    if comm.rank == 0 and not arguments.no_report:
        study = studies[0]  # the base, where there are variants: its page compares them
        with attempt(f"no report in {study.out}"):
            log.info("report: %s", report.write(study.out))
    return OK if all(solved) else CASE_FAILED


def _log_to(console: "Console") -> None:
    """Show what the study tells of itself, and warnings of all packages."""
    from rich.logging import RichHandler

    if console.is_terminal:
        handler: logging.Handler = RichHandler(console=console, show_path=False)
    else:
        handler = logging.StreamHandler()
        handler.setFormatter(logging.Formatter("%(asctime)s %(message)s", "%H:%M:%S"))
    logging.basicConfig(level=logging.WARNING, handlers=[handler])
    log.setLevel(logging.INFO)
