"""What a run that was stopped has left in its folder, and which of it is kept."""

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from calfsocket.io.errors import InputError
from calfsocket.postprocess.vtu import FIELDS_FILE
from calfsocket.simulation.record import StudyRecord, read_run

CASE_FILES = (FIELDS_FILE, "contact.csv")
"""Files of a finished case; its picture can be drawn again from them."""


def digests(
    out: Path, name: str, key: Mapping[str, str], tables: Sequence[str]
) -> dict[str, str | None]:
    """SHA-256 of a case's files, and of its rows in the tables that cases share.

    Parameters
    ----------
    out
        Folder of the results.
    name
        Name of the case's folder.
    key
        Column -> value, by which its rows are known.
    tables
        Names of the tables in `out`.

    Returns
    -------
    dict
        File -> digest; None where it is missing or cannot be read.
    """
    found: dict[str, str | None] = {}
    for file in CASE_FILES:
        path = out / name / file
        found[f"{name}/{file}"] = _digest(path.read_bytes()) if path.is_file() else None
    for table in tables:
        try:
            rows = pd.read_csv(out / table, dtype=str, keep_default_na=False)
            for column, value in key.items():
                rows = rows[rows[column] == value]
        except (OSError, ValueError, KeyError):
            found[table] = None
        else:
            found[table] = _digest(rows.to_csv(index=False).encode())
    return found


def damage(then: Mapping[str, str | None], now: Mapping[str, str | None]) -> str:
    """Return which files of a solved case have changed, in words; empty where none have.

    Parameters
    ----------
    then, now : mapping of str to str
        `digests` when the case was finished, and at present.
    """
    changed = [file for file in now if now[file] is None or now[file] != then.get(file)]
    return (
        f"solved again, because files are missing or have changed: {', '.join(changed)}"
        if changed
        else ""
    )


def earlier_run(path: Path, conditions: Mapping[str, Any] | None) -> StudyRecord | None:
    """Read an earlier run.json.

    Parameters
    ----------
    path : Path
        The run.json; None is returned where there is none.
    conditions : mapping, optional
        Values that it must have, e.g. of `versions`.

    Raises
    ------
    InputError
        If it cannot be read, or conditions differ.
    """
    if not path.exists():
        return None
    try:
        run = read_run(path)
    except InputError as error:
        raise InputError(f"{error}; or add --overwrite to start again") from None
    differing = [key for key, value in (conditions or {}).items() if getattr(run, key) != value]
    if differing:
        raise InputError(
            f"{path}: was made with other {' and '.join(differing)}, so that numbers may differ; "
            "use those again, or omit --resume to solve all cases again"
        )
    return run


def _digest(content: bytes) -> str:
    return "sha256:" + hashlib.sha256(content).hexdigest()
