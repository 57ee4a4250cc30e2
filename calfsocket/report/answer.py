"""The numbers of the answer: what a reader should take home. Its sentences are in the template."""

from dataclasses import dataclass
from typing import Any

import pandas as pd

from calfsocket.postprocess.quantities import REPORTED
from calfsocket.report import names
from calfsocket.report.findings import Findings
from calfsocket.report.method import states_of
from calfsocket.report.words import number, span

MOST_NAMED, MOST_LISTED = 4, 6
"""Sockets that one sentence names, and cases."""


@dataclass(frozen=True)
class Peak:
    """The largest value of a quantity in a tissue, and where it is."""

    socket: str
    quantity: str
    value: float
    unit: str
    region: str
    """Empty where its name says no more than the tissue's."""
    direction: str

    def __str__(self) -> str:
        return f"{names.QUANTITIES[self.quantity]} {number(abs(self.value))} {self.unit}"

    @property
    def where(self) -> str:
        """Region and side of the limb."""
        return ", ".join(filter(None, (names.region(self.region), self.direction)))


def _peak(findings: Findings, row: Any) -> Peak:
    plain = row.tissue in row.region  # "deep_fascia" adds nothing to "fascia"
    return Peak(
        row.socket,
        row.quantity,
        row.value,
        row.unit,
        "" if plain else row.region,
        findings.frame.direction(row.x_mm, row.y_mm),
    )


class Answer:
    """What the sockets do to the limb, as far as a study's cases show it.

    Tissues are described with the first material set: Separate, where fascia is itself.
    """

    def __init__(self, findings: Findings) -> None:
        self.findings, self.results = findings, findings.results
        self.material_set = self.results.material_sets[0]
        rows = self.results.summary
        self._rows = rows[rows.material_set == self.material_set]

    @property
    def pressure(self) -> pd.DataFrame:
        """Mean and largest contact pressure of each socket, kPa, and where the largest is."""
        skin = self._rows[self._rows.tissue == "skin"]  # a liner has contact, too
        rows = skin[skin.quantity == "contact_pressure_max"]
        mean = skin[skin.quantity == "contact_pressure_mean"].set_index("socket").value
        peaks = [_peak(self.findings, row) for row in rows.itertuples()]
        return pd.DataFrame(
            {
                "socket": rows.socket,
                "average": rows.socket.map(mean),
                "largest": rows.value,
                "side": [peak.direction for peak in peaks],
            }
        ).reset_index(drop=True)

    @property
    def tissues(self) -> dict[str, list[Peak]]:
        """Largest effective stress and shear strain of each tissue."""
        found: dict[str, list[Peak]] = {}
        for tissue in (name for name in REPORTED if name in self.findings.tissues):
            for quantity in ("effective_stress", "shear_log_strain"):
                rows = self._rows[
                    (self._rows.tissue == tissue) & (self._rows.quantity == quantity)
                ].dropna(subset="value")
                if rows.value.any():
                    largest = rows.loc[rows.value.abs().idxmax()]
                    found.setdefault(tissue, []).append(_peak(self.findings, largest))
        return found

    # --- the Combined set against the Separate set

    @property
    def changes(self) -> pd.DataFrame:
        """Changes of each set's own maximum."""
        changes = self.findings.changes
        return changes[changes.site == "max_both"]

    def pressure_changes(self, quantity: str) -> "pd.Series[float]":
        """Relative changes of a contact pressure by socket, %."""
        rows = self.changes[self.changes.quantity == quantity]
        return rows.set_index("socket").relative_change_pct

    def magnitude_changes(self, tissue: str, quantity: str) -> str:
        """Return the range of changes of a tissue's maxima over sockets, %, in words."""
        of = (self.changes.tissue == tissue) & (self.changes.quantity == quantity)
        values = self.changes.magnitude_change_pct[of]
        return span(values)

    def most_loaded(self, material_set: str, quantity: str) -> str:
        """Return the tissue with the largest magnitude, over the sockets with both sets."""
        rows = self.changes[self.changes.quantity == quantity]
        return names.TISSUES[rows.tissue[rows[material_set].abs().idxmax()]]

    # --- thresholds and stability

    @property
    def damage(self) -> list[tuple[str, pd.DataFrame]]:
        """What each threshold limits, in words, and the cases that are beyond it."""
        table, found = self.findings.damage, []
        for threshold in self.findings.thresholds.all[:2]:
            tissue, quantity, limit = threshold.tissue, threshold.quantity, threshold.value
            rows = table[(table.tissue == tissue) & (table.quantity == quantity)]
            if len(rows):
                what = f"{limit:g} % {names.QUANTITIES[quantity]} in {names.TISSUES[tissue]}"
                found.append((what, rows[rows.level_pct > limit]))
        return found

    @property
    def unstable(self) -> list[str]:
        """States whose equilibrium is not stable, with the number of negative modes."""
        records = states_of(self.findings.study)
        modes = {name: each.checks.negative_modes for name, each in records if each.checks}
        return [f"{name} ({n})" for name, n in modes.items() if n]
