"""The command ``run``: the study of a file, or an earlier run again."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from calfsocket.commands.solving import add_running, check_options, solve
from calfsocket.parallel.first_rank import on_first_rank

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mpi4py import MPI

    from calfsocket.study.study import Study

HELP = "solve a study file, or repeat a run.json"
DESCRIPTION = """\
Solve the cases of a study file, side by side on the ranks that mpirun starts; or repeat an earlier
run from its run.json, which holds all of its inputs.
"""
EPILOG = """\
examples:
  python3 -m calfsocket new my-study.toml
  python3 -m calfsocket check my-study.toml
  mpirun -n 2 python3 -m calfsocket run my-study.toml
  python3 -m calfsocket run results/run.json --out again
  python3 -m calfsocket run --resume results/            continue an interrupted study
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument(
        "file", type=Path, metavar="FILE", help="study file, run.json, or a folder with a run.json"
    )
    add_running(parser, "the folder that FILE names")


def run(comm: "MPI.Intracomm", arguments: argparse.Namespace) -> int:
    """Solve it."""
    check_options(comm, arguments)
    study = on_first_rank(comm, lambda: _read(arguments))
    set_options(study.petsc_options)
    return solve(comm, study, arguments)


def _read(arguments: argparse.Namespace) -> "Study":
    from calfsocket.simulation.record import RUN_FILE
    from calfsocket.study.study import Study

    path = arguments.file
    if path.is_dir():  # of results, where they go again
        arguments.out = arguments.out or path
        path = path / RUN_FILE
    study = Study.read(path)
    assert study.plan  # refuses what cannot be solved
    return study


def set_options(petsc_options: "Mapping[str, str]") -> None:
    """Set the PETSc options of an earlier run, except those on the command line."""
    from petsc4py import PETSc

    known = PETSc.Options()
    for name, value in petsc_options.items():
        if name.startswith("calfsocket_") and not known.hasName(name):
            known.setValue(name, value)
