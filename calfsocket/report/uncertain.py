"""What a report shows of uncertain inputs: bands, what matters most, and how far to trust it."""

from collections import Counter
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import pandas as pd

from calfsocket.postprocess.levels import NEARLY_ALL
from calfsocket.postprocess.quantities import REPORTED
from calfsocket.report import names
from calfsocket.report.table import Table
from calfsocket.report.words import number
from calfsocket.simulation.design import Design, Group
from calfsocket.simulation.record import KEY
from calfsocket.simulation.result import STATE
from calfsocket.simulation.results import Results
from calfsocket.simulation.uncertain import AROUND, Uncertain
from calfsocket.uncertainty.chaos import TRUSTED

MOST_NAMED = 3
"""Inputs that are named for each number."""

NO_SHARE = 0.005
"""Share of the variance below which an input is not named."""

TOGETHER = "\u00a0"
"""Blank at which a line is not broken."""

DOUBT = "*"
"""Mark of what must not be trusted."""

CHECK_COLUMNS = (
    *KEY,
    STATE,
    "tissue",
    "quantity",
    "unit",
    "mean",
    "check_mean",
    "sd",
    "check_sd",
    "low",
    "high",
    "check_inside_pct",
    "q2",
    "check_q2",
    "check_cases",
    "check_failed",
)
"""What is written of the cases that nothing is fitted to."""

SETTLES = f"_{NEARLY_ALL}"
OF_CONTACT = ("contact_pressure_mean", f"contact_pressure{SETTLES}")
OF_TISSUES = (f"effective_stress{SETTLES}", f"shear_log_strain{SETTLES}")


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """The uncertain inputs of a study, and what they do, as a report shows it."""

    results: Results
    found: Uncertain
    design: Design

    @classmethod
    def of(cls, results: Results) -> "Uncertainty | None":
        """Return that of a study; None where it has no uncertain inputs, or too few cases."""
        found = results.uncertainty
        return cls(results, found, results.design) if found and len(found.table) else None

    # --- its inputs

    @cached_property
    def titles(self) -> dict[str, str]:
        """Words for each input."""
        return {name: of.title or name for name, of in self.design.inputs.inputs.items()}

    @property
    def correlations(self) -> list[str]:
        """Pairs of correlated inputs, in words."""
        return [
            f"{' and '.join(self.titles[name] for name in each.between)} ({number(each.rank)})"
            for each in self.design.inputs.correlations
        ]

    # --- its cases

    @property
    def drawn(self) -> int:
        """Number of cases of the design."""
        return sum(len(group.records) for group in self.design.groups)

    @property
    def solved(self) -> int:
        """Number of those that reached their full load."""
        return sum(int(group.solved.sum()) for group in self.design.groups)

    @property
    def failed(self) -> list[str]:
        """Names of those that failed."""
        records = [record for group in self.design.groups for record in group.records]
        return [record.name for record in records if record.status == "failed"]

    @property
    def unfinished(self) -> int:
        """Number of those that were not begun, or not ended."""
        return self.drawn - self.solved - len(self.failed)

    @property
    def failures(self) -> list[str]:
        """Whether they are random, in words, for each socket and material set with failures."""
        several = len(self.design.groups) > 1
        found = []
        for group in self.design.groups:
            words = group.failures
            for name, title in self.titles.items():
                words = words.replace(name, title)
            if words:
                found.append((f"in {_case(group.base)} " if several else "") + words)
        return found

    @property
    def checks(self) -> tuple[Group, ...]:
        """The cases that check the design, by socket and material set."""
        return tuple(self.design.checks.values())

    @property
    def checked(self) -> int:
        """Number of those that reached their full load."""
        return sum(int(group.solved.sum()) for group in self.checks)

    @property
    def drawn_to_check(self) -> int:
        """Number of all of them."""
        return sum(len(group.records) for group in self.checks)

    @property
    def beyond_loads(self) -> dict[str, int]:
        """Stage of loading -> how many cases could not bear it, and are in no number of its end."""
        records = (record for group in self.design.groups for record in group.records)
        counts = Counter(name for record in records for name in record.limited)
        return {name: counts[name] for name in self.every_state if counts[name]}

    @property
    def warnings(self) -> list[str]:
        """What a reader must know of the cases of the design, a line for each kind."""
        found = []
        if self.unfinished:
            found.append(f"{self.unfinished} of {self.drawn} cases of the design are not finished")
        if self.failed:
            found.append(f"{len(self.failed)} of {self.drawn} cases of the design failed")
        if self.checked < self.drawn_to_check:
            missing = self.drawn_to_check - self.checked
            found.append(
                f"{missing} of {self.drawn_to_check} cases that check the design have no results"
            )
        found += [
            f"{n} of {self.drawn} cases of the design cannot bear what stage {name} asks for"
            for name, n in self.beyond_loads.items()
        ]
        # what failed is in no number, so that its warnings would say nothing of these
        records = (record for group in self.design.groups for record in group.records)
        texts = (text for r in records if r.status != "failed" for text in r.warnings)
        counts = Counter(text.partition(":")[0].partition(" of ")[0] for text in texts)
        kinds = [f"{n} of {self.drawn} cases of the design: {text}" for text, n in counts.items()]
        return [*found, *kinds]

    # --- its numbers

    @cached_property
    def every_state(self) -> tuple[str, ...]:
        """The donned socket and the ends of the stages of loading."""
        return tuple(self.found.table[STATE].unique())

    @property
    def states(self) -> tuple[str, ...]:
        """Those that are shown: the first and the last."""
        return tuple(dict.fromkeys((self.every_state[0], self.every_state[-1])))

    @cached_property
    def headlines(self) -> pd.DataFrame:
        """Rows of the numbers that a report quotes, in the order of the tissues."""
        wanted = [("skin", quantity) for quantity in OF_CONTACT]
        wanted += [(tissue, quantity) for tissue in REPORTED for quantity in OF_TISSUES]
        table = self.found.table
        place = {pair: number for number, pair in enumerate(wanted)}
        order = [place.get(pair, -1) for pair in zip(table.tissue, table.quantity, strict=True)]
        rows = table.assign(order=order)[[place >= 0 for place in order]]
        rows = rows[rows[["mean", "nominal"]].abs().max(axis=1) > 0]  # not of what touches nothing
        rows = rows[rows[STATE].isin(self.states)]
        late = rows[STATE] != self.every_state[0]
        return rows.assign(late=late).sort_values([*KEY, "late", "order"], kind="stable")

    @property
    def fitted(self) -> bool:
        """Whether there were cases enough for a chaos."""
        return bool(len(self.found.shares))

    @property
    def sure(self) -> pd.DataFrame:
        """Headlines of the first state that may be trusted."""
        return self.headlines[self.headlines.trusted & ~self.headlines.late]

    @property
    def doubtful(self) -> list[str]:
        """Headlines whose chaos must not be trusted."""
        return [self.label(row) for row in self.headlines.itertuples() if not row.trusted]

    def most(self, row: Any) -> list[str]:
        """Return the inputs that matter most for a number, with their shares of its variance."""
        shares = self.found.shares
        mine = (
            shares[[*KEY, STATE, "tissue", "quantity"]]
            == [*key_of(row), row.state, row.tissue, row.quantity]
        ).all(axis=1)
        best = shares[mine].sort_values("rank")[:MOST_NAMED]
        best = best[best[["first", "total"]].max(axis=1) > NO_SHARE]
        return [f"{self.titles[each.input]} {_share(each)}" for each in best.itertuples()]

    def label(self, row: Any, with_state: bool = True) -> str:
        """Return a number in words."""
        places = [_case(key_of(row))] if len(self.design.groups) > 1 else []
        places += [row.state] if with_state and len(self.states) > 1 else []
        of_case = f"{', '.join(places)}: " if places else ""
        tissue = "" if row.quantity in OF_CONTACT else f"{names.TISSUES[row.tissue]}, "
        return f"{of_case}{tissue}{names.QUANTITIES[row.quantity.removesuffix(SETTLES)]}"

    # --- tables

    def tables(self) -> list[Table]:
        """Return the tables of the numbers, of what checks them, and of the inputs."""
        rows = [*self.headlines.itertuples()]
        shown = pd.DataFrame(
            {
                "unit": [row.unit for row in rows],
                "file's values": [number(row.nominal) for row in rows],
                "mean": [number(row.mean) for row in rows],
                "95 % of cases": [_band(row) for row in rows],
                "what matters most": [", ".join(self.most(row)) for row in rows],
                "Q2": [
                    number(row.q2) + ("" if row.trusted else f"{TOGETHER}{DOUBT}") for row in rows
                ],
            },
            index=[self.label(row) for row in rows],
        )
        inputs = self.design.inputs.inputs
        listed = pd.DataFrame(
            {
                "parameter": [", ".join(of.scales) or name for name, of in inputs.items()],
                "distribution": [of.words for of in inputs.values()],
                "source": [of.source for of in inputs.values()],
            },
            index=[*self.titles.values()],
        )
        data = listed.reset_index(names="input")
        found = [Table("uncertainty", self.found.table, shown), Table("inputs", data, listed)]
        return [*found, self._check()] if self.checks and self.fitted else found

    def _check(self) -> Table:
        """Return the table that sets cases that nothing is fitted to beside the chaos."""
        table = self.headlines[self.headlines.check_cases > 0]
        rows = [*table.itertuples()]
        shown = pd.DataFrame(
            {
                "unit": [row.unit for row in rows],
                "mean": [number(row.mean) for row in rows],
                "mean of cases": [number(row.check_mean) for row in rows],
                "sd": [number(row.sd) for row in rows],
                "sd of cases": [number(row.check_sd) for row in rows],
                "in band, %": [number(row.check_inside_pct) for row in rows],
                "Q2": [number(row.q2) for row in rows],
                "Q2 in cases": [number(row.check_q2) for row in rows],
            },
            index=[self.label(row) for row in rows],
        )
        return Table("check", table[[*CHECK_COLUMNS]], shown)

    @property
    def pressure(self) -> dict[str, Any]:
        """What is said of the band of pressure: its least Q2, inputs, and whether to trust it."""
        table, shares = (
            each[each[STATE].isin(self.states)] for each in (self.found.pressure, self.found.shares)
        )
        rows = table.drop_duplicates([*KEY, STATE])
        most = shares[(shares.quantity == AROUND) & (shares["rank"] == 1)]
        several = len(self.states) > 1
        return {
            "q2": number(rows.q2.min()),
            "check": number(rows.check_q2.min()) if rows.check_q2.notna().all() else "",
            "inside": number(rows.check_inside_pct.min()),
            "trusted": bool(rows.trusted.all()),
            "most": [
                f"{self.titles[each.input]} {_share(each)}" + f" ({each.state})" * several
                for each in most.itertuples()
            ],
        }

    trusted = f"{TRUSTED:g}"
    doubt = DOUBT


def key_of(row: Any) -> tuple[str, str]:
    """Return socket and material set of a row."""
    return row.socket, row.material_set


def _case(key: tuple[str, str]) -> str:
    return f"{key[0]} {names.material_set(key[1])}"


def _band(row: Any) -> str:
    words = f"{number(row.low)} to {number(row.high)}".replace(" ", TOGETHER)
    return words if row.trusted or row.q2 == row.q2 else ""


def _share(row: Any) -> str:
    """Return an input's share: the total one, or of a correlated input both."""
    if row.correlated:
        return f"(alone {100 * row.first:.0f} %, only it {100 * row.total:.0f} %)"
    return f"{100 * row.total:.0f} %"
