"""What solves studies: the paper's, which runs without a command, and ``run``, that of a file."""

import logging
from argparse import Namespace
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from calfsocket.commands import CASE_FAILED, OK, Comm, command, group, option, options, report
from calfsocket.io.errors import InputError
from calfsocket.parallel.first_rank import on_first_rank

if TYPE_CHECKING:
    from rich.console import Console

    from calfsocket.simulation.results import Results
    from calfsocket.study.study import Study

log = logging.getLogger("calfsocket")

RUNNING = (
    option("--overwrite", action="store_true", help="replace results made from other inputs"),
    option(
        "--resume",
        action="store_true",
        help="keep the cases already solved in DIR, and continue the others from their last "
        "equilibrium",
    ),
    option(
        "--ranks-per-case",
        type=int,
        metavar="N",
        help="ranks that solve one case together (default: cases run side by side)",
    ),
    option(
        "--profile", action="store_true", help="show where the time goes, and write profile.csv"
    ),
    option(
        "--mesh-error",
        action="store_true",
        help="solve each case on a second mesh, too, and give every number the error that follows",
    ),
    option(
        "--step-fields",
        action="store_true",
        help="write the fields of every load step, too, and fields.pvd for ParaView",
    ),
    option("--no-pictures", action="store_true", help="do not draw the cases"),
    option("--no-report", action="store_true", help="do not write the report at the end"),
)
"""How to run a study."""


@command(
    group(
        "what to solve",
        option("--sockets", default="TC,TSB,HS", metavar="LIST", help="default: %(default)s"),
        option(
            "--materials", default="separate,combined", metavar="LIST", help="default: %(default)s"
        ),
        options.size("paper", refined=True),
        option(
            "--socket-support",
            default="floating",
            choices=("floating", "outer-fixed"),
            help="socket resting on the limb alone, or fixed at its outer face (default: "
            "%(default)s)",
        ),
        options.FASCIA_C10,
        option(
            "--ogden-form",
            default="abaqus",
            choices=("abaqus", "as-printed"),
            help="factor 2 mu/alpha^2, or mu/alpha as in the paper's equation (1) "
            "(default: %(default)s)",
        ),
        options.material("`combined` is muscle and fascia of the combined set; "),
        options.FRICTION,
        option(
            "--variants",
            action="store_true",
            help="also solve the cases under each choice that the paper leaves open (fixed socket, "
            "C10, friction 0, Ogden form), and compare",
        ),
    ),
    group(
        "how to run",
        option("--out", type=Path, metavar="DIR", help="default: results"),
        *RUNNING,
    ),
    description="""\
What does a prosthetic socket do inside a leg?

Without a command, solves the study: three sockets (TC total contact, TSB total surface bearing,
HS hydrostatic), each with separate and with combined properties of muscle and fascia, and writes
stresses, strains and contact pressures to a folder of results.
""",
    epilog="""\
examples:
  python3 -m calfsocket                                 the six runs, into results/
  python3 -m calfsocket --size coarse --out quick       the same on a coarse mesh
  python3 -m calfsocket --sockets TC,HS --materials separate
  mpirun -n 2 python3 -m calfsocket                     two cases side by side
  python3 -m calfsocket --size coarse --variants        which results depend on choices of the model
  python3 -m calfsocket report results                  make tables, figures and page again
  python3 -m calfsocket mesh --socket HS --out hs.msh   only a mesh, with a table of its quality
  python3 -m calfsocket new my-study.toml               an example study file to start from

results:
  summary.csv    largest stress and strain of each tissue, and contact pressure
  levels.csv     what 50, 95, 99 and 99.9 % of each tissue's area stay below, mean and rms
  contact.csv    contact pressure, friction and gap along the skin
  steps.csv      load steps and Newton iterations
  cases.csv      which cases are solved, and why others are not
  run.json       inputs, versions, checks and timings
  report.html    all of it on one page, beside the paper's numbers; tables/, figures/
  TC_separate/   fields.vtu (for ParaView), contact.csv and picture.png of a case

Every option of PETSc can be set with its name after -calfsocket_, e.g. -calfsocket_snes_monitor.
Exit code: 0 all cases solved, 1 a case failed, 2 the input cannot be used.
""",
)
def study(comm: Comm, arguments: Namespace) -> int:
    """Solve the study of the paper as the options change it."""
    check_options(comm, arguments)
    return solve(comm, on_first_rank(comm, lambda: asked_for(arguments)), arguments)


def asked_for(arguments: Namespace) -> "Study":
    """Return the study of the paper as the options change it."""
    from calfsocket.materials.material_set import BASE_SETS
    from calfsocket.study.study import Study, variants

    paper = Study.paper()
    sockets = options.select(arguments.sockets.split(","), list(paper.reference), "--sockets")
    sets = options.select(arguments.materials.split(","), BASE_SETS, "--materials")
    model = ("friction", "socket_support", "fascia_c10", "ogden_form")
    tables: dict[str, dict[str, Any]] = {
        "model": {
            "size": options.checked_size(arguments.size),
            **{key: getattr(arguments, key) for key in model},
        },
        "laws": {
            tissue: {"file": str(path.absolute())}
            for tissue, path in options.material_files(arguments.material, sets).items()
        },
    }
    if arguments.variants:
        tables["sweep"] = {"variants": variants()}
    study = paper.changed(tables)
    asked = {(socket, name) for socket in sockets for name in sets}
    return study.changed(chosen=[case.name for case in study.cases if case.of in asked])


@command(
    option(
        "file", type=Path, metavar="FILE", help="study file, run.json, or a folder with a run.json"
    ),
    option("--out", type=Path, metavar="DIR", help="default: the folder that FILE names"),
    *RUNNING,
    description="""\
Solve the cases of a study file, side by side on the ranks that mpirun starts; or repeat an earlier
run from its run.json, which holds all of its inputs.
""",
    epilog="""\
examples:
  python3 -m calfsocket new my-study.toml
  python3 -m calfsocket check my-study.toml
  mpirun -n 2 python3 -m calfsocket run my-study.toml
  python3 -m calfsocket run results/run.json --out again
  python3 -m calfsocket run --resume results/            continue an interrupted study
""",
)
def run(comm: Comm, arguments: Namespace) -> int:
    """Solve a study file, or repeat a run.json."""
    check_options(comm, arguments)
    study = on_first_rank(comm, lambda: _read(arguments))
    set_options(study.petsc_options)
    return solve(comm, study, arguments)


def _read(arguments: Namespace) -> "Study":
    from calfsocket.simulation.record import RUN_FILE
    from calfsocket.study.study import Study

    path = arguments.file
    if path.is_dir():  # of results, where they go again
        arguments.out = arguments.out or path
        path = path / RUN_FILE
    study = Study.read(path)
    _ = study.plan  # refuses what cannot be solved
    return study


def set_options(petsc_options: Mapping[str, str]) -> None:
    """Set the PETSc options of an earlier run, except those on the command line."""
    from petsc4py import PETSc

    known = PETSc.Options()
    for name, value in petsc_options.items():
        if name.startswith("calfsocket_") and not known.hasName(name):
            known.setValue(name, value)


def check_options(comm: Comm, arguments: Namespace) -> None:
    """Refuse options that cannot be combined, on all ranks."""
    ranks = arguments.ranks_per_case
    if ranks is not None and not 1 <= ranks <= comm.size:
        raise InputError(
            f"--ranks-per-case: is {ranks}; it must be 1 to {comm.size}, the number of MPI ranks"
        )
    if arguments.resume and arguments.overwrite:
        raise InputError("--resume keeps results and --overwrite replaces them; use one of the two")


def solve(comm: Comm, study: "Study", arguments: Namespace) -> int:
    """Solve a study and write its report (collective); return the exit code."""
    from rich.console import Console

    console = Console(stderr=True)
    if comm.rank == 0:
        _log_to(console)
    if arguments.mesh_error:
        study = study.changed({"study": {"mesh_error": True}})
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
            then=lambda results: _finish(comm, results, arguments, console),
            step_fields=arguments.step_fields,
        )
    except KeyboardInterrupt as interrupt:
        raise type(interrupt)(
            f"interrupted; the finished cases are complete in {out}, and the same command with "
            "--resume continues"
        ) from None
    solved = all(case.key in results for case in study.plan.to_solve)
    return OK if solved else CASE_FAILED


def _finish(comm: Comm, results: "Results", arguments: Namespace, console: "Console") -> None:
    """Show the profile and write the report; neither may fail what is solved."""
    from calfsocket.simulation import profile
    from calfsocket.study.runner import logged

    out = results.folder
    if arguments.profile and comm.rank == 0:
        with logged(f"the profile of {out} could not be made"):
            console.print(profile.table(out))
    if not arguments.no_report:
        said = logged(f"the report in {out} could not be made")
        with said if comm.rank == 0 else suppress(Exception):
            log.info("report: %s", report.write(comm, results))


def _log_to(console: "Console") -> None:
    """Show the study's messages, and warnings of all packages."""
    if console.is_terminal:
        from rich.logging import RichHandler

        handler: logging.Handler = RichHandler(console=console, show_path=False)
    else:
        handler = logging.StreamHandler()
        handler.setFormatter(logging.Formatter("%(asctime)s %(message)s", "%H:%M:%S"))
    logging.basicConfig(level=logging.WARNING, handlers=[handler])
    log.setLevel(logging.INFO)
