"""The study: cases times settings, solved side by side, written case by case."""

import hashlib
import json
import logging
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import pandas as pd
from mpi4py import MPI
from petsc4py import PETSc
from rich.console import Console

from calfsocket import compilation, outcomes, picture, writers
from calfsocket.case import Case, Run, Settings, case_laws, region_tissues
from calfsocket.contact_line import ContactLine
from calfsocket.errors import CalfsocketError, InputError
from calfsocket.farm import Farm
from calfsocket.gather import contact_line, section_fields
from calfsocket.laws import ogden_terms
from calfsocket.meshes.data import Limb, Sockets
from calfsocket.profile import PROFILE_FILE, Profile
from calfsocket.progress import Event, Reporter
from calfsocket.section_fields import SectionFields
from calfsocket.stepping import LoadStep
from calfsocket.tissues import MATERIAL_SETS
from calfsocket.versions import versions

KEY = ("socket", "material_set")
RUN_FILE = "run.json"
TABLES = ("summary.csv", "contact.csv", "steps.csv", PROFILE_FILE)

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
    profile : bool
        Whether to write where the time goes (profile.csv).
    """

    cases: tuple[Case, ...]
    settings: Settings
    limb: Limb
    sockets: Sockets
    out: Path
    pictures: bool = True
    profile: bool = False

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
) -> bool:
    """Solve every case and write its results (collective).

    Cases run side by side on groups of ranks. A case that fails does not stop the others: its last
    converged state is written, and run.json says why.

    Returns
    -------
    bool
        Whether every case reached the full load.
    """
    ledger = Ledger(study, comm.size) if comm.rank == 0 else None
    names = [case.name for case in study.cases]
    reporter = Reporter(names, console or Console(stderr=True)) if ledger else None

    def on_report(message: Event | dict[str, Any]) -> None:
        assert ledger is not None and reporter is not None
        if isinstance(message, Event):
            reporter.show(message)
        else:
            ledger.record(message)

    with reporter or nullcontext():
        laws = [case_laws(case, study.settings).values() for case in study.cases]
        compilation.warm(comm, map(ogden_terms, laws))
        farm = Farm(comm, len(study.cases), ranks_per_case, on_report)
        while (number := farm.next_case()) is not None:
            case = study.cases[number]
            try:
                entry = _run_case(farm, study, case)
            except CalfsocketError as error:  # raised by all ranks of the group
                farm.report(Event(case.name, str(error), 0.0, milestone=True))
                entry = {"status": "failed", "message": str(error)}
            farm.report({"name": case.name, **entry})
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
            for name in (*TABLES, RUN_FILE):
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
    """The run.json of a study, kept up to date by rank 0."""

    def __init__(self, study: Study, ranks: int) -> None:
        self._path = study.out / RUN_FILE
        self._start = time.perf_counter()
        earlier = {}
        if self._path.exists():
            earlier = json.loads(self._path.read_text(encoding="utf-8"))["cases"]
        self._asked = [case.name for case in study.cases]
        self._content = {
            "program": "calfsocket",
            "versions": versions(),
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
            "petsc_options": PETSc.Options().getAll(),
            "finished": False,
            "seconds": 0.0,
            "cases": {name: entry for name, entry in earlier.items() if name not in self._asked}
            | {name: {"status": "running"} for name in self._asked},
        }
        self._write()

    def record(self, entry: dict[str, Any]) -> None:
        """Put in how a case ended."""
        self._content["cases"][entry.pop("name")] = entry
        self._write()

    def close(self) -> bool:
        """Mark the study as finished; tell whether every case asked for was solved."""
        self._content["finished"] = True
        self._write()
        return all(self._content["cases"][name]["status"] == "solved" for name in self._asked)

    def _write(self) -> None:
        self._content["seconds"] = time.perf_counter() - self._start
        writers.write_json(self._path, self._content)


def _run_case(farm: Farm, study: Study, case: Case) -> dict[str, Any]:
    """Solve a case on this group of ranks and write its files; return its entry of run.json."""
    root = farm.group.rank == 0
    rows: list[dict[str, Any]] = []
    profile = Profile() if study.profile else None

    def tell(text: str, load: float, milestone: bool = False) -> None:
        farm.report(Event(case.name, text, load, milestone))

    def on_step(step: LoadStep) -> None:
        newton = step.newton
        how = "Newton" if newton.converged else f"failed ({newton.reason}) after"
        tell(f"{how} {newton.iterations}, residual {newton.residual:.1e} N/mm", step.load, True)
        rows.append(_step_row(case, step))
        if root:
            _merge(study, "steps.csv", pd.DataFrame(rows))

    tell("mesh and set-up", 0.0, True)
    run = Run(
        farm.group,
        case,
        study.settings,
        study.limb,
        study.sockets.socket(case.socket),
        on_iteration=lambda load, k, norm: tell(f"iteration {k}, residual {norm:.1e} N/mm", load),
        on_step=on_step,
    )
    if profile:
        profile.start()
    run.solve()
    if profile:
        profile.stop()
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
    if profile and root:
        times = profile.rows(run.seconds)
        times.insert(0, "socket", case.socket)
        times.insert(1, "material_set", case.material_set)
        _merge(study, PROFILE_FILE, times)
    load = float(run.model.contact.load)
    warnings = run.warnings(checks)
    text = run.failure or "; ".join(["solved", *warnings])
    tell(text, load, True)
    return {
        "status": "failed" if run.failure else "solved",
        "message": run.failure,
        "warnings": warnings,
        "ranks": farm.group.size,
        "seconds": run.seconds,
        **checks,
    }


@contextmanager
def attempt(what: str) -> Iterator[None]:
    """Turn a failure into a warning: results that are solved and written must not be lost."""
    try:
        yield
    except Exception as error:
        log.warning("%s: %s: %s", what, type(error).__name__, error)


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
