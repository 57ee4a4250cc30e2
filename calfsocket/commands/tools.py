"""Commands around the model: ``mesh``, ``verify`` and ``precompile``."""

from argparse import Namespace
from pathlib import Path

from calfsocket.commands import CASE_FAILED, OK, Comm, command, first_rank, option, options
from calfsocket.io.errors import InputError


@command(
    option("--socket", required=True, metavar="NAME", help="TC, TSB or HS"),
    options.size("paper"),
    option("--out", type=Path, required=True, metavar="FILE.msh"),
    description="Write a mesh with named regions and boundaries, and print a table of its quality.",
    solves=False,
)
@first_rank
def mesh(arguments: Namespace) -> None:
    """Write a mesh and a table of its quality."""
    from calfsocket.meshes.limb import Limb
    from calfsocket.meshes.quality import format_table
    from calfsocket.meshes.section import write_section
    from calfsocket.meshes.sizing import mesh_size
    from calfsocket.meshes.socket import Socket

    socket, size = Socket.reference(arguments.socket), mesh_size(arguments.size)
    print(format_table(write_section(arguments.out, Limb.reference(), socket, size)))


@command(
    option("--out", type=Path, default=Path("docs"), metavar="DIR", help="default: %(default)s"),
    option(
        "--only",
        metavar="LIST",
        help="subjects to run, e.g. element,limb; other sections of the page stay (default: all)",
    ),
    option(
        "--size",
        default="coarse,medium",
        metavar="LIST",
        help="mesh sizes of the limb, at least two (default: %(default)s)",
    ),
    option(
        "--results",
        type=Path,
        default=Path("results/verification"),
        metavar="DIR",
        help="where the limb's runs are, or will be put, in a folder for each size (default: "
        "%(default)s); solve them beforehand on several ranks with `--size SIZE --out DIR/SIZE`",
    ),
    description="Solve problems with known answers and write verification.md, with figures.",
)
def verify(comm: Comm, arguments: Namespace) -> int:
    """Solve problems with known answers and report the errors."""
    from calfsocket.simulation.precompile import precompile
    from calfsocket.verification import peer
    from calfsocket.verification.limb import coarsest_first
    from calfsocket.verification.page import SUBJECTS, chosen_subjects, write_page

    if comm.size > 1:
        raise InputError("verify: runs on one rank; start it without mpirun")
    subjects = chosen_subjects(arguments.only.split(",") if arguments.only else SUBJECTS)
    sizes = coarsest_first(arguments.size.split(","))
    if "peer" in subjects and (missing := peer.missing()):
        if arguments.only:
            raise InputError(f"verify --only peer: {missing}")
        print(f"verify: the section peer is left out: {missing}")
        subjects.remove("peer")
    precompile(comm)
    limb = {"limb": {"sizes": sizes, "results": arguments.results}}
    return OK if write_page(arguments.out, subjects, limb) else CASE_FAILED


@command()
def precompile(comm: Comm, _: Namespace) -> None:
    """Compile all forms now instead of in the first run."""
    from calfsocket.simulation.precompile import precompile

    precompile(comm)
