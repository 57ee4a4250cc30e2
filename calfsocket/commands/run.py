"""The command ``run``: a study of one's own, or an earlier run again."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from calfsocket.commands.solving import add_running, check_ranks, solve
from calfsocket.parallel.first_rank import on_first_rank

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mpi4py import MPI

    from calfsocket.study.study import Study

HELP = "solve the study of a file"
DESCRIPTION = """\
Solve the cases of a study file, side by side on the ranks that mpirun starts; or solve those of an
earlier run again, from its run.json, which holds all that they were made of.
"""
EPILOG = """\
examples:
  python3 -m calfsocket new my-study.toml
  python3 -m calfsocket check my-study.toml
  mpirun -n 2 python3 -m calfsocket run my-study.toml
  python3 -m calfsocket run results/run.json --out again
  python3 -m calfsocket run --resume results/            go on with an interrupted study
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument(
        "file", type=Path, metavar="FILE", help="study file, a run.json or the folder of one"
    )
    add_running(parser, None)


def run(comm: "MPI.Intracomm", arguments: argparse.Namespace) -> int:
    """Solve it."""
    from calfsocket.study.build import to_study
    from calfsocket.study.reading import read_study
    from calfsocket.study.record import RUN_FILE

    check_ranks(comm, arguments.ranks_per_case)

    def read() -> "tuple[Study, Mapping[str, str]]":
        path, out = arguments.file, arguments.out
        if path.is_dir():  # of results, which is where they go again
            path, out = path / RUN_FILE, out or path
        file = read_study(path)
        study = to_study(file, file.plan(), out, not arguments.no_pictures)
        return study, file.petsc_options

    study, petsc_options = on_first_rank(comm, read)
    set_options(petsc_options)
    return solve(comm, [study], arguments)


def set_options(petsc_options: "Mapping[str, str]") -> None:
    """Give PETSc the options of an earlier run, unless they are given anew."""
    from petsc4py import PETSc

    known = PETSc.Options()
    for name, value in petsc_options.items():
        if name.startswith("calfsocket_") and not known.hasName(name):
            known.setValue(name, value)
