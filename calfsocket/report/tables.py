"""The tables of any study: laws, maxima, thresholds, damage, a sweep."""

from typing import Any

import pandas as pd

from calfsocket.postprocess.quantities import CONTACT_UNITS, UNITS
from calfsocket.postprocess.thresholds import SHARE
from calfsocket.report import inputs
from calfsocket.report.table import TOGETHER, Table, in_words, number, spread
from calfsocket.simulation.results import Results

SWEEP_FILE = "sweep.csv"

_PARAMETERS = {"mu": "MPa", "alpha": "", "d1": "1/MPa", "c10": "MPa", "c20": "MPa", "c30": "MPa",
               "e": "MPa", "nu": ""}  # fmt: skip


def laws(results: Results) -> Table | None:
    """Laws of every tissue or region in the sets that are solved; None where they are not known."""
    known = inputs.laws(results)
    rows = [
        {
            "material_set": material_set,
            "tissue": tissue,
            "law": law["law"],
            "symbol": symbol,
            "unit": unit,
            "value": _numbers(law[symbol]),
        }
        for material_set in results.material_sets
        for tissue, law in known.get(material_set, {}).items()
        for symbol, unit in _PARAMETERS.items()
        if law.get(symbol) is not None
    ]
    if not rows:
        return None
    data = pd.DataFrame(rows)
    text = (data.symbol + " " + data.value + " " + data.unit).str.strip()
    cells = data.assign(text=text).groupby(["material_set", "tissue"], sort=False)
    shown = cells.agg(law=("law", "first"), text=("text", ", ".join)).reset_index()
    return Table(
        "laws",
        "Laws of this study",
        "Material set by material set; a region that is named has a law of its own. A socket's own "
        "modulus is in run.json.",
        data,
        spread(shown, ["tissue"], ["material_set"], shown.law + ": " + shown.text),
    )


def _numbers(value: Any) -> str:
    values = value if isinstance(value, list | tuple) else [value]
    return " ".join(f"{each:.6g}" for each in values)


def maxima(results: Results) -> Table:
    """Largest values of every case, one column a case."""
    data = results.summary
    shown = in_words(data[data.quantity.isin((*UNITS, *CONTACT_UNITS))])
    shown = shown.assign(quantity=shown.quantity + ", " + shown.unit)
    return Table(
        "maxima",
        "Largest stresses and strains of every case",
        "Levels reached in two neighbouring elements and five of their nodes; contact pressure as "
        "a 3 mm running mean along the skin, and its mean over the skin in contact.",
        data,
        spread(shown, ["tissue", "quantity"], ["socket", "material_set"], shown.value.map(number)),
    )


def thresholds(results: Results) -> Table | None:
    """Share of each tissue beyond the study's thresholds; None where it has none."""
    data = results.summary[results.summary.quantity.str.startswith(SHARE)]
    if data.empty:
        return None
    words = data.quantity.str.removeprefix(SHARE).str.replace("_", " ")
    shown = in_words(data).assign(threshold=words)
    return Table(
        "thresholds",
        "Beyond the thresholds of this study, %",
        "Contact pressure: share of the skin's outline whose 3 mm running mean is beyond it. "
        "Others: share of the tissue's area in the section, by Gauss points, that is beyond it.",
        data,
        spread(shown, ["tissue", "threshold"], ["socket", "material_set"], shown.value.map(number)),
    )


def damage(data: pd.DataFrame) -> Table:
    """Strains against damage thresholds (`damage.damage`)."""
    text = [
        f"{number(row.level_pct)} ({number(row.area_mm2)}{TOGETHER}mm²,"
        f"{TOGETHER}{number(row.area_share_pct)}{TOGETHER}%)"
        for row in data.itertuples()
    ]
    limit = [f"{value:g} %" for value in data.threshold_pct]
    return Table(
        "damage",
        "Strains against damage thresholds",
        "Magnitude of the maximum, %; in brackets the area of the section beyond the threshold, by "
        "Gauss points, and its share of the tissue: for muscle the damage risk volume of a slice. "
        "AMP is the absolute maximum principal strain, which may be compressive; the fascia's "
        "threshold was measured in tension.",
        data,
        spread(
            in_words(data).assign(threshold=limit),
            ["tissue", "quantity", "threshold"],
            ["socket", "material_set"],
            text,
        ),
    )


def sweep(results: Results) -> Table | None:
    """Parameters and results of a sweep's cases; None where the study is none."""
    path = results.folder / SWEEP_FILE
    if not path.is_file():
        return None
    data = pd.read_csv(path)
    shown = data.set_index("case").drop(columns=["socket", "material_set"])
    return Table(
        "sweep",
        "The sweep",
        "One row a case: what was changed, and what came of it. A parameter that does not reach "
        "the case is empty.",
        data,
        shown.map(lambda value: number(value) if isinstance(value, float) else value),
    )
