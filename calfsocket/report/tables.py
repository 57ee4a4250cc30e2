"""The tables of any study: laws, maxima, thresholds, damage, a sweep.

Their titles and captions are in the template of the page.
"""

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
import pandas as pd

from calfsocket.materials.law import Law
from calfsocket.postprocess.levels import NEARLY_ALL
from calfsocket.postprocess.mesh_error import MESH_ERROR, error_of, with_levels
from calfsocket.postprocess.quantities import CONTACT_UNITS, UNITS
from calfsocket.postprocess.thresholds import SHARE
from calfsocket.report import along, method, names, variants
from calfsocket.report.findings import Findings
from calfsocket.report.table import Table, in_words, settling, spread
from calfsocket.report.words import TOGETHER, measured_all, number
from calfsocket.simulation.result import STATE
from calfsocket.simulation.results import KEY, Results

SWEEP_FILE = "sweep.csv"


def tables(findings: Findings) -> dict[str, Table]:
    """Return the tables of a study by name, without those that it has no rows for."""
    results = findings.results
    made = (
        laws(findings.laws),
        *(findings.uncertainty.tables() if findings.uncertainty else [sweep(findings.study)]),
        *along.tables(findings),
        levels(results),
        maxima(results),
        thresholds(results),
        damage(findings.damage),
        states(results),
        *variants.tables(findings.study),
        *method.tables(findings),
    )
    return {table.name: table for table in made if len(table.data)}


def laws(known: Mapping[str, Mapping[str, Law]]) -> Table:
    """Laws of every tissue or region in the sets that are solved."""
    data = pd.DataFrame(
        [
            {
                "material_set": material_set,
                "tissue": tissue,
                "law": law.name,
                "symbol": symbol,
                "unit": unit,
                "value": _numbers(getattr(law, symbol)),
            }
            for material_set, of_set in known.items()
            for tissue, law in of_set.items()
            for symbol, unit in law.units().items()
            if getattr(law, symbol) is not None
        ],
        columns=["material_set", "tissue", "law", "symbol", "unit", "value"],
    )
    text = (data.symbol + " " + data.value + " " + data.unit).str.strip()
    cells = data.assign(text=text).groupby(["material_set", "tissue"], sort=False)
    shown = cells.agg(law=("law", "first"), text=("text", ", ".join)).reset_index()
    shown["tissue"] = [names.TISSUES.get(name, names.region(name)) for name in shown.tissue]
    text = shown.law + ": " + shown.text
    return Table("laws", data, spread(in_words(shown), ["tissue"], ["material_set"], text))


def _numbers(value: Any) -> str:
    values = value if isinstance(value, list | tuple) else [value]
    return " ".join(f"{each:.6g}" for each in values)


def levels(results: Results) -> Table:
    """Levels by area of every case: of whole tissues on the page, of regions in the file."""
    data = results.levels
    shown = in_words(data[data.region == ""])
    shown = shown.assign(quantity=shown.quantity + ", " + shown.unit)
    below, rms = (measured_all(shown[name], shown, error_of(name)) for name in (NEARLY_ALL, "rms"))
    text = [f"{each} (rms{TOGETHER}{mean})" for each, mean in zip(below, rms, strict=True)]
    return _by_case("levels", data, shown, ["quantity"], text)


def maxima(results: Results) -> Table:
    """Largest values of every case."""
    data = results.summary
    shown = in_words(data[data.quantity.isin((*UNITS, *CONTACT_UNITS))])
    shown = shown.assign(quantity=shown.quantity + ", " + shown.unit)
    text = measured_all(shown.value, shown, MESH_ERROR)
    return _by_case("maxima", data, shown, ["quantity"], text)


def states(results: Results) -> Table:
    """Levels by area and contact of every case in each state of its stages of loading.

    Those of the paper's rule are in the file.
    """
    if results.states.empty:
        return Table("states", results.states, results.states)
    data = with_levels(results.states, results.levels_of_states)
    shown = in_words(settling(data))
    shown = shown.assign(quantity=shown["quantity"] + ", " + shown.unit)
    cells = spread(
        shown,
        ["tissue", "quantity"],
        ["socket", "material_set", STATE],
        measured_all(shown.value, shown, MESH_ERROR),
    )
    return Table("states", data, cells)


def thresholds(results: Results) -> Table:
    """Share of each tissue beyond the study's thresholds."""
    data = results.summary[results.summary.quantity.str.startswith(SHARE)]
    words = data.quantity.str.removeprefix(SHARE).str.replace("_", " ")
    shown = in_words(data).assign(threshold=words)
    text = measured_all(shown.value, shown, MESH_ERROR)
    return _by_case("thresholds", data, shown, ["threshold"], text)


def damage(data: pd.DataFrame) -> Table:
    """Strains against damage thresholds (`damage.damage`)."""
    columns = ("below_99.9_pct", "area_mm2", "area_share_pct")
    said = [measured_all(data[column], data, error_of(column)) for column in columns]
    text = [
        f"{below} ({area}{TOGETHER}mm²,{TOGETHER}{share}{TOGETHER}%)"
        for below, area, share in zip(*said, strict=True)
    ]
    shown = in_words(data).assign(threshold=[f"{limit:g} %" for limit in data.threshold_pct])
    return _by_case("damage", data, shown, ["quantity", "threshold"], text)


def _by_case(
    name: str, data: pd.DataFrame, shown: pd.DataFrame, rows: list[str], text: Iterable[str]
) -> Table:
    """Return a table with a row for each tissue and `rows`, and a column for each case."""
    return Table(name, data, spread(shown, ["tissue", *rows], ["socket", "material_set"], text))


def sweep(results: Results) -> Table:
    """Parameters and results of a sweep's solved cases."""
    path = results.folder / SWEEP_FILE
    if not path.is_file():
        return Table("sweep", pd.DataFrame(), pd.DataFrame())
    data = pd.read_csv(path, dtype=dict.fromkeys(KEY, str))
    solved = [key in results for key in zip(data.socket, data.material_set, strict=True)]
    data = data[solved].dropna(axis="columns", how="all")
    cases = data.set_index("case")
    largest = [name.replace(f"_{NEARLY_ALL}", "") for name in data if f"_{NEARLY_ALL}_" in name]
    errors = [name for name in data if name.endswith(MESH_ERROR)]
    said = {}
    for column in cases.columns.drop([*KEY, "status", *errors, *largest], errors="ignore"):
        form = number if heading(column) != column else "{:g}".format
        cells = [_cell(cell, form) for cell in cases[column]]
        if error_of(column) in cases:
            cells = measured_all(cases[column], cases, error_of(column))
        said[heading(column)] = cells
    return Table("sweep", data, pd.DataFrame(said, index=cases.index))


def _cell(value: Any, form: Callable[[float], str]) -> Any:
    """Return a number as `form` writes it, nothing where there is none; else the value."""
    return ("" if np.isnan(value) else form(value)) if isinstance(value, float) else value


def swept_results(data: pd.DataFrame) -> list[str]:
    """Return the columns of a sweep's table with results that a report shows."""
    return [name for name in data if heading(name) != name and not name.endswith(MESH_ERROR)]


_HEADINGS = {
    f"{tissue}_{name}_{NEARLY_ALL}_{unit.replace('%', 'percent')}": f"{title}: {words}, {unit}"
    for tissue, title in names.TISSUES.items()
    for name, unit in UNITS.items()
    for words in [names.QUANTITIES[name]]
} | {
    f"{name}_{unit.replace('%', 'percent')}": f"{names.QUANTITIES[name]}, {unit}"
    for name, unit in CONTACT_UNITS.items()
}


def heading(column: str) -> str:
    """Return the heading of a result of a sweep in words, its state behind; else the column's."""
    tissue, share, of = column.partition(f"_{SHARE}")
    if share:
        threshold, _, state = of.partition("_in_percent")
        quantity, _, limit = threshold.partition("_above_")
        limit = limit.replace("_percent", " %").replace("_", " ")
        title, what = names.TISSUES.get(tissue, tissue), names.QUANTITIES.get(quantity, quantity)
        words = f"{title}: beyond {limit} {what}, %"
        return f"{words}, {state.removeprefix('_')}" if state else words
    for name, words in _HEADINGS.items():
        if column == name:
            return words
        if column.startswith(f"{name}_"):
            return f"{words}, {column.removeprefix(f'{name}_')}"
    return column
