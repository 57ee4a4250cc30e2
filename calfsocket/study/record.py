"""The run.json and cases.csv of a study, kept up to date while it runs."""

import logging
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

from calfsocket.io.errors import InputError
from calfsocket.io.files import occupied, remove_unfinished, write_json
from calfsocket.io.tables import Rows, remove_rows
from calfsocket.meshes import tags
from calfsocket.meshes.levels import LimbLevels
from calfsocket.meshes.limb import Limb
from calfsocket.simulation.checkpoint import CHECKPOINT_FILE, STAGE_FILES, conditions
from calfsocket.simulation.design import DESIGN_FILE, EVALUATED
from calfsocket.simulation.profile import PROFILE_FILE
from calfsocket.simulation.record import LEVEL, RUN_FILE, CaseRecord, StudyRecord, read_run
from calfsocket.simulation.results import KEY
from calfsocket.study import design_table, restart, sweep_table
from calfsocket.study.cases import Case, Plan
from calfsocket.study.sweep import flat
from calfsocket.study.sweep_table import SWEEP_FILE

CASES_FILE = "cases.csv"
TABLES = (*restart.CASE_TABLES, *restart.STAGE_TABLES)
FILES = (*TABLES, PROFILE_FILE, SWEEP_FILE, DESIGN_FILE, *EVALUATED, CASES_FILE, RUN_FILE)
"""Files of a study beside its cases' folders."""

log = logging.getLogger(__name__)


class Recorder:
    """Keeps run.json and cases.csv, on rank 0.

    `to_solve` are the chosen cases; to `resume`, without those that an earlier run has finished.
    Of these, `on_second_mesh` lack nothing but their result on a second mesh.

    Raises
    ------
    InputError
        If the earlier run was made under other conditions.
    """

    def __init__(self, plan: Plan, out: Path, ranks: int, resume: bool = False) -> None:
        self._plan, self._out = plan, out
        self._start = time.perf_counter()
        self._asked = [case.name for case in plan.to_solve]
        for folder in (out, *(out / name for name in self._asked)):
            remove_unfinished(folder)
        now = conditions()
        earlier = restart.earlier_run(out / RUN_FILE, now if resume else None)
        before = earlier.cases if earlier else {}
        kept = [case for case in plan.to_solve if resume and self._is_kept(case, before)]
        self.on_second_mesh = tuple(
            case for case in kept if case.has_mesh_error and not before[case.name].has_second_mesh
        )
        again = tuple(case for case in plan.to_solve if case not in kept)
        self.to_solve = (*again, *self.on_second_mesh)
        records = {case.name: case.record for case in again}
        for name in EVALUATED:  # of fewer cases than there will be
            (out / name).unlink(missing_ok=True)
        # A case that is solved again has no results until it reaches its full load again.
        for table in TABLES:
            remove_rows(out / table, KEY, {case.key for case in again})
        self._record = StudyRecord(
            **now,
            ranks=ranks,
            study=plan.source,
            settings=plan.settings,
            limb=plan.limb if isinstance(plan.limb, Limb) else None,
            levels=plan.limb if isinstance(plan.limb, LimbLevels) else None,
            sockets={case.socket.name: case.socket for case in plan.cases},
            laws=laws_of_sets(plan),
            inputs=(earlier.inputs if earlier else {}) | plan.fingerprints,
            thresholds=tuple(asdict(threshold) for threshold in plan.thresholds),
            cases=before | records,
        )
        self._write()

    def _is_kept(self, case: Case, earlier: Mapping[str, CaseRecord]) -> bool:
        known = earlier.get(case.name)
        if known is None or not known.solved:
            return False
        second = known.has_second_mesh
        now = restart.digests(self._out, case.key, known.states, second)
        why = restart.damage(known.files, now)
        log.info("%s: %s", case.name, why or "already solved; kept")
        return not why

    def put(self, record: CaseRecord) -> None:
        """Record how a case ended; a full disk at this moment does not stop the cases that run."""
        self._record.cases[record.name] = record
        try:
            self._write()
        except OSError as error:
            log.warning("%s", error)

    def close(self) -> bool:
        """Mark the study as finished, and return whether every case asked for was solved.

        Raises
        ------
        WriteError
            If that cannot be written.
        """
        self._record = self._record.model_copy(update={"finished": True})
        self._write()
        records = [self._record.cases[name] for name in self._asked]
        failed = [record for record in records if not record.solved]
        if failed:
            log.warning(
                "%d of %d cases failed and have no results; run again with --resume to retry them:",
                len(failed),
                len(records),
            )
        for record in failed:
            log.warning("%s: %s", record.name, record.message)
        return not failed

    def _write(self) -> None:
        seconds = time.perf_counter() - self._start
        self._record = self._record.model_copy(update={"seconds": seconds})
        cases = self._record.cases
        write_json(self._out / RUN_FILE, self._record.model_dump(mode="json", exclude_none=True))
        cases_table(cases.values()).write(self._out / CASES_FILE)
        if self._plan.document.uncertainty:
            design_table.write(self._out, self._plan, cases)
        if self._plan.parameters:
            sweep_table.write(self._out, self._plan, cases)
        for name in self._asked:
            if cases[name].solved:
                # Its files hold all there is to know; one that failed may be resumed.
                for path in (
                    self._out / name / CHECKPOINT_FILE,
                    *(self._out / name).glob(STAGE_FILES),
                ):
                    path.unlink(missing_ok=True)


def laws_of_sets(plan: Plan) -> dict[str, dict[str, Any]]:
    """Return the laws of each material set by tissue or region, without those of sockets.

    A case whose laws differ from those of its set has an entry by its own name.
    """
    found: dict[str, dict[str, Any]] = {}
    for case in plan.cases:
        laws = case.materials.tissue_laws() | dict(case.materials.regions)
        if case.document.liner:
            laws |= {tags.LINER: case.document.liner.law}
        if found.setdefault(case.materials.name, laws) != laws:
            found[case.name] = laws  # a variant changes them
    return found


def cases_table(records: Iterable[CaseRecord]) -> Rows:
    """Return the rows of cases.csv: how each case ended, and why."""
    rows = [
        {
            "case": record.name,
            **{name: record.columns[name] for name in LEVEL if name in record.columns},
            "status": record.status,
            "load": "" if record.load is None else record.load,
            "message": record.message,
            "warnings": "; ".join(record.warnings),
        }
        for record in records
    ]
    columns = list(dict.fromkeys(column for row in rows for column in row))
    return Rows(columns, [[str(row.get(column, "")) for column in columns] for row in rows])


@contextmanager
def results_folder(out: Path, plan: Plan, overwrite: bool = False) -> Iterator[None]:
    """Keep a folder for the results of a plan until the body ends.

    Raises
    ------
    InputError
        If another run writes into the folder, it contains results of other inputs and they may not
        be overwritten, or it cannot be written to.
    """
    with ExitStack() as stack:
        try:
            stack.enter_context(occupied(out))
            if overwrite:
                for name in FILES:
                    (out / name).unlink(missing_ok=True)
        except OSError as error:
            raise InputError(
                f"--out {out}: {error.strerror}; name a folder that can be written to"
            ) from None
        if (out / RUN_FILE).exists():
            _check_inputs(out, plan)
        yield


MOST_NAMED = 5
"""Changed inputs that a message names; a design has hundreds of cases."""


def _first(words: Sequence[str]) -> str:
    """Return the first of some words, and how many more there are."""
    more = len(words) - MOST_NAMED
    return ", ".join(words[:MOST_NAMED]) + (f" and {more} more" if more > 0 else "")


def _check_inputs(out: Path, plan: Plan) -> None:
    """Refuse a folder whose results were made from other inputs."""
    advice = "name another folder, or add --overwrite to replace its results"
    before = read_run(out / RUN_FILE, advice)
    now = flat({"settings": plan.settings, "thresholds": [*map(asdict, plan.thresholds)]})
    then = flat({"settings": before.settings, "thresholds": [*before.thresholds]})
    changed = [
        f"case {name}"
        for name, fingerprint in plan.fingerprints.items()
        if before.inputs.get(name, fingerprint) != fingerprint
    ]
    if changed or now["thresholds"] != then["thresholds"]:
        # What differs in the file's tables says more than the names of the cases.
        words = sorted(key for key in then.keys() | now.keys() if then.get(key) != now.get(key))
        raise InputError(
            f"--out {out}: contains results of other inputs "
            f"({_first(words or changed)} changed); {advice}"
        )
