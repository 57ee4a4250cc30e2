"""The study: cases times settings, solved side by side, written case by case."""

import hashlib
import json
import logging
import time
import traceback
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import pandas as pd
from mpi4py import MPI
from petsc4py import PETSc
from rich.console import Console

from calfsocket import compilation, outcomes, picture, resume, writers
from calfsocket.case import Case, Run, Settings, case_laws, region_tissues
from calfsocket.checkpoint import CHECKPOINT_FILE, Checkpoint, CheckpointError
from calfsocket.contact_line import ContactLine
from calfsocket.errors import CalfsocketError, InputError, SolveError, in_one_line
from calfsocket.farm import Farm
from calfsocket.gather import contact_line, section_fields
from calfsocket.laws import ogden_terms
from calfsocket.meshes.data import Limb, Sockets
from calfsocket.progress import Event, Reporter
from calfsocket.section_fields import SectionFields
from calfsocket.stepping import LoadStep, Milestone
from calfsocket.tissues import MATERIAL_SETS
from calfsocket.versions import versions

KEY = ("socket", "material_set")
RUN_FILE = "run.json"
CASES_FILE = "cases.csv"
CASE_TABLES = ("summary.csv", "contact.csv", "steps.csv")
"""Tables in which a case has rows of its own."""
TABLES = CASE_TABLES

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Study:
    """Cases, what they share, and where results go.

    Attributes
    ----------
    cases : tuple of Case
        In the order of the result tables.
    settings : Settings
        Shared by all.
    limb, sockets
        Geometry.
    out : Path
        Folder of the results.
    pictures : bool
        Whether to draw each case.
    """

    cases: tuple[Case, ...]
    settings: Settings
    limb: Limb
    sockets: Sockets
    out: Path
    pictures: bool = True

    def inputs(self) -> dict[str, Any]:
        """Everything that the results depend on, apart from the choice of cases."""
        return {
            "settings": asdict(self.settings),
            "limb": _fingerprint(self.limb.model_dump_json()),
            "sockets": _fingerprint(self.sockets.model_dump_json()),
        }


def run_study(
    comm: MPI.Intracomm,
    study: Study,
    ranks_per_case: int | None = None,
    console: Console | None = None,
    go_on: bool = False,
) -> bool:
    """Solve every case and write its results (collective).

    Cases run side by side on groups of ranks. A case that fails does not stop the others: its last
    converged state is written, and run.json says why.

    Parameters
    ----------
    comm, study, ranks_per_case
        What is solved by whom.
    console
        Where progress is shown; standard error by default.
    go_on
        Keep the cases that an earlier run into the same folder has finished, and go on with those
        that it had begun from their last equilibrium.

    Returns
    -------
    bool
        Whether every case reached the full load.

    Raises
    ------
    InputError
        When the earlier run cannot be gone on with.
    WriteError
        When run.json cannot be written.
    """
    ledger, refusal = None, None
    if comm.rank == 0:
        try:
            ledger = Ledger(study, comm.size, go_on)
        except CalfsocketError as error:
            refusal = error
    refusal, cases = comm.bcast((refusal, ledger.to_solve if ledger else []), root=0)
    if refusal is not None:
        raise refusal
    if cases:
        console = console or Console(stderr=True)
        reporter = Reporter([case.name for case in cases], console) if ledger else None

        def on_report(message: Event | dict[str, Any]) -> None:
            assert ledger is not None and reporter is not None
            if isinstance(message, Event):
                reporter.show(message)
            else:
                ledger.record(message)

        with reporter or nullcontext():
            laws = [case_laws(case, study.settings).values() for case in cases]
            compilation.warm(comm, map(ogden_terms, laws))
            farm = Farm(comm, len(cases), ranks_per_case, on_report)
            while (number := farm.next_case()) is not None:
                entry = _try_case(farm, study, cases[number], go_on)
                farm.report({"name": cases[number].name, **entry})
            farm.finish()
    return comm.bcast(ledger.close() if ledger else None, root=0)


def check_folder(study: Study, overwrite: bool) -> None:
    """Refuse a folder whose results were made with other settings.

    Raises
    ------
    InputError
        When the folder holds another study, unless it may be overwritten, or cannot be written.
    """
    path = study.out / RUN_FILE
    try:
        study.out.mkdir(parents=True, exist_ok=True)
        if not path.exists():
            return
        if overwrite:
            for name in (*TABLES, CASES_FILE, RUN_FILE):
                (study.out / name).unlink(missing_ok=True)
            return
        before = json.loads(path.read_text(encoding="utf-8"))["inputs"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(
            f"--out {study.out}: {error}; name a folder that can be written, "
            "or add --overwrite to replace the results in it"
        ) from None
    now = json.loads(json.dumps(study.inputs()))
    changed = sorted(_differences(before, now))
    if changed:
        raise InputError(
            f"--out {study.out}: holds results made with other inputs ({', '.join(changed)}); "
            "name another folder, or add --overwrite to replace them"
        )


class Ledger:
    """The run.json and cases.csv of a study, kept up to date by rank 0.

    Parameters
    ----------
    study, ranks
        What is solved, and by how many ranks.
    go_on
        Whether cases that an earlier run has finished are kept.

    Attributes
    ----------
    to_solve : list of Case
        The study's cases apart from those that are kept.
    """

    def __init__(self, study: Study, ranks: int, go_on: bool = False) -> None:
        self._out = study.out
        self._start = time.perf_counter()
        self._asked = [case.name for case in study.cases]
        conditions = {"versions": versions(), "petsc_options": PETSc.Options().getAll()}
        for folder in (study.out, *(study.out / name for name in self._asked)):
            writers.remove_unfinished(folder)
        earlier = resume.earlier_run(study.out / RUN_FILE, conditions if go_on else {})["cases"]
        self.to_solve = [
            case for case in study.cases if not (go_on and _is_kept(study, case, earlier))
        ]
        self._content = {
            "program": "calfsocket",
            **conditions,
            "ranks": ranks,
            "inputs": study.inputs(),
            "laws": {
                material_set: {
                    tissue: {"law": law.name, **asdict(law)}
                    for tissue, law in case_laws(Case("", material_set), study.settings).items()
                }
                for material_set in MATERIAL_SETS
            },
            "limb": study.limb.model_dump(mode="json"),
            "sockets": study.sockets.model_dump(mode="json"),
            "finished": False,
            "seconds": 0.0,
            "cases": earlier | {case.name: {"status": "running"} for case in self.to_solve},
        }
        self._write()

    def record(self, entry: dict[str, Any]) -> None:
        """Put in how a case ended; a full disk now need not stop the cases that run."""
        self._content["cases"][entry.pop("name")] = entry
        try:
            self._write()
        except OSError as error:
            log.warning("%s", error)

    def close(self) -> bool:
        """Mark the study as finished; tell whether every case asked for was solved.

        Raises
        ------
        WriteError
            When that cannot be written.
        """
        self._content["finished"] = True
        self._write()
        entries = {name: self._content["cases"][name] for name in self._asked}
        failed = {name: each for name, each in entries.items() if each["status"] != "solved"}
        if failed:
            log.warning(
                "%d of %d cases failed; with --resume they are tried again:",
                len(failed),
                len(entries),
            )
        for name, entry in failed.items():
            log.warning("%s: %s", name, entry["message"])
        return not failed

    def _write(self) -> None:
        self._content["seconds"] = time.perf_counter() - self._start
        writers.write_json(self._out / RUN_FILE, self._content)
        with writers.replacing(self._out / CASES_FILE) as temporary:
            _cases_table(self._content["cases"]).to_csv(temporary, index=False)
        for name in self._asked:
            if self._content["cases"][name]["status"] == "solved":
                # Its files hold all there is to know; one that failed may be gone on with.
                (self._out / name / CHECKPOINT_FILE).unlink(missing_ok=True)


def _is_kept(study: Study, case: Case, earlier: Mapping[str, Any]) -> bool:
    if earlier.get(case.name, {}).get("status") != "solved":
        return False
    why = resume.damage(earlier[case.name], _digests(study, case))
    log.info("%s: %s", case.name, why or "solved already")
    return not why


def _digests(study: Study, case: Case) -> dict[str, str | None]:
    return resume.digests(study.out, case.name, dict(zip(KEY, case.key, strict=True)), CASE_TABLES)


def _cases_table(entries: Mapping[str, Any]) -> pd.DataFrame:
    """Rows of cases.csv: how each case ended, and why."""
    return pd.DataFrame(
        [
            {
                "case": name,
                "status": entry["status"],
                "load": entry.get("load", ""),
                "message": entry.get("message", ""),
                "warnings": "; ".join(entry.get("warnings", [])),
            }
            for name, entry in entries.items()
        ]
    )


def _try_case(farm: Farm, study: Study, case: Case, go_on: bool) -> dict[str, Any]:
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
    return entry


def _run_case(farm: Farm, study: Study, case: Case, go_on: bool) -> dict[str, Any]:
    """Solve a case on this group of ranks and write its files; return its entry of run.json."""
    root = farm.group.rank == 0
    rows: list[dict[str, Any]] = []
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
        rows.append(_step_row(case, step))
        if root:
            with in_passing(step.load):
                _merge(study, "steps.csv", pd.DataFrame(rows))

    def on_milestone(milestone: Milestone) -> None:
        with run.phase("checkpoints"), in_passing(milestone.load):
            checkpoint.save(milestone)

    tell("mesh and set-up", 0.0, True)
    run = Run(
        farm.group,
        case,
        study.settings,
        study.limb,
        study.sockets.socket(case.socket),
        on_iteration=lambda load, k, norm: tell(f"iteration {k}, residual {norm:.1e} N/mm", load),
        on_step=on_step,
        on_milestone=on_milestone,
    )
    checkpoint = Checkpoint(
        study.out / case.name / CHECKPOINT_FILE,
        run.model,
        {
            "case": case.key,
            **study.inputs(),
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
        rows += [_step_row(case, step) for step in start.steps]
    run.solve(start)
    checks = run.checks()
    with run.phase("outcomes"):
        fields = section_fields(run.model, region_tissues(study.limb))
        line = contact_line(run.model)
    if fields is not None and line is not None:
        with run.phase("files"):
            _write_case(study, case, fields, line)
        if rows:
            rows[-1]["negative_modes"] = checks["negative_modes"]
            _merge(study, "steps.csv", pd.DataFrame(rows))
        if study.pictures:
            with run.phase("picture"), attempt(f"no picture of {case.name}"):
                picture.draw(study.out / case.name)
    load = float(run.model.contact.load)
    warnings = run.warnings(checks)
    text = run.failure or "; ".join(["solved", *warnings])
    tell(text, load, True)
    return {
        "status": "failed" if run.failure else "solved",
        "message": run.failure,
        "warnings": warnings,
        "ranks": farm.group.size,
        "gone_on_from_load": start.load if start else 0.0,
        "seconds": run.seconds,
        **checks,
        "files": _digests(study, case) if root else {},
    }


@contextmanager
def attempt(what: str) -> Iterator[None]:
    """Turn a failure into a warning: results that are solved and written must not be lost."""
    try:
        yield
    except Exception as error:
        log.warning("%s: %s", what, in_one_line(error))


def _write_case(study: Study, case: Case, fields: SectionFields, line: ContactLine) -> None:
    folder = study.out / case.name
    writers.write_fields(folder, fields, case.socket, case.material_set)
    contact = line.rows(case.socket, case.material_set)
    with writers.replacing(folder / "contact.csv") as temporary:
        contact.to_csv(temporary, index=False, float_format=writers.FLOAT_FORMAT)
    _merge(study, "contact.csv", contact)
    _merge(
        study,
        "summary.csv",
        outcomes.summary_rows(fields, line, case.socket, case.material_set),
    )


def _merge(study: Study, name: str, rows: pd.DataFrame) -> None:
    writers.merge_csv(study.out / name, rows, KEY, [case.key for case in all_cases(study.sockets)])


def all_cases(sockets: Sockets) -> list[Case]:
    """Every socket with every material set, in the order of the tables."""
    return [Case(socket, name) for socket in sockets.sockets for name in MATERIAL_SETS]


def _step_row(case: Case, step: LoadStep) -> dict[str, Any]:
    return {
        "socket": case.socket,
        "material_set": case.material_set,
        "step": step.number,
        "load": step.load,
        "converged": step.newton.converged,
        "reason": step.newton.reason,
        "newton_iterations": step.newton.iterations,
        "residual_N_per_mm": step.newton.residual,
        "seconds": step.seconds,
        "negative_modes": "",
    }


def _fingerprint(text: str) -> str:
    return "sha256:" + hashlib.sha256(text.encode()).hexdigest()


def _differences(before: Any, now: Any, path: str = "") -> set[str]:
    """Dotted names of the values that differ."""
    if isinstance(before, dict) and isinstance(now, dict):
        found: set[str] = set()
        for key in before.keys() | now.keys():
            name = f"{path}.{key}" if path else str(key)
            found |= _differences(before.get(key), now.get(key), name)
        return found
    return set() if before == now else {path}


def select(names: Sequence[str], allowed: Sequence[str], option: str) -> list[str]:
    """Return the chosen names in the order of the allowed ones, whatever their case.

    Raises
    ------
    InputError
        For a name that is not allowed, one given twice, or none at all.
    """
    by_lower = {name.lower(): name for name in allowed}
    chosen = []
    for name in names:
        key = name.strip().lower()
        if key not in by_lower:
            raise InputError(f"{option}: {name!r} is none of {', '.join(allowed)}")
        if by_lower[key] in chosen:
            raise InputError(f"{option}: {name!r} stands there twice; name each once")
        chosen.append(by_lower[key])
    if not chosen:
        raise InputError(f"{option}: nothing chosen; name at least one of {', '.join(allowed)}")
    return [name for name in allowed if name in chosen]
