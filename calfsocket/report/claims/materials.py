"""Claims on tissues and their laws: Table 1, the two sets, Ogden's form."""

import numpy as np
import pandas as pd

from calfsocket.report import comparison, published
from calfsocket.report.claims.evidence import Evidence
from calfsocket.report.claims.registry import Finding, claim
from calfsocket.report.claims.tolerances import SAME, THREE_FIGURES
from calfsocket.report.table import number

LIMB_TISSUES = ("skin", "fat", "fascia", "muscle", "vessel", "bone")
POISSON_RATIO = 0.495


def _distinct(laws: dict[str, dict]) -> int:
    return len({repr(laws[tissue]) for tissue in LIMB_TISSUES})


@claim("C001")
def tissue_types(e: Evidence) -> Finding:
    """Check for six tissue materials in Separate, five in Combined, in three sockets."""
    counts = [_distinct(e.laws[name]) for name in ("separate", "combined")]
    n = len(e.sockets)
    return Finding(
        [*counts, n] == [6, 5, 3],
        f"{counts[0]} materials Separate, {counts[1]} Combined; {n} sockets",
        "6 and 5; 3 sockets",
    )


@claim("C002")
def nonlinear_with_friction(e: Evidence) -> Finding:
    """Check that nonlinear laws and friction are switched on."""
    laws = {law["law"] for law in e.laws["separate"].values()}
    friction = e.settings["contact"]["friction"]
    return Finding(
        {"ogden", "yeoh"} <= laws and friction > 0,
        f"{', '.join(sorted(laws))} at large strain; friction {friction:g}",
        "nonlinear, with friction",
        "this study has no friction" if friction == 0 else "",
    )


@claim("C019")
@claim("C083")
def sets_differ_in_muscle_and_fascia(e: Evidence) -> Finding:
    """Check that the sets differ in muscle and fascia alone, which share one law in Combined."""
    separate, combined = e.laws["separate"], e.laws["combined"]
    differ = sorted(tissue for tissue in separate if separate[tissue] != combined[tissue])
    shared = combined["muscle"] == combined["fascia"]
    return Finding(
        differ == ["fascia", "muscle"] and shared,
        f"laws that differ: {', '.join(differ)}; {'one' if shared else 'two'} in Combined",
        "muscle and fascia, one law in Combined",
    )


@claim("C020")
def law_of_each_tissue(e: Evidence) -> Finding:
    """Check for Ogden of one term, Yeoh in fascia, linear laws of bone and vessels."""
    expected = {
        "skin": "ogden",
        "fat": "ogden",
        "muscle": "ogden",
        "fascia": "yeoh",
        "bone": "hencky",
        "vessel": "hencky",
    }
    ours = {tissue: e.laws["separate"][tissue] for tissue in expected}
    terms = {len(law["mu"]) for law in ours.values() if law["law"] == "ogden"}
    holds = {tissue: law["law"] for tissue, law in ours.items()} == expected and terms == {1}
    return Finding(
        holds,
        ", ".join(f"{tissue} {law['law']}" for tissue, law in ours.items())
        + "; hencky is linear in logarithmic strain",
        "Ogden of order 1, Yeoh, linear elastic",
    )


@claim("C021", material="skin")
@claim("C022", material="fat")
@claim("C023", material="muscle")
@claim("C024", material="fascia")
@claim("C025", material="muscle and fascia, combined")
@claim("C026", material="vessel")
@claim("C027", material="bone")
@claim("C028", material="socket")
def parameters(e: Evidence, material: str) -> Finding:
    """Check that parameters equal those of Table 1."""
    rows = comparison.materials(e.results)
    rows = rows[rows.material == material]
    same = (rows.ours - rows.paper).abs() <= SAME * rows.paper.abs()
    why = "; ".join(
        f"{row.symbol} is {row.ours:.4g} {row.unit} by choice of this study"
        for row in rows[~same].itertuples()
    )
    return Finding(bool(same.all()), _listed(rows, "ours"), _listed(rows, "paper"), why)


def _listed(rows: pd.DataFrame, column: str) -> str:
    return ", ".join(
        f"{row['symbol']} {row[column]:.4g} {row['unit']}".rstrip() for _, row in rows.iterrows()
    )


@claim("C029")
def d1_of_poisson_ratio(e: Evidence) -> Finding:
    """Check that D1 = 3 (1 - 2 nu) / (mu1 (1 + nu)) gives the four D1 of Table 1."""
    laws = [e.laws["separate"][tissue] for tissue in ("skin", "fat", "muscle")]
    laws.append(e.laws["combined"]["muscle"])
    factor = 3 * (1 - 2 * POISSON_RATIO) / (1 + POISSON_RATIO)
    off = [abs(factor / law["mu"][0] / law["d1"] - 1) for law in laws]
    return Finding(
        max(off) <= THREE_FIGURES,
        f"recomputed D1 differ by at most {100 * max(off):.2f} %",
        f"nu = {POISSON_RATIO:g} in all four",
    )


@claim("C038")
def ogden_prefactor(e: Evidence) -> Finding:
    """Check whether Ogden's form is that of equation (1), mu/alpha.

    At constant volume and 45 degrees to the principal axes S12 = (2 mu/alpha) sinh(alpha LE12/2)
    in Abaqus's form, alpha/2 times as much in that of equation (1). Tables 2 and 4 of the paper
    give pairs of S12 and LE12 for skin and muscle.
    """
    at = published.maxima().set_index(["tissue", "outcome", "socket", "material_set"]).printed
    abaqus, printed = [], []
    for tissue, material_set in (
        ("skin", "separate"),
        ("skin", "combined"),
        ("muscle", "separate"),
    ):
        law = e.laws[material_set][tissue]
        mu, alpha = 1e3 * law["mu"][0], law["alpha"][0]
        for socket in ("TC", "TSB", "HS"):
            shear = abs(at[(tissue, "shear_log_strain", socket, material_set)]) / 100
            stress = abs(at[(tissue, "shear_stress", socket, material_set)])
            ratio = stress / (2 * mu / alpha * np.sinh(alpha * shear / 2))
            abaqus.append(ratio)
            printed.append(ratio / (alpha / 2))
    form = e.laws["separate"]["skin"]["form"]
    return Finding(
        form == "as-printed" and abs(np.log(np.median(printed))) < abs(np.log(np.median(abaqus))),
        f"form solved: {form}; the paper's own stresses are {np.median(abaqus):.2f} of those of "
        f"2 mu/alpha^2 and {np.median(printed):.2f} of those of mu/alpha (medians)",
        "mu/alpha, equation (1)",
        "Table 1's D1 and Tables 2 and 4 fit 2 mu/alpha^2, which is Abaqus's form",
    )


@claim("C039")
def fascia_is_incompressible(e: Evidence) -> Finding:
    """Check that the separate fascia has no D."""
    law = e.laws["separate"]["fascia"]
    return Finding(
        law["law"] == "yeoh" and not law.get("d1"),
        "incompressible",
        "incompressible",
    )


@claim("C099")
def fascia_is_modelled(e: Evidence) -> Finding:
    """Check that fascia is in both sets, in none with muscle's own material."""
    fascia = [region.name for region in e.limb.regions if region.tissue == "fascia"]
    area = sum(region.area for region in e.limb.regions if region.tissue == "fascia")
    muscle = e.laws["separate"]["muscle"]
    ignored = [name for name, laws in e.laws.items() if laws["fascia"] == muscle]
    return Finding(
        bool(fascia) and not ignored,
        f"{len(fascia)} regions, {number(area)} mm², in both sets",
        "in both sets",
    )
