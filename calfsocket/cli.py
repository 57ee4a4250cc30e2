"""The command line: what a person types, and what they get to read."""

import argparse
import contextlib
import difflib
import io
import os
import sys
import traceback
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import calfsocket
from calfsocket.errors import CalfsocketError, InputError
from calfsocket.fit import command

if TYPE_CHECKING:
    from mpi4py import MPI

    from calfsocket.laws import Ogden

# Heavy imports stand in the functions that need them: --help should not wait for MPI and dolfinx.

OK, CASE_FAILED, BAD_INPUT = 0, 1, 2

PROGRAM = "python3 -m calfsocket"

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


class _Parser(argparse.ArgumentParser):
    def __init__(self, **settings: Any) -> None:
        super().__init__(
            formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False, **settings
        )

    def error(self, message: str) -> NoReturn:
        raise InputError(f"{message}; see `{self.prog} --help`")

    def parse_all(self, words: list[str]) -> argparse.Namespace:
        """Parse, and suggest the nearest option for an unknown one."""
        arguments, unknown = self.parse_known_args(words)
        if unknown:
            known = [option for action in self._actions for option in action.option_strings]
            near = difflib.get_close_matches(unknown[0].split("=")[0], known, n=1)
            hint = f"; did you mean {near[0]}?" if near else ""
            self.error(f"{unknown[0]}: no such option or command{hint}")
        return arguments


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit code."""
    words, petsc = _split_petsc(list(sys.argv[1:] if argv is None else argv))
    first = _launched_rank() == 0
    program = PROGRAM
    action: Action = _study
    parser: Callable[[str], _Parser] = _study_parser
    if words and words[0] in COMMANDS:
        action, parser, _ = COMMANDS[words[0]]
        program = f"{PROGRAM} {words.pop(0)}"
    try:
        with contextlib.redirect_stdout(sys.stdout if first else io.StringIO()):
            arguments = parser(program).parse_all(words)
    except InputError as error:
        return _refuse(error, first)
    return _with_mpi(action, arguments, petsc)


def _with_mpi(
    action: "Action",
    arguments: argparse.Namespace,
    petsc: list[str],
) -> int:
    import petsc4py

    petsc4py.init(["calfsocket", *petsc])
    from mpi4py import MPI

    comm = MPI.COMM_WORLD
    try:
        return action(comm, arguments)
    except InputError as error:
        return _refuse(error, first=comm.rank == 0)
    except BaseException as error:
        if comm.size == 1:
            raise
        # The other ranks may wait for this one: end them all, with this one message.
        if isinstance(error, CalfsocketError):
            print(f"calfsocket: {error}", file=sys.stderr, flush=True)
        else:
            traceback.print_exc()
            sys.stderr.flush()
        comm.Abort(1)
        raise


def _refuse(error: InputError, first: bool) -> int:
    if first:
        print(f"calfsocket: {error}", file=sys.stderr)
    return BAD_INPUT


def _split_petsc(argv: list[str]) -> tuple[list[str], list[str]]:
    """Part PETSc's options (-calfsocket_NAME [VALUE]) from ours."""
    ours: list[str] = []
    petsc: list[str] = []
    takes_value = False
    for word in argv:
        if word.startswith("-calfsocket_"):
            petsc.append(word)
            takes_value = True
        elif takes_value and not word.startswith("--"):
            petsc.append(word)
            takes_value = False
        else:
            ours.append(word)
            takes_value = False
    return ours, petsc


def _launched_rank() -> int:
    """Rank in the MPI job by the launcher's environment, without initialising MPI."""
    for name in ("OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK"):
        if name in os.environ:
            return int(os.environ[name])
    return 0


def _study_parser(program: str) -> _Parser:
    commands = "\n".join(f"  {name:9s} {text}" for name, (_, _, text) in COMMANDS.items())
    parser = _Parser(
        prog=program,
        usage=f"{program} [options]   or   {program} COMMAND [options]",
        description=f"{DESCRIPTION}\ncommands:\n{commands}",
        epilog=EPILOG,
    )
    parser.add_argument(
        "--version", action="version", version=f"calfsocket {calfsocket.__version__}"
    )
    what = parser.add_argument_group("what to solve")
    what.add_argument("--sockets", default="TC,TSB,HS", metavar="LIST", help="default: %(default)s")
    what.add_argument(
        "--materials", default="separate,combined", metavar="LIST", help="default: %(default)s"
    )
    what.add_argument(
        "--size", default="paper", help="mesh: coarse, medium or paper (default: %(default)s)"
    )
    what.add_argument(
        "--socket-support",
        default="floating",
        choices=("floating", "outer-fixed"),
        help="socket resting on the limb alone, or held at its outer face (default: %(default)s)",
    )
    what.add_argument(
        "--fascia-c10",
        default="printed",
        choices=("printed", "tables"),
        help="fascia's C10 as the paper prints it, 4.91 MPa, or as its tables need it, 0.491 MPa "
        "(default: %(default)s)",
    )
    what.add_argument(
        "--ogden-form",
        default="abaqus",
        choices=("abaqus", "as-printed"),
        help="factor 2 mu/alpha^2, or mu/alpha as in the paper's equation (1) "
        "(default: %(default)s)",
    )
    what.add_argument(
        "--material",
        action="append",
        default=[],
        metavar="TISSUE=FILE",
        help="material file in the place of Table 1's law of a tissue, as `fit` writes it; "
        "the tissue `combined` is muscle and fascia of the combined set; may be repeated",
    )
    what.add_argument(
        "--friction", type=float, default=0.4, metavar="MU", help="coefficient (default: 0.4)"
    )
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
    how.add_argument("--no-pictures", action="store_true", help="do not draw the cases")
    how.add_argument("--no-report", action="store_true", help="do not write the report at the end")

    return parser


def _mesh_parser(program: str) -> _Parser:
    parser = _Parser(prog=program, description="Write a mesh with names, and show its quality.")
    parser.add_argument("--socket", required=True, metavar="NAME", help="TC, TSB or HS")
    parser.add_argument(
        "--size", default="paper", help="coarse, medium or paper (default: %(default)s)"
    )
    parser.add_argument("--out", type=Path, required=True, metavar="FILE.msh")
    return parser


def _picture_parser(program: str) -> _Parser:
    parser = _Parser(prog=program, description="Draw a solved case again, from its files.")
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="e.g. results/TC_separate")
    return parser


def _report_parser(program: str) -> _Parser:
    parser = _Parser(
        prog=program,
        description="Write tables, figures, the scoreboard and report.html of a study, from its "
        "files alone; a study that is not complete gets what it allows.",
    )
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="e.g. results")
    limits = parser.add_argument_group("damage thresholds, % (default: the paper's)")
    limits.add_argument(
        "--muscle-shear", type=float, default=50.0, metavar="PCT", help="default: %(default)g"
    )
    limits.add_argument(
        "--fascia-strain", type=float, default=27.0, metavar="PCT", help="default: %(default)g"
    )
    return parser


def _warm_parser(program: str) -> _Parser:
    return _Parser(prog=program, description="Compile all forms now rather than in the first run.")


def _study(comm: "MPI.Intracomm", arguments: argparse.Namespace) -> int:
    import logging
    import math

    from rich.console import Console
    from rich.logging import RichHandler

    from calfsocket import variants
    from calfsocket.case import Case, Settings
    from calfsocket.contact.nitsche import ContactParameters
    from calfsocket.material_file import read_materials
    from calfsocket.meshes.data import load_limb, load_sockets
    from calfsocket.meshes.sizing import mesh_size
    from calfsocket.study import MATERIAL_SETS, Study, attempt, check_folder, run_study, select

    mesh_size(arguments.size)
    if not (math.isfinite(arguments.friction) and arguments.friction >= 0):
        raise InputError(f"--friction: {arguments.friction}; give a number of 0 or more")
    if arguments.ranks_per_case is not None and not 1 <= arguments.ranks_per_case <= comm.size:
        raise InputError(
            f"--ranks-per-case: {arguments.ranks_per_case}; give 1 to {comm.size}, the number of "
            "ranks that mpirun started"
        )
    sockets = load_sockets()
    chosen = select(arguments.sockets.split(","), list(sockets.sockets), "--sockets")
    sets: list[Any] = select(arguments.materials.split(","), MATERIAL_SETS, "--materials")
    study = Study(
        cases=tuple(Case(socket, name) for socket in chosen for name in sets),
        settings=Settings(
            size=arguments.size,
            socket_support=arguments.socket_support,
            fascia_c10=arguments.fascia_c10,
            ogden_form=arguments.ogden_form,
            materials=read_materials(arguments.material, sets),
            contact=ContactParameters(fric_coeff=arguments.friction),
        ),
        limb=load_limb(),
        sockets=sockets,
        out=arguments.out,
        pictures=not arguments.no_pictures,
    )
    studies = variants.studies(study) if arguments.variants else [study]
    for each in studies:
        _on_first_rank(comm, partial(check_folder, each, arguments.overwrite))
    console = Console(stderr=True)
    log = logging.getLogger("calfsocket")
    if comm.rank == 0:
        if console.is_terminal:
            handler: logging.Handler = RichHandler(console=console, show_path=False)
        else:
            handler = logging.StreamHandler()
            handler.setFormatter(logging.Formatter("%(asctime)s %(message)s", "%H:%M:%S"))
        logging.basicConfig(level=logging.WARNING, handlers=[handler])
        # What other packages tell of themselves is not for the user of this one.
        log.setLevel(logging.INFO)
    solved = []
    for each in studies:
        log.info("results go to %s", each.out)
        solved.append(run_study(comm, each, arguments.ranks_per_case, console))
    if comm.rank == 0 and not arguments.no_report:
        from calfsocket.report.writing import write_report

        study = studies[0]  # the base, where there are variants: its page compares them
        with attempt(f"no report in {study.out}"):
            log.info("report: %s", write_report(study.out))
    return OK if all(solved) else CASE_FAILED


def _on_first_rank(comm: "MPI.Intracomm", task: Callable[[], None]) -> None:
    """Do something on rank 0; where it refuses the input, refuse on all ranks."""
    refusal: InputError | None = None
    if comm.rank == 0:
        try:
            task()
        except InputError as error:
            refusal = error
    refusal = comm.bcast(refusal, root=0)
    if refusal is not None:
        raise refusal


def _mesh(comm: "MPI.Intracomm", arguments: argparse.Namespace) -> int:
    from calfsocket.meshes.quality import format_table
    from calfsocket.meshes.section import write_section

    _on_first_rank(
        comm,
        lambda: print(format_table(write_section(arguments.out, arguments.socket, arguments.size))),
    )
    return OK


def _picture(comm: "MPI.Intracomm", arguments: argparse.Namespace) -> int:
    from calfsocket import picture
    from calfsocket.writers import FIELDS_FILE

    if not (arguments.folder / FIELDS_FILE).is_file():
        raise InputError(
            f"picture: {arguments.folder} holds no {FIELDS_FILE}; "
            "name the folder of a solved case, e.g. results/TC_separate"
        )
    _on_first_rank(comm, lambda: print(picture.draw(arguments.folder)))
    return OK


def _report(comm: "MPI.Intracomm", arguments: argparse.Namespace) -> int:
    from calfsocket.report.damage import Thresholds
    from calfsocket.report.writing import write_report

    thresholds = Thresholds(arguments.muscle_shear, arguments.fascia_strain)
    _on_first_rank(comm, lambda: print(write_report(arguments.folder, thresholds)))
    return OK


def _warm(comm: "MPI.Intracomm", arguments: argparse.Namespace) -> int:
    from calfsocket import compilation

    compilation.warm(comm)
    return OK


def _verify_parser(program: str) -> _Parser:
    parser = _Parser(
        prog=program,
        description="Solve problems with known answers and write verification.md, with figures.",
    )
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
        help="mesh sizes of the limb, two at least (default: %(default)s)",
    )
    parser.add_argument(
        "--results",
        type=Path,
        default=Path("results/verification"),
        metavar="DIR",
        help="where the limb's runs are, or are put, in a folder a size (default: %(default)s); "
        "solve them beforehand on several ranks with `--size SIZE --out DIR/SIZE`",
    )
    return parser


def _verify(comm: "MPI.Intracomm", arguments: argparse.Namespace) -> int:
    from calfsocket import compilation
    from calfsocket.verification.limb import coarsest_first
    from calfsocket.verification.page import SUBJECTS, chosen_subjects, write_page

    if comm.size > 1:
        raise InputError("verify: runs on one rank; start it without mpirun")
    subjects = chosen_subjects(arguments.only.split(",")) if arguments.only else SUBJECTS
    sizes = coarsest_first(arguments.size.split(","))
    compilation.warm(comm)
    options = {"limb": {"sizes": sizes, "results": arguments.results}}
    return OK if write_page(arguments.out, subjects, options) else CASE_FAILED


def _fit_parser(program: str) -> _Parser:
    parser = _Parser(prog=program, description=command.DESCRIPTION, epilog=command.EPILOG)
    command.add_arguments(parser)
    return parser


def _fit(comm: "MPI.Intracomm", arguments: argparse.Namespace) -> int:
    _on_first_rank(comm, lambda: command.run(arguments))
    return OK


def _calibrate_parser(program: str) -> _Parser:
    parser = _Parser(
        prog=program,
        description="Find the combined material of muscle and fascia: press a specimen with a flat "
        "plate, and fit\nOgden's mu and alpha to the force-displacement curve of the separate "
        "materials.",
        epilog="""\
examples:
  python3 -m calfsocket calibrate                   a compound of layers and compartments
  python3 -m calfsocket calibrate --specimen limb   the limb's own section, which takes longer
  python3 -m calfsocket --material combined=calibration/combined.toml     use the result

results: curves.csv, calibration.json, combined.toml, figure3.png, figure3.pdf
""",
    )
    what = parser.add_argument_group("what to press")
    what.add_argument(
        "--specimen",
        default="compound",
        choices=("compound", "limb"),
        help="default: %(default)s",
    )
    what.add_argument(
        "--compound", type=Path, metavar="FILE", help="dimensions, as meshes/compound.json"
    )
    what.add_argument("--stroke", type=float, metavar="MM", help="default: the specimen's own")
    what.add_argument("--size", default="coarse", help="mesh: coarse, medium, paper (%(default)s)")
    what.add_argument(
        "--fascia-c10",
        default="printed",
        choices=("printed", "tables"),
        help="as for the study (default: %(default)s)",
    )
    what.add_argument(
        "--material",
        action="append",
        default=[],
        metavar="TISSUE=FILE",
        help="material file in the place of Table 1's law of a tissue; may be repeated",
    )
    what.add_argument(
        "--friction", type=float, default=0.4, metavar="MU", help="coefficient (default: 0.4)"
    )
    how = parser.add_argument_group("how to fit")
    how.add_argument(
        "--points", type=int, default=8, metavar="N", help="of a curve (default: %(default)s)"
    )
    how.add_argument(
        "--start",
        action="append",
        default=[],
        metavar="KPA,ALPHA",
        help="where to search from; may be repeated (default: 5,5 and 30,25)",
    )
    how.add_argument(
        "--free-d", action="store_true", help="fit D1, too, instead of taking nu = 0.495"
    )
    how.add_argument(
        "--out", type=Path, default=Path("calibration"), metavar="DIR", help="default: %(default)s"
    )
    return parser


def _calibrate(comm: "MPI.Intracomm", arguments: argparse.Namespace) -> int:
    import math

    from rich.console import Console

    from calfsocket import compilation
    from calfsocket.calibration import report
    from calfsocket.calibration.run import STARTS, Settings, calibrate
    from calfsocket.contact.nitsche import ContactParameters
    from calfsocket.material_file import read_materials
    from calfsocket.meshes.compound import load_compound
    from calfsocket.meshes.data import load_limb
    from calfsocket.meshes.sizing import mesh_size

    mesh_size(arguments.size)
    if not (math.isfinite(arguments.friction) and arguments.friction >= 0):
        raise InputError(f"--friction: {arguments.friction}; give a number of 0 or more")
    settings = Settings(
        compound=load_compound(arguments.compound),
        limb=load_limb(),
        specimen=arguments.specimen,
        size=arguments.size,
        fascia_c10=arguments.fascia_c10,
        materials=read_materials(arguments.material, ["separate"]),
        contact=ContactParameters(fric_coeff=arguments.friction),
        stroke=arguments.stroke,
        points=arguments.points,
        starts=tuple(_start(word) for word in arguments.start) or STARTS,
        free_d=arguments.free_d,
    )
    _on_first_rank(comm, lambda: _make_folder(arguments.out))
    compilation.warm(comm)
    console = Console(stderr=True, quiet=comm.rank > 0)
    calibration = calibrate(comm, settings, tell=lambda text: console.print(text, style="dim"))
    if comm.rank == 0:
        from calfsocket.calibration import figure

        report.write(calibration, settings, arguments.out)
        figure.draw(calibration, arguments.out)
        report.show(calibration, Console())
    return OK


def _start(word: str) -> "Ogden":
    """Read a start of a fit, mu in kPa and alpha."""
    from calfsocket.calibration.fit import LARGEST_ALPHA, SMALLEST_ALPHA, ogden

    try:
        mu, alpha = (float(part) for part in word.split(","))
    except ValueError:
        raise InputError(f"--start: {word!r}; give mu in kPa and alpha, e.g. 5,5") from None
    if not (0 < mu < float("inf") and SMALLEST_ALPHA <= alpha <= LARGEST_ALPHA):
        raise InputError(
            f"--start: {word!r}; give mu > 0 and alpha from {SMALLEST_ALPHA:g} to {LARGEST_ALPHA:g}"
        )
    return ogden(1e-3 * mu, alpha)


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--out {folder}: {error.strerror}; name another folder") from None


Action = Callable[["MPI.Intracomm", argparse.Namespace], int]

COMMANDS: dict[str, tuple[Action, Callable[[str], _Parser], str]] = {
    "calibrate": (_calibrate, _calibrate_parser, "fit the combined material of muscle and fascia"),
    "fit": (_fit, _fit_parser, "fit a law to stress-stretch data"),
    "mesh": (_mesh, _mesh_parser, "write a mesh and a table of its quality"),
    "picture": (_picture, _picture_parser, "draw a solved case again"),
    "report": (_report, _report_parser, "tables, figures and page of a solved study"),
    "verify": (_verify, _verify_parser, "solve problems with known answers, and say how well"),
    "warm": (_warm, _warm_parser, "compile all forms now rather than at the first run"),
}
