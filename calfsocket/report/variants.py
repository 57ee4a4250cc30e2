"""A study and its variants: what is robust, what hangs on a choice.

The base is what the study file says; a variant changes some of its parameters. Ratios are of
magnitudes, a variant's over the base's, of quantities of the same socket and material set; a
quantity of a tissue in one set is summed up by the median over sockets, and their range.
"""

from collections.abc import Mapping

import pandas as pd

from calfsocket.postprocess.mesh_error import error_of, with_levels
from calfsocket.report.table import Table, in_words, settling, spread
from calfsocket.report.words import TIMES, measured_all
from calfsocket.simulation.record import CaseRecord
from calfsocket.simulation.results import KEY, Results, of_case

BASE = "base"

ROBUST = 1.1
"""A quantity whose median moves by no more than this factor is called robust."""

MOVES = "\N{UP DOWN ARROW}"
"""Mark of one that is not."""

_ROW = ["tissue", "quantity", "material_set"]
_GROUP = [*_ROW, "variant"]
_STATISTICS = ("median", "low", "high")


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
    """Every quantity under each variant, beside the base's; one row each.

    Those of the summary, and levels by area (`with_levels`).
    """
    numbers = {name: with_levels(each.summary, each.levels) for name, each in of.items()}
    return _beside_base(numbers)


def second_quantities(of: Mapping[str, Results]) -> pd.DataFrame:
    """Return the same on second meshes, with `times` by which changes to these count.

    Of cases that have one; empty where none has.
    """
    numbers: dict[str, pd.DataFrame] = {}
    for variant, results in of.items():
        parts = []
        for key, record in results.records.items():
            result = results[key] if record.has_second_mesh else None
            if result is not None and result.second is not None:
                second = result.second
                rows = with_levels(second.summary(), second.levels())
                parts.append(of_case(rows, record, key).assign(times=result.times_change))
        numbers[variant] = pd.concat(parts) if parts else pd.DataFrame()
    if numbers[BASE].empty:
        return pd.DataFrame()
    return _beside_base({name: rows for name, rows in numbers.items() if len(rows)})


def _beside_base(numbers: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    key = [*KEY, "tissue", "quantity"]
    base = numbers[BASE].set_index(key).value.rename("base")
    more = [name for name in ("times",) if name in numbers[BASE]]
    parts = [
        rows.join(base, on=key, how="inner")[[*key, "unit", "value", "base", *more]].assign(
            variant=variant
        )
        for variant, rows in numbers.items()
    ]
    table = pd.concat(parts, ignore_index=True)
    return table.assign(
        ratio=(table.value / table.base.where(table.base != 0)).abs(),
        sign_flip=table.value * table.base < 0,
    )


def dependence(table: pd.DataFrame, second: pd.DataFrame | None = None) -> pd.DataFrame:
    """Sum `quantities` up: how much each variant moves each quantity of a tissue.

    Parameters
    ----------
    table
        That of `quantities`.
    second
        That of `second_quantities`.

    Returns
    -------
    DataFrame
        One row a tissue, quantity, material set and variant other than the base: median, low and
        high of the ratio over sockets, and `robust`: whether the median is within `ROBUST` of 1.
        Where cases have second meshes, each of the three has a column with its mesh error, by its
        own change: errors of two cases on one mesh are alike. It is empty where a case has none.
    """
    found = _summed_up(table)
    if second is None or second.empty:
        return found.reset_index()
    other = _summed_up(second).reindex(found.index)
    times = second.groupby(_GROUP, sort=False).times.max().reindex(found.index)
    times = times.where(other.cases == found.cases)
    errors = {error_of(name): times * (found[name] - other[name]).abs() for name in _STATISTICS}
    return found.assign(**errors).reset_index()


def _summed_up(table: pd.DataFrame) -> pd.DataFrame:
    changed = table[table.variant != BASE].dropna(subset="ratio")
    ratios = changed.groupby(_GROUP, sort=False).ratio
    found = ratios.agg(median="median", low="min", high="max", cases="size")
    return found.assign(robust=found["median"].between(1 / ROBUST, ROBUST))


def tables(study: Results) -> list[Table]:
    """Return the tables of variants and of what depends on them; none without variants."""
    of = variants(study)
    if not of:
        return []
    found = dependence(quantities(of), second_quantities(of))
    return [_variants_table(of), _dependence_table(found)]


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
    rows = settling(data)
    said = [measured_all(rows[name], rows, error_of(name)) for name in _STATISTICS]
    text = [
        f"{TIMES}{median} ({low} to {high})" + ("" if robust else f" {MOVES}")
        for median, low, high, robust in zip(*said, rows.robust, strict=True)
    ]
    return Table("dependence", data, spread(in_words(rows), _ROW, ["variant"], text))
