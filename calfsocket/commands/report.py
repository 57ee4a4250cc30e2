"""Commands on solved studies: ``report`` and ``picture``."""

from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from calfsocket.commands import Comm, command, first_rank, group, option
from calfsocket.io.errors import InputError

if TYPE_CHECKING:
    from calfsocket.report.damage import DamageThresholds
    from calfsocket.simulation.results import Results


@command(
    option("folder", type=Path, metavar="FOLDER", help="e.g. results"),
    group(
        "damage thresholds, % (default: those of the literature)",
        option(
            "--muscle-shear", type=float, default=50.0, metavar="PCT", help="default: %(default)g"
        ),
        option(
            "--fascia-strain", type=float, default=27.0, metavar="PCT", help="default: %(default)g"
        ),
    ),
    description="""\
Write tables, figures and report.html of a study, from its files alone; a study that is not complete
gets what it allows. Beside results of the paper's cases stand the paper's own, with a scoreboard of
its claims. Started with `mpirun -n 2`, two ranks draw the figures.
""",
    solves=False,
)
def report(comm: Comm, arguments: Namespace) -> None:
    """Make tables, figures and page of a solved study."""
    from calfsocket.report.damage import DamageThresholds
    from calfsocket.simulation.results import load_results

    thresholds = DamageThresholds(arguments.muscle_shear, arguments.fascia_strain)
    page = write(comm, load_results(arguments.folder).shared(comm), thresholds)
    if comm.rank == 0:
        print(page)


def write(comm: Comm, results: "Results", thresholds: "DamageThresholds | None" = None) -> Path:
    """Write the report of results, with what the paper adds (collective); return its page."""
    from calfsocket.paper.guest import guest
    from calfsocket.report.write import write_report

    return write_report(results, guest, thresholds, comm)


@command(
    option("folder", type=Path, metavar="FOLDER", help="e.g. results/TC_separate"),
    option(
        "--format",
        choices=("png", "svg", "pdf"),
        default="png",
        help="of the picture (default: %(default)s)",
    ),
    description="""\
Redraw the picture of a case from its files. That of a case which has stopped below its full load
says so.
""",
    solves=False,
)
@first_rank
def picture(arguments: Namespace) -> None:
    """Redraw the picture of a case."""
    from calfsocket.simulation.result import RESULT_FILE, Result

    folder = arguments.folder
    if not (folder / RESULT_FILE).is_file():
        raise InputError(
            f"picture: {folder} contains no {RESULT_FILE}; "
            "name the folder of a case, e.g. results/TC_separate"
        )
    print(Result.load(folder, stopped=True).draw(folder, arguments.format))
