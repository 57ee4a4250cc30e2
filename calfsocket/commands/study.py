"""The study: what runs without a command."""

import argparse
import logging
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from calfsocket.commands import CASE_FAILED, OK, options
from calfsocket.commands.first_rank import on_first_rank
from calfsocket.errors import InputError

if TYPE_CHECKING:
    from mpi4py import MPI
    from rich.console import Console

    from calfsocket.study import Study

log = logging.getLogger("calfsocket")

DESCRIPTION = """\
What does a prosthetic socket do inside a leg?

Without a command, solves the study: three sockets (TC total contact, TSB total surface bearing,
HS hydrostatic), each with separate and with combined properties of muscle and fascia, and writes
stresses, strains and contact pressures to a folder of results.
"""

EPILOG = """\
examples:
  python3 -m calfsocket                                 the six runs, into results/
  python3 -m calfsocket --size coarse --out quick       the same on a coarse mesh
  python3 -m calfsocket --sockets TC,HS --materials separate
  mpirun -n 2 python3 -m calfsocket                     two cases side by side
  python3 -m calfsocket --size coarse --variants        what depends on choices of the model
  python3 -m calfsocket report results                  tables, figures and page again
  python3 -m calfsocket mesh --socket HS --out hs.msh   only a mesh, with a table of its quality

results:
  summary.csv    largest stress and strain of each tissue, and contact pressure
  contact.csv    contact pressure, friction and gap along the skin
  steps.csv      load steps and Newton iterations
  run.json       inputs, versions, checks and timings
  report.html    all of it on one page, beside the paper's numbers; tables/, figures/
  TC_separate/   fields.vtu (for ParaView), contact.csv and picture.png of a case

Every option of PETSc can be set with its name after -calfsocket_, e.g. -calfsocket_snes_monitor.
Exit code: 0 all cases solved, 1 a case failed, 2 the input cannot be used.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    what = parser.add_argument_group("what to solve")
    what.add_argument("--sockets", default="TC,TSB,HS", metavar="LIST", help="default: %(default)s")
    what.add_argument(
        "--materials", default="separate,combined", metavar="LIST", help="default: %(default)s"
    )
    options.add_size(what)
    what.add_argument(
        "--socket-support",
        default="floating",
        choices=("floating", "outer-fixed"),
        help="socket resting on the limb alone, or held at its outer face (default: %(default)s)",
    )
    options.add_fascia_c10(what)
    what.add_argument(
        "--ogden-form",
        default="abaqus",
        choices=("abaqus", "as-printed"),
        help="factor 2 mu/alpha^2, or mu/alpha as in the paper's equation (1) "
        "(default: %(default)s)",
    )
    options.add_material(what, "the tissue `combined` is muscle and fascia of the combined set; ")
    options.add_friction(what)
    what.add_argument(
        "--variants",
        action="store_true",
        help="solve the study also with each choice that the paper leaves open changed (held "
        "socket, C10, friction 0, Ogden form), into DIR/variants/, and compare",
    )
    how = parser.add_argument_group("how to run")
    how.add_argument(
        "--out", type=Path, default=Path("results"), metavar="DIR", help="default: %(default)s"
    )
    how.add_argument(
        "--overwrite", action="store_true", help="replace results made with other settings"
    )
    how.add_argument(
        "--ranks-per-case",
        type=int,
        metavar="N",
        help="ranks that solve one case together (default: cases side by side)",
    )
    how.add_argument(
        "--profile", action="store_true", help="say where the time goes, and write profile.csv"
    )
    how.add_argument("--no-pictures", action="store_true", help="do not draw the cases")
    how.add_argument("--no-report", action="store_true", help="do not write the report at the end")


def run(comm: "MPI.Intracomm", arguments: argparse.Namespace) -> int:
    """Solve the study, and its variants where they are wanted; write the report."""
    from rich.console import Console

    from calfsocket import profile, variants
    from calfsocket.report.writing import write_report
    from calfsocket.study import attempt, check_folder, run_study

    study = _study(comm, arguments)
    studies = variants.studies(study) if arguments.variants else [study]
    for each in studies:
        on_first_rank(comm, partial(check_folder, each, arguments.overwrite))
    console = Console(stderr=True)
    if comm.rank == 0:
        _log_to(console)
    solved = []
    for each in studies:
        log.info("results go to %s", each.out)
        solved.append(run_study(comm, each, arguments.ranks_per_case, console))
        if comm.rank == 0 and arguments.profile:
            with attempt(f"no profile of {each.out}"):
                console.print(profile.table(each.out))
    if comm.rank == 0 and not arguments.no_report:
        study = studies[0]  # the base, where there are variants: its page compares them
        with attempt(f"no report in {study.out}"):
            log.info("report: %s", write_report(study.out))
    return OK if all(solved) else CASE_FAILED


def _study(comm: "MPI.Intracomm", arguments: argparse.Namespace) -> "Study":
    """Return what was asked for."""
    from calfsocket.case import Case, Settings
    from calfsocket.meshes.data import load_limb, load_sockets
    from calfsocket.study import MATERIAL_SETS, Study, select

    if arguments.ranks_per_case is not None and not 1 <= arguments.ranks_per_case <= comm.size:
        raise InputError(
            f"--ranks-per-case: {arguments.ranks_per_case}; give 1 to {comm.size}, the number of "
            "ranks that mpirun started"
        )
    sockets = load_sockets()
    chosen = select(arguments.sockets.split(","), list(sockets.sockets), "--sockets")
    sets: list[Any] = select(arguments.materials.split(","), MATERIAL_SETS, "--materials")
    return Study(
        cases=tuple(Case(socket, name) for socket in chosen for name in sets),
        settings=Settings(
            socket_support=arguments.socket_support,
            ogden_form=arguments.ogden_form,
            **options.model_settings(arguments, sets),
        ),
        limb=load_limb(),
        sockets=sockets,
        out=arguments.out,
        pictures=not arguments.no_pictures,
        profile=arguments.profile,
    )


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
