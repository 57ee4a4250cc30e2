"""The answer in ten lines, computed from the numbers: what a reader should take home."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from calfsocket.outcomes import SUMMARY_TISSUES
from calfsocket.report import names, published
from calfsocket.report.changes import relative_changes
from calfsocket.report.damage import Thresholds, damage
from calfsocket.report.results import Results
from calfsocket.report.scoreboard import counts
from calfsocket.report.table import change, number

SECTORS = (
    "lateral", "anterolateral", "anterior", "anteromedial",
    "medial", "posteromedial", "posterior", "posterolateral",
)  # fmt: skip
"""Eighths of the turn about the section's origin, counter-clockwise from +x; a right leg."""


@dataclass(frozen=True)
class Line:
    """A line of the answer: what it is about, and the sentence."""

    topic: str
    text: str


def sector(x_mm: float, y_mm: float) -> str:
    """Name the side of the limb on which a site lies."""
    angle = np.degrees(np.arctan2(y_mm, x_mm))
    return SECTORS[round(angle / 45) % 8]


def answer(
    results: Results, board: pd.DataFrame, thresholds: Thresholds | None = None
) -> list[Line]:
    """Say in ten lines what the sockets do to the limb.

    Parameters
    ----------
    results : Results
        Of a study; what a study of fewer cases cannot tell is left out.
    board : DataFrame
        The scoreboard.
    thresholds : Thresholds, optional
        Damage thresholds, the paper's by default.
    """
    changes = relative_changes(results)
    lines = [_contact(results), *(_tissue(results, tissue) for tissue in SUMMARY_TISSUES)]
    if len(changes):
        lines += [_merging_and_pressure(changes), _merging_and_tissues(changes)]
    lines += [_damage(results, thresholds or Thresholds()), _trust(results, board)]
    return [line for line in lines if line.text]


def _reference(results: Results) -> str:
    """Give the set that tissues are described with: Separate, where fascia is itself."""
    return results.material_sets[0]


def _contact(results: Results) -> Line:
    material_set = _reference(results)
    parts = []
    rows = results.summary[results.summary.material_set == material_set]
    at = rows.set_index(["outcome", "socket"])
    for socket in rows.socket.unique():
        largest = at.loc[("contact_pressure_max", socket)]
        mean = at.value[("contact_pressure_mean", socket)]
        place = sector(largest.x_mm, largest.y_mm)
        parts.append(f"{socket} {number(mean)} kPa, at most {number(largest.value)} ({place})")
    return Line(
        "The sockets", f"press the skin on average with {'; '.join(parts)} "
        f"({names.SETS[material_set]} set, no weight on the leg)."
    )  # fmt: skip


def _tissue(results: Results, tissue: str) -> Line:
    """Say in which socket and where a tissue is loaded most."""
    material_set = _reference(results)
    summary = results.summary
    rows = summary[(summary.material_set == material_set) & (summary.tissue == tissue)]
    parts = []
    for outcome in ("effective_stress", "shear_log_strain"):
        of_outcome = rows[rows.outcome == outcome]
        if of_outcome.value.isna().all():
            continue
        most = of_outcome.loc[of_outcome.value.abs().idxmax()]
        where = sector(most.x_mm, most.y_mm)
        if most.region != tissue:
            where = f"{names.region(most.region)}, {where}"
        parts.append(
            f"{names.OUTCOMES[outcome]} {number(abs(most.value))} {most.unit} "
            f"in {most.socket} ({where})"
        )
    if not parts:
        return Line("", "")
    name = names.TISSUES[tissue]
    text = f"is loaded most by {' and by '.join(parts)}."
    if name.endswith("s"):
        text = text.replace("is loaded", "are loaded", 1)
    return Line(name.capitalize(), text)


def _merging_and_pressure(changes: pd.DataFrame) -> Line:
    both = changes[changes.site == "max_both"].set_index(["outcome", "socket"])
    mean = both.relative_change_pct["contact_pressure_mean"]
    largest = both.relative_change_pct["contact_pressure_max"]
    printed = published.pressure().set_index(["outcome", "socket"]).printed
    paper = [printed.get(("contact_pressure_max", socket), np.nan) for socket in largest.index]
    text = (
        f"changes the mean contact pressure by {_list(mean)} % "
        f"and the largest by {_list(largest)} % ({', '.join(mean.index)}"
    )
    if np.isfinite(paper).all():
        text += f"; the paper has {_list(paper)} % for the largest"
    return Line("Merging fascia and muscle", f"{text}).")


def _merging_and_tissues(changes: pd.DataFrame) -> Line:
    """Say how stress and strain of muscle and fascia change in magnitude, over the sockets."""
    both = changes[changes.site == "max_both"]
    parts = []
    for tissue in ("fascia", "muscle"):
        ranges = []
        for outcome, word in (("effective_stress", "stress"), ("shear_log_strain", "shear strain")):
            rows = both[(both.tissue == tissue) & (both.outcome == outcome)]
            ranges.append(f"{word} by {_range(rows.magnitude_change_pct)} %")
        parts.append(f"the {names.TISSUES[tissue]}'s largest {' and '.join(ranges)}")
    return Line("It also changes", f"in magnitude {'; '.join(parts)}.")


def _damage(results: Results, thresholds: Thresholds) -> Line:
    table = damage(results, thresholds)
    parts = []
    for tissue, outcome, limit in (
        ("muscle", "shear_log_strain", thresholds.muscle_shear_pct),
        ("fascia", "amp_log_strain", thresholds.fascia_strain_pct),
    ):
        rows = table[(table.tissue == tissue) & (table.outcome == outcome)]
        beyond = rows[rows.level_pct > limit]
        what = f"{limit:g} % {names.OUTCOMES[outcome]} in {names.TISSUES[tissue]}"
        if beyond.empty:
            parts.append(f"no run exceeds {what}")
            continue
        runs = [
            f"{row.socket} {names.SETS[row.material_set]} ({number(row.level_pct)} %, "
            f"{number(row.area_share_pct)} % of the tissue)"
            for row in beyond.itertuples()
        ]
        parts.append(f"{what} is exceeded in {', '.join(runs)}")
    return Line("Damage thresholds", f"{'; '.join(parts)}.")


def _trust(results: Results, board: pd.DataFrame) -> Line:
    cases = results.run["cases"]
    modes = {"_".join(key): cases["_".join(key)].get("negative_modes") for key in results.cases}
    unstable = [f"{name} ({n})" for name, n in modes.items() if n]
    unknown = [name for name, n in modes.items() if n is None]
    if unstable:
        text = f"not every result is a stable equilibrium: negative modes in {', '.join(unstable)}"
    elif unknown:
        text = f"stability was not counted in {', '.join(unknown)}"
    else:
        text = "every result is a stable equilibrium (no negative modes)"
    tally = counts(board)
    total = sum(tally.values())
    text += f"; of {total} claims of the paper " + ", ".join(
        f"{n} {verdict.replace('does not', 'do not') if n != 1 else verdict}"
        for verdict, n in tally.items()
    ).replace(" holds", " hold")
    return Line("How far to trust it", f"{text}.")


def _list(values: pd.Series | list[float]) -> str:
    return ", ".join(change(value) for value in values)


def _range(values: pd.Series) -> str:
    low, high = change(values.min()), change(values.max())
    return low if low == high else f"{low} to {high}"
