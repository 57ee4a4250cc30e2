"""The run.json and cases.csv of a study: what is asked for, what is solved, what failed and why."""

import logging
import time
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import pandas as pd
from petsc4py import PETSc

from calfsocket.io.files import remove_unfinished, replacing, write_json
from calfsocket.io.versions import versions
from calfsocket.simulation.case import Case
from calfsocket.simulation.checkpoint import CHECKPOINT_FILE
from calfsocket.simulation.profile import PROFILE_FILE
from calfsocket.study import restart as resume
from calfsocket.study import sweep_table
from calfsocket.study.inventory import about, laws_of_sets
from calfsocket.study.sweep_table import SWEEP_FILE

if TYPE_CHECKING:
    from calfsocket.study.study import Study

KEY = ("socket", "material_set")
RUN_FILE = "run.json"
CASES_FILE = "cases.csv"
CASE_TABLES = ("summary.csv", "contact.csv", "steps.csv")
"""Tables in which a case has rows of its own."""
FILES = (*CASE_TABLES, PROFILE_FILE, SWEEP_FILE, CASES_FILE, RUN_FILE)
"""Files of a study beside its cases' folders."""

log = logging.getLogger(__name__)


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

    def __init__(self, study: "Study", ranks: int, go_on: bool = False) -> None:
        self._out = study.out
        self._start = time.perf_counter()
        self._study = study
        self._asked = [case.name for case in study.cases]
        conditions = {"versions": versions(), "petsc_options": PETSc.Options().getAll()}
        for folder in (study.out, *(study.out / name for name in self._asked)):
            remove_unfinished(folder)
        earlier = resume.earlier_run(study.out / RUN_FILE, conditions if go_on else {})
        self.to_solve = [
            case for case in study.cases if not (go_on and _is_kept(study, case, earlier["cases"]))
        ]
        inputs = study.inputs()
        inputs["cases"] = earlier["inputs"].get("cases", {}) | inputs["cases"]
        self._content = {
            "program": "calfsocket",
            **conditions,
            "ranks": ranks,
            "study": dict(study.origin),
            "inputs": inputs,
            "laws": laws_of_sets(study.order, study.settings, study.limb),
            "limb": study.limb.model_dump(mode="json"),
            "sockets": {
                name: socket.model_dump(mode="json", exclude_none=True)
                for name, socket in study.sockets.items()
            },
            "finished": False,
            "seconds": 0.0,
            "cases": earlier["cases"]
            | {case.name: {**about(case), "status": "running"} for case in self.to_solve},
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
        write_json(self._out / RUN_FILE, self._content)
        with replacing(self._out / CASES_FILE) as temporary:
            _cases_table(self._content["cases"]).to_csv(temporary, index=False)
        if self._study.sweep:
            status = {name: each["status"] for name, each in self._content["cases"].items()}
            sweep_table.write(self._out, self._study.sweep, self._study.order, status)
        for name in self._asked:
            if self._content["cases"][name]["status"] == "solved":
                # Its files hold all there is to know; one that failed may be gone on with.
                (self._out / name / CHECKPOINT_FILE).unlink(missing_ok=True)


def _is_kept(study: "Study", case: Case, earlier: Mapping[str, Any]) -> bool:
    if earlier.get(case.name, {}).get("status") != "solved":
        return False
    why = resume.damage(earlier[case.name], case_digests(study, case))
    log.info("%s: %s", case.name, why or "solved already")
    return not why


def case_digests(study: "Study", case: Case) -> dict[str, str | None]:
    """Give the digests of a case's files and rows."""
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
