"""What a run that was stopped has left in its folder, and what of it is kept."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from calfsocket.io.errors import InputError
from calfsocket.postprocess.vtu import FIELDS_FILE

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


def damage(entry: Mapping[str, Any], now: Mapping[str, str | None]) -> str:
    """Say which files of a solved case are not what they were; empty where it is whole.

    Parameters
    ----------
    entry
        Its entry in run.json, with the `digests` when it was finished.
    now
        Its present `digests`.
    """
    then = entry.get("files") or {}
    changed = [file for file in now if now[file] is None or now[file] != then.get(file)]
    return f"solved anew, missing or changed since: {', '.join(changed)}" if changed else ""


def earlier_run(path: Path, conditions: Mapping[str, Any]) -> dict[str, Any]:
    """Read an earlier run.json, if that run was made under the same conditions.

    Parameters
    ----------
    path
        The run.json; there need be none.
    conditions
        What in it must be the same, e.g. versions.

    Returns
    -------
    dict
        Its content; that of a run without cases where there is none.

    Raises
    ------
    InputError
        When it cannot be read, or conditions differ.
    """
    if not path.exists():
        return {"inputs": {}, "cases": {}}
    try:
        run: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        run["inputs"].keys(), run["cases"].keys()
        differing = [name for name, value in conditions.items() if run[name] != value]
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(
            f"{path}: cannot be read ({error!r}); add --overwrite to start anew"
        ) from None
    if differing:
        raise InputError(
            f"{path}: made with other {' and '.join(differing)}, so that numbers may differ; "
            "repeat it with those, or leave --resume out to solve everything anew"
        )
    return run


def _digest(content: bytes) -> str:
    return "sha256:" + hashlib.sha256(content).hexdigest()
