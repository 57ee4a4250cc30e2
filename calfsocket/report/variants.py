"""A study under the choices that the paper leaves open: what is robust, what hangs on a choice.

Ratios are of magnitudes, a variant's over the base's, of outcomes of the same socket and material
set; an outcome of a tissue in one set is summed up by the median over sockets, and their range.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from calfsocket.io.errors import InputError
from calfsocket.report import names
from calfsocket.report.damage import Thresholds
from calfsocket.report.results import RUN_FILE, VARIANTS_FOLDER, Results, read_results
from calfsocket.report.scoreboard import FAILS, HOLDS, UNCHECKED, counts, scoreboard
from calfsocket.report.table import Table, number, spread
from calfsocket.report.tables import TIMES

BASE = "base"

ROBUST = 1.1
"""An outcome whose median moves by no more than this factor is called robust."""

MARKS = {HOLDS: "\N{CHECK MARK}", FAILS: "\N{MULTIPLICATION SIGN}", UNCHECKED: "?"}

_CASE = ["socket", "material_set"]
_OUTCOME = ["tissue", "outcome"]
_ROW = [*_OUTCOME, "material_set"]


@dataclass(frozen=True)
class Variants:
    """Results of the base and its variants, the base first, and why others cannot be read."""

    folder: Path
    results: dict[str, Results]
    left_out: dict[str, str]


def read_variants(folder: Path) -> Variants:
    """Read all variants of a study from its folder.

    Raises
    ------
    InputError
        When the folder has no variants, or the base cannot be read.
    """
    folder = Path(folder) / VARIANTS_FOLDER
    found = sorted(path.parent.name for path in folder.glob(f"*/{RUN_FILE}"))
    if BASE not in found:
        raise InputError(f"{folder}: holds no {BASE}; solve the study with --variants first")
    results, left_out = {BASE: read_results(folder / BASE)}, {}
    for name in found:
        try:
            results.setdefault(name, read_results(folder / name))
        except InputError as error:
            left_out[name] = str(error)
    return Variants(folder, results, left_out)


def choices(variants: Variants, boards: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Tell what each variant changes, how many cases it solved, and its scoreboard's counts."""
    base = _settings(variants.results[BASE])
    rows = []
    for name, results in variants.results.items():
        settings = _settings(results)
        changed = {key: value for key, value in settings.items() if value != base[key]}
        cases = results.run["cases"].values()
        rows.append(
            {
                "variant": name,
                "choice": ", ".join(f"{key} {value}" for key, value in changed.items())
                or ", ".join(f"{key} {base[key]}" for key in _CHOICES),
                "cases": len(results.cases),
                "unstable_cases": sum(bool(case.get("negative_modes")) for case in cases),
                **counts(boards[name]),
            }
        )
    return pd.DataFrame(rows)


_CHOICES = ("socket_support", "fascia_c10", "friction", "ogden_form")


def _settings(results: Results) -> dict[str, Any]:
    settings = results.run["inputs"]["settings"]
    return {key: (settings | settings["contact"])[key] for key in _CHOICES}


def claims(boards: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Verdict on each claim under each variant; `same` says whether all agree."""
    board = boards[BASE][["id", "kind", "claim"]].copy()
    verdicts = pd.DataFrame({name: board_.verdict for name, board_ in boards.items()})
    return board.join(verdicts).assign(same=verdicts.nunique(axis=1) == 1)


def outcomes(variants: Variants) -> pd.DataFrame:
    """Every outcome of the summary under each variant, beside the base's; one row each."""
    key = [*_CASE, *_OUTCOME]
    base = variants.results[BASE].summary.set_index(key).value
    parts = []
    for name, results in variants.results.items():
        rows = results.summary.join(base.rename("base"), on=key, how="inner")
        parts.append(rows[[*key, "unit", "value", "base"]].assign(variant=name))
    table = pd.concat(parts, ignore_index=True)
    return table.assign(
        ratio=(table.value / table.base.where(table.base != 0)).abs(),
        sign_flip=table.value * table.base < 0,
    )


def dependence(table: pd.DataFrame) -> pd.DataFrame:
    """Sum `outcomes` up: how much each choice moves each outcome of a tissue.

    Returns
    -------
    DataFrame
        One row a tissue, outcome, material set and variant other than the base: median, low and
        high of the ratio over sockets, and `robust`: whether the median is within `ROBUST` of 1.
    """
    rows = []
    changed = table[(table.variant != BASE)].dropna(subset="ratio")
    for key, group in changed.groupby([*_ROW, "variant"], sort=False):
        median = group.ratio.median()
        rows.append(
            {
                **dict(zip([*_ROW, "variant"], key, strict=True)),
                "median": median,
                "low": group.ratio.min(),
                "high": group.ratio.max(),
                "robust": 1 / ROBUST <= median <= ROBUST,
            }
        )
    return pd.DataFrame(rows)


def build(variants: Variants, thresholds: Thresholds | None = None) -> list[Table]:
    """Make the tables: variants, claims_by_variant, dependence."""
    boards = {name: scoreboard(results, thresholds) for name, results in variants.results.items()}
    return [
        _choices_table(variants, choices(variants, boards)),
        _claims_table(claims(boards)),
        _dependence_table(dependence(outcomes(variants))),
    ]


def _choices_table(variants: Variants, data: pd.DataFrame) -> Table:
    shown = data.rename(columns={"unstable_cases": "unstable cases"}).set_index("variant")
    return Table(
        "variants",
        "Choices that the paper leaves open",
        "One choice is changed at a time, so that a difference from the base has one cause; all "
        "combinations would be 16 studies and tell little more. The one combination is that where "
        "both choices act on peaks. Unstable: an equilibrium with negative modes.",
        data,
        shown.map(str),
        tuple(f"{name} is left out: {why}" for name, why in variants.left_out.items()),
    )


def _claims_table(data: pd.DataFrame) -> Table:
    open_ = data[~data.same]
    verdicts = [name for name in data.columns if name not in ("id", "kind", "claim", "same")]
    shown = open_.set_index("id")[["claim", *verdicts]].replace(dict.fromkeys(verdicts, MARKS))
    return Table(
        "claims_by_variant",
        "Claims whose verdict depends on a choice",
        f"{MARKS[HOLDS]} holds, {MARKS[FAILS]} does not hold, {MARKS[UNCHECKED]} cannot be "
        f"checked. The other {int(data.same.sum())} of {len(data)} claims have the same verdict "
        "under every choice; the CSV file has them all.",
        data,
        shown,
    )


def _dependence_table(data: pd.DataFrame) -> Table:
    text = pd.Series(
        [
            f"{TIMES}{number(row.median)} ({number(row.low)} to {number(row.high)})"
            + ("" if row.robust else " *")
            for row in data.itertuples()
        ],
        index=data.index,
        dtype=object,
    )
    words = data.assign(
        tissue=data.tissue.map(names.TISSUES),
        outcome=data.outcome.map(names.OUTCOMES),
        material_set=data.material_set.map(names.SETS),
    )
    known = words.outcome.notna()
    return Table(
        "dependence",
        "Which outcome depends on which choice",
        "Magnitude under the choice over that of the base: median over sockets, and range. *: the "
        f"median moves by more than {100 * (ROBUST - 1):.0f} %. C10 of fascia does not enter "
        "Combined.",
        data,
        spread(words[known], _ROW, ["variant"], text[known]),
    )
