"""Tables 1 to 5 of the paper with our numbers beside, and what agrees."""

from collections.abc import Sequence

import pandas as pd

from calfsocket.paper import comparison, published
from calfsocket.paper.evidence import STRAINS, STRESSES, Evidence
from calfsocket.postprocess.mesh_error import MESH_ERROR, error_of
from calfsocket.report import names
from calfsocket.report.names import SETS
from calfsocket.report.table import Table, in_words, spread
from calfsocket.report.words import TIMES, TOGETHER, change, changes_all, measured_all, number

FLIP = "\N{RIGHTWARDS ARROW OVER LEFTWARDS ARROW}"
MARK = "\N{DAGGER}"

CHANGE = "relative_change_pct"
PRESSURES = (
    ("skin", "contact_pressure_max"),
    ("skin", "contact_pressure_mean"),
    ("vessel", "pressure"),
)


def tables(evidence: Evidence) -> dict[str, Table]:
    """Return the tables that the solved cases allow, by name.

    table1 to table5 (those of changes need a socket with both material sets), agreement, pressure.
    """
    maxima, changes = evidence.maxima, evidence.compared_changes
    made = [_maxima(2, maxima, STRESSES), _maxima(4, maxima, STRAINS)]
    made.append(_materials(evidence.materials))
    if len(changes):
        made += [_changes(3, changes, STRESSES), _changes(5, changes, STRAINS)]
    made += [_agreement(maxima), _pressure(evidence)]
    return {table.name: table for table in made}


def _materials(data: pd.DataFrame) -> Table:
    shown = data[["material", "law", "symbol", "unit"]].assign(
        ours=[f"{value:.6g}" for value in data.ours],
        paper=[f"{row.paper:.6g}{_mark(row.note)}" for row in data.itertuples()],
    )
    return Table("table1", data, shown.set_index("material"), _notes(data, "material", "symbol"))


def _maxima(n: int, maxima: pd.DataFrame, quantities: Sequence[str]) -> Table:
    data = maxima[maxima.quantity.isin(quantities)].reset_index(drop=True)
    ours = measured_all(data.ours, data, error_of("ours"))
    text = [
        f"{said} ({number(row.paper)}{_mark(row.note)},"
        f"{TOGETHER}{TIMES}{number(row.ratio)}{FLIP if row.sign_flip else ''})"
        for said, row in zip(ours, data.itertuples(), strict=True)
    ]
    shown = spread(in_words(data), ["tissue", "quantity"], ["socket", "material_set"], text)
    notes = _notes(data, "tissue", "socket", "material_set", "quantity")
    return Table(f"table{n}", data, shown, notes)


def _changes(n: int, changes: pd.DataFrame, quantities: Sequence[str]) -> Table:
    data = changes[changes.quantity.isin(quantities)].reset_index(drop=True)
    ours = changes_all(data.ours, data, error_of("ours"))
    text = [
        f"{said} ({change(row.paper)}{_mark(row.note)}{FLIP if row.sign_flip else ''})"
        for said, row in zip(ours, data.itertuples(), strict=True)
    ]
    shown = spread(in_words(data), ["tissue", "site"], ["socket", "quantity"], text)
    return Table(f"table{n}", data, shown, _notes(data, "tissue", "socket", "quantity", "site"))


def _agreement(maxima: pd.DataFrame) -> Table:
    data = comparison.agreement(maxima, ["tissue", "material_set"])
    places = [place.split(" ") for place in data.worst_at]
    shown = pd.DataFrame(
        {
            "tissue": data.tissue.map(names.TISSUES),
            "set": data.material_set.map(names.material_set),
            "cells": data.cells.map(str),
            "median ratio": measured_all(data.median_ratio, data, error_of("median_ratio")),
            "worst ratio": measured_all(data.worst_ratio, data, error_of("worst_ratio")),
            "worst in": [f"{socket}, {names.QUANTITIES[name]}" for socket, name in places],
            "signs that differ": data.sign_flips.map(str),
        }
    )
    return Table("agreement", data, shown.set_index("tissue"))


def _pressure(evidence: Evidence) -> Table:
    """Pressures of every socket in both sets, with their changes: ours and the paper's."""
    key = ["tissue", "quantity", "socket"]
    summary = evidence.results.summary
    columns = [name for name in ("value", MESH_ERROR) if name in summary]
    sets = summary.pivot(index=key, columns="material_set", values=columns)
    sets = sets.reindex(columns=pd.MultiIndex.from_product([columns, SETS]))
    sets.columns = [
        f"{name}_kPa" if column == "value" else error_of(f"{name}_kPa")
        for column, name in sets.columns
    ]
    both = evidence.changes[evidence.changes.site == "max_both"].set_index(key)
    both = both[[name for name in both if name.startswith(CHANGE)]]
    printed = published.pressure().set_index(key).printed
    cells = [(*pair, socket) for pair in PRESSURES for socket in evidence.results.sockets]
    data = (
        pd.DataFrame(cells, columns=key)
        .join(sets, on=key)
        .join(both.rename(columns=lambda name: name.removeprefix("relative_")), on=key)
        .join(printed.rename("paper_change_pct"), on=key)
    )
    shown = pd.DataFrame(
        {
            "pressure": data["quantity"].map(names.QUANTITIES | {"pressure": "in the vessels"}),
            "socket": data.socket,
            "Separate, kPa": measured_all(data.separate_kPa, data, error_of("separate_kPa")),
            "Combined, kPa": measured_all(data.combined_kPa, data, error_of("combined_kPa")),
            "change, %": changes_all(data.change_pct, data, error_of("change_pct")),
            "paper's change, %": data.paper_change_pct.map(change),
        }
    )
    vessels = published.pressure().set_index("quantity").loc["pressure"]
    note = f"The paper's vessels reach {vessels.printed:g} kPa ({vessels.note})."
    return Table("pressure", data, shown.set_index(["pressure", "socket"]), (note,))


def _mark(note: str) -> str:
    return MARK if note else ""


def _notes(data: pd.DataFrame, *where: str) -> tuple[str, ...]:
    """Return which cells are marked, and why."""
    readable = in_words(data)
    return tuple(
        f"{MARK} {', '.join(readable.loc[row, list(where)])}: {note}"
        for row, note in data.note[data.note != ""].items()
    )
