"""A study that solves in half a second a case: an oval limb of three tissues.

``python3 tiny_study.py '{"out": "results", "study": {"sockets": ["A"]}}'`` runs it by the command
line's own ways into MPI and out of it, with a fault on some rank where one is wanted.
"""

import argparse
import builtins
import importlib
import itertools
import json
import logging
import os
import signal
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mpi4py import MPI

from calfsocket import cli, compilation, errors
from calfsocket.case import Case, Settings
from calfsocket.commands import CASE_FAILED, OK
from calfsocket.meshes.data import Limb, Sockets
from calfsocket.study import Study, check_folder, run_study

# Semi-axes in mm.
OVALS = {"outside": (12.5, 12.0), "inside": (11.0, 10.5), "bone": (5.0, 4.6), "hollow": (2.6, 2.4)}


def tiny_limb() -> Limb:
    """Skin, muscle and a bone."""

    def region(number: int, tissue: str, outer: str, hole: str) -> dict[str, object]:
        area = 3.14159 * (OVALS[outer][0] * OVALS[outer][1] - OVALS[hole][0] * OVALS[hole][1])
        return {
            "id": number, "name": tissue, "tissue": tissue, "outer": outer, "holes": [hole],
            "area": area, "target_area": area,
        }  # fmt: skip

    return Limb.model_validate(
        {
            "title": "an oval limb",
            "units": "mm, deg",
            "fixed_boundary": "hollow",
            "contact_boundary": "outside",
            "layers": {"skin_thickness": 1.5, "fat_thickness": [[0.0, 1.0], [180.0, 1.0]]},
            "curves": {
                name: {"type": "ellipse", "center": [0, 0], "semi_axes": axes, "angle_deg": 0}
                for name, axes in OVALS.items()
            },
            "regions": [
                region(1, "skin", "outside", "inside"),
                region(2, "muscle", "inside", "bone"),
                region(3, "bone", "bone", "hollow"),
            ],
        }
    )


def tiny_sockets() -> Sockets:
    """Three that press more and more, on one side."""
    return Sockets.model_validate(
        {
            "units": "mm, deg",
            "wall_thickness": 2.0,
            "sockets": {
                name: {
                    "title": name,
                    "law": "normal_offset",
                    "base": base,
                    "bumps": [{"center": 40, "width": 25, "amplitude": 0.15}],
                }
                for name, base in (("A", 0.1), ("B", 0.15), ("C", 0.2))
            },
        }
    )


def tiny_study(
    out: Path,
    sockets: tuple[str, ...] = ("A", "B"),
    material_sets: tuple[str, ...] = ("combined",),
    pictures: bool = False,
) -> Study:
    """Make the study."""
    cases = tuple(Case(socket, name) for socket in sockets for name in material_sets)
    return Study(cases, Settings(size="coarse"), tiny_limb(), tiny_sockets(), out, pictures)


class TinyStudy:
    """The study as a command: `cli` brings it into MPI and out of it again."""

    @staticmethod
    def run(comm: MPI.Intracomm, arguments: argparse.Namespace) -> int:
        study = tiny_study(Path(arguments.out), **arguments.study)
        check_folder(study, overwrite=False)
        solved = run_study(comm, study, arguments.ranks_per_case, go_on=arguments.go_on)
        return OK if solved else CASE_FAILED


@dataclass(frozen=True)
class Fault:
    """Where, on which ranks, at which call, and what happens there: an exception, or SIGKILL."""

    where: str
    ranks: tuple[int, ...] = (0,)
    call: int = 1
    error: str = "RuntimeError"
    text: str = "injected"


def inject(fault: Fault) -> None:
    """Put a fault into a function."""
    if MPI.COMM_WORLD.rank not in fault.ranks:
        return
    module, path = fault.where.split(":")
    owner = importlib.import_module(module)
    *parents, name = path.split(".")
    for parent in parents:
        owner = getattr(owner, parent)
    original = getattr(owner, name)
    calls = itertools.count(1)

    def faulty(*words: Any, **named: Any) -> Any:
        if next(calls) == fault.call:
            if fault.error == "SIGKILL":
                os.kill(os.getpid(), signal.SIGKILL)
            error = getattr(builtins, fault.error, None) or getattr(errors, fault.error)
            raise error(fault.text)
        return original(*words, **named)

    setattr(owner, name, faulty)


def after_warming(task: Callable[[], None]) -> None:
    """Do something when the forms are compiled: rank 0 solves a ring for that."""
    warm = compilation.warm

    def warm_and_then(*words: Any) -> None:
        warm(*words)
        task()

    compilation.warm = warm_and_then


def main(out: str, study: Mapping[str, Any], **how: Any) -> int:
    """Run the tiny study in a folder, with a fault where there is one."""
    if "fault" in how:
        fault = Fault(**how["fault"])
        if "compilation" in fault.where:
            inject(fault)
        else:
            after_warming(lambda: inject(fault))
    words = argparse.Namespace(
        out=out,
        study={
            name: value if name == "pictures" else tuple(value) for name, value in study.items()
        },
        ranks_per_case=how.get("ranks_per_case"),
        go_on=how.get("go_on", False),
    )
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    return cli._with_mpi(TinyStudy, words, list(how.get("petsc", ())))


if __name__ == "__main__":
    sys.exit(main(**json.loads(sys.argv[1])))
