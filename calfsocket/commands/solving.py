"""Options and work that the commands which solve a study have in common."""

import argparse
import logging
from pathlib import Path
from typing import TYPE_CHECKING

from calfsocket.commands import CASE_FAILED, OK, report
from calfsocket.commands.options import Options
from calfsocket.io.errors import InputError

if TYPE_CHECKING:
    from mpi4py import MPI
    from rich.console import Console

    from calfsocket.study.study import Study

log = logging.getLogger("calfsocket")


def add_running(parser: Options, out: str) -> None:
    """Add the options that say how to run a study; `out` describes the default folder."""
    parser.add_argument("--out", type=Path, metavar="DIR", help=f"default: {out}")
    parser.add_argument(
        "--overwrite", action="store_true", help="replace results made from other inputs"
    )
    parser.add_argument(
        "--resume",
        action="store_true",
        help="keep the cases already solved in DIR, and continue the others from their last "
        "equilibrium",
    )
    parser.add_argument(
        "--ranks-per-case",
        type=int,
        metavar="N",
        help="ranks that solve one case together (default: cases run side by side)",
    )
    parser.add_argument(
        "--profile", action="store_true", help="show where the time goes, and write profile.csv"
    )
    parser.add_argument("--no-pictures", action="store_true", help="do not draw the cases")
    parser.add_argument(
        "--no-report", action="store_true", help="do not write the report at the end"
    )


def check_options(comm: "MPI.Intracomm", arguments: argparse.Namespace) -> None:
    """Refuse options that cannot be combined, on all ranks.

    Raises
    ------
    InputError
        One line that names the option.
    """
    ranks = arguments.ranks_per_case
    if ranks is not None and not 1 <= ranks <= comm.size:
        raise InputError(
            f"--ranks-per-case: is {ranks}; it must be 1 to {comm.size}, the number of MPI ranks"
        )
    if arguments.resume and arguments.overwrite:
        raise InputError("--resume keeps results and --overwrite replaces them; use one of the two")


def solve(comm: "MPI.Intracomm", study: "Study", arguments: argparse.Namespace) -> int:
    """Solve a study and write its report (collective); return the exit code."""
    from rich.console import Console

    console = Console(stderr=True)
    if comm.rank == 0:
        _log_to(console)
    out = Path(arguments.out or study.plan.document.study.out)
    try:
        results = study.run(
            comm,
            out,
            resume=arguments.resume,
            overwrite=arguments.overwrite,
            ranks_per_case=arguments.ranks_per_case,
            pictures=not arguments.no_pictures,
            profile=arguments.profile,
            console=console,
        )
    except KeyboardInterrupt as interrupt:
        raise type(interrupt)(
            f"interrupted; the finished cases are complete in {out}, and the same command with "
            "--resume continues"
        ) from None
    if comm.rank == 0:
        _finish(out, arguments, console)
    solved = all(case.key in results for case in study.plan.to_solve)
    return OK if solved else CASE_FAILED


def _finish(out: Path, arguments: argparse.Namespace, console: "Console") -> None:
    """Show the profile and write the report; neither may fail what is solved."""
    from calfsocket.simulation import profile
    from calfsocket.study.runner import logged

    if arguments.profile:
        with logged(f"the profile of {out} could not be made"):
            console.print(profile.table(out))
    if not arguments.no_report:
        with logged(f"the report in {out} could not be made"):
            log.info("report: %s", report.write(out))


def _log_to(console: "Console") -> None:
    """Show the study's messages, and warnings of all packages."""
    from rich.logging import RichHandler

    if console.is_terminal:
        handler: logging.Handler = RichHandler(console=console, show_path=False)
    else:
        handler = logging.StreamHandler()
        handler.setFormatter(logging.Formatter("%(asctime)s %(message)s", "%H:%M:%S"))
    logging.basicConfig(level=logging.WARNING, handlers=[handler])
    log.setLevel(logging.INFO)
