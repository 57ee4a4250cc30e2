"""What uncertain inputs do to the results of a study: bands, and what each input explains."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from calfsocket.io.files import replacing
from calfsocket.io.tables import FLOAT_FORMAT
from calfsocket.parallel.first_rank import on_first_rank
from calfsocket.postprocess.contact_line import ContactLine
from calfsocket.postprocess.levels import NEARLY_ALL
from calfsocket.simulation.design import EVALUATED, Design, Group, Key
from calfsocket.simulation.record import KEY
from calfsocket.simulation.result import STATE
from calfsocket.uncertainty.chaos import BAND, TRUSTED, Basis, fit
from calfsocket.uncertainty.field import fit_field
from calfsocket.uncertainty.inputs import CASES_PER_TERM, Array
from calfsocket.uncertainty.shares import Explained, Shares

if TYPE_CHECKING:
    from mpi4py import MPI

AROUND = "contact_pressure_around"
"""Quantity of the skin: contact pressure at all angles together."""

ANGLES_DEG = np.arange(0.0, 360.0, 2.0)
"""Where the band of contact pressure has its points."""

SHARED = "share"
"""Word in the names of shares of a tissue or of the skin, in %."""

NUMBER = (*KEY, STATE, "tissue", "quantity")
CHECKED = ("check_inside_pct", "check_q2")
"""What cases that nothing is fitted to say of a chaos: how many % of them lie in the band, and
which share of their variance the chaos predicts."""
TABLE_COLUMNS = (
    *NUMBER,
    "unit",
    "nominal",
    "mean",
    "sd",
    "low",
    "high",
    "q2",
    "trusted",
    "mean_of_cases",
    "sd_of_cases",
    "cases",
    "failed",
    "unfinished",
    "failures",
    "check_cases",
    "check_failed",
    "check_mean",
    "check_sd",
    *CHECKED,
)
SHARES_COLUMNS = (*NUMBER, "input", "first", "total", "rank", "correlated")
PRESSURE_COLUMNS = (
    *KEY,
    STATE,
    "angle_deg",
    "nominal_kPa",
    "mean_kPa",
    "low_kPa",
    "median_kPa",
    "high_kPa",
    "q2",
    "trusted",
    *CHECKED,
)
COLUMNS = (TABLE_COLUMNS, SHARES_COLUMNS, PRESSURE_COLUMNS)


@dataclass(frozen=True, eq=False)
class Uncertain:
    """Results of a study whose inputs are uncertain.

    Attributes
    ----------
    table : DataFrame
        One row a quantity of a tissue in a state, by its magnitude: the file's own value, mean,
        standard deviation, band of 95 %, Q2 and whether to trust it, cases that it is fitted on;
        what cases say that it is not fitted on, if the study has any.
    shares : DataFrame
        What each input explains of the variance: first and total share (`uncertainty.shares`).
    pressure : DataFrame
        Contact pressure around the limb with its band, as running mean.
    """

    table: pd.DataFrame
    shares: pd.DataFrame
    pressure: pd.DataFrame

    @classmethod
    def read(cls, folder: Path) -> "Uncertain | None":
        """Read what was written; None where a file is missing, or another version wrote it."""
        paths = [folder / name for name in EVALUATED]
        if not all(path.is_file() for path in paths):
            return None
        types = dict.fromkeys((*KEY, STATE, "failures"), str)
        tables = [pd.read_csv(path, dtype=types) for path in paths]
        if [tuple(table.columns) for table in tables] != [*COLUMNS]:
            return None
        table, shares, pressure = tables
        return cls(table.fillna({"failures": ""}), shares, pressure)

    def write(self, folder: Path) -> list[Path]:
        """Write all tables; return their paths."""
        for name, table in zip(EVALUATED, (self.table, self.shares, self.pressure), strict=True):
            with replacing(folder / name) as temporary:
                table.to_csv(temporary, index=False, float_format=FLOAT_FORMAT)
        return [folder / name for name in EVALUATED]


def numbers(summary: pd.DataFrame, levels: pd.DataFrame) -> pd.DataFrame:
    """Return all numbers of cases in their states as rows of a summary.

    With what nearly all of a tissue's area stays below, as QUANTITY_below_99.9.
    """
    whole = levels[levels.region == ""]
    settling = whole.assign(quantity=whole.quantity + f"_{NEARLY_ALL}", value=whole[NEARLY_ALL])
    columns = [*NUMBER, "unit", "value"]
    return pd.concat([summary[columns], settling[columns]], ignore_index=True)


Tables = Mapping[tuple[str, str, str], pd.DataFrame]
"""Rows by socket, material set and state."""


def by_state(table: pd.DataFrame) -> Tables:
    """Return the rows of each case in each state."""
    return dict(list(table.groupby([*KEY, STATE], sort=False)))


@dataclass(frozen=True, eq=False)
class Sample:
    """Inputs and numbers of some cases in one state.

    Attributes
    ----------
    values : array
        Of the inputs, a row a case.
    numbers : DataFrame
        Magnitudes, a row a case and a column a tissue and quantity.
    around : array
        Contact pressure at `ANGLES_DEG`, a row a case, kPa.
    """

    values: Array
    numbers: pd.DataFrame
    around: Array

    @classmethod
    def of(cls, group: Group, summary: Tables, contact: Tables) -> "Sample":
        """Return that of the solved cases of a group in its state."""
        places = [(*each.key, group.state) for each in group.records]
        solved = [place for place, each in zip(places, group.solved, strict=True) if each]
        columns = {place: _magnitudes(summary[place]) for place in solved}
        wide = pd.concat(columns, axis=1).T if columns else pd.DataFrame()
        around = [_around(contact[place]) for place in solved]
        return cls(
            group.values[group.solved],
            wide.reset_index(drop=True),
            np.array(around).reshape(len(solved), len(ANGLES_DEG)),
        )


@dataclass(frozen=True, eq=False)
class Evaluation:
    """What is computed of one socket with one material set in one state.

    Attributes
    ----------
    group : Group
        The cases of the design in that state.
    fitted : Sample
        Those that are solved.
    check : Sample, optional
        Solved cases that nothing is fitted to.
    check_failed : int
        Cases of that kind that failed.
    nominal : Series
        Magnitudes of the file's own values.
    nominal_around : array
        Contact pressure of the file's own values, NaN where that case is not solved.
    units : Series
        Of the numbers.
    """

    group: Group
    fitted: Sample
    check: Sample | None
    check_failed: int
    nominal: "pd.Series[float]"
    nominal_around: Array
    units: "pd.Series[str]"

    @classmethod
    def of(
        cls, group: Group, check: Group | None, summary: Tables, contact: Tables
    ) -> "Evaluation":
        """Collect the numbers of a group in its state."""
        own = (*group.base, group.state)
        bore_it = group.own is not None and group.state not in group.own.limited
        fitted = Sample.of(group, summary, contact)
        known = [(*each.key, group.state) for each in group.records]
        rows = next((summary[place] for place in known if place in summary), None)
        return cls(
            group,
            fitted,
            Sample.of(check, summary, contact) if check else None,
            int(check.failed.sum()) if check else 0,
            _magnitudes(summary[own]) if bore_it and own in summary else pd.Series(dtype=float),
            _around(contact[own])
            if bore_it and own in contact
            else np.full(len(ANGLES_DEG), np.nan),
            pd.Series(dtype=str) if rows is None else _by_number(rows).unit,
        )

    @property
    def columns(self) -> dict[str, Any]:
        """Columns that name it in tables."""
        return dict(zip((*KEY, STATE), (*self.group.base, self.group.state), strict=True))

    @property
    def enough(self) -> bool:
        """Whether there are cases enough for a chaos."""
        terms = 1 + sum(each.terms for each in self.group.joint.marginals)
        return len(self.fitted.values) >= CASES_PER_TERM * terms

    @property
    def counts(self) -> dict[str, Any]:
        """How many cases failed, or did not end."""
        group = self.group
        return {
            "failed": int(group.failed.sum()),
            "unfinished": int((~group.solved & ~group.failed).sum()),
            "failures": group.failures,
        }

    def number(self, name: Key, explained: Explained) -> tuple[dict[str, Any], pd.DataFrame]:
        """Return the row of a tissue's quantity, and what each input explains of it.

        With a chaos where there are cases enough.
        """
        every = self.fitted.numbers[name].to_numpy(dtype=float)
        values = every[~np.isnan(every)]
        row = self.columns | dict(zip(("tissue", "quantity"), name, strict=True))
        row |= {"unit": self.units.get(name, ""), "nominal": self.nominal.get(name, np.nan)}
        row |= {"mean_of_cases": values.mean(), "sd_of_cases": values.std(), "cases": len(values)}
        row |= self.counts | self._of_checks(name) | {"trusted": False}
        if not self.enough or len(values) < len(every):
            return row, pd.DataFrame()
        chaos = fit(explained.basis, self.fitted.values, values)
        most = 100.0 if SHARED in name[1] else np.inf
        low, high = np.clip(np.quantile(chaos.sample, BAND), 0.0, most)  # it is a magnitude
        row |= {"mean": chaos.mean, "sd": chaos.sd, "low": low, "high": high, "q2": chaos.q2}
        row["trusted"] = chaos.trusted
        if row["check_cases"]:
            assert self.check is not None
            found = self.check.numbers[name].to_numpy(dtype=float)
            row |= _judged(found, chaos(self.check.values), (low, high))
            row["trusted"] = chaos.trusted and not row["check_q2"] < TRUSTED
        return row, self._shares(name, explained(chaos))

    def _of_checks(self, name: Key) -> dict[str, Any]:
        """Return how many cases check a number, their mean and standard deviation."""
        row = {"check_cases": 0, "check_failed": self.check_failed}
        if self.check is None or name not in self.check.numbers:
            return row
        values = self.check.numbers[name].to_numpy(dtype=float)
        if np.isnan(values).any():
            return row
        cases = {"check_mean": values.mean(), "check_sd": values.std()}
        return row | {"check_cases": len(values)} | cases

    def pressure(self, explained: Explained) -> tuple[pd.DataFrame, pd.DataFrame]:
        """Return contact pressure around the limb with its band, and what inputs explain of it."""
        found = fit_field(explained.basis, self.fitted.values, self.fitted.around)
        low, median, high = np.maximum(found.band, 0.0)
        judged = dict.fromkeys(CHECKED, np.nan)
        if self.check is not None and len(self.check.values):
            judged = _judged(self.check.around, found(self.check.values), (low, high))
        trusted = found.q2 >= TRUSTED and not judged["check_q2"] < TRUSTED
        table = pd.DataFrame(
            {
                **self.columns,
                "angle_deg": ANGLES_DEG,
                "nominal_kPa": self.nominal_around,
                "mean_kPa": found.mean,
                "low_kPa": low,
                "median_kPa": median,
                "high_kPa": high,
                "q2": found.q2,
                "trusted": trusted,
                **judged,
            }
        )
        return table, self._shares(("skin", AROUND), explained.of(found.chaos))

    def _shares(self, name: Key, shares: Shares) -> pd.DataFrame:
        joint = self.group.joint
        rank = np.empty(len(joint.names), dtype=int)
        rank[shares.order] = np.arange(1, len(rank) + 1)
        return pd.DataFrame(
            {
                **self.columns,
                **dict(zip(("tissue", "quantity"), name, strict=True)),
                "input": joint.names,
                "first": shares.first,
                "total": shares.total,
                "rank": rank,
                "correlated": joint.dependent,
            }
        )


def evaluations(design: Design, summary: pd.DataFrame, contact: pd.DataFrame) -> list[Evaluation]:
    """Collect what is to be computed of a study.

    Parameters
    ----------
    design : Design
        The cases and their inputs.
    summary, contact : DataFrame
        `numbers` and contact of all solved cases in all states.
    """
    of_summary, of_contact = by_state(summary), by_state(contact)
    return [
        Evaluation.of(each.at(state), check and check.at(state), of_summary, of_contact)
        for each in design.groups
        for check in [design.checks.get(each.base)]
        for state in each.states
    ]


def evaluate(collect: Callable[[], list[Evaluation]], comm: "MPI.Intracomm") -> Uncertain:
    """Fit a chaos to every number and to the contact pressure around the limb (collective).

    Ranks take a number each until all are done.

    Parameters
    ----------
    collect : callable
        Returns the evaluations; called on rank 0.

    Returns
    -------
    Uncertain
        Of all numbers on rank 0; without rows on the others.
    """
    from calfsocket.parallel.tasks import side_by_side

    parts = on_first_rank(comm, collect)
    explained: dict[Key, Explained] = {}

    def of(part: Evaluation) -> Explained:
        """Return the polynomials of a group, which all its states share."""
        base = part.group.base
        if base not in explained:
            explained[base] = Explained(Basis(part.group.joint))
        return explained[base]

    def field(part: Evaluation) -> tuple[pd.DataFrame, pd.DataFrame]:
        return part.pressure(of(part))

    def number(part: Evaluation, name: Key) -> tuple[dict[str, Any], pd.DataFrame]:
        return part.number(name, of(part))

    fields = [partial(field, part) for part in parts if part.enough]
    rows = [partial(number, part, name) for part in parts for name in part.fitted.numbers.columns]
    # fields take longest and begin first, so that no rank is left with one at the end
    done = side_by_side(comm, [*fields, *rows])
    of_fields, of_rows = done[: len(fields)], done[len(fields) :]
    table = pd.DataFrame([row for row, _ in of_rows], columns=[*TABLE_COLUMNS])
    shares = _joined([each for _, each in [*of_rows, *of_fields]], SHARES_COLUMNS)
    return Uncertain(table, shares, _joined([each for each, _ in of_fields], PRESSURE_COLUMNS))


def _judged(found: Array, predicted: Array, band: tuple[Any, Any]) -> dict[str, float]:
    """Return `CHECKED` of what cases have come to and a chaos says of them."""
    low, high = band
    inside = np.mean((found >= low) & (found <= high))
    variance = np.mean((found - found.mean(axis=0)) ** 2)
    same = not variance > 0
    q2 = np.nan if same else 1 - np.mean((found - predicted) ** 2) / variance
    return dict(zip(CHECKED, (100.0 * float(inside), float(q2)), strict=True))


def _joined(parts: Sequence[pd.DataFrame], columns: Iterable[str]) -> pd.DataFrame:
    """Return tables below each other; with columns even where all are empty."""
    filled = [part for part in parts if len(part)]
    whole = pd.concat(filled, ignore_index=True) if filled else pd.DataFrame(columns=[*columns])
    return whole[[*columns]]


def _by_number(rows: pd.DataFrame) -> pd.DataFrame:
    return rows.set_index(["tissue", "quantity"])


def _magnitudes(rows: pd.DataFrame) -> "pd.Series[float]":
    """Return the magnitude of each quantity: a sign that changes with its site is no number."""
    return _by_number(rows).value.abs()


def _around(rows: pd.DataFrame) -> Array:
    """Return the running mean of a case's contact pressure at `ANGLES_DEG`, kPa."""
    line = ContactLine.from_table(rows)
    return np.interp(ANGLES_DEG, line.angle_deg, line.running_mean_kPa, period=360.0)
