"""Tables 1 to 5 of the paper with our numbers beside, and what agrees."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from calfsocket.paper import comparison, published
from calfsocket.paper.evidence import STRAINS, STRESSES, Evidence
from calfsocket.report import names
from calfsocket.report.names import SETS
from calfsocket.report.table import TIMES, TOGETHER, Table, change, in_words, number, spread

FLIP = "\N{RIGHTWARDS ARROW OVER LEFTWARDS ARROW}"
MARK = "\N{DAGGER}"


def tables(evidence: Evidence) -> dict[str, Table]:
    """Return the tables that the solved cases allow, by name.

    table1 to table5 (those of changes need a socket with both material sets), agreement, pressure.
    """
    maxima, changes = evidence.maxima, evidence.compared_changes
    made = [_maxima(2, "largest stresses, kPa", maxima, STRESSES)]
    made.append(_maxima(4, "largest logarithmic strains, %", maxima, STRAINS))
    made.append(_materials(comparison.materials(evidence.laws)))
    if len(changes):
        made.append(_changes(3, "relative change of stresses, %", changes, STRESSES))
        made.append(_changes(5, "relative change of strains, %", changes, STRAINS))
    made += [_agreement(maxima), _pressure(evidence)]
    return {table.name: table for table in made}


def _materials(data: pd.DataFrame) -> Table:
    shown = data[["material", "law", "symbol", "unit"]].assign(
        ours=[f"{value:.6g}" for value in data.ours],
        paper=[f"{row.paper:.6g}{_mark(row.note)}" for row in data.itertuples()],
    )
    return Table(
        "table1",
        "Table 1: material properties",
        "Parameters of the laws as solved, beside those of the paper.",
        data,
        shown.set_index("material"),
        _notes(data, "material", "symbol"),
    )


def _maxima(n: int, title: str, maxima: pd.DataFrame, quantities: Sequence[str]) -> Table:
    data = maxima[maxima.quantity.isin(quantities)].reset_index(drop=True)
    text = [
        f"{number(row.ours)} ({number(row.paper)}{_mark(row.note)},"
        f"{TOGETHER}{TIMES}{number(row.ratio)}{FLIP if row.sign_flip else ''})"
        for row in data.itertuples()
    ]
    return Table(
        f"table{n}",
        f"Table {n}: {title}",
        "Ours; in brackets the paper's, and the ratio of magnitudes, ours over the paper's. "
        f"{FLIP}: the signs differ.",
        data,
        spread(in_words(data), ["tissue", "quantity"], ["socket", "material_set"], text),
        _notes(data, "tissue", "socket", "material_set", "quantity"),
    )


def _changes(n: int, title: str, changes: pd.DataFrame, quantities: Sequence[str]) -> Table:
    data = changes[changes.quantity.isin(quantities)].reset_index(drop=True)
    text = [
        f"{change(row.ours)} ({change(row.paper)}{_mark(row.note)}{FLIP if row.sign_flip else ''})"
        for row in data.itertuples()
    ]
    return Table(
        f"table{n}",
        f"Table {n}: {title}",
        "Combined against Separate by equation (3), on signed values: ours, in brackets the "
        f"paper's. {FLIP}: the signs differ. A negative number need not be a smaller stress or "
        "strain; the changes of magnitude are in the CSV file beside them.",
        data,
        spread(in_words(data), ["tissue", "site"], ["socket", "quantity"], text),
        _notes(data, "tissue", "socket", "quantity", "site"),
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
    socket, quantity = place.split(" ")
    return f"{socket}, {names.QUANTITIES[quantity]}"


def _pressure(evidence: Evidence) -> Table:
    results, ours = evidence.results, evidence.changes
    printed = published.pressure().set_index(["quantity", "socket"]).printed
    both = ours[ours.site == "max_both"].set_index(["tissue", "quantity", "socket"])
    at = both.relative_change_pct.sort_index()
    quantities = (
        ("skin", "contact_pressure_max"),
        ("skin", "contact_pressure_mean"),
        ("vessel", "pressure"),
    )
    rows = []
    for tissue, quantity in quantities:
        for socket in results.sockets:
            separate, combined = (results.value(socket, name, tissue, quantity) for name in SETS)
            rows.append(
                {
                    "tissue": tissue,
                    "quantity": quantity,
                    "socket": socket,
                    "separate_kPa": separate,
                    "combined_kPa": combined,
                    "change_pct": at.get((tissue, quantity, socket), np.nan),
                    "paper_change_pct": printed.get((quantity, socket), np.nan),
                }
            )
    data = pd.DataFrame(rows)
    shown = pd.DataFrame(
        {
            "pressure": [
                "in the vessels" if quantity == "pressure" else names.QUANTITIES[quantity]
                for quantity in data.quantity
            ],
            "socket": data.socket,
            "Separate, kPa": data.separate_kPa.map(number),
            "Combined, kPa": data.combined_kPa.map(number),
            "change, %": data.change_pct.map(change),
            "paper's change, %": data.paper_change_pct.map(change),
        }
    )
    vessels = published.pressure().set_index("quantity").loc["pressure"]
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


def _mark(note: str) -> str:
    return MARK if note else ""


def _notes(data: pd.DataFrame, *where: str) -> tuple[str, ...]:
    """Return which cells are marked, and why."""
    readable = in_words(data)
    return tuple(
        f"{MARK} {', '.join(readable.loc[row, list(where)])}: {note}"
        for row, note in data.note[data.note != ""].items()
    )
