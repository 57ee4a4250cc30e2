"""sweep.csv: one row a case with the parameters of a sweep and the main results."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from calfsocket.io.files import replacing
from calfsocket.io.tables import FLOAT_FORMAT
from calfsocket.postprocess.quantities import CONTACT_UNITS, SUMMARY_TISSUES, UNITS
from calfsocket.postprocess.thresholds import Threshold
from calfsocket.simulation.case import Case

SWEEP_FILE = "sweep.csv"

_QUANTITY = re.compile(r"\s*([+-]?[\d.]+(?:[eE][+-]?\d+)?)\s*(\S+)\s*")


@dataclass(frozen=True)
class Sweep:
    """What the table tells.

    Attributes
    ----------
    parameters : tuple of str
        Dotted names in the study file.
    quantities : tuple of str
        Of summary.csv; those of tissues are told for every tissue.
    thresholds : tuple of Threshold
        Their shares are told, too.
    """

    parameters: tuple[str, ...]
    quantities: tuple[str, ...]
    thresholds: tuple[Threshold, ...] = ()


def write(folder: Path, sweep: Sweep, cases: Sequence[Case], status: Mapping[str, str]) -> None:
    """Write the table of the cases so far, from summary.csv."""
    path = folder / "summary.csv"
    summary = pd.read_csv(path) if path.exists() else pd.DataFrame()
    rows = table(sweep, [case for case in cases if case.name in status], status, summary)
    with replacing(folder / SWEEP_FILE) as temporary:
        rows.to_csv(temporary, index=False, float_format=FLOAT_FORMAT)


def table(
    sweep: Sweep, cases: Sequence[Case], status: Mapping[str, str], summary: pd.DataFrame
) -> pd.DataFrame:
    """One row a case: its names, parameters, results (empty until it is solved) and status.

    A parameter that does not reach a case is empty.
    """
    rows: list[dict[str, Any]] = [
        {"case": case.name, "socket": case.socket, "material_set": case.material_set}
        for case in cases
    ]
    for name in sweep.parameters:
        heading, values = column(name, [case.changes.get(name) for case in cases])
        for row, value in zip(rows, values, strict=True):
            row[heading] = value
    results = results_of(summary)
    for heading, tissue, quantity in _headings(sweep):
        for row, case in zip(rows, cases, strict=True):
            row[heading] = results.get((*case.key, tissue, quantity))
    for row, case in zip(rows, cases, strict=True):
        row["status"] = status[case.name]
    return pd.DataFrame(rows)


def column(name: str, values: Sequence[Any]) -> tuple[str, list[Any]]:
    """Give a parameter's heading and cells: plain numbers where all have one unit.

    Text that a spreadsheet would take for a formula gets an apostrophe before it.
    """
    written = [value for value in values if value is not None]
    found = [_QUANTITY.fullmatch(value) if isinstance(value, str) else None for value in written]
    units = {match[2] for match in found if match}
    if written and all(found) and len(units) == 1:
        return f"{name} [{units.pop()}]", [
            None if value is None else float(_QUANTITY.fullmatch(value)[1])  # type: ignore[index]
            for value in values
        ]
    return name, [harmless(value) for value in values]


def harmless(value: Any) -> Any:
    """Return a cell that no spreadsheet runs: numbers stay, text does not begin as a formula."""
    if value is None or isinstance(value, bool | int | float):
        return value
    text = str(value)
    return f"'{text}" if text[:1] in ("=", "+", "-", "@", "\t", "\r") else text


def results_of(summary: pd.DataFrame) -> dict[tuple[str, str, str, str], float]:
    """Values of summary.csv by socket, material set, tissue and quantity."""
    if summary.empty:
        return {}
    key = ["socket", "material_set", "tissue", "quantity"]
    rows = summary[[*key, "value"]].itertuples(index=False, name=None)
    return {(*map(str, row[:4]),): row[4] for row in rows}  # type: ignore[misc]


def _headings(sweep: Sweep) -> list[tuple[str, str, str]]:
    """List heading, tissue and quantity of every result."""
    found = []
    for quantity in sweep.quantities:
        if quantity in CONTACT_UNITS:
            found.append((f"{quantity}_{_unit(CONTACT_UNITS[quantity])}", "skin", quantity))
            continue
        tissues = ("vessel",) if quantity == "pressure" else SUMMARY_TISSUES
        unit = _unit(UNITS[quantity])
        found += [(f"{tissue}_{quantity}_{unit}", tissue, quantity) for tissue in tissues]
    found += [(f"{t.tissue}_{t.name}_in_percent", t.tissue, t.name) for t in sweep.thresholds]
    return found


def _unit(unit: str) -> str:
    return {"%": "percent"}.get(unit, unit)
