"""The six runs with the choices that the paper leaves open: Ogden's form and fascia's C10."""

from collections.abc import Mapping
from pathlib import Path

import pandas as pd

from calfsocket.materials.material_set import BASE_SETS, BaseSet
from calfsocket.simulation.case import Settings
from calfsocket.verification.limb_runs import solved_study, summary

VARIANTS: dict[str, tuple[dict[str, str], tuple[BaseSet, ...]]] = {
    "as-printed": ({"ogden_form": "as-printed"}, BASE_SETS),
    "tables": ({"fascia_c10": "tables"}, ("separate",)),
}
"""Settings that differ from the study's, and the material sets that they change."""

SHOWN = {
    "mean pressure": ("skin", "contact_pressure_mean"),
    "largest pressure": ("skin", "contact_pressure_max"),
    "skin": ("skin", "effective_stress"),
    "fat": ("fat", "effective_stress"),
    "muscle": ("muscle", "effective_stress"),
    "fascia": ("fascia", "effective_stress"),
    "vessel": ("vessel", "effective_stress"),
}
"""Columns: contact pressures and the largest effective stress of each tissue, kPa."""


def variant_folders(results: Path, size: str) -> dict[str, Path]:
    """Solve the variants at a mesh size, unless they are there; folders by name."""
    return {
        name: solved_study(results / f"{size}-{name}", Settings(size=size, **changed), sets)  # type: ignore[arg-type]
        for name, (changed, sets) in VARIANTS.items()
    }


def comparison(folders: Mapping[str, Path]) -> pd.DataFrame:
    """Means and maxima of each case by variant, in kPa; the study's own is among the folders."""
    rows = []
    for name, folder in folders.items():
        for (socket, material_set), part in summary(folder).groupby(
            ["socket", "material_set"], sort=False
        ):
            value = part.set_index(["tissue", "quantity"])["value"]
            shown = {column: float(value[key]) for column, key in SHOWN.items()}
            rows.append({"case": f"{socket}_{material_set}", "variant": name, **shown})
    table = pd.DataFrame(rows)
    cases = list(dict.fromkeys(table["case"]))
    return table.sort_values("case", key=lambda c: c.map(cases.index), kind="stable")
