"""A study and its variants: what is robust, what hangs on a choice.

The base is what the study file says; a variant changes some of its parameters. Ratios are of
magnitudes, a variant's over the base's, of quantities of the same socket and material set; a
quantity of a tissue in one set is summed up by the median over sockets, and their range.
"""

from collections.abc import Mapping

import pandas as pd

from calfsocket.report.table import Table, in_words, spread
from calfsocket.report.words import TIMES, number
from calfsocket.simulation.record import CaseRecord
from calfsocket.simulation.results import KEY, Results

BASE = "base"

ROBUST = 1.1
"""A quantity whose median moves by no more than this factor is called robust."""

_ROW = ["tissue", "quantity", "material_set"]


def variants(study: Results) -> dict[str, Results]:
    """Return the results of the base and of each variant by name, the base first.

    Empty where a study has no base or nothing beside it, as a sweep of a grid.
    """
    if study.run and "uncertainty" in study.run.study.content:
        return {}  # a design is not told case by case
    base = study.select({})
    found = {} if not base else {BASE: base}
    for record in study.records.values():
        if record.changes and base:
            found.setdefault(name(record), study.select(record.changes))
    return found if len(found) > 1 else {}


def name(record: CaseRecord) -> str:
    """Return the name of a case's variant: the label in its names, or its changes."""
    pairs = zip(record.key, record.base, strict=True)
    labels = dict.fromkeys(each.removeprefix(base).removeprefix("@") for each, base in pairs)
    return "@".join(filter(None, labels)) or changes_of(record)


def changes_of(record: CaseRecord) -> str:
    """Return what a case changes, in words; empty for the base."""
    return ", ".join(f"{parameter} = {value}" for parameter, value in record.changes.items())


def quantities(of: Mapping[str, Results]) -> pd.DataFrame:
    """Every quantity of the summary under each variant, beside the base's; one row each."""
    key = [*KEY, "tissue", "quantity"]
    base = of[BASE].summary.set_index(key).value.rename("base")
    parts = [
        results.summary.join(base, on=key, how="inner")[[*key, "unit", "value", "base"]].assign(
            variant=variant
        )
        for variant, results in of.items()
    ]
    table = pd.concat(parts, ignore_index=True)
    return table.assign(
        ratio=(table.value / table.base.where(table.base != 0)).abs(),
        sign_flip=table.value * table.base < 0,
    )


def dependence(table: pd.DataFrame) -> pd.DataFrame:
    """Sum `quantities` up: how much each variant moves each quantity of a tissue.

    Returns
    -------
    DataFrame
        One row a tissue, quantity, material set and variant other than the base: median, low and
        high of the ratio over sockets, and `robust`: whether the median is within `ROBUST` of 1.
    """
    changed = table[table.variant != BASE].dropna(subset="ratio")
    ratios = changed.groupby([*_ROW, "variant"], sort=False).ratio
    found = ratios.agg(median="median", low="min", high="max").reset_index()
    return found.assign(robust=found["median"].between(1 / ROBUST, ROBUST))


def tables(study: Results) -> list[Table]:
    """Return the tables of variants and of what depends on them; none without variants."""
    of = variants(study)
    return [_variants_table(of), _dependence_table(dependence(quantities(of)))] if of else []


def _variants_table(of: Mapping[str, Results]) -> Table:
    rows = []
    for variant, results in of.items():
        records = [*results.records.values()]
        unstable = sum(bool(each.checks and each.checks.negative_modes) for each in records)
        rows.append((variant, changes_of(records[0]), len(records), unstable))
    data = pd.DataFrame(rows, columns=["variant", "changes", "cases", "unstable_cases"])
    shown = data.rename(columns={"unstable_cases": "unstable cases"}).set_index("variant")
    return Table("variants", data, shown.map(str))


def _dependence_table(data: pd.DataFrame) -> Table:
    text = [
        f"{TIMES}{number(row.median)} ({number(row.low)} to {number(row.high)})"
        + ("" if row.robust else " *")
        for row in data.itertuples()
    ]
    return Table("dependence", data, spread(in_words(data), _ROW, ["variant"], text))
