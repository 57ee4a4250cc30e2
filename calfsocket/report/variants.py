"""A study and its variants: what is robust, what hangs on a choice.

The base is what the study file says; a variant changes some of its parameters. Ratios are of
magnitudes, a variant's over the base's, of quantities of the same socket and material set; a
quantity of a tissue in one set is summed up by the median over sockets, and their range.
"""

from collections.abc import Mapping

import pandas as pd

from calfsocket.postprocess.levels import BELOW, NEARLY_ALL
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
NEXT = f"_{BELOW[-2]}"
NEARLY = f"_{NEARLY_ALL}"
"""Ends of the names of the level of nearly all, and of the one next to it."""
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

    Those of the summary, and levels by area (`with_levels`). Where cases have second meshes,
    `ratio_mesh_error` is by the change of the ratio itself: errors of two cases on one mesh are
    alike. As everywhere, that of a level is by the largest change among itself and the next one.
    """
    table = _beside_base({name: _numbers(each.summary, each.levels) for name, each in of.items()})
    is_next = table["quantity"].str.endswith(NEXT)
    second = {name: _on_second_meshes(each) for name, each in of.items()}
    if any(map(len, second.values())) and len(second[BASE]):
        other = _beside_base({name: rows for name, rows in second.items() if len(rows)})
        row = [*KEY, "tissue", "quantity", "variant"]
        both = table.merge(other[[*row, "ratio", "times"]], "left", row, suffixes=("", "_second"))
        error = both.times * (both.ratio - both.ratio_second).abs()
        level = both["quantity"].where(~is_next, both["quantity"].str.removesuffix(NEXT) + NEARLY)
        groups = [both[name] if name != "quantity" else level for name in row]
        table[error_of("ratio")] = error.groupby(groups).transform("max")
    return table[~is_next].reset_index(drop=True)


def _numbers(summary: pd.DataFrame, levels: pd.DataFrame) -> pd.DataFrame:
    rows = with_levels(summary, levels), with_levels(summary.iloc[:0], levels, BELOW[-2])
    return pd.concat([each for each in rows if len(each)], ignore_index=True)


def _on_second_meshes(results: Results) -> pd.DataFrame:
    """Return the numbers of cases that have a second mesh, and `times` their changes count."""
    parts = []
    for key, record in results.records.items():
        result = results[key] if record.has_second_mesh else None
        if result is not None and result.second is not None:
            rows = _numbers(result.second.summary(), result.second.levels())
            parts.append(of_case(rows, record, key).assign(times=result.times_change))
    return pd.concat(parts) if parts else pd.DataFrame()


def _beside_base(numbers: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    key = [*KEY, "tissue", "quantity"]
    base = numbers[BASE].set_index(key).value.rename("base")
    columns = [*key, "unit", "value", "base", *(["times"] if "times" in numbers[BASE] else [])]
    parts = [
        rows.join(base, on=key, how="inner")[columns].assign(variant=variant)
        for variant, rows in numbers.items()
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
        Where cases have second meshes, each of the three has a column with its mesh error: by how
        much it moves where all ratios move by theirs, one way or the other.
    """
    changed = table[table.variant != BASE].dropna(subset="ratio")
    found = _statistics(changed)
    if error_of("ratio") in table:
        error = changed[error_of("ratio")]
        moved = [
            _statistics(changed.assign(ratio=changed.ratio + side * error)) for side in (-1, 1)
        ]
        known = error.notna().groupby([changed[name] for name in _GROUP], sort=False).all()
        for name in _STATISTICS:
            ends = [(each[name] - found[name]).abs() for each in moved]
            found[error_of(name)] = ends[0].combine(ends[1], max).where(known)
    return found.reset_index().assign(robust=found["median"].between(1 / ROBUST, ROBUST).to_numpy())


def _statistics(changed: pd.DataFrame) -> pd.DataFrame:
    ratios = changed.groupby(_GROUP, sort=False).ratio
    return ratios.agg(median="median", low="min", high="max")


def tables(study: Results) -> list[Table]:
    """Return the tables of variants and of what depends on them; none without variants."""
    of = variants(study)
    if not of:
        return []
    return [_variants_table(of), _dependence_table(dependence(quantities(of)))]


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
