"""A study that solves in half a second a case: an oval limb of three tissues.

``python3 tiny_study.py '{"out": "results", "study": {"sockets": ["A"]}}'`` runs it by the command
line's own ways into MPI and out of it, with a fault on some rank where one is wanted.
"""

import argparse
import builtins
import functools
import importlib
import itertools
import json
import logging
import os
import resource
import signal
import sys
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from calfsocket import cli
from calfsocket.commands import CASE_FAILED, OK
from calfsocket.io import errors
from calfsocket.materials.material_set import MaterialSet
from calfsocket.meshes import distributed, section, store, tags
from calfsocket.meshes.limb import Limb
from calfsocket.meshes.placement import check_placement
from calfsocket.meshes.socket import NormalOffset, Socket
from calfsocket.meshes.triangles import TriangleMesh
from calfsocket.parallel.first_rank import on_first_rank
from calfsocket.simulation.record import StudySource
from calfsocket.study import runner
from calfsocket.study.cases import Case, Plan
from calfsocket.study.document import Document
from calfsocket.study.record import results_folder
from calfsocket.study.runner import Runner

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


def tiny_socket(name: str) -> Socket:
    """One of three that press more and more, on one side."""
    return NormalOffset(
        name=name,
        wall_thickness=2.0,
        base={"A": 0.1, "B": 0.15, "C": 0.2}[name],
        bumps=[{"center": 40, "width": 25, "amplitude": 0.15}],
    )


@dataclass(frozen=True)
class TinyStudy:
    """The study and where its results go."""

    out: Path
    plan: Plan
    pictures: bool = False

    def run(
        self,
        comm: MPI.Intracomm = MPI.COMM_SELF,
        resume: bool = False,
        ranks_per_case: int | None = None,
    ) -> bool:
        """Solve it; return whether all cases reached the full load."""
        with ExitStack() as stack:
            place = results_folder(self.out, self.plan)
            on_first_rank(comm, lambda: stack.enter_context(place))
            runner = Runner(comm, self.plan, self.out, ranks_per_case, self.pictures)
            return runner.run(resume)


def tiny_study(
    out: Path,
    sockets: tuple[str, ...] = ("A", "B"),
    pictures: bool = False,
    frictions: tuple[float, ...] = (),
    mesh_error: bool = False,
    size: str = "coarse",
) -> TinyStudy:
    """Make the study; with frictions, a case for each of them and each socket."""
    limb = tiny_limb()
    cases = []
    for friction, socket in itertools.product(frictions or [0.4], map(tiny_socket, sockets)):
        name = f"{socket.name}@{friction}" if frictions else socket.name
        cases.append(
            Case(
                limb,
                socket.model_copy(update={"name": name}),
                MaterialSet.paper("combined"),
                Document.model_validate(
                    {
                        "study": {"mesh_error": mesh_error},
                        "model": {"size": size, "friction": friction},
                    }
                ),
                of=(socket.name, "combined"),
                changes={},
                placement=check_placement(socket, limb),
            )
        )
    source = StudySource(file="tiny.toml", content={})
    return TinyStudy(out, Plan(source, cases[0].document, limb, tuple(cases)), pictures)


class TinyCommand:
    """The study as a command: `cli` starts MPI with it and ends it."""

    solves = True

    @staticmethod
    def run(comm: MPI.Intracomm, arguments: argparse.Namespace) -> int:
        study = tiny_study(Path(arguments.out), **arguments.study)
        solved = study.run(comm, arguments.resume, arguments.ranks_per_case)
        return OK if solved else CASE_FAILED


@dataclass(frozen=True)
class Fault:
    """An error that a function raises when it is called for the n-th time on some ranks.

    Attributes
    ----------
    where : str
        The function, as ``module:name`` or ``module:Class.name``.
    ranks : tuple of int
        Ranks of the program.
    call : int
        Counted from 1.
    error : str
        Name of an exception, Python's or calfsocket's, or a signal that the process sends itself.
    words : tuple
        The exception's arguments.
    """

    where: str
    ranks: tuple[int, ...] = (0,)
    call: int = 1
    error: str = "RuntimeError"
    words: tuple[Any, ...] = ("injected",)

    def owner(self) -> tuple[Any, str]:
        """Return the module or class whose attribute the function is, and its name there."""
        module, path = self.where.split(":")
        *parents, name = path.split(".")
        return functools.reduce(getattr, parents, importlib.import_module(module)), name

    def put_into(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return the function with the fault."""
        calls = itertools.count(1)

        def faulty(*words: Any, **named: Any) -> Any:
            if MPI.COMM_WORLD.rank in self.ranks and next(calls) == self.call:
                Path(f"injected-{MPI.COMM_WORLD.rank}").touch()
                self.strike()
            return function(*words, **named)

        return faulty

    def strike(self) -> None:
        if self.error.startswith("SIG"):
            os.kill(os.getpid(), getattr(signal, self.error))
        raise (getattr(builtins, self.error, None) or getattr(errors, self.error))(*self.words)


def inject(fault: Fault) -> None:
    """Put a fault in its place."""
    owner, name = fault.owner()
    setattr(owner, name, fault.put_into(getattr(owner, name)))


def mesh_again(_: str, make: Callable[[], TriangleMesh]) -> TriangleMesh:
    """Stand for `store.stored`, so that each study meshes its sections itself."""
    return make()


def share_out(owners: tuple[int, int]) -> None:
    """Place the limb on one rank and the socket on another; further ranks get nothing."""
    from dolfinx.cpp.graph import AdjacencyList_int32

    build, parts = section.build, {}

    def remember(*words: Any) -> Any:
        mesh = build(*words)
        parts["socket"] = mesh.cell_tags == tags.SOCKET_ID
        return mesh

    def by_body(mode: Any) -> Any:
        def partition(comm: MPI.Comm, n: int, cell_types: Any, cells: Any) -> Any:
            rank = np.where(parts["socket"], *owners[::-1]) if comm.rank == 0 else np.empty(0)
            return AdjacencyList_int32(rank.astype(np.int32).reshape(-1, 1))

        return partition

    section.build = remember
    distributed.cell_partitioner = by_body


def after_precompiling(task: Callable[[], None]) -> None:
    """Do something when the forms are compiled: rank 0 solves a ring for that."""
    original = runner.precompile

    def precompile_and_then(*words: Any) -> None:
        original(*words)
        task()

    runner.precompile = precompile_and_then


def main(out: str, study: Mapping[str, Any], **how: Any) -> int:
    """Run the tiny study in a folder, with a fault where there is one.

    `how` may have ``ranks_per_case``, ``resume``, ``fault``, ``owners`` (`share_out`), ``petsc``
    (options) and ``largest_file`` (bytes).
    """
    store.stored = mesh_again
    if "owners" in how:
        owners = how["owners"]
        after_precompiling(lambda: share_out(owners))
    if "largest_file" in how:  # after the forms, which are larger
        limit = how["largest_file"]
        after_precompiling(lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)))
    if "fault" in how:
        fault = Fault(**how["fault"])
        if "precompile" in fault.where:
            inject(fault)
        else:
            after_precompiling(lambda: inject(fault))
    words = argparse.Namespace(
        out=out,
        study={
            name: value if isinstance(value, bool | str) else tuple(value)
            for name, value in study.items()
        },
        ranks_per_case=how.get("ranks_per_case"),
        resume=how.get("resume", False),
    )
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    return cli._with_mpi(TinyCommand, words, list(how.get("petsc", ())))


if __name__ == "__main__":
    # A shell makes jobs in its background deaf to Ctrl-C, and they their children.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    sys.exit(main(**json.loads(sys.argv[1])))
