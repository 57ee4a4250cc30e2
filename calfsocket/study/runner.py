"""One case of a study on its group of ranks: solved, written, and agreed upon."""

import logging
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import pandas as pd
from petsc4py import PETSc

from calfsocket.io.errors import CalfsocketError, InputError, SolveError, in_one_line
from calfsocket.io.tables import merge_csv
from calfsocket.io.versions import versions
from calfsocket.mechanics.stepping import LoadStep, Milestone
from calfsocket.parallel.progress import Event
from calfsocket.parallel.scheduler import Farm
from calfsocket.postprocess.extract import contact_line, section_fields
from calfsocket.postprocess.thresholds import shares_beyond
from calfsocket.simulation.case import Case, Run, region_tissues
from calfsocket.simulation.checkpoint import CHECKPOINT_FILE, Checkpoint, CheckpointError
from calfsocket.simulation.profile import PROFILE_FILE, Profile
from calfsocket.simulation.record import CaseRecord, Checks
from calfsocket.simulation.result import STEP_COLUMNS, Result
from calfsocket.simulation.results import of_case
from calfsocket.study.inventory import about
from calfsocket.study.record import KEY, case_digests

if TYPE_CHECKING:
    from calfsocket.study.study import Study

log = logging.getLogger(__name__)


def try_case(farm: Farm, study: "Study", case: Case, go_on: bool) -> CaseRecord:
    """Solve a case; where it cannot be, and all ranks of the group know, say why.

    Raises
    ------
    Exception
        On a rank that cannot go on while the others wait for it in vain.
    """
    entry: dict[str, Any] = {}
    failure: Exception | None = None
    try:
        entry = _run_case(farm, study, case, go_on)
    except Exception as error:
        failure = error
    try:
        message = farm.agree(in_one_line(failure) if failure else "")
    except TimeoutError as error:
        assert failure is not None
        # Nobody waits for this rank to refuse the input together with it.
        raise (SolveError(error) if isinstance(failure, InputError) else failure) from None
    if message:
        farm.report(Event(case.name, f"failed: {message}", None, milestone=True))
        entry = {"status": "failed", "message": message}
        if failure and not isinstance(failure, CalfsocketError):
            entry["traceback"] = traceback.format_exception(failure)
    return CaseRecord(**about(case), **entry)


def _run_case(farm: Farm, study: "Study", case: Case, go_on: bool) -> dict[str, Any]:
    """Solve a case on this group of ranks and write its files; return how it ended."""
    root = farm.group.rank == 0
    rows: list[dict[str, Any]] = []
    profile = Profile() if study.profile else None
    troubles: set[str] = set()

    def tell(text: str, load: float, milestone: bool = False) -> None:
        farm.report(Event(case.name, text, load, milestone))

    @contextmanager
    def in_passing(load: float) -> Iterator[None]:
        """Say once what cannot be written, and go on: it may be at the end."""
        try:
            yield
        except OSError as error:
            text = in_one_line(error)
            if text not in troubles:
                tell(text, load, True)
            troubles.add(text)

    def on_step(step: LoadStep) -> None:
        newton = step.newton
        how = "Newton" if newton.converged else f"failed ({newton.reason}) after"
        tell(f"{how} {newton.iterations}, residual {newton.residual:.1e} N/mm", step.load, True)
        rows.append(_step_row(step))
        if root:
            with in_passing(step.load):
                _merge(study, "steps.csv", of_case(_steps(rows), case.key))

    def on_milestone(milestone: Milestone) -> None:
        with run.phase("checkpoints"), in_passing(milestone.load):
            checkpoint.save(milestone)

    tell("mesh and set-up", 0.0, True)
    run = Run(
        farm.group,
        case,
        study.settings_of(case),
        study.limb,
        study.socket(case),
        on_iteration=lambda load, k, norm: tell(f"iteration {k}, residual {norm:.1e} N/mm", load),
        on_step=on_step,
        on_milestone=on_milestone,
    )
    checkpoint = Checkpoint(
        study.out / case.name / CHECKPOINT_FILE,
        run.model,
        {
            **study.inputs_of(case),
            "versions": versions(),
            "petsc_options": PETSc.Options().getAll(),
        },
    )
    start: Milestone | None = None
    if go_on:
        try:
            start = checkpoint.load()
        except CheckpointError as error:  # on all ranks
            tell(f"starts anew: {error}", 0.0, True)
    if start is not None:
        tell("goes on from its last equilibrium", start.load, True)
        rows += [_step_row(step) for step in start.steps]
    if profile:
        profile.start()
    run.solve(start)
    if profile:
        profile.stop()
    checks = run.checks()
    entry: dict[str, Any] = {
        "status": "failed" if run.failure else "solved",
        "message": run.failure,
        "ranks": farm.group.size,
        "resumed_from_load": start.load if start else 0.0,
        "checks": Checks(**checks),
    }
    with run.phase("quantities"):
        fields = section_fields(run.model, region_tissues(study.limb))
        line = contact_line(run.model)
    if fields is not None and line is not None:
        if rows:
            rows[-1]["negative_modes"] = checks["negative_modes"]
        record = CaseRecord(**about(case), seconds=run.seconds, **entry)
        result = Result(record, fields, line, _steps(rows))
        with run.phase("files"):
            _write_case(study, result)
        if study.pictures:
            with run.phase("picture"), attempt(f"no picture of {case.name}"):
                result.draw(study.out / case.name)
    if profile and root:
        times = profile.rows(run.seconds)
        times.insert(0, "socket", case.socket)
        times.insert(1, "material_set", case.material_set)
        _merge(study, PROFILE_FILE, times)
    load = float(run.model.contact.load)
    text = run.failure or "; ".join(["solved", *Checks(**checks).warnings])
    tell(text, load, True)
    return {
        **entry,
        "seconds": run.seconds,
        "files": case_digests(study, case) if root else {},
    }


@contextmanager
def attempt(what: str) -> Iterator[None]:
    """Turn a failure into a warning: results that are solved and written must not be lost."""
    try:
        yield
    except Exception as error:
        log.warning("%s: %s", what, in_one_line(error))


def _write_case(study: "Study", result: Result) -> None:
    """Write a case's own files, and its rows of the tables that cases share."""
    key = result.record.key
    result.save(study.out / result.record.name)
    beyond = shares_beyond(result.quantities, result.line, study.thresholds)
    summary = result.summary()
    summary = pd.concat([summary, beyond]) if len(beyond) else summary
    for name, rows in (
        ("contact.csv", result.contact), ("summary.csv", summary), ("steps.csv", result.steps)
    ):  # fmt: skip
        if len(rows):
            _merge(study, name, of_case(rows, key))


def _merge(study: "Study", name: str, rows: pd.DataFrame) -> None:
    merge_csv(study.out / name, rows, KEY, [case.key for case in study.order])


def _steps(rows: list[dict[str, Any]]) -> pd.DataFrame:
    return pd.DataFrame(rows, columns=list(STEP_COLUMNS))


def _step_row(step: LoadStep) -> dict[str, Any]:
    return {
        "step": step.number,
        "load": step.load,
        "converged": step.newton.converged,
        "reason": step.newton.reason,
        "newton_iterations": step.newton.iterations,
        "residual_N_per_mm": step.newton.residual,
        "seconds": step.seconds,
        "negative_modes": None,
    }
