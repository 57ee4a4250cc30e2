"""A study: the cases of a study file on one limb, and where their results go."""

import logging
import re
from collections.abc import Callable, Collection, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from calfsocket.io.errors import InputError
from calfsocket.io.schema import check_readable, read_toml
from calfsocket.meshes.levels import LimbLevels, read_limb
from calfsocket.meshes.limb import Limb
from calfsocket.meshes.socket import AnySocket, reference_sockets
from calfsocket.parallel.first_rank import on_first_rank
from calfsocket.simulation.record import StudySource, read_run
from calfsocket.study.cases import Case, Plan, Planner
from calfsocket.study.files import Files, sha256

if TYPE_CHECKING:
    from mpi4py import MPI
    from rich.console import Console

    from calfsocket.simulation.results import Results

log = logging.getLogger(__name__)

_DATA = Path(__file__).parent / "data"


@dataclass(frozen=True)
class Study:
    """The cases of a study file.

    Attributes
    ----------
    path : Path
        The study file, or the run.json of an earlier run.
    content : mapping
        As parsed.
    files : Files
        What it names.
    limb : Limb or LimbLevels
        The section, or several along the limb.
    reference : mapping of str to Socket
        The sockets that every study knows.
    sha256 : mapping of str to str
        Hashes of the files read so far.
    chosen : tuple of str
        Names of the cases to solve; all of the file where empty.
    petsc_options : mapping
        Of the earlier run.
    """

    path: Path
    content: Mapping[str, Any]
    files: Files
    limb: Limb | LimbLevels
    reference: Mapping[str, AnySocket]
    sha256: Mapping[str, str] = field(default_factory=dict)
    chosen: tuple[str, ...] = ()
    petsc_options: Mapping[str, str] = field(default_factory=dict)

    # -- where it comes from --------------------------------------------------------------------

    @classmethod
    def read(cls, path: Path | str) -> Self:
        """Read a study file, or the run.json of an earlier run.

        Raises
        ------
        InputError
            If it cannot be read, or names a limb that cannot be used.
        """
        path = Path(path)
        if path.suffix == ".json":
            return cls._of_run(path)
        content = read_toml(path)
        if not content:
            raise InputError(f"{path}: is empty; `new` writes an example to start from")
        hashes = {path.name: sha256(path)}
        table = content.get("study")
        name = table.get("limb") if isinstance(table, dict) else None
        limb: Limb | LimbLevels = Limb.reference()
        if isinstance(name, str):
            check_readable(path.parent / name)
            hashes[name] = sha256(path.parent / name)
            limb = read_limb(path.parent / name)
            if isinstance(limb, LimbLevels):
                folder = (path.parent / name).parent
                hashes |= {each.file: sha256(folder / each.file) for each in limb.levels}
        return cls(path, content, Files(path.parent), limb, reference_sockets(), hashes)

    @classmethod
    def paper(cls) -> Self:
        """Return the study of the paper, which is part of the package."""
        return cls.read(_DATA / "paper.toml")

    @classmethod
    def _of_run(cls, path: Path) -> Self:
        """Read what an earlier run was made of."""
        run = read_run(path)
        return cls(
            path=path,
            content=run.study.content,
            files=Files(path.parent, run.study.files),
            limb=run.whole_limb,
            reference={
                name: run.sockets.get(name, socket) for name, socket in reference_sockets().items()
            },
            sha256={path.name: sha256(path), **run.study.sha256},
            chosen=tuple(run.cases),
            petsc_options=_harmless(path, run.petsc_options),
        )

    def changed(
        self,
        tables: Mapping[str, Mapping[str, Any]] | None = None,
        chosen: Collection[str] | None = None,
    ) -> Self:
        """Return the study with other values in some tables, or other cases chosen.

        Parameters
        ----------
        tables : mapping
            Table of the study file -> keys with values that replace or join those of the file.
        chosen : collection of str, optional
            Names of the cases to solve.
        """
        content = dict(self.content)
        for name, values in (tables or {}).items():
            content[name] = {**content.get(name, {}), **values}
        names = self.chosen if chosen is None else tuple(chosen)
        return replace(self, content=content, chosen=names)

    # -- what it holds --------------------------------------------------------------------------

    @cached_property
    def plan(self) -> Plan:
        """What it solves.

        Raises
        ------
        InputError
            One line: file, key, what is allowed, what to do.
        """
        planner = Planner(self.path, self.content, self.files, self.limb, self.reference)
        cases = planner.cases()
        missing = set(self.chosen) - {case.name for case in cases}
        if missing:
            raise InputError(
                f"{self.path}: cases: not in this study: {', '.join(sorted(missing))}; "
                "the file was edited"
            )
        source = StudySource(
            file=self.path.name,
            content=dict(self.content),
            sha256=dict(self.sha256),
            files=self.files.record,
        )
        return Plan(source, planner.document, self.limb, cases, self.chosen, planner.parameters)

    @property
    def cases(self) -> tuple[Case, ...]:
        """All cases of the file, in its order."""
        return self.plan.cases

    # -- solving --------------------------------------------------------------------------------

    def run(
        self,
        comm: "MPI.Intracomm | None" = None,
        out: Path | str | None = None,
        *,
        resume: bool = False,
        overwrite: bool = False,
        ranks_per_case: int | None = None,
        pictures: bool = True,
        profile: bool = False,
        console: "Console | None" = None,
        then: "Callable[[Results], object]" = lambda _: None,
        step_fields: bool = False,
    ) -> "Results":
        """Solve the chosen cases side by side and write their results (collective).

        A case that fails does not stop the others: its last equilibrium is written, and run.json
        says why.

        Parameters
        ----------
        comm : MPI.Intracomm, optional
            By default all ranks of the program.
        out : Path, optional
            Folder of the results; by default the one that the file names.
        resume : bool
            Keep the cases that an earlier run into the folder has solved, and start those that it
            had begun from their last equilibrium.
        overwrite : bool
            Replace results that were made from other inputs.
        ranks_per_case : int, optional
            Ranks that solve one case together; by default cases run side by side.
        pictures, profile : bool
            Whether to draw each case, and to write where the time goes.
        console : rich.console.Console, optional
            Where progress is shown; standard error by default.
        then : callable
            What is made of the results, on all ranks, before another run may begin in the folder.
        step_fields : bool
            Whether to write the fields of every load step, too, for ParaView.

        Returns
        -------
        Results
            Of all cases in the folder.

        Raises
        ------
        InputError
            If the study cannot be used, the folder contains results of other inputs, or another
            run writes into it.
        WriteError
            If run.json cannot be written.
        """
        # What solves takes a second to load, and checking a file does without.
        from mpi4py import MPI

        from calfsocket.simulation.results import load_results
        from calfsocket.study.record import results_folder
        from calfsocket.study.runner import Runner

        comm = comm or MPI.COMM_WORLD
        for text in self.plan.warnings if comm.rank == 0 else ():
            log.warning("%s", text)
        folder = Path(self.plan.document.study.out if out is None else out)
        place = results_folder(folder, self.plan, overwrite)
        with ExitStack() as stack:
            on_first_rank(comm, lambda: stack.enter_context(place))
            log.info("results go to %s", folder)
            runner = Runner(
                comm, self.plan, folder, ranks_per_case, pictures, profile, console, step_fields
            )
            runner.run(resume)
            results = load_results(folder, runner.shared())
            on_first_rank(comm, lambda: results.write_maps(pictures))
            _evaluate(results, comm)
            then(results)
            return results


def _evaluate(results: "Results", comm: "MPI.Intracomm") -> None:
    """Write what uncertain inputs do (collective); a failure may not fail what is solved."""
    from calfsocket.study.runner import logged

    with logged("the bands of the uncertain inputs could not be computed"):
        results.write_uncertainty(comm)


def variants() -> dict[str, dict[str, Any]]:
    """Return the choices that the paper's text leaves open, each as changes of its study."""
    return dict(read_toml(_DATA / "variants.toml")["sweep"]["variants"])


def example() -> str:
    """Return the example study, a file for people to change."""
    return (_DATA / "example.toml").read_text(encoding="utf-8")


def _harmless(path: Path, options: dict[str, str]) -> dict[str, str]:
    """Refuse options of PETSc that name files: its viewers would write them anywhere."""
    for name, value in options.items():
        if not (re.fullmatch(r"[a-z0-9_]+", name) and re.fullmatch(r"[\w.+-]*", value)):
            raise InputError(
                f"{path}: petsc_options.{name}: is {value!r}, which may write files; remove it "
                "here, and if it is needed give it on the command line as -NAME VALUE"
            )
    return options
