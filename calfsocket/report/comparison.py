"""Our numbers beside the paper's, one row a printed number.

`ratio` is ours over the paper's, of magnitudes; `sign_flip` says that the signs differ. Signs of
maxima are fragile: peaks of both directions are often nearly equal, and where fascia is
incompressible both principal strains have the same magnitude.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from calfsocket.report import published
from calfsocket.report.changes import magnitude_change, relative_changes
from calfsocket.report.results import Results

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


def materials(results: Results) -> pd.DataFrame:
    """Table 1: parameters of the laws."""
    rows = []
    for row in published.table(1).itertuples():
        ours = parameter(results.run["laws"], row.material, row.symbol, row.unit)
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


def parameter(
    laws: Mapping[str, Mapping[str, Mapping[str, Any]]], material: str, symbol: str, unit: str
) -> float:
    """Give a law's parameter in the unit that Table 1 prints; NaN where the law has none of it."""
    material_set, tissue = MATERIALS[material]
    value = laws[material_set][tissue].get(_KEYS.get(symbol, symbol.lower()), np.nan)
    first = value[0] if isinstance(value, list) else value
    return first * _PER_MPA[unit]


def maxima(results: Results) -> pd.DataFrame:
    """Tables 2 and 4: largest stresses (kPa) and strains (%) of the cases solved."""
    rows = []
    for row in published.maxima().itertuples():
        if (row.socket, row.material_set) not in results.cases:
            continue
        ours = results.value(row.socket, row.material_set, row.tissue, row.outcome)
        rows.append(
            {
                "tissue": row.tissue,
                "outcome": row.outcome,
                "socket": row.socket,
                "material_set": row.material_set,
                "unit": row.unit,
                **compare(ours, row.printed),
                "note": row.note,
            }
        )
    columns = ["tissue", "outcome", "socket", "material_set", "unit"]
    columns += ["ours", "paper", "ratio", "sign_flip", "note"]
    return pd.DataFrame(rows, columns=columns)


def changes(results: Results, ours: pd.DataFrame | None = None) -> pd.DataFrame:
    """Tables 3 and 5: relative changes by equation (3), %, of the sockets that have both sets.

    Beside them the changes of magnitude: ours, and the paper's where Tables 2 and 4 give it.
    """
    if ours is None:
        ours = relative_changes(results)
    keys = ["socket", "tissue", "outcome", "site"]
    at = ours.set_index(keys)
    maximum = published.maxima().set_index(["tissue", "outcome", "socket", "material_set"]).printed
    rows = []
    for row in published.changes().itertuples():
        key = (row.socket, row.tissue, row.outcome, row.site)
        if key not in at.index:
            continue
        cell = (row.tissue, row.outcome, row.socket)
        rows.append(
            {
                "tissue": row.tissue,
                "site": row.site,
                "socket": row.socket,
                "outcome": row.outcome,
                **compare(at.relative_change_pct[key], row.printed),
                "ours_magnitude": at.magnitude_change_pct[key],
                "paper_magnitude": magnitude_change(
                    maximum[(*cell, "separate")], maximum[(*cell, "combined")]
                )
                if row.site == "max_both"
                else np.nan,
                "region": at.region[key],
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
                "worst_at": f"{worst.socket} {worst.outcome}",
                "sign_flips": int(group.sign_flip.sum()),
            }
        )
    return pd.DataFrame(rows)
