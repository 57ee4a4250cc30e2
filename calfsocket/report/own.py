"""Tables of cases of a study's own: their laws, maxima, thresholds and sweep, no paper beside."""

from typing import Any

import pandas as pd

from calfsocket.materials.laws import LAWS
from calfsocket.postprocess.quantities import UNITS
from calfsocket.report import names
from calfsocket.report.results import Results, is_of_paper
from calfsocket.report.table import Table, number, spread
from calfsocket.study.sweep_table import SWEEP_FILE

_CONTACT = ("contact_pressure_max", "contact_pressure_mean", "contact_share")


def build(results: Results) -> list[Table]:
    """Make the tables that a study with cases of its own has: laws, maxima, thresholds, sweep.

    A study of the paper's cases alone has only those of thresholds and of a sweep.
    """
    made = []
    if not all(map(is_of_paper, results.cases)):
        made += [_laws(results), _maxima(results)]
    summary = results.summary
    if summary.outcome.str.startswith("share_of_").any():
        made.append(_thresholds(results))
    if (results.folder / SWEEP_FILE).is_file():
        made.append(_sweep(results))
    return made


def _laws(results: Results) -> Table:
    """Laws of every tissue or region, in the sets that are solved."""
    rows = []
    for material_set in results.material_sets:
        for tissue, law in results.run["laws"][material_set].items():
            rows += [
                {
                    "material_set": material_set,
                    "tissue": tissue,
                    "law": law["law"],
                    "symbol": symbol,
                    "unit": unit,
                    "value": _numbers(law[symbol]),
                }
                for symbol, unit in LAWS[law["law"]].units().items()
            ]
    data = pd.DataFrame(rows)
    text = data.symbol + " " + data.value + " " + data.unit
    both = data.assign(text=text.str.strip())
    cells = both.groupby(["material_set", "tissue"], sort=False).agg(
        law=("law", "first"), text=("text", ", ".join)
    )
    cells = cells.reset_index()
    return Table(
        "laws",
        "Laws of this study",
        "Material set by material set; a region that is named has a law of its own. A socket's own "
        "modulus is in run.json.",
        data,
        spread(cells, ["tissue"], ["material_set"], cells.law + ": " + cells.text),
    )


def _numbers(value: Any) -> str:
    values = value if isinstance(value, list) else [value]
    return " ".join(f"{each:.6g}" for each in values)


def _maxima(results: Results) -> Table:
    """Largest values of every case, one column a case."""
    data = results.summary
    kept = data[data.outcome.isin((*UNITS, *_CONTACT))]
    words = {**names.OUTCOMES, "contact_share": "share in contact"}
    shown = kept.assign(
        tissue=kept.tissue.map(names.TISSUES),
        outcome=[f"{words[o]}, {u}" for o, u in zip(kept.outcome, kept.unit, strict=True)],
        material_set=kept.material_set.map(names.material_set),
    )
    return Table(
        "maxima",
        "Largest stresses and strains of every case",
        "Levels held by two neighbouring elements and five of their nodes; contact pressure as a "
        "3 mm running mean along the skin, and its mean over the skin in contact.",
        data,
        spread(shown, ["tissue", "outcome"], ["socket", "material_set"], shown.value.map(number)),
    )


def _thresholds(results: Results) -> Table:
    """Share of each tissue beyond the study's thresholds."""
    data = results.summary[results.summary.outcome.str.startswith("share_of_")]
    data = data.reset_index(drop=True)
    shown = data.assign(
        tissue=data.tissue.map(names.TISSUES),
        threshold=data.outcome.str.removeprefix("share_of_").str.replace("_", " "),
        material_set=data.material_set.map(names.material_set),
    )
    return Table(
        "thresholds",
        "Beyond the thresholds of this study, %",
        "Contact pressure: share of the skin's outline whose 3 mm running mean is beyond it. "
        "Others: share of the tissue's area in pairs of elements that hold a level beyond it.",
        data,
        spread(shown, ["tissue", "threshold"], ["socket", "material_set"], shown.value.map(number)),
    )


def _sweep(results: Results) -> Table:
    data = pd.read_csv(results.folder / SWEEP_FILE)
    shown = data.set_index("case").drop(columns=["socket", "material_set"])
    shown = shown.map(lambda value: number(value) if isinstance(value, float) else value)
    return Table(
        "sweep",
        "The sweep",
        "One row a case: what was changed, and what came of it. A parameter that does not reach "
        "the case is empty.",
        data,
        shown,
    )
