"""What uncertain inputs do to the results of a study: bands, and what each input explains."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from calfsocket.io.errors import InputError
from calfsocket.io.files import replacing
from calfsocket.io.tables import FLOAT_FORMAT
from calfsocket.postprocess.contact_line import ContactLine
from calfsocket.postprocess.levels import NEARLY_ALL
from calfsocket.simulation.record import KEY, CaseRecord
from calfsocket.uncertainty.chaos import BAND, TRUSTED, Basis, fit
from calfsocket.uncertainty.failures import pattern
from calfsocket.uncertainty.field import fit_field
from calfsocket.uncertainty.inputs import CASES_PER_TERM, Array, Joint, Uncertainty
from calfsocket.uncertainty.shares import Explained, Shares

DESIGN_FILE = "design.csv"
UNCERTAINTY_FILE = "uncertainty.csv"
SHARES_FILE = "sobol.csv"
PRESSURE_FILE = "contact_pressure_band.csv"
EVALUATED = (UNCERTAINTY_FILE, SHARES_FILE, PRESSURE_FILE)
FILES = (DESIGN_FILE, *EVALUATED)

AROUND = "contact_pressure_around"
"""Quantity of the skin: contact pressure at all angles together."""

ANGLES_DEG = np.arange(0.0, 360.0, 2.0)
"""Where the band of contact pressure has its points."""

SHARED = "share"
"""Word in the names of shares of a tissue or of the skin, in %."""

NUMBER = (*KEY, "tissue", "quantity")
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
)
SHARES_COLUMNS = (*NUMBER, "input", "first", "total", "rank", "correlated")
PRESSURE_COLUMNS = (
    *KEY,
    "angle_deg",
    "nominal_kPa",
    "mean_kPa",
    "low_kPa",
    "median_kPa",
    "high_kPa",
    "q2",
    "trusted",
)
COLUMNS = (TABLE_COLUMNS, SHARES_COLUMNS, PRESSURE_COLUMNS)

Key = tuple[str, str]


def heading(name: str, unit: str) -> str:
    """Return the heading of an input's column."""
    return f"{name} [{unit}]" if unit else name


@dataclass(frozen=True, eq=False)
class Group:
    """Cases of a design that share socket and material set.

    Attributes
    ----------
    base : tuple of str
        These two, and the key of the case with the file's own values.
    joint : Joint
        Of the inputs that reach them.
    values : array
        Of these inputs, a row a case.
    records : tuple of CaseRecord
        Of the cases.
    """

    base: Key
    joint: Joint
    values: Array
    records: tuple[CaseRecord, ...]

    @property
    def solved(self) -> "np.ndarray[Any, np.dtype[np.bool_]]":
        """Whether each case reached its full load."""
        return np.array([record.solved for record in self.records])

    @property
    def failed(self) -> "np.ndarray[Any, np.dtype[np.bool_]]":
        """Whether each case failed; one that was not begun, or not ended, did not."""
        return np.array([record.status == "failed" for record in self.records])

    @property
    def failures(self) -> str:
        """Whether cases failed by chance, in words; empty where none failed."""
        ended = self.solved | self.failed
        failed = self.failed[ended]
        if not failed.any():
            return ""
        names = self.joint.names
        found = pattern(names, self.values[ended], failed)
        if found.inputs:
            where = ", ".join(f"{size} {name}" for name, size in found.inputs.items())
            return f"not random: more often with {where}"
        return "random as far as they tell" if found.tells else "too few to tell whether random"


@dataclass(frozen=True, eq=False)
class Design:
    """A study's uncertain inputs, and the cases of its design by socket and material set."""

    inputs: Uncertainty
    groups: tuple[Group, ...]


def read_design(folder: Path, content: Mapping[str, Any], records: Iterable[CaseRecord]) -> Design:
    """Read the design of a study.

    Raises
    ------
    InputError
        When design.csv is missing or is not that of the study.
    """
    path = folder / DESIGN_FILE
    inputs = Uncertainty.model_validate(content)
    names = [heading(name, of.unit) for name, of in inputs.inputs.items()]
    again = "run the study again with --resume"
    try:
        table = pd.read_csv(path, dtype=dict.fromkeys(KEY, str)).set_index("case")[names]
    except (OSError, ValueError, KeyError) as error:
        raise InputError(f"{path}: cannot be read ({error}); {again}") from None
    of_base: dict[Key, list[CaseRecord]] = {}
    for record in records:
        if record.name in table.index:
            of_base.setdefault(record.base, []).append(record)
    groups = []
    for base, cases in of_base.items():
        rows = table.loc[[record.name for record in cases]]
        kept = rows.notna().all().to_numpy()
        pairs = [
            (of, rows[name])
            for (name, of, keep) in zip(names, inputs.inputs.values(), kept, strict=True)
            if keep
        ]
        values = np.column_stack(
            [column.map(of.value) if of.discrete else column.astype(float) for of, column in pairs]
        )
        groups.append(Group(base, inputs.joint.only(kept), values, tuple(cases)))
    return Design(inputs, tuple(groups))


@dataclass(frozen=True, eq=False)
class Uncertain:
    """Results of a study whose inputs are uncertain.

    Attributes
    ----------
    table : DataFrame
        One row a quantity of a tissue, by its magnitude: the file's own value, mean, standard
        deviation, band of 95 %, Q2 and whether to trust it, cases that it is fitted on.
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
        """Read what was written; None where a file is missing."""
        paths = [folder / name for name in EVALUATED]
        if not all(path.is_file() for path in paths):
            return None
        types = dict.fromkeys((*KEY, "failures"), str)
        found = (pd.read_csv(path, dtype=types) for path in paths)
        table, shares, pressure = found
        return cls(table.fillna({"failures": ""}), shares, pressure)

    def write(self, folder: Path) -> list[Path]:
        """Write all tables; return their paths."""
        for name, table in zip(EVALUATED, (self.table, self.shares, self.pressure), strict=True):
            with replacing(folder / name) as temporary:
                table.to_csv(temporary, index=False, float_format=FLOAT_FORMAT)
        return [folder / name for name in EVALUATED]


def numbers(summary: pd.DataFrame, levels: pd.DataFrame) -> pd.DataFrame:
    """Return all numbers of cases as rows of a summary.

    With what nearly all of a tissue's area stays below, as QUANTITY_below_99.9.
    """
    whole = levels[levels.region == ""]
    settling = whole.assign(quantity=whole.quantity + f"_{NEARLY_ALL}", value=whole[NEARLY_ALL])
    columns = [*NUMBER, "unit", "value"]
    return pd.concat([summary[columns], settling[columns]], ignore_index=True)


def evaluate(design: Design, summary: pd.DataFrame, contact: pd.DataFrame) -> Uncertain:
    """Fit a chaos to every number of the cases, and to the contact pressure around the limb.

    Parameters
    ----------
    design : Design
        The cases and their inputs.
    summary, contact : DataFrame
        `numbers` and contact of the donned sockets of all solved cases, as in `Results`.
    """
    of_summary = dict(list(summary.groupby([*KEY], sort=False)))
    of_contact = dict(list(contact.groupby([*KEY], sort=False)))
    tables, shares, pressures = [], [], []
    for group in design.groups:
        part = _Evaluation(group, of_summary, of_contact)
        tables.append(part.table())
        pressures.append(part.pressure())
        shares.append(part.shares())
    every = zip((tables, shares, pressures), COLUMNS, strict=True)
    return Uncertain(*(_joined(parts, columns) for parts, columns in every))


def _joined(parts: Iterable[pd.DataFrame], columns: tuple[str, ...]) -> pd.DataFrame:
    """Return the tables of all groups below each other; with columns even where all are empty."""
    filled = [part for part in parts if len(part)]
    if not filled:
        return pd.DataFrame(columns=list(columns))
    return pd.concat(filled, ignore_index=True)[list(columns)]


class _Evaluation:
    """That of one socket with one material set."""

    def __init__(
        self, group: Group, summary: Mapping[Key, pd.DataFrame], contact: Mapping[Key, pd.DataFrame]
    ) -> None:
        self._group, self._solved = group, group.solved
        self._keys = [record.key for record in group.records if record.solved]
        self._values = group.values[self._solved]
        self._summary, self._contact = summary, contact
        terms = 1 + sum(each.terms for each in group.joint.marginals)
        self._enough = len(self._keys) >= CASES_PER_TERM * terms
        self._basis = Basis(group.joint)
        self._explained = Explained(self._basis)
        self._shares: list[pd.DataFrame] = []

    def table(self) -> pd.DataFrame:
        """Return a row for each quantity."""
        if not self._keys:
            return pd.DataFrame()
        wide = pd.concat(
            {key: _magnitudes(self._summary[key]) for key in self._keys}, axis=1
        ).T.reset_index(drop=True)
        own = self._summary.get(self._group.base)
        nominal = _magnitudes(own) if own is not None else pd.Series(dtype=float)
        units = self._summary[self._keys[0]].set_index(["tissue", "quantity"]).unit
        rows = []
        for name in wide.columns:
            known = wide[name].notna().to_numpy()
            row = dict(zip(NUMBER, (*self._group.base, *name), strict=True))
            row |= {"unit": units.get(name, ""), "nominal": nominal.get(name, np.nan)}
            rows.append(row | self._of(name, wide[name].to_numpy(dtype=float), known))
        return pd.DataFrame(rows)

    def _of(self, name: Key, outputs: Array, known: Any) -> dict[str, Any]:
        """Return the numbers of a quantity; a chaos where there are cases enough."""
        n, values = int(known.sum()), outputs[known]
        counts = {
            "cases": n,
            "failed": int(self._group.failed.sum()),
            "unfinished": int((~self._solved & ~self._group.failed).sum()),
            "failures": self._group.failures,
        }
        cases = {"mean_of_cases": values.mean() if n else np.nan, "sd_of_cases": values.std()}
        if not (self._enough and n == len(self._keys)):
            empty = dict.fromkeys(("mean", "sd", "low", "high", "q2"), np.nan)
            return {**empty, "trusted": False, **cases, **counts}
        chaos = fit(self._basis, self._values, values)
        most = 100.0 if SHARED in name[1] else np.inf
        low, high = np.clip(np.quantile(chaos.sample, BAND), 0.0, most)  # it is a magnitude
        self._add(name, self._explained(chaos))
        return {
            "mean": chaos.mean, "sd": chaos.sd, "low": low, "high": high, "q2": chaos.q2,
            "trusted": chaos.trusted, **cases, **counts,
        }  # fmt: skip

    def _add(self, name: Key, shares: Shares) -> None:
        joint = self._group.joint
        rank = np.empty(len(joint.names), dtype=int)
        rank[shares.order] = np.arange(1, len(rank) + 1)
        columns = dict(zip(NUMBER, (*self._group.base, *name), strict=True))
        self._shares.append(
            pd.DataFrame(
                {
                    **columns,
                    "input": joint.names,
                    "first": shares.first,
                    "total": shares.total,
                    "rank": rank,
                    "correlated": joint.dependent,
                }
            )
        )

    def pressure(self) -> pd.DataFrame:
        """Return the contact pressure around the limb, with its band."""
        if not self._enough:
            return pd.DataFrame()
        fields = np.array([_around(self._contact[key]) for key in self._keys])
        found = fit_field(self._basis, self._values, fields)
        self._add(("skin", AROUND), self._explained.of(found.chaos))
        low, median, high = np.maximum(found.band, 0.0)
        own = self._contact.get(self._group.base)
        return pd.DataFrame(
            {
                **dict(zip(KEY, self._group.base, strict=True)),
                "angle_deg": ANGLES_DEG,
                "nominal_kPa": np.nan if own is None else _around(own),
                "mean_kPa": found.mean,
                "low_kPa": low,
                "median_kPa": median,
                "high_kPa": high,
                "q2": found.q2,
                "trusted": found.q2 >= TRUSTED,
            }
        )

    def shares(self) -> pd.DataFrame:
        """Return what each input explains of each quantity; call after the others."""
        return pd.concat(self._shares, ignore_index=True) if self._shares else pd.DataFrame()


def _magnitudes(rows: pd.DataFrame) -> "pd.Series[float]":
    """Return the magnitude of each quantity: a sign that changes with its site is no number."""
    return rows.set_index(["tissue", "quantity"]).value.abs()


def _around(rows: pd.DataFrame) -> Array:
    """Return the running mean of a case's contact pressure at `ANGLES_DEG`, kPa."""
    line = ContactLine.from_table(rows)
    return np.interp(ANGLES_DEG, line.angle_deg, line.running_mean_kPa, period=360.0)
