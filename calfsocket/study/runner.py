"""The cases of a study, solved side by side by groups of ranks."""

import gc
import logging
import traceback
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from mpi4py import MPI
from rich.console import Console

from calfsocket.io.errors import (
    CalfsocketError,
    ConvergenceError,
    InputError,
    SolveError,
    in_one_line,
)
from calfsocket.io.tables import merge_csv
from calfsocket.mechanics.stepping import LoadStep, Milestone
from calfsocket.parallel.first_rank import on_first_rank
from calfsocket.parallel.progress import Event, Reporter
from calfsocket.parallel.scheduler import Scheduler, number_of_groups
from calfsocket.postprocess.series import remove_steps
from calfsocket.postprocess.thresholds import shares_beyond
from calfsocket.simulation.checkpoint import CHECKPOINT_FILE
from calfsocket.simulation.precompile import precompile
from calfsocket.simulation.prepared import Prepared
from calfsocket.simulation.profile import PROFILE_FILE, Phases, Profile
from calfsocket.simulation.record import CaseRecord, SecondMesh
from calfsocket.simulation.result import CURVE_FILE, SECOND_MESH, Result
from calfsocket.simulation.results import KEY, Key, of_case
from calfsocket.simulation.simulation import Monitor, Simulation, reported, steps_table
from calfsocket.study.cases import Case, Plan
from calfsocket.study.record import Recorder
from calfsocket.study.restart import digests

if TYPE_CHECKING:
    import pandas as pd

log = logging.getLogger(__name__)

KEPT_CELLS = 200_000
"""Most cells of results that a rank keeps, some 0.2 GB; what is beyond is read from its files."""


@dataclass(frozen=True)
class Runner:
    """Solves the cases of a study and writes their results; parameters as of `Study.run`."""

    comm: MPI.Intracomm
    plan: Plan
    out: Path
    ranks_per_case: int | None = None
    pictures: bool = True
    profile: bool = False
    console: Console | None = None
    step_fields: bool = False
    solved: dict[Key, Result] = field(default_factory=dict)
    """What this rank has solved and kept, for what is made of it at the end."""

    def run(self, resume: bool = False) -> bool:
        """Solve every case (collective); return whether all reached the full load.

        Raises
        ------
        InputError
            If the earlier run cannot be resumed.
        WriteError
            If run.json cannot be written.
        """
        recorder, cases, first = self._begin(resume)
        if cases:
            self._solve(cases, first, recorder, resume)
        return bool(self.comm.bcast(recorder.close() if recorder else None, root=0))

    def keep(self, result: Result) -> None:
        """Keep a result while there is room."""
        if result.solved and cells_of([*self.solved.values(), result]) <= KEPT_CELLS:
            self.solved[result.record.key] = result

    def shared(self) -> dict[Key, Result]:
        """Return the results that all ranks have kept, while there is room (collective)."""
        if self.comm.allreduce(cells_of(self.solved.values())) > KEPT_CELLS:
            return self.solved
        return {
            key: each for part in self.comm.allgather(self.solved) for key, each in part.items()
        }

    def _begin(self, resume: bool) -> tuple[Recorder | None, tuple[Case, ...], frozenset[str]]:
        """Open the record on rank 0; return it there, and the cases to solve on all ranks.

        Of some, by their names, nothing but the second mesh is to be solved.
        """
        recorder: Recorder | None = None

        def opened() -> tuple[list[int], frozenset[str]]:
            nonlocal recorder
            recorder = Recorder(self.plan, self.out, self.comm.size, resume)
            numbers = [self.plan.cases.index(case) for case in recorder.to_solve]
            return numbers, frozenset(case.name for case in recorder.on_second_mesh)

        numbers, solved = on_first_rank(self.comm, opened)
        return recorder, tuple(self.plan.cases[number] for number in numbers), solved

    def _solve(
        self,
        cases: tuple[Case, ...],
        solved: frozenset[str],
        recorder: Recorder | None,
        resume: bool,
    ) -> None:
        names = [case.name for case in cases]
        console = self.console or Console(stderr=True)
        reporter = Reporter(names, console) if recorder else None

        def on_report(message: Event | CaseRecord) -> None:
            assert recorder is not None and reporter is not None
            if isinstance(message, Event):
                reporter.show(message)
            else:
                recorder.put(message)

        with reporter or nullcontext():
            precompile(self.comm, [case.materials for case in cases])
            if number_of_groups(self.comm.size, len(cases), self.ranks_per_case) > 1:
                cases = longest_first(cases)
            families = numbered([case.geometry for case in cases])
            scheduler = Scheduler(self.comm, families, self.ranks_per_case, on_report)
            prepared = Prepared()
            gc.freeze()  # what is there by now stays, and need not be searched after each case
            try:
                while (number := scheduler.next_case()) is not None:
                    case = cases[number]
                    runner = _CaseRunner(self, scheduler, case, prepared, case.name in solved)
                    scheduler.report(runner.attempt(resume))
                    if families.count(families[number]) == 1:
                        prepared.forget()
                    gc.collect()
            finally:
                gc.unfreeze()  # whoever called may have had garbage
            scheduler.finish()


class _CaseRunner(Monitor):
    """One case on its group of ranks: solved, written, and its end agreed upon."""

    def __init__(
        self,
        study: Runner,
        scheduler: Scheduler,
        case: Case,
        prepared: Prepared,
        solved: bool = False,
    ) -> None:
        self._study, self._scheduler, self._case = study, scheduler, case
        self._is_solved = solved
        self._prepared = prepared
        self._steps: list[LoadStep] = []
        self._is_root = scheduler.group.rank == 0
        self._troubles: set[str] = set()

    def attempt(self, resume: bool) -> CaseRecord:
        """Solve the case; where it cannot be, and all ranks of the group know, say why.

        Raises
        ------
        Exception
            On a rank that cannot continue while the others wait for it in vain.
        """
        record, failure = self._case.record, None
        try:
            record = self._solve(resume)
        except Exception as error:
            failure = error
        try:
            message = self._scheduler.agree(in_one_line(failure) if failure else "")
        except TimeoutError as error:
            assert failure is not None
            # Nobody waits for this rank to refuse the input together with it.
            raise (SolveError(error) if isinstance(failure, InputError) else failure) from None
        if not message:
            return record
        self.message(f"failed: {message}", None, True)
        unforeseen = failure is not None and not isinstance(failure, CalfsocketError)
        trace = tuple(traceback.format_exception(failure)) if unforeseen else ()
        return record.model_copy(
            update={"status": "failed", "message": message, "traceback": trace}
        )

    def _solve(self, resume: bool) -> CaseRecord:
        study, case = self._study, self._case
        if self._is_solved:
            return self._second(Result.load(study.out / case.name), resume)
        if self._is_root:
            Result.remove(study.out / case.name)
            if not (study.step_fields and resume):
                remove_steps(study.out / case.name)
        simulation = case.simulation(self._scheduler.group)
        profile = Profile() if study.profile else None
        try:
            result = simulation.solve(
                self,
                study.out / case.name / CHECKPOINT_FILE,
                resume,
                profile,
                self._prepared,
                study.out / case.name if study.step_fields else None,
            )
        except ConvergenceError as error:
            result = error.result
        names = {"of": case.of, "level": case.place, "changes": dict(case.changes)}
        result = replace(result, record=result.record.model_copy(update=names))
        if self._is_root:
            self._write(simulation, result)
            if profile:
                self._merge(PROFILE_FILE, profile.rows(simulation.phases.seconds))
        seconds = {"seconds": simulation.phases.seconds}
        result = replace(result, record=result.record.model_copy(update=seconds))
        if result.solved and self._case.has_mesh_error:
            return self._second(result, resume)
        return self._end(result)

    def _end(self, result: Result) -> CaseRecord:
        """Return the record of what is written."""
        record, study = result.record, self._study
        how = "solved" if record.solved else f"stopped, {record.message}"
        self.message("; ".join([how, *record.warnings]), record.load, True)
        if not self._is_root:
            return record
        study.keep(result)
        files = digests(study.out, self._case.key, record.states, record.has_second_mesh)
        return record.model_copy(update={"files": files})

    def _second(self, result: Result, resume: bool) -> CaseRecord:
        """Solve the case on a second mesh and write its numbers with their mesh error.

        Where that fails the case is solved all the same, and its record says why it has no error.
        """
        study, case = self._study, self._case
        folder = study.out / case.name
        own = case.simulation(self._scheduler.group)
        simulation = case.simulation(own.comm, own.mesh_size.second(result.checks.cells))
        if self._is_root:
            Result.remove(folder / SECOND_MESH)
            (folder / SECOND_MESH).mkdir(exist_ok=True)
        about, why = SecondMesh(size=simulation.mesh_size.name), ""
        try:
            checkpoint = folder / SECOND_MESH / CHECKPOINT_FILE
            second = simulation.solve(
                _OnSecondMesh(self), checkpoint, resume, prepared=self._prepared.for_second_mesh()
            )
            on_both = result.on_second_mesh(second)
        except Exception as error:
            why = f"the second mesh ({about.size}): {in_one_line(error)}"
        if why := self._scheduler.agree(why):
            about = about.model_copy(update={"message": why})
        else:
            result = on_both
            about = about.model_copy(update={"cells": second.checks.cells})
        seconds = {
            **result.record.seconds,
            SECOND_MESH: sum(simulation.phases.seconds.values()),
        }
        update = {"second_mesh": about, "seconds": seconds, "files": {}}
        result = replace(result, record=result.record.model_copy(update=update))
        if self._is_root:
            result.save(folder)
            self._write_results(result, simulation.phases)
            if result.second is not None:
                for path in (folder / SECOND_MESH).glob("checkpoint*.npz"):
                    path.unlink()
        return self._end(result)

    # -- what it writes -------------------------------------------------------------------------

    def _write(self, simulation: Simulation, result: Result) -> None:
        study, phases = self._study, simulation.phases
        folder = study.out / self._case.name
        with phases("files"):
            result.save(folder)
            self._merge("steps.csv", result.steps)
        if result.solved:  # what a case has come to on its way is no result of the study
            self._write_results(result, phases)
        if study.pictures and self._case.row is None:  # nobody looks at a hundred of a design
            with phases("picture"), logged(f"the picture of {self._case.name} could not be made"):
                result.draw(folder)

    def _write_results(self, result: Result, phases: Phases) -> None:
        with phases("quantities"):
            summary = result.of_states(self._summary)
            levels = result.of_states(Result.levels)
        with phases("files"):
            self._merge("contact.csv", result.of_states(lambda state: state.contact))
            self._merge("summary.csv", summary)
            self._merge("levels.csv", levels)
            if result.curve is not None:
                self._merge(CURVE_FILE, result.curve)

    def _summary(self, state: Result) -> "pd.DataFrame":
        """Return the rows of a state in summary.csv."""
        import pandas as pd

        shares = state.with_mesh_error(
            lambda of: shares_beyond(of.quantities, of.line, self._study.plan.thresholds)
        )
        return pd.concat([state.summary(), shares]) if len(shares) else state.summary()

    def _merge(self, name: str, rows: "pd.DataFrame") -> None:
        """Put the case's rows into a table that all cases share."""
        named = of_case(rows, self._case.record)
        merge_csv(self._study.out / name, named, KEY, self._study.plan.order)

    # -- what the simulation reports ------------------------------------------------------------

    def message(self, text: str, load: float | None, milestone: bool = False) -> None:
        """Pass a remark on to rank 0 of all."""
        self._scheduler.report(Event(self._case.name, text, load, milestone))

    def resumed(self, start: Milestone) -> None:
        """Show where the case starts, and keep the steps of the earlier run."""
        self.message("resumes from its last equilibrium", start.load, True)
        self._steps = list(start.steps)

    def iteration(self, load: float, number: int, residual: float) -> None:
        """Show an iteration of Newton's method."""
        self.message(f"iteration {number}, residual {residual:.1e} N/mm", load)

    def step(self, step: LoadStep) -> None:
        """Show a load step, and write it."""
        newton = step.newton
        how = "" if newton.converged else f"failed ({newton.reason}) after "
        text = f"{how}{newton.iterations} iterations, residual {newton.residual:.1e} N/mm"
        self.message(text, step.load, True)
        self._steps.append(step)
        if self._is_root:
            with reported(self, step.load, self._troubles):
                self._merge("steps.csv", steps_table(self._steps))


class _OnSecondMesh(Monitor):
    """Passes on what is said while a case is solved on its second mesh."""

    def __init__(self, of: Monitor) -> None:
        self._of = of

    def message(self, text: str, load: float | None, milestone: bool = False) -> None:
        """Pass a remark on."""
        self._of.message(f"second mesh: {text}", load, milestone)

    def iteration(self, load: float, number: int, residual: float) -> None:
        """Pass an iteration of Newton's method on."""
        self._of.iteration(load, number, residual)

    def step(self, step: LoadStep) -> None:
        """Show a load step."""
        how = "" if step.newton.converged else f"failed ({step.newton.reason}) after "
        self.message(f"{how}{step.newton.iterations} iterations", step.load, True)


def cells_of(results: Iterable[Result]) -> int:
    """Return the number of cells of results with their states."""
    return sum(len(each.fields.cells) * (1 + len(each.states)) for each in results)


@contextmanager
def logged(what: str) -> Iterator[None]:
    """Turn a failure into a warning: results that are solved and written must not be lost."""
    try:
        yield
    except Exception as error:
        log.warning("%s: %s", what, in_one_line(error))


def longest_first(cases: Sequence[Case]) -> tuple[Case, ...]:
    """Order cases for several groups of ranks, so that no group is left with a long one at the end.

    A socket takes the more iterations the more it squeezes, and separate materials take more than
    combined ones.
    """
    return tuple(
        sorted(
            cases,
            key=lambda case: (-case.placement.squeezed, case.materials.base == "combined"),
        )
    )


def numbered(geometries: Sequence[str]) -> list[int]:
    """Return a number for each, the same for those that are the same."""
    numbers: dict[str, int] = {}
    return [numbers.setdefault(each, len(numbers)) for each in geometries]
