"""The report's tables: the paper's Tables 1 to 5 with our numbers, contact pressure, damage."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from calfsocket.report import comparison, names, published
from calfsocket.report import own as own_tables
from calfsocket.report.changes import relative_changes
from calfsocket.report.damage import Thresholds, damage
from calfsocket.report.results import Results
from calfsocket.report.table import Table, change, number, spread

FOLDER = "tables"

STRESSES = ("effective_stress", "shear_stress")
STRAINS = ("amp_log_strain", "shear_log_strain")

FLIP = "\N{RIGHTWARDS ARROW OVER LEFTWARDS ARROW}"
MARK = "\N{DAGGER}"
TIMES = "\N{MULTIPLICATION SIGN}"
TOGETHER = "\N{NO-BREAK SPACE}"  # a narrow cell breaks before its bracket, not within it


def build(results: Results, thresholds: Thresholds | None = None) -> list[Table]:
    """Make every table that the solved cases allow.

    Parameters
    ----------
    results : Results
        Of a study; tables of changes need a socket with both material sets.
    thresholds : Thresholds, optional
        Damage thresholds, the paper's by default.

    Returns
    -------
    list of Table
        table1 to table5, agreement, pressure, damage, in this order, where cases are the paper's;
        then those of `own`.
    """
    own = own_tables.build(results)
    damaged = _damage(results, thresholds)
    paper = results.of_paper
    if paper is None:
        return [*own, damaged]
    ours = relative_changes(paper)
    maxima, changes = comparison.maxima(paper), comparison.changes(paper, ours)
    tables = [_materials(paper), _maxima(2, "largest stresses, kPa", maxima, STRESSES)]
    if len(changes):
        tables.append(_changes(3, "relative change of stresses, %", changes, STRESSES))
    tables.append(_maxima(4, "largest logarithmic strains, %", maxima, STRAINS))
    if len(changes):
        tables.append(_changes(5, "relative change of strains, %", changes, STRAINS))
    return [*tables, _agreement(maxima), _pressure(paper, ours), damaged, *own]


def write(results: Results, tables: Sequence[Table]) -> Path:
    """Write tables into the results' folder of tables; return it."""
    folder = results.folder / FOLDER
    for table in tables:
        table.write(folder)
    return folder


def _materials(results: Results) -> Table:
    data = comparison.materials(results)
    shown = data[["material", "law", "symbol", "unit"]].assign(
        ours=[f"{value:.6g}" for value in data.ours],
        paper=[f"{value:.6g}{mark}" for value, mark in zip(data.paper, _marks(data), strict=True)],
    )
    return Table(
        "table1",
        "Table 1: material properties",
        "Parameters of the laws as solved, beside those of the paper.",
        data,
        shown.set_index("material"),
        _notes(data, "material", "symbol"),
    )


def _maxima(n: int, title: str, maxima: pd.DataFrame, outcomes: Sequence[str]) -> Table:
    data = maxima[maxima.outcome.isin(outcomes)].reset_index(drop=True)
    paper = [
        f"({number(value)}{mark},{TOGETHER}{TIMES}{number(ratio)}{FLIP if flip else ''})"
        for value, mark, ratio, flip in zip(
            data.paper, _marks(data), data.ratio, data.sign_flip, strict=True
        )
    ]
    text = pd.Series([number(value) for value in data.ours]) + " " + pd.Series(paper)
    return Table(
        f"table{n}",
        f"Table {n}: {title}",
        "Ours; in brackets the paper's, and the ratio of magnitudes, ours over the paper's. "
        f"{FLIP}: the signs differ.",
        data,
        spread(_readable(data), ["tissue", "outcome"], ["socket", "material_set"], text),
        _notes(data, "tissue", "socket", "material_set", "outcome"),
    )


def _changes(n: int, title: str, changes: pd.DataFrame, outcomes: Sequence[str]) -> Table:
    data = changes[changes.outcome.isin(outcomes)].reset_index(drop=True)
    text = [
        f"{change(ours)} ({change(paper)}{mark}{FLIP if flip else ''})"
        for ours, paper, mark, flip in zip(
            data.ours, data.paper, _marks(data), data.sign_flip, strict=True
        )
    ]
    return Table(
        f"table{n}",
        f"Table {n}: {title}",
        "Combined against Separate by equation (3), on signed values: ours, in brackets the "
        f"paper's. {FLIP}: the signs differ. A negative number need not be a smaller stress or "
        "strain; the changes of magnitude are in the CSV file beside them.",
        data,
        spread(_readable(data), ["tissue", "site"], ["socket", "outcome"], pd.Series(text)),
        _notes(data, "tissue", "socket", "outcome", "site"),
    )


def _agreement(maxima: pd.DataFrame) -> Table:
    data = comparison.agreement(maxima, ["tissue", "material_set"])
    shown = pd.DataFrame(
        {
            "tissue": data.tissue.map(names.TISSUES),
            "set": data.material_set.map(names.material_set),
            "cells": data.cells.map(str),
            "median ratio": data.median_ratio.map(number),
            "worst ratio": data.worst_ratio.map(number),
            "worst in": [_place(place) for place in data.worst_at],
            "signs that differ": data.sign_flips.map(str),
        }
    )
    return Table(
        "agreement",
        "Agreement with Tables 2 and 4",
        "Ratio of magnitudes, ours over the paper's, over all stresses and strains of a tissue "
        "in one material set; the worst is the one farthest from 1 in either direction.",
        data,
        shown.set_index("tissue"),
    )


def _place(place: str) -> str:
    socket, outcome = place.split(" ")
    return f"{socket}, {names.OUTCOMES[outcome]}"


def _pressure(results: Results, ours: pd.DataFrame) -> Table:
    printed = published.pressure().set_index(["outcome", "socket"]).printed
    both = ours[ours.site == "max_both"].set_index(["tissue", "outcome", "socket"])
    at = both.relative_change_pct.sort_index()
    quantities = (
        ("skin", "contact_pressure_max"),
        ("skin", "contact_pressure_mean"),
        ("vessel", "pressure"),
    )
    rows = []
    for tissue, outcome in quantities:
        for socket in results.sockets:
            separate, combined = (
                results.value(socket, name, tissue, outcome) for name in names.SETS
            )
            rows.append(
                {
                    "tissue": tissue,
                    "outcome": outcome,
                    "socket": socket,
                    "separate_kPa": separate,
                    "combined_kPa": combined,
                    "change_pct": at.get((tissue, outcome, socket), np.nan),
                    "paper_change_pct": printed.get((outcome, socket), np.nan),
                }
            )
    data = pd.DataFrame(rows)
    shown = pd.DataFrame(
        {
            "pressure": [
                "in the vessels" if outcome == "pressure" else names.OUTCOMES[outcome]
                for outcome in data.outcome
            ],
            "socket": data.socket,
            "Separate, kPa": data.separate_kPa.map(number),
            "Combined, kPa": data.combined_kPa.map(number),
            "change, %": data.change_pct.map(change),
            "paper's change, %": data.paper_change_pct.map(change),
        }
    )
    vessels = published.pressure().set_index("outcome").loc["pressure"]
    return Table(
        "pressure",
        "Contact pressure and pressure in the vessels",
        "The largest contact pressure is a 3 mm running mean along the skin, so that no spike "
        "counts; the mean is over the skin in contact. The paper prints changes of the largest "
        "contact pressure only, no value.",
        data,
        shown.set_index(["pressure", "socket"]),
        (f"The paper's vessels reach {vessels.printed:g} kPa ({vessels.note}).",),
    )


def _damage(results: Results, thresholds: Thresholds | None) -> Table:
    data = damage(results, thresholds)
    text = [
        f"{number(level)} ({number(area)}{TOGETHER}mm²,{TOGETHER}{number(share)}{TOGETHER}%)"
        for level, area, share in zip(
            data.level_pct, data.area_mm2, data.area_share_pct, strict=True
        )
    ]
    limit = [f"{value:g} %" for value in data.threshold_pct]
    return Table(
        "damage",
        "Strains against damage thresholds",
        "Magnitude held, %; in brackets the area of the section beyond the threshold and its share "
        "of the tissue: for muscle the damage risk volume of a slice. AMP is the absolute maximum "
        "principal strain, which the paper holds against the fascia's tensile threshold also where "
        "it is compressive.",
        data,
        spread(
            _readable(data).assign(threshold=limit),
            ["tissue", "outcome", "threshold"],
            ["socket", "material_set"],
            pd.Series(text),
        ),
    )


def _readable(data: pd.DataFrame) -> pd.DataFrame:
    """Give columns of names the words that people read; outcomes with their unit's kind."""
    words = {
        "tissue": names.TISSUES,
        "outcome": names.OUTCOMES,
        "site": names.SITES,
        "material_set": names.SETS,
    }
    return data.assign(
        **{
            key: data[key].map(lambda name, known=words[key]: known.get(name, name))
            for key in words.keys() & set(data)
        }
    )


def _marks(data: pd.DataFrame) -> list[str]:
    return [MARK if note else "" for note in data.note]


def _notes(data: pd.DataFrame, *where: str) -> tuple[str, ...]:
    """Say at which cells the marks stand, and why."""
    readable = _readable(data)
    return tuple(
        f"{MARK} {', '.join(readable.loc[row, list(where)])}: {note}"
        for row, note in data.note[data.note != ""].items()
    )
