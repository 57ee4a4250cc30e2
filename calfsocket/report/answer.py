"""The answer in ten lines, computed from the numbers: what a reader should take home."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import pandas as pd

from calfsocket.postprocess.quantities import SUMMARY_TISSUES
from calfsocket.report import comparison, names, published
from calfsocket.report.changes import relative_changes
from calfsocket.report.damage import Thresholds, damage
from calfsocket.report.results import Results
from calfsocket.report.scoreboard import PLURAL, counts
from calfsocket.report.table import change, number

SECTORS = (
    "lateral", "anterolateral", "anterior", "anteromedial",
    "medial", "posteromedial", "posterior", "posterolateral",
)  # fmt: skip
"""Eighths of the turn about the section's origin, counter-clockwise from +x; a right leg."""

MOST_NAMED = 4
"""Sockets that one sentence names."""


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
    changes = relative_changes(results.of_paper or results)
    lines = [_contact(results), *(_tissue(results, tissue) for tissue in SUMMARY_TISSUES)]
    if len(changes):
        lines += [_merging_and_pressure(changes), _merging_and_tissues(results, changes)]
    lines += [_damage(results, thresholds or Thresholds()), _trust(results, board)]
    return [Line(line.topic, _tie_units(line.text)) for line in lines if line.text]


def _tie_units(text: str) -> str:
    """Keep numbers and their units on one line."""
    for unit in ("%", "kPa"):
        text = text.replace(f" {unit}", f"\N{NO-BREAK SPACE}{unit}")
    return text


def _reference(results: Results) -> str:
    """Give the set that tissues are described with: Separate, where fascia is itself."""
    return results.material_sets[0]


def _contact(results: Results) -> Line:
    material_set = _reference(results)
    peaks = results.summary[
        (results.summary.material_set == material_set)
        & (results.summary.outcome == "contact_pressure_max")
    ]
    means = pd.Series(
        {
            socket: results.value(socket, material_set, "skin", "contact_pressure_mean")
            for socket in peaks.socket
        }
    )
    if len(peaks) > MOST_NAMED:
        return _contact_of_many(peaks, means, material_set)
    largest = [
        f"{number(row.value)} kPa ({sector(row.x_mm, row.y_mm)})" for row in peaks.itertuples()
    ]
    average = _and(means.map(number))
    return Line(
        "Contact pressure",
        f"On average {average} kPa in {_and(peaks.socket)}; at most {_and(largest)} "
        f"({names.material_set(material_set)} set; the leg bears no weight).",
    )


def _contact_of_many(peaks: pd.DataFrame, means: pd.Series, material_set: str) -> Line:
    """Say the range over sockets that are too many to name."""
    lowest, highest = means.idxmin(), means.idxmax()
    worst = peaks.loc[peaks.value.idxmax()]
    return Line(
        "Contact pressure",
        f"On average {number(means[lowest])} kPa in {lowest} to {number(means[highest])} kPa in "
        f"{highest}, of {len(peaks)} sockets; at most {number(worst.value)} kPa in {worst.socket} "
        f"({sector(worst.x_mm, worst.y_mm)}) ({names.material_set(material_set)} set; the leg "
        "bears no weight).",
    )


def _tissue(results: Results, tissue: str) -> Line:
    """Say in which socket and where a tissue is loaded most."""
    summary = results.summary
    rows = summary[(summary.material_set == _reference(results)) & (summary.tissue == tissue)]
    most = [
        of_outcome.loc[of_outcome.value.abs().idxmax()]
        for outcome in ("effective_stress", "shear_log_strain")
        if (of_outcome := rows[rows.outcome == outcome]).value.notna().any()
    ]
    same = len({row.socket for row in most}) == 1
    parts = []
    for row in most:
        where = [] if same else [row.socket]
        if tissue not in row.region:  # "deep_fascia" tells no more than "fascia"
            where.append(names.region(row.region))
        where.append(sector(row.x_mm, row.y_mm))
        value = f"{names.OUTCOMES[row.outcome]} {number(abs(row.value))} {row.unit}"
        parts.append(f"{value} ({', '.join(where)})")
    if not parts:
        return Line("", "")
    socket = f" in {most[0].socket}" if same else ""
    return Line(names.TISSUES[tissue].capitalize(), f"Loaded most{socket}: {_and(parts)}.")


def _merging_and_pressure(changes: pd.DataFrame) -> Line:
    both = changes[changes.site == "max_both"].set_index(["outcome", "socket"])
    mean = both.relative_change_pct["contact_pressure_mean"]
    largest = both.relative_change_pct["contact_pressure_max"]
    printed = published.pressure().set_index(["outcome", "socket"]).printed
    paper = [printed.get(("contact_pressure_max", socket), np.nan) for socket in largest.index]
    text = (
        f"Changes the mean contact pressure by {_and(map(change, mean))} % "
        f"and the largest by {_and(map(change, largest))} % in {_and(mean.index)}"
    )
    if np.isfinite(paper).all():
        text += f" (the paper, the largest: {_and(map(change, paper))} %)"
    return Line("Merging fascia and muscle", f"{text}.")


def _merging_and_tissues(results: Results, changes: pd.DataFrame) -> Line:
    """Say how the tissues' largest values change in magnitude, and which tissue has the largest."""
    both = changes[changes.site == "max_both"].set_index(["tissue", "outcome"]).sort_index()
    parts = []
    for tissue in ("fascia", "muscle"):
        stress, strain = (
            _range(both.magnitude_change_pct[tissue, outcome])
            for outcome in ("effective_stress", "shear_log_strain")
        )
        parts.append(f"{names.TISSUES[tissue]}: stress {stress} %, shear strain {strain} %")
    moves = []
    for outcome in ("effective_stress", "shear_log_strain"):
        before, after = (_most_loaded(results, name, outcome) for name in names.SETS)
        move = f"stays in {before}" if before == after else f"moves from {before} to {after}"
        moves.append(f"the largest {names.OUTCOMES[outcome]} {move}")
    return Line(
        "Merging and the tissues",
        f"In magnitude, {'; '.join(parts)}. Of all tissues, {_and(moves)}.",
    )


def _most_loaded(results: Results, material_set: str, outcome: str) -> str:
    """Name the tissue with the largest magnitude of an outcome, over all sockets."""
    summary = results.summary
    rows = summary[(summary.material_set == material_set) & (summary.outcome == outcome)]
    return names.TISSUES[rows.tissue[rows.value.abs().idxmax()]]


def _damage(results: Results, thresholds: Thresholds) -> Line:
    table = damage(results, thresholds)
    parts = []
    for tissue, outcome, limit in (
        ("muscle", "shear_log_strain", thresholds.muscle_shear_pct),
        ("fascia", "amp_log_strain", thresholds.fascia_strain_pct),
    ):
        rows = table[(table.tissue == tissue) & (table.outcome == outcome)]
        what = f"{limit:g} % {names.OUTCOMES[outcome]} in {names.TISSUES[tissue]}"
        beyond = [
            f"{row.socket} {names.material_set(row.material_set)} ({number(row.level_pct)} %, "
            f"{number(row.area_share_pct)} % of the tissue)"
            for row in rows[rows.level_pct > limit].itertuples()
        ]
        parts.append(f"{what} is exceeded in {_and(beyond) or 'no run'}")
    return Line("Damage thresholds", f"{_and(parts, comma=True)}.")


def _trust(results: Results, board: pd.DataFrame) -> Line:
    cases = results.run["cases"]
    modes = {"_".join(key): cases["_".join(key)].get("negative_modes") for key in results.cases}
    unstable = [f"{name} ({n})" for name, n in modes.items() if n]
    unknown = [name for name, n in modes.items() if n is None]
    if unstable:
        text = f"Not every result is a stable equilibrium: negative modes in {_and(unstable)}."
    elif unknown:
        text = f"Stability was not counted in {_and(unknown)}."
    else:
        text = "Every result is a stable equilibrium (no negative modes)."
    tally = counts(board)
    claims = _and(f"{tally[verdict]} {does}" for verdict, does in PLURAL.items())
    if len(board):
        text += f" Of the paper's {len(board)} claims {claims}."
    ratio = comparison.maxima(results).ratio
    if ratio.notna().any():
        low, middle, high = (number(ratio.quantile(share)) for share in (0.25, 0.5, 0.75))
        text += (
            f" Stresses and strains are {middle} times the paper's in the median, "
            f"half of them {low} to {high} times."
        )
    return Line("How far to trust it", text)


def _and(words: Iterable[str], comma: bool = False) -> str:
    """Join words to a list as one reads it."""
    *first, last = [*words] or [""]
    return f"{', '.join(first)}{',' if comma else ''} and {last}" if first else last


def _range(values: pd.Series) -> str:
    low, high = change(values.min()), change(values.max())
    return low if low == high else f"{low} to {high}"
