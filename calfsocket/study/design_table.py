"""design.csv: one row a case of the design of uncertain inputs, with what was drawn."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from calfsocket.io.files import replacing
from calfsocket.io.tables import FLOAT_FORMAT
from calfsocket.simulation.design import CHECK, DESIGN_FILE, FIT, PURPOSE, heading
from calfsocket.simulation.record import CaseRecord
from calfsocket.study.cases import Plan

if TYPE_CHECKING:
    import pandas as pd


def table(plan: Plan, records: Mapping[str, CaseRecord]) -> "pd.DataFrame":
    """Return one row a case of the design: what was drawn, and how the case ended.

    An input that does not reach a case is empty.
    """
    import pandas as pd

    uncertain = plan.document.uncertainty
    assert uncertain is not None
    rows = []
    for case in plan.cases:
        if case.row is None or case.name not in records:
            continue
        row: dict[str, Any] = {"case": case.name, **records[case.name].columns}
        row[PURPOSE] = FIT if case.row < uncertain.cases else CHECK
        drawn = uncertain.rows[case.row]
        for (name, of), value in zip(uncertain.inputs.items(), drawn, strict=True):
            reached = any(parameter in case.changes for parameter in of.scales or (name,))
            shown = of.text(value) if of.discrete else value
            row[heading(name, of.unit)] = shown if reached else None
        rows.append(row | {"status": records[case.name].status})
    return pd.DataFrame(rows)


def write(folder: Path, plan: Plan, records: Mapping[str, CaseRecord]) -> None:
    """Write the table."""
    with replacing(folder / DESIGN_FILE) as temporary:
        table(plan, records).to_csv(temporary, index=False, float_format=FLOAT_FORMAT)
