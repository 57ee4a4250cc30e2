"""The study: what runs without a command."""

import argparse
from typing import TYPE_CHECKING, Any

from calfsocket.commands import options
from calfsocket.commands.solving import add_running, check_options, solve
from calfsocket.parallel.first_rank import on_first_rank

if TYPE_CHECKING:
    from mpi4py import MPI

    from calfsocket.study.study import Study

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
  python3 -m calfsocket --size coarse --variants        which results depend on choices of the model
  python3 -m calfsocket report results                  make tables, figures and page again
  python3 -m calfsocket mesh --socket HS --out hs.msh   only a mesh, with a table of its quality
  python3 -m calfsocket new my-study.toml               an example study file to start from

results:
  summary.csv    largest stress and strain of each tissue, and contact pressure
  contact.csv    contact pressure, friction and gap along the skin
  steps.csv      load steps and Newton iterations
  cases.csv      which cases are solved, and why others are not
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
        help="socket resting on the limb alone, or fixed at its outer face (default: %(default)s)",
    )
    options.add_fascia_c10(what)
    what.add_argument(
        "--ogden-form",
        default="abaqus",
        choices=("abaqus", "as-printed"),
        help="factor 2 mu/alpha^2, or mu/alpha as in the paper's equation (1) "
        "(default: %(default)s)",
    )
    options.add_material(what, "`combined` is muscle and fascia of the combined set; ")
    options.add_friction(what)
    what.add_argument(
        "--variants",
        action="store_true",
        help="also solve the cases under each choice that the paper leaves open (fixed socket, "
        "C10, friction 0, Ogden form), and compare",
    )
    add_running(parser.add_argument_group("how to run"), "results")


def run(comm: "MPI.Intracomm", arguments: argparse.Namespace) -> int:
    """Solve the study of the paper as the options change it."""
    check_options(comm, arguments)
    return solve(comm, on_first_rank(comm, lambda: _study(arguments)), arguments)


def _study(arguments: argparse.Namespace) -> "Study":
    """Return what was asked for."""
    from calfsocket.materials.material_set import BASE_SETS
    from calfsocket.study.study import Study, variants

    paper = Study.paper()
    sockets = options.select(arguments.sockets.split(","), list(paper.reference), "--sockets")
    sets = options.select(arguments.materials.split(","), BASE_SETS, "--materials")
    tables: dict[str, dict[str, Any]] = {
        "model": {
            "size": options.checked_size(arguments.size),
            "friction": arguments.friction,
            "socket_support": arguments.socket_support,
            "fascia_c10": arguments.fascia_c10,
            "ogden_form": arguments.ogden_form,
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
