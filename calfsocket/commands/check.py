"""The command ``check``: a study file verified without solving."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from calfsocket.commands import OK
from calfsocket.parallel.first_rank import on_first_rank

if TYPE_CHECKING:
    from mpi4py import MPI

    from calfsocket.study.cases import Plan

HELP = "check a study file in seconds, without solving"
DESCRIPTION = """\
Check a study file without solving it: keys, units, ranges, the files it names, and whether each
socket can be put on the limb. Also list the cases.
"""
EPILOG = "Exit code: 0 if the file can be run, 2 if it cannot; one line says why.\n"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument("file", type=Path, metavar="FILE", help="study file, or a run.json")


def run(comm: "MPI.Intracomm", arguments: argparse.Namespace) -> int:
    """Verify it, and list the cases."""
    from calfsocket.study.study import Study

    file = arguments.file
    on_first_rank(comm, lambda: print(listing(file, Study.read(file).plan), end=""))
    return OK


def listing(path: Path, plan: "Plan") -> str:
    """List the cases, and how their sockets sit on the limb."""
    n = len(plan.cases)
    width = max(len(case.name) for case in plan.cases)
    size = plan.document.model.size
    lines = [f"{path}: {n} case{'s' if n > 1 else ''}, mesh {size}"]
    lines.append(f"  {'case':{width}}  area lost  touching  deepest overlap  where")
    for case in plan.cases:
        on = case.placement
        lines.append(
            f"  {case.name:{width}}  {100 * on.area_reduction:7.2f} %  {100 * on.touching:6.0f} %  "
            f"{on.largest_overlap:12.2f} mm  {on.largest_angle:3.0f} deg"
        )
    return "\n".join(lines) + "\n"
