"""Every number of summary.csv at several mesh sizes, with its change and its uncertainty."""

from collections.abc import Mapping, Sequence
from functools import reduce
from itertools import pairwise

import numpy as np
import pandas as pd

from calfsocket.postprocess.fields import SectionFields
from calfsocket.postprocess.levels import level
from calfsocket.postprocess.quantities import effective_stress
from calfsocket.verification.report import LOG, Curve, Draw, curves

KEY = ["socket", "material_set", "tissue", "quantity"]
CONVERGED, CONVERGING = 5.0, 10.0
"""Largest last change, %."""

SAFETY = 1.25
"""Roache's factor for three meshes."""

OTHER_SITE_MM = 10.0
"""A maximum that moves farther was found at another place."""

QUANTILES = (50.0, 90.0, 99.0)
"""% of a tissue's area."""


def long_table(summaries: Mapping[str, pd.DataFrame], cells: Mapping[str, float]) -> pd.DataFrame:
    """Join the summaries of mesh sizes, coarsest first, with so many cells; judge each number.

    One row a number: its key and unit; value, site and region by size; change in % and distance of
    the sites in mm by size after the first; uncertainty in % (1.25 e/(r - 1) with the change e and
    the ratio r of element sizes: Roache 1994, doi:10.1115/1.2910291), verdict and reason.
    """
    sizes = list(summaries)
    by_size = ("value", "x_mm", "y_mm", "region")
    parts = [
        summary.rename(columns={name: f"{name}_{size}" for name in by_size})
        for size, summary in summaries.items()
    ]
    table = reduce(lambda left, right: left.merge(right.drop(columns="unit"), on=KEY), parts)
    for coarse, fine in pairwise(sizes):
        before, after = (table[f"value_{size}"].abs() for size in (coarse, fine))
        table[f"change_{fine}_pct"] = 100.0 * (after / before - 1.0)
        table[f"site_moved_{fine}_mm"] = np.hypot(
            table[f"x_mm_{fine}"] - table[f"x_mm_{coarse}"],
            table[f"y_mm_{fine}"] - table[f"y_mm_{coarse}"],
        )
    ratio = float(np.sqrt(cells[sizes[-1]] / cells[sizes[-2]]))
    last = table[f"change_{sizes[-1]}_pct"].abs()
    earlier = (
        table[f"change_{sizes[-2]}_pct"].abs() if len(sizes) > 2 else pd.Series(np.inf, table.index)
    )
    table["uncertainty_pct"] = SAFETY * last / (ratio - 1.0)
    table["verdict"] = np.select(
        [last <= CONVERGED, (last <= CONVERGING) & (last <= earlier)],
        ["converged", "converging"],
        "not converged",
    )
    table["reason"] = table.apply(_reason, axis=1, fine=sizes[-1], coarse=sizes[-2])
    return table.reset_index(drop=True)


def _reason(row: pd.Series, fine: str, coarse: str) -> str:
    """Return why a number does not converge, as far as the numbers show it; empty if it does."""
    if row["verdict"] != "not converged":
        return ""
    reasons = []
    if row["tissue"] == "fascia" and row["material_set"] == "separate":
        reasons.append("bending across the fascia")
    if row[f"site_moved_{fine}_mm"] > OTHER_SITE_MM:
        turned = np.sign(row[f"value_{fine}"]) != np.sign(row[f"value_{coarse}"])
        reasons.append("another site" + (", of the other sign" if turned else ""))
    return "; ".join(reasons or ["a peak as narrow as the elements"])


def digest(table: pd.DataFrame, sizes: Sequence[str]) -> pd.DataFrame:
    """Largest last change and uncertainty over the sockets, by quantity and material set, in %."""
    last = f"change_{sizes[-1]}_pct"
    rows = []
    for (tissue, quantity), group in table.groupby(["tissue", "quantity"], sort=False):
        row: dict[str, object] = {"tissue": tissue, "quantity": quantity}
        for name, part in group.groupby("material_set", sort=False):
            settled = (part["verdict"] != "not converged").all()
            uncertainty = f"{part['uncertainty_pct'].max():.2g}" if settled else "not converged"
            row |= {
                f"{name}: change": part[last].abs().max(),
                f"{name}: uncertainty": uncertainty,
            }
        rows.append(row)
    return pd.DataFrame(rows)


def unconverged(
    table: pd.DataFrame, sizes: Sequence[str], fields: Mapping[str, SectionFields]
) -> pd.DataFrame:
    """Numbers of a `long_table` that do not converge: values, site and what is near, reason.

    The site is that on the finest mesh, whose fields are given by the case's name.
    """
    rows = []
    for _, number in table[table["verdict"] == "not converged"].iterrows():
        case = f"{number['socket']}_{number['material_set']}"
        region = number[f"region_{sizes[-1]}"]
        x, y = (number[f"{axis}_mm_{sizes[-1]}"] for axis in "xy")
        near, distance = nearest_material(fields[case], number["material_set"], region, x, y)
        rows.append(
            {
                "case": case,
                "quantity": f"{number['tissue']} {number['quantity']}, {number['unit']}",
                **{size: number[f"value_{size}"] for size in sizes},
                "site": f"{region} ({x:.0f}, {y:.0f})".replace("_", " "),
                "nearest other material": f"{near}, {distance:.1f} mm".replace("_", " "),
                "why": number["reason"],
            }
        )
    return pd.DataFrame(rows)


def nearest_material(
    fields: SectionFields, material_set: str, region: str, x: float, y: float
) -> tuple[str, float]:
    """Nearest region of another material than a region's, and its distance from a site, mm."""
    merged = {"fascia": "muscle"} if material_set == "combined" else {}
    materials = {
        fields.region_names[tag]: merged.get(tissue, tissue)
        for tag, tissue in fields.region_tissues.items()
    }
    distances = []
    for tag, name in fields.region_names.items():
        if materials[name] != materials[region]:
            nodes = fields.points[np.unique(fields.cells[fields.region == tag])]
            distances.append((float(np.hypot(*(nodes - (x, y)).T).min()), name))
    distance, nearest = min(distances)
    return nearest, distance


def stress_quantiles(fields: SectionFields, tissue: str) -> dict[str, float]:
    """Root mean square and quantiles, by area, of a tissue's effective stress at Gauss points, kPa.

    What a maximum by the paper's rule is not: a number of the field that the mesh plays no part in.
    """
    inside = fields.cells_of(tissue)
    stress = effective_stress(fields.stress[inside]).ravel()
    area = fields.gauss_area[inside].ravel()
    found = {f"{share:g} %": float(level(stress, area, share)) for share in QUANTILES}
    return {"rms": float(np.sqrt(np.average(stress**2, weights=area))), **found}


def figure(table: pd.DataFrame, sizes: Sequence[str], cells: Mapping[str, float]) -> Draw:
    """Plot the distance of contact pressure and effective stresses from the finest mesh."""
    shown = {
        ("skin", "contact_pressure_mean"): "contact pressure, mean",
        ("skin", "contact_pressure_max"): "contact pressure, maximum",
        **{(tissue, "effective_stress"): tissue for tissue in ("skin", "fat", "muscle", "fascia")},
        ("vessel", "pressure"): "vessel pressure",
    }
    finest, others = sizes[-1], sizes[:-1]
    relative = [np.sqrt(cells[finest] / cells[size]) for size in others]
    lines: list[Curve] = []
    for k, ((tissue, quantity), label) in enumerate(shown.items()):
        part = table[(table["tissue"] == tissue) & (table["quantity"] == quantity)]
        for name, style in (("separate", "o-"), ("combined", "s--")):
            values = part[part["material_set"] == name][[f"value_{size}" for size in sizes]].abs()
            reference = values[f"value_{finest}"]
            off = [100.0 * (values[f"value_{s}"] / reference - 1.0).abs().mean() for s in others]
            text = label if name == "separate" else None
            lines.append((relative, np.maximum(off, 1e-4), f"{style}C{k}", text))
    labels = f"element size, {finest} = 1", f"mean distance from {finest}, %"
    return curves(labels, lines, **LOG)
