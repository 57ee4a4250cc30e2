"""Where strains pass a damage threshold: how much of muscle and of fascia, and by how much.

Thresholds of the paper: 50 % shear strain in muscle, whose volume beyond it is the damage risk
volume (Moerman et al.), and 27 % strain of leg fascia in tensile tests (Stecco et al.). The paper
holds its absolute maximum principal strain against the latter, also where that is compressive; the
tensile principal strain stands beside it here.
"""

import math
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from calfsocket.io.errors import InputError
from calfsocket.meshes.quality import determinant, jacobians
from calfsocket.postprocess.fields import GAUSS_POINTS, TISSUES, SectionFields
from calfsocket.postprocess.quantities import (
    EXTRAPOLATION,
    CellOutcomes,
    absolute_maximum_principal,
    log_strain,
    maximum,
    node_average,
)
from calfsocket.report.results import Results, SolvedCase


@dataclass(frozen=True)
class Thresholds:
    """Strains beyond which tissue is counted as at risk, %.

    Attributes
    ----------
    muscle_shear_pct : float
        Of |LE12|, the engineering shear.
    fascia_strain_pct : float
        Of |AMP|, of the tensile principal strain, and of |LE12|.
    """

    muscle_shear_pct: float = 50.0
    fascia_strain_pct: float = 27.0

    def __post_init__(self) -> None:
        for key, value in vars(self).items():
            if not (math.isfinite(value) and value > 0):
                raise InputError(f"{key} is {value}; give a strain above 0, in %")


INDICATORS = (
    ("muscle", "shear_log_strain"),
    ("fascia", "amp_log_strain"),
    ("fascia", "tensile_log_strain"),
    ("fascia", "shear_log_strain"),
)
"""Tissue and strain. tensile_log_strain is the largest principal strain; the others as always."""


def gauss_areas(fields: SectionFields) -> NDArray[np.float64]:
    """Area of the reference section that each Gauss point stands for, mm^2, (n_cells, 3)."""
    return np.abs(determinant(jacobians(fields.points[fields.cells], GAUSS_POINTS))) / 6


def tensile_strain(strain: NDArray[np.float64]) -> NDArray[np.float64]:
    """Largest principal value in the plane of e11, e22, e12 (..., 3)."""
    e11, e22, e12 = np.moveaxis(strain, -1, 0)
    return 0.5 * (e11 + e22) + np.hypot(0.5 * (e11 - e22), e12)


def damage(results: Results, thresholds: Thresholds | None = None) -> pd.DataFrame:
    """Compare strains with damage thresholds.

    Parameters
    ----------
    results : Results
        Of a study.
    thresholds : Thresholds, optional
        The paper's by default.

    Returns
    -------
    DataFrame
        One row a solved case and indicator: socket, material_set, tissue, outcome, threshold_pct;
        level_pct, the magnitude held by the paper's rule, with its region; area_mm2 and
        area_share_pct, the part of the tissue whose strain is above the threshold, by Gauss points
        of the reference section: the damage risk volume of a slice.
    """
    thresholds = thresholds or Thresholds()
    limits = {"muscle": thresholds.muscle_shear_pct, "fascia": thresholds.fascia_strain_pct}
    rows = []
    for socket, material_set in results.cases:
        case = results.case(socket, material_set)
        present = set(case.fields.tissue)
        for tissue, outcome in INDICATORS:
            if TISSUES.index(tissue) not in present:
                continue
            row = _row(case, tissue, outcome, limits[tissue])
            rows.append({"socket": socket, "material_set": material_set, **row})
    return pd.DataFrame(rows)


def _row(case: SolvedCase, tissue: str, outcome: str, limit: float) -> dict[str, object]:
    fields = case.fields
    strain = log_strain(fields.deformation_gradient)
    outcomes = case.outcomes
    if outcome == "tensile_log_strain":
        outcomes = _tensile(fields, strain)
    held = maximum(fields, outcomes, case.pairs, tissue, outcome)
    inside = fields.tissue == TISSUES.index(tissue)
    area = gauss_areas(fields)[inside]
    beyond = area[_magnitude(strain[inside], outcome) > limit].sum()
    return {
        "tissue": tissue,
        "outcome": outcome,
        "threshold_pct": limit,
        "level_pct": abs(held.value),
        "region": held.region,
        "area_mm2": beyond,
        "area_share_pct": 100 * beyond / area.sum(),
    }


def _tensile(fields: SectionFields, strain: NDArray[np.float64]) -> CellOutcomes:
    nodal = node_average(fields)(100 * tensile_strain(EXTRAPOLATION @ strain))
    mean = 100 * tensile_strain(strain).mean(axis=1)
    return CellOutcomes({"tensile_log_strain": nodal}, {"tensile_log_strain": mean})


def _magnitude(strain: NDArray[np.float64], outcome: str) -> NDArray[np.float64]:
    """Strain at the Gauss points that is held against a threshold, %."""
    if outcome == "tensile_log_strain":
        return 100 * tensile_strain(strain)
    if outcome == "amp_log_strain":
        return 100 * np.abs(absolute_maximum_principal(strain))
    return 200 * np.abs(strain[..., 2])
