"""The answer in a few lines, computed from the numbers: what a reader should take home."""

from collections.abc import Iterable

import numpy as np
import pandas as pd

from calfsocket.postprocess.quantities import SUMMARY_TISSUES
from calfsocket.report import names
from calfsocket.report.chapters import Line
from calfsocket.report.findings import Findings
from calfsocket.report.table import change, listed, number
from calfsocket.simulation.results import Results

MERGING, TRUST = "Merging fascia and muscle", "How far to trust it"
"""Topics that guests add to."""

SECTORS = (
    "lateral", "anterolateral", "anterior", "anteromedial",
    "medial", "posteromedial", "posterior", "posterolateral",
)  # fmt: skip
"""Eighths of the turn about the section's origin, counter-clockwise from +x; a right leg."""

MOST_NAMED = 4
"""Sockets that one sentence names."""


def sector(x_mm: float, y_mm: float) -> str:
    """Return the side of the limb on which a site lies."""
    angle = np.degrees(np.arctan2(y_mm, x_mm))
    return SECTORS[round(angle / 45) % 8]


def answer(findings: Findings) -> list[Line]:
    """Return what the sockets do to the limb, as far as the study's cases show it."""
    results, changes = findings.results, findings.changes
    lines = [_contact(results), *(_tissue(results, tissue) for tissue in SUMMARY_TISSUES)]
    if len(changes):
        lines += [_merging_and_pressure(changes), _merging_and_tissues(results, changes)]
    lines += [_damage(findings), _stability(results)]
    return [line for line in lines if line.text]


def joined(lines: Iterable[Line], more: Iterable[Line]) -> list[Line]:
    """Add lines to those of the same topic, or at the end; keep numbers and units together."""
    texts: dict[str, str] = {}
    for line in [*lines, *more]:
        texts[line.topic] = f"{texts.get(line.topic, '')} {line.text}".strip()
    return [Line(topic, _tie_units(text)) for topic, text in texts.items()]


def _tie_units(text: str) -> str:
    """Keep numbers and their units on one line."""
    for unit in ("%", "kPa"):
        text = text.replace(f" {unit}", f"\N{NO-BREAK SPACE}{unit}")
    return text


def _reference(results: Results) -> str:
    """Return the set that tissues are described with: Separate, where fascia is itself."""
    return results.material_sets[0]


def _contact(results: Results) -> Line:
    material_set = _reference(results)
    peaks = results.summary[
        (results.summary.material_set == material_set)
        & (results.summary.quantity == "contact_pressure_max")
    ]
    means = pd.Series(
        {
            socket: results.value(socket, material_set, "skin", "contact_pressure_mean")
            for socket in peaks.socket
        }
    )
    if len(peaks) <= MOST_NAMED:
        average = f"{listed(means.map(number))} kPa in {listed(peaks.socket)}"
        largest = listed(
            f"{number(row.value)} kPa ({sector(row.x_mm, row.y_mm)})" for row in peaks.itertuples()
        )
    else:
        lowest, highest = (
            f"{number(means[socket])} kPa in {socket}"
            for socket in (means.idxmin(), means.idxmax())
        )
        average = f"{lowest} to {highest}, of {len(peaks)} sockets"
        worst = peaks.loc[peaks.value.idxmax()]
        where = sector(worst.x_mm, worst.y_mm)
        largest = f"{number(worst.value)} kPa in {worst.socket} ({where})"
    return Line(
        "Contact pressure",
        f"On average {average}; at most {largest} "
        f"({names.material_set(material_set)} set; the leg bears no weight).",
    )


def _tissue(results: Results, tissue: str) -> Line:
    """Return in which socket and where a tissue is loaded most."""
    summary = results.summary
    rows = summary[(summary.material_set == _reference(results)) & (summary.tissue == tissue)]
    most = [
        found.loc[found.value.abs().idxmax()]
        for quantity in ("effective_stress", "shear_log_strain")
        if (found := rows[rows.quantity == quantity]).value.notna().any()
    ]
    same = len({row.socket for row in most}) == 1
    parts = []
    for row in most:
        where = [] if same else [row.socket]
        if tissue not in row.region:  # "deep_fascia" adds nothing to "fascia"
            where.append(names.region(row.region))
        where.append(sector(row.x_mm, row.y_mm))
        value = f"{names.QUANTITIES[row.quantity]} {number(abs(row.value))} {row.unit}"
        parts.append(f"{value} ({', '.join(where)})")
    if not parts:
        return Line("", "")
    socket = f" in {most[0].socket}" if same else ""
    return Line(names.TISSUES[tissue].capitalize(), f"Loaded most{socket}: {listed(parts)}.")


def _merging_and_pressure(changes: pd.DataFrame) -> Line:
    both = changes[changes.site == "max_both"].set_index(["quantity", "socket"])
    mean = both.relative_change_pct["contact_pressure_mean"]
    largest = both.relative_change_pct["contact_pressure_max"]
    return Line(
        MERGING,
        f"Changes the mean contact pressure by {listed(map(change, mean))} % "
        f"and the largest by {listed(map(change, largest))} % in {listed(mean.index)}.",
    )


def _merging_and_tissues(results: Results, changes: pd.DataFrame) -> Line:
    """Return how the tissues' largest values change, and which tissue has the largest of all."""
    both = changes[changes.site == "max_both"].set_index(["tissue", "quantity"]).sort_index()
    parts = []
    for tissue in ("fascia", "muscle"):
        stress, strain = (
            _range(both.magnitude_change_pct[tissue, quantity])
            for quantity in ("effective_stress", "shear_log_strain")
        )
        parts.append(f"{names.TISSUES[tissue]}: stress {stress} %, shear strain {strain} %")
    moves = []
    for quantity in ("effective_stress", "shear_log_strain"):
        before, after = (_most_loaded(results, name, quantity) for name in names.SETS)
        move = f"stays in {before}" if before == after else f"moves from {before} to {after}"
        moves.append(f"the largest {names.QUANTITIES[quantity]} {move}")
    return Line(
        "Merging and the tissues",
        f"In magnitude, {'; '.join(parts)}. Of all tissues, {listed(moves)}.",
    )


def _most_loaded(results: Results, material_set: str, quantity: str) -> str:
    """Return the tissue with the largest magnitude of a quantity, over all sockets."""
    summary = results.summary
    rows = summary[(summary.material_set == material_set) & (summary.quantity == quantity)]
    return names.TISSUES[rows.tissue[rows.value.abs().idxmax()]]


def _damage(findings: Findings) -> Line:
    parts = []
    for threshold in findings.thresholds.all[:2]:
        tissue, quantity, limit = threshold.tissue, threshold.quantity, threshold.value
        table = findings.damage
        rows = table[(table.tissue == tissue) & (table.quantity == quantity)]
        what = f"{limit:g} % {names.QUANTITIES[quantity]} in {names.TISSUES[tissue]}"
        beyond = [
            f"{row.socket} {names.material_set(row.material_set)} ({number(row.level_pct)} %, "
            f"{number(row.area_share_pct)} % of the tissue)"
            for row in rows[rows.level_pct > limit].itertuples()
        ]
        parts.append(f"{what} is exceeded in {listed(beyond) or 'no run'}")
    return Line("Damage thresholds", f"{listed(parts, comma=True)}.")


def _stability(results: Results) -> Line:
    modes = {
        record.name: record.checks.negative_modes
        for record in results.records.values()
        if record.checks
    }
    unstable = [f"{name} ({n})" for name, n in modes.items() if n]
    text = "Every result is a stable equilibrium (no negative modes)."
    if unstable:
        text = f"Not every result is a stable equilibrium: negative modes in {listed(unstable)}."
    return Line(TRUST, text)


def _range(values: pd.Series) -> str:
    low, high = change(values.min()), change(values.max())
    return low if low == high else f"{low} to {high}"
