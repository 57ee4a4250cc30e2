"""What a run that was stopped has left in its folder, and which of it is kept."""

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from calfsocket.io.errors import InputError
from calfsocket.io.tables import Rows
from calfsocket.postprocess.vtu import FIELDS_FILE
from calfsocket.simulation.record import StudyRecord, read_run
from calfsocket.simulation.result import CURVE_FILE, SECOND_MESH
from calfsocket.simulation.results import KEY, Key

CASE_FILES = (FIELDS_FILE, "contact.csv")
"""Files of a finished case; its picture can be drawn again from them."""

CASE_TABLES = ("summary.csv", "levels.csv", "contact.csv", "steps.csv")
"""Tables in which a case has rows of its own."""

STAGE_TABLES = (CURVE_FILE,)
"""Such tables of cases with stages of loading."""


def digests(
    out: Path, key: Key, states: Sequence[str] = (), second: bool = False
) -> dict[str, str | None]:
    """SHA-256 by file: of a case's own, and of its rows in the tables that cases share.

    `states` are the names of its states after stages of loading, `second` whether it has a result
    on a second mesh.

    None for a file that is missing or cannot be read.
    """
    found: dict[str, str | None] = {}
    folders = [*states, *([SECOND_MESH] if second else [])]
    own = [*CASE_FILES, *(f"{folder}/{file}" for folder in folders for file in CASE_FILES)]
    for file in own:
        name = f"{'_'.join(key)}/{file}"
        found[name] = _digest((out / name).read_bytes()) if (out / name).is_file() else None
    for table in (*CASE_TABLES, *(STAGE_TABLES if states else ())):
        try:
            every = Rows.read(out / table)
            rows = Rows(every.columns, every.of_cases(KEY).get(key, []))
        except (OSError, ValueError):
            found[table] = None
        else:
            found[table] = _digest(rows.text().encode())
    return found


def damage(then: Mapping[str, str | None], now: Mapping[str, str | None]) -> str:
    """Say by its `digests` which files of a solved case have changed; empty where none have."""
    changed = [file for file in now if now[file] is None or now[file] != then.get(file)]
    return (
        f"solved again, because files are missing or have changed: {', '.join(changed)}"
        if changed
        else ""
    )


def earlier_run(path: Path, conditions: Mapping[str, Any] | None) -> StudyRecord | None:
    """Read an earlier run.json, if there is one.

    `conditions` are values that it must have, e.g. of `versions`.

    Raises
    ------
    InputError
        If it cannot be read, or conditions differ.
    """
    if not path.exists():
        return None
    run = read_run(path)
    differing = [key for key, value in (conditions or {}).items() if getattr(run, key) != value]
    if differing:
        raise InputError(
            f"{path}: was made with other {' and '.join(differing)}, so that numbers may differ; "
            "use those again, or omit --resume to solve all cases again"
        )
    return run


def _digest(content: bytes) -> str:
    return "sha256:" + hashlib.sha256(content).hexdigest()
