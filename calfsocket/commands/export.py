"""``export``: a case of a study as the input of another program."""

from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from calfsocket.commands import command, first_rank, option
from calfsocket.io.errors import InputError, error_context

if TYPE_CHECKING:
    from calfsocket.study.cases import Case, Plan

FORMATS = ("abaqus", "calculix", "febio", "msh", "xdmf")
"""As `export.write.FORMATS`, which a help that starts quickly does not import."""


@command(
    option("file", type=Path, metavar="FILE", help="study file, or a run.json"),
    option("--case", metavar="NAME", help="case, as `check` lists them (default: the only one)"),
    option(
        "--format",
        required=True,
        choices=FORMATS,
        help="input of Abaqus/Standard, CalculiX 2.20 or FEBio 4; or the mesh alone, with its "
        "names, for gmsh (msh) or ParaView (xdmf)",
    ),
    option("--out", type=Path, required=True, metavar="FILE", help="file to write"),
    description="""\
Write a case of a study for another program: mesh with named sets, laws, contact, supports, donning
and stages of loading. What has no equivalent there is said on screen and in the head of the file.
""",
    epilog="""\
examples:
  python3 -m calfsocket export my-study.toml --case TSB_combined --format calculix --out tsb.inp
  python3 -m calfsocket export my-study.toml --case HS_separate --format febio --out hs.feb
""",
)
@first_rank
def export(arguments: Namespace) -> None:
    """Write a case for Abaqus, CalculiX or FEBio, or its mesh."""
    from mpi4py import MPI

    from calfsocket.study.study import Study

    if arguments.out.is_dir():
        raise InputError(f"--out {arguments.out}: is a folder; give the name of a file")
    case = chosen(Study.read(arguments.file).plan, arguments.case, arguments.file)
    simulation = case.simulation(MPI.COMM_SELF)
    with error_context(arguments.file, case.name):
        remarks = simulation.export(arguments.out, arguments.format)
    print("\n  ".join([str(arguments.out), *remarks]))


def chosen(plan: "Plan", name: str | None, file: Path) -> "Case":
    """Return the case of a name, or the only one.

    Raises
    ------
    InputError
        If there is no such case, or no name and several cases.
    """
    from calfsocket.io.schema import nearest

    by_name = {case.name: case for case in plan.cases}
    if name is None:
        if len(by_name) > 1:
            raise InputError(
                f"{file}: has {len(by_name)} cases; choose one with --case, e.g."
                f" --case {next(iter(by_name))}"
            )
        return next(iter(by_name.values()))
    if name not in by_name:
        raise InputError(f"--case: {file} has no case '{name}'; {nearest(name, by_name)}")
    return by_name[name]
