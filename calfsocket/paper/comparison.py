"""Our numbers beside the paper's, one row a printed number.

`ratio` is ours over the paper's, of magnitudes; `sign_flip` says that the signs differ. Signs of
maxima are fragile: peaks of both directions are often nearly equal, and where fascia is
incompressible both principal strains have the same magnitude.
"""

import numpy as np
import pandas as pd

from calfsocket.paper import published
from calfsocket.report.changes import SETS, magnitude_change
from calfsocket.report.findings import Findings
from calfsocket.report.inputs import Laws

MATERIALS = {
    "skin": ("separate", "skin"),
    "fat": ("separate", "fat"),
    "muscle": ("separate", "muscle"),
    "fascia": ("separate", "fascia"),
    "muscle and fascia, combined": ("combined", "muscle"),
    "vessel": ("separate", "vessel"),
    "bone": ("separate", "bone"),
    "socket": ("separate", "socket"),
}
"""Row of Table 1 -> material set and tissue of run.json."""

_KEYS = {"mu1": "mu", "alpha1": "alpha"}  # others are the symbol in small letters

# Inside a run, stresses are MPa; Table 1 prints these units.
_PER_MPA = {"kPa": 1e3, "MPa": 1.0, "GPa": 1e-3, "1/Pa": 1e-6, "": 1.0}


def compare(ours: float, paper: float) -> dict[str, object]:
    """Ratio of magnitudes, and whether the signs differ; NaN where there is nothing to divide."""
    known = np.isfinite([ours, paper]).all() and paper != 0
    return {
        "ours": ours,
        "paper": paper,
        "ratio": abs(ours / paper) if known else np.nan,
        "sign_flip": bool(known and ours * paper < 0),
    }


def materials(laws: Laws) -> pd.DataFrame:
    """Table 1: parameters of the laws."""
    rows = []
    for row in published.table(1).itertuples():
        ours = parameter(laws, row.material, row.symbol, row.unit)
        rows.append(
            {
                "material": row.material,
                "law": row.law,
                "symbol": row.symbol,
                "unit": row.unit,
                **compare(ours, row.printed),
                "note": row.note,
            }
        )
    return pd.DataFrame(rows)


def parameter(laws: Laws, material: str, symbol: str, unit: str) -> float:
    """Return a law's parameter in the unit of Table 1; NaN where the law has none of it."""
    material_set, tissue = MATERIALS[material]
    value = laws[material_set][tissue].get(_KEYS.get(symbol, symbol.lower()), np.nan)
    first = value[0] if isinstance(value, list | tuple) else value
    return first * _PER_MPA[unit]


def maxima(findings: Findings) -> pd.DataFrame:
    """Tables 2 and 4: largest stresses (kPa) and strains (%) of the cases solved."""
    results, columns = findings.results, ["tissue", "quantity", "socket", "material_set", "unit"]
    rows = [
        {
            **{name: getattr(row, name) for name in columns},
            **compare(
                results.value(row.socket, row.material_set, row.tissue, row.quantity), row.printed
            ),
            "note": row.note,
        }
        for row in published.maxima().itertuples()
        if (row.socket, row.material_set) in results
    ]
    return pd.DataFrame(rows, columns=[*columns, "ours", "paper", "ratio", "sign_flip", "note"])


def changes(findings: Findings) -> pd.DataFrame:
    """Tables 3 and 5: relative changes by equation (3), %, of the sockets that have both sets.

    Beside them the changes of magnitude: ours, and the paper's where Tables 2 and 4 give it.
    """
    columns = ["tissue", "site", "socket", "quantity"]
    at = findings.changes.set_index(columns)
    printed = published.maximum()
    rows = []
    for row in published.changes().itertuples():
        key = tuple(getattr(row, name) for name in columns)
        if key not in at.index:
            continue
        ours = at.loc[key]
        cell = (row.tissue, row.quantity, row.socket)
        theirs = [printed[(*cell, name)] for name in SETS]
        rows.append(
            {
                **dict(zip(columns, key, strict=True)),
                **compare(ours.relative_change_pct, row.printed),
                "ours_magnitude": ours.magnitude_change_pct,
                "paper_magnitude": magnitude_change(*theirs) if row.site == "max_both" else np.nan,
                "region": ours.region,
                "note": row.note,
            }
        )
    return pd.DataFrame(rows)


def agreement(cells: pd.DataFrame, by: list[str]) -> pd.DataFrame:
    """Median and worst ratio of groups of cells, and where the worst is.

    The worst ratio is the one farthest from 1 in either direction, by its logarithm.
    """
    rows = []
    for key, group in cells.dropna(subset="ratio").groupby(by, sort=False):
        far = np.abs(np.log(group.ratio.clip(lower=np.finfo(float).tiny)))
        worst = group.loc[far.idxmax()]
        rows.append(
            {
                **dict(zip(by, key, strict=True)),
                "cells": len(group),
                "median_ratio": group.ratio.median(),
                "worst_ratio": worst.ratio,
                "worst_at": f"{worst.socket} {worst.quantity}",
                "sign_flips": int(group.sign_flip.sum()),
            }
        )
    return pd.DataFrame(rows)
