"""Our numbers beside the paper's, one row a printed number.

`ratio` is ours over the paper's, of magnitudes; `sign_flip` says that the signs differ. Signs of
maxima are fragile: peaks of both directions are often nearly equal, and where fascia is
incompressible both principal strains have the same magnitude.
"""

from typing import Any

import numpy as np
import pandas as pd

from calfsocket.paper import published
from calfsocket.postprocess.mesh_error import MESH_ERROR, error_of
from calfsocket.report.findings import Findings
from calfsocket.simulation.results import KEY

Laws = dict[str, dict[str, dict[str, Any]]]
"""Material set -> tissue -> kind of law and parameters, MPa."""

_KEYS = {"mu1": "mu", "alpha1": "alpha"}  # others are the symbol in small letters

# Inside a run, stresses are MPa; Table 1 prints these units.
_PER_MPA = {"kPa": 1e3, "MPa": 1.0, "GPa": 1e-3, "1/Pa": 1e-6, "": 1.0}


def compare(rows: pd.DataFrame, columns: list[str]) -> pd.DataFrame:
    """Return columns of rows with ours, paper, ratio, sign_flip and note.

    There is no ratio where one of the two is missing or the paper has 0. Behind ours is its mesh
    error, where there is any.
    """
    known = rows.ours.notna() & rows.paper.notna() & (rows.paper != 0)
    compared = rows.assign(
        ratio=(rows.ours / rows.paper).abs().where(known),
        sign_flip=known & (rows.ours * rows.paper < 0),
    )
    error = [error_of("ours")] if error_of("ours") in rows else []
    return compared[[*columns, "ours", *error, "paper", "ratio", "sign_flip", "note"]]


def materials(laws: Laws) -> pd.DataFrame:
    """Table 1: parameters of the laws of the material sets that a study has."""
    rows = published.table(1).rename(columns={"printed": "paper"})
    rows = rows[[_law(laws, name) is not None for name in rows.material]]
    known = {name: _law(laws, name) or {} for name in rows.material}
    ours = [_parameter(known[row.material], row.symbol, row.unit) for row in rows.itertuples()]
    return compare(rows.assign(ours=ours), ["material", "law", "symbol", "unit"])


def _law(laws: Laws, material: str) -> dict[str, Any] | None:
    """Return the law of a material of Table 1; None where no set of the study has it."""
    if material == "muscle and fascia, combined":
        return laws.get("combined", {}).get("muscle")
    if material in ("muscle", "fascia"):
        return laws.get("separate", {}).get(material)
    return next(iter(laws.values()))[material]


def _parameter(law: dict[str, Any], symbol: str, unit: str) -> float:
    """Return a law's parameter in the unit of Table 1; NaN where the law has none of it."""
    value = law.get(_KEYS.get(symbol, symbol.lower()), np.nan)
    first = value[0] if isinstance(value, list | tuple) else value
    return first * _PER_MPA[unit]


def maxima(findings: Findings) -> pd.DataFrame:
    """Tables 2 and 4: largest stresses (kPa) and strains (%) of the cases solved."""
    cell = ["tissue", "quantity", *KEY]
    names = {"value": "ours", MESH_ERROR: error_of("ours")}
    ours = findings.results.summary.rename(columns=names)
    ours = ours[[*cell, *(name for name in names.values() if name in ours)]]
    solved = pd.DataFrame(list(findings.results), columns=list(KEY))
    printed = published.maxima().rename(columns={"printed": "paper"}).merge(solved, on=list(KEY))
    return compare(printed.merge(ours, on=cell, how="left"), [*cell, "unit"])


def changes(findings: Findings) -> pd.DataFrame:
    """Tables 3 and 5: relative changes by equation (3), %, of the sockets that have both sets.

    Beside them the changes of magnitude: ours, and the paper's where Tables 2 and 4 give it.
    """
    cell = ["tissue", "site", "socket", "quantity"]
    names = {"relative_change_pct": "ours", "magnitude_change_pct": "ours_magnitude"}
    names |= {error_of(column): error_of(name) for column, name in names.items()}
    ours = findings.changes.rename(columns=names)
    known = [name for name in names.values() if name in ours]
    rows = published.changes().rename(columns={"printed": "paper"})
    rows = rows.merge(ours[[*cell, *known, "region"]], on=cell)
    both = published.maximum().abs().unstack("material_set")
    change = (100 * (both.combined / both.separate - 1)).rename("paper_magnitude")
    rows = rows.join(change, on=change.index.names)
    rows["paper_magnitude"] = rows.paper_magnitude.where(rows.site == "max_both")
    compared = compare(rows, cell).drop(columns="note")
    more = [name for name in known if name not in compared]
    return compared.join(rows[[*more, "paper_magnitude", "region", "note"]])


def quantile(cells: pd.DataFrame, share: float) -> tuple[float, float]:
    """Return a quantile of ratios, and its mesh error: NaN where a cell has none.

    It is by how much the quantile moves where all ratios move by their own mesh errors, one way or
    the other.
    """
    value = float(cells.ratio.quantile(share))
    if error_of("ours") not in cells or cells[error_of("ours")].isna().any():
        return value, np.nan
    error = cells[error_of("ours")] / cells.paper.abs()
    ends = [(cells.ratio + side * error).quantile(share) for side in (-1, 1)]
    return value, float(np.abs(np.array(ends) - value).max())


def agreement(cells: pd.DataFrame, by: list[str]) -> pd.DataFrame:
    """Median and worst ratio of groups of cells, and where the worst is.

    The worst ratio is the one farthest from 1 in either direction, by its logarithm. Both have mesh
    errors where their cells have.
    """
    cells = cells.dropna(subset="ratio")
    far = np.abs(np.log(cells.ratio.clip(lower=np.finfo(float).tiny)))
    groups = cells.groupby(by, sort=False)
    worst = cells.loc[far.groupby([cells[name] for name in by], sort=False).idxmax()]
    found = groups.agg(cells=("ratio", "size"), median_ratio=("ratio", "median")).reset_index()
    found = found.assign(
        worst_ratio=worst.ratio.to_numpy(),
        worst_at=(worst.socket + " " + worst["quantity"]).to_numpy(),
        sign_flips=groups.sign_flip.sum().to_numpy(),
    )
    if error_of("ours") in worst:
        errors = [quantile(rows, 0.5)[1] for _, rows in groups]
        found[error_of("median_ratio")] = errors
        found[error_of("worst_ratio")] = (worst[error_of("ours")] / worst.paper.abs()).to_numpy()
    return found
