"""Solved studies of the limb: read from their folders, or solved into them."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd
from mpi4py import MPI

from calfsocket.io.errors import InputError
from calfsocket.meshes.limb import Limb
from calfsocket.meshes.socket import reference_sockets
from calfsocket.simulation.case import Case, Settings
from calfsocket.study.study import RUN_FILE, Study, check_folder, run_study


def solved_study(
    folder: Path, settings: Settings, material_sets: Sequence[BaseSet] = BASE_SETS
) -> Path:
    """Make sure that a folder holds the cases of all sockets, and return it.

    Cases are solved on this rank unless the folder holds them, made with the same inputs; so a
    study may be solved beforehand, on several ranks.

    Parameters
    ----------
    folder : Path
        Of the results.
    settings : Settings
        What the cases share.
    material_sets : sequence of str
        Which cases.

    Raises
    ------
    InputError
        If the folder holds results that were made with other inputs.
    """
    sockets = reference_sockets()
    study = Study(
        cases=tuple(Case(s, name) for s in sockets for name in material_sets),
        settings=settings,
        limb=Limb.reference(),
        sockets=sockets,
        out=folder,
        pictures=False,
    )
    try:
        check_folder(study, overwrite=False)
    except InputError:
        raise InputError(
            f"--results: {folder} cannot be written, or holds results made with other inputs; "
            "name another folder"
        ) from None
    entries = run_entries(folder)
    missing = tuple(
        case for case in study.cases if entries.get(case.name, {}).get("status") != "solved"
    )
    if missing:
        run_study(MPI.COMM_SELF, Study(**(vars(study) | {"cases": missing})))
    return folder


def run_entries(folder: Path) -> dict[str, dict[str, Any]]:
    """Entries of the cases in run.json; none if there is no such file."""
    path = folder / RUN_FILE
    if not path.exists():
        return {}
    entries: dict[str, dict[str, Any]] = json.loads(path.read_text(encoding="utf-8"))["cases"]
    return entries


def summary(folder: Path) -> pd.DataFrame:
    """Read summary.csv of the cases that reached their full load."""
    table = pd.read_csv(folder / "summary.csv")
    table["region"] = table["region"].fillna("")
    solved = [name for name, entry in run_entries(folder).items() if entry["status"] == "solved"]
    return table[(table["socket"] + "_" + table["material_set"]).isin(solved)]


def cells(folder: Path) -> float:
    """Mean number of elements of the cases."""
    counts = [entry["cells"] for entry in run_entries(folder).values()]
    return sum(counts) / len(counts)
