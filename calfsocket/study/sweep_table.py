"""sweep.csv: one row a case, with the parameters of a sweep and the main results."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from calfsocket.io.files import replacing
from calfsocket.io.tables import FLOAT_FORMAT
from calfsocket.mechanics.loading import DONNED
from calfsocket.postprocess.levels import NEARLY_ALL
from calfsocket.postprocess.mesh_error import MESH_ERROR, error_of, with_levels
from calfsocket.postprocess.quantities import CONTACT_UNITS, SUMMARY_TISSUES, UNITS
from calfsocket.simulation.record import CaseRecord
from calfsocket.simulation.result import STATE
from calfsocket.simulation.results import KEY, LEVELS_FILE, SUMMARY_FILE
from calfsocket.study.cases import Plan

if TYPE_CHECKING:
    import pandas as pd

SWEEP_FILE = "sweep.csv"

_QUANTITY = re.compile(r"\s*([+-]?[\d.]+(?:[eE][+-]?\d+)?)\s*(\S+)\s*")


def write(folder: Path, plan: Plan, records: Mapping[str, CaseRecord]) -> None:
    """Write the table of the cases so far, from summary.csv and levels.csv."""
    import pandas as pd

    keys = dict.fromkeys(KEY, str)
    paths = folder / SUMMARY_FILE, folder / LEVELS_FILE
    summary, levels = (
        pd.read_csv(path, dtype=keys) if path.exists() else pd.DataFrame() for path in paths
    )
    if len(levels):
        summary = with_levels(summary, levels)
    with replacing(folder / SWEEP_FILE) as temporary:
        rows = table(plan, records, summary)
        rows.to_csv(temporary, index=False, float_format=FLOAT_FORMAT)


def table(plan: Plan, records: Mapping[str, CaseRecord], summary: "pd.DataFrame") -> "pd.DataFrame":
    """Return one row a case: names, parameters, results (empty until it is solved) and status.

    Results of the donned socket, and of the state after each stage of loading under its name; of
    tissues what nearly all of the area stays below, and the largest level behind it. Each number
    has its mesh error behind it where the summary has any. A parameter that does not reach a case
    is empty.

    Parameters
    ----------
    summary
        As of `calfsocket.postprocess.mesh_error.with_levels`.
    """
    import pandas as pd

    cases = [records[case.name] for case in plan.cases if case.name in records]
    rows: list[dict[str, Any]] = [{"case": case.name, **case.columns} for case in cases]
    for name in plan.parameters:
        heading, values = column(name, [case.changes.get(name) for case in cases])
        for row, value in zip(rows, values, strict=True):
            row[heading] = value
    key = [*KEY, "tissue", "quantity", STATE]
    if STATE not in summary:
        summary = summary.assign(**{STATE: DONNED})
    columns = ["value", *([MESH_ERROR] if MESH_ERROR in summary else [])]
    indexed = summary if summary.empty else summary.set_index(key)
    results = {name: {} if summary.empty else indexed[name].to_dict() for name in columns}
    states = dict.fromkeys([DONNED, *(summary[STATE] if len(summary) else [])])
    for state in states:
        for heading, tissue, quantity in _headings(plan):
            in_state = heading if state == DONNED else f"{heading}_{state}"
            for row, case in zip(rows, cases, strict=True):
                for name, of in results.items():
                    cell = in_state if name == "value" else error_of(in_state)
                    row[cell] = of.get((*case.key, tissue, quantity, state))
    for row, case in zip(rows, cases, strict=True):
        row["status"] = case.status
    return pd.DataFrame(rows)


def column(name: str, values: Sequence[Any]) -> tuple[str, list[Any]]:
    """Return a parameter's heading and cells: plain numbers where all have one unit.

    An apostrophe goes in front of a text that a spreadsheet would take for a formula.
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


def _headings(plan: Plan) -> list[tuple[str, str, str]]:
    """Return heading, tissue and quantity of every result."""
    found: list[tuple[str, str, str]] = []
    for quantity in plan.document.study.quantities:
        unit = (CONTACT_UNITS | UNITS)[quantity].replace("%", "percent")
        if quantity in CONTACT_UNITS:
            found.append((f"{quantity}_{unit}", "skin", quantity))
            continue
        changed = {name.split(".")[0] for case in plan.cases for name in case.changes}
        lined = ("liner",) if plan.document.liner or "liner" in changed else ()
        tissues = ("vessel",) if quantity == "pressure" else (*SUMMARY_TISSUES, *lined)
        for name in (f"{quantity}_{NEARLY_ALL}", quantity):
            found += [(f"{tissue}_{name}_{unit}", tissue, name) for tissue in tissues]
    found += [(f"{t.tissue}_{t.name}_in_percent", t.tissue, t.name) for t in plan.thresholds]
    return found
