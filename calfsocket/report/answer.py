"""The numbers of the answer: what a reader should take home. Its sentences are in the template."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from calfsocket.postprocess.levels import BELOW, BY_MAGNITUDE, NEARLY_ALL, SHARES, levels_of
from calfsocket.postprocess.mesh_error import MESH_ERROR, error_of
from calfsocket.postprocess.quantities import REPORTED
from calfsocket.report import names
from calfsocket.report.changes import magnitude_change
from calfsocket.report.findings import Findings
from calfsocket.report.method import states_of
from calfsocket.report.words import changes, measured, measured_all, span
from calfsocket.simulation.result import Result

MOST_NAMED, MOST_LISTED = 4, 6
"""Sockets that one sentence names, and cases."""

BEYOND = 100 - SHARES[-1]
"""Share of a tissue, %, that `NEARLY_ALL` leaves out."""


@dataclass(frozen=True)
class Level:
    """What nearly all of a tissue's area stays below, in the socket where that is highest."""

    socket: str
    quantity: str
    value: float
    unit: str
    region: str
    """Where most of what reaches it is; empty where its name says no more than the tissue's."""
    direction: str
    error: float = np.nan
    """Mesh error, NaN where it is not known."""

    def __str__(self) -> str:
        return f"{measured(self.value, self.error)} {self.unit} {names.QUANTITIES[self.quantity]}"

    @property
    def where(self) -> str:
        """Region and side of the limb."""
        return ", ".join(filter(None, (names.region(self.region), self.direction)))


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
        """Mean and largest contact pressure of each socket, kPa, and where the largest is.

        Both as text, too, with their mesh errors.
        """
        skin = self._rows[self._rows.tissue == "skin"]  # a liner has contact, too
        rows = skin[skin.quantity == "contact_pressure_max"]
        means = skin[skin.quantity == "contact_pressure_mean"].set_index("socket").loc[rows.socket]
        places = zip(rows.x_mm, rows.y_mm, strict=True)
        return pd.DataFrame(
            {
                "socket": rows.socket.to_numpy(),
                "average": means.value.to_numpy(),
                "largest": rows.value.to_numpy(),
                "average_text": measured_all(means.value, means, MESH_ERROR),
                "largest_text": measured_all(rows.value, rows, MESH_ERROR),
                "side": [self.findings.frame.direction(*place) for place in places],
            }
        )

    @property
    def tissues(self) -> dict[str, list[Level]]:
        """Highest level of effective stress and of shear strain in each tissue."""
        rows = self._levels[self._levels.material_set == self.material_set]
        found: dict[str, list[Level]] = {}
        for tissue in (name for name in REPORTED if name in self.findings.tissues):
            for quantity in ("effective_stress", "shear_log_strain"):
                of = rows[(rows.tissue == tissue) & (rows.quantity == quantity)]
                if of[NEARLY_ALL].any():
                    highest = of.loc[of[NEARLY_ALL].idxmax()]
                    level = (quantity, float(highest[NEARLY_ALL]))
                    where = self._where(highest.socket, tissue, *level)
                    error = float(highest.get(error_of(NEARLY_ALL), np.nan))
                    about = Level(highest.socket, *level, highest.unit, *where, error)
                    found.setdefault(tissue, []).append(about)
        return found

    def _where(self, socket: str, tissue: str, quantity: str, value: float) -> tuple[str, str]:
        """Return the region and the side with most of a tissue's area at or above a value."""
        quantities = self.results[socket, self.material_set].quantities
        fields, values = quantities.fields, quantities.gauss[quantity]
        sized = abs(values) if quantity in BY_MAGNITUDE else values
        reached = sized >= value * (1 - 1e-9)  # the table has ten digits
        areas: dict[tuple[str, str], float] = {}
        for cell in fields.cells_of(tissue):
            if reached[cell].any():
                middle = fields.points[fields.cells[cell]].mean(axis=0)
                region = fields.region_names[int(fields.region[cell])]
                place = region, self.findings.frame.direction(*middle)
                area = float(fields.gauss_area[cell][reached[cell]].sum())
                areas[place] = areas.get(place, 0.0) + area
        region, side = max(areas, key=lambda place: areas[place])
        return "" if tissue in region else region, side  # "deep_fascia" adds nothing to "fascia"

    @cached_property
    def _levels(self) -> pd.DataFrame:
        """Levels of whole tissues in all cases."""
        rows = self.results.levels
        return rows[rows.region == ""]

    # --- the Combined set against the Separate set

    @property
    def changes(self) -> pd.DataFrame:
        """Changes of each set's own maximum."""
        changes = self.findings.changes
        return changes[changes.site == "max_both"]

    def pressure_changes(self, quantity: str) -> "pd.Series[float]":
        """Relative changes of a contact pressure by socket, %."""
        rows = self.changes[self.changes["quantity"] == quantity]
        return rows.set_index("socket").relative_change_pct

    def pressure_change(self, quantity: str) -> str:
        """Return the same in words, with mesh errors."""
        rows = self.changes[self.changes["quantity"] == quantity]
        return changes(rows.relative_change_pct, rows.get(error_of("relative_change_pct")))

    def _both(self, quantity: str) -> pd.DataFrame:
        """Return levels of a quantity by socket and tissue, with a column for either set."""
        rows = self._levels[self._levels["quantity"] == quantity]
        rows = rows[rows.tissue.isin(self.findings.soft_tissues)]
        sets = rows.pivot(index=["socket", "tissue"], columns="material_set", values=NEARLY_ALL)
        return sets[[*names.SETS]].dropna()

    def level_changes(self, tissue: str, quantity: str) -> str:
        """Return the range of changes of a tissue's levels over sockets, %, in words."""
        rows = self._both(quantity).xs(tissue, level="tissue")
        found = rows.separate.combine(rows.combined, magnitude_change)
        errors = [self._level_error(socket, tissue, quantity) for socket in rows.index]
        return span(found, pd.Series(errors, rows.index))

    def _level_error(self, socket: str, tissue: str, quantity: str) -> float:
        """Return the mesh error of a change of a level: as of a level, by itself and the next."""
        pair = [self.results[socket, name] for name in names.SETS]
        second = [each.second for each in pair if each.second]
        if len(second) < len(pair):
            return np.nan

        def found(both: Sequence[Result]) -> NDArray[np.float64]:
            rows = [levels_of(each.quantities, [(tissue, quantity)]) for each in both]
            levels = [each[[*BELOW[-2:]]].to_numpy().ravel() for each in rows]
            return np.array([magnitude_change(*each) for each in zip(*levels, strict=True)])

        largest = np.abs(found(pair) - found(second)).max()
        return float(max(each.times_change for each in pair) * largest)

    def most_loaded(self, material_set: str, quantity: str) -> str:
        """Return the tissue with the highest level, over the sockets with both sets."""
        _, tissue = self._both(quantity)[material_set].idxmax()
        return names.TISSUES[tissue]

    # --- thresholds and stability

    @property
    def damage(self) -> list[tuple[str, pd.DataFrame, bool]]:
        """What each threshold limits, in words, cases with more than `BEYOND`, and if any has."""
        table, found = self.findings.damage, []
        for threshold in self.findings.thresholds.all[:2]:
            tissue, quantity, limit = threshold.tissue, threshold.quantity, threshold.value
            rows = table[(table.tissue == tissue) & (table["quantity"] == quantity)]
            if len(rows):
                share = rows.area_share_pct
                rows = rows.assign(said=measured_all(share, rows, error_of("area_share_pct")))
                what = f"{limit:g} % {names.QUANTITIES[quantity]} in {names.TISSUES[tissue]}"
                found.append((what, rows[share > BEYOND], bool((share > 0).any())))
        return found

    @property
    def damage_after_stages(self) -> list[str]:
        """For each threshold the stage whose end is farthest beyond it, in words."""
        table, found = self.findings.damage_after_stages, []
        for threshold in self.findings.thresholds.all[:2]:
            tissue, quantity = threshold.tissue, threshold.quantity
            rows = table[(table.tissue == tissue) & (table["quantity"] == quantity)]
            if not len(rows):
                continue
            limit = f"{threshold.value:g} % {names.QUANTITIES[quantity]} in {names.TISSUES[tissue]}"
            said = measured_all(rows.area_share_pct, rows, error_of("area_share_pct"))
            worst = rows.assign(said=said).loc[rows.area_share_pct.idxmax()]
            if worst.area_share_pct > 0:
                case = f" of {worst.socket} {names.material_set(worst.material_set)}"
                stage = worst.state + case * (len(self.results) > 1)
                beyond = f"At the end of stage {stage}, {limit} is exceeded in {worst.said} %"
                found.append(
                    f"{beyond} of the tissue{', the most of all stages' * (len(rows) > 1)}."
                )
            else:
                found.append(f"At the end of no stage is {limit} exceeded.")
        return found

    @property
    def unstable(self) -> list[str]:
        """States whose equilibrium is not stable, with the number of negative modes."""
        records = states_of(self.findings.judged)
        modes = {name: each.checks.negative_modes for name, each in records if each.checks}
        return [f"{name} ({n})" for name, n in modes.items() if n]
