"""Thresholds of a study: how much of a tissue holds a stress or strain beyond one.

The share is counted by the rules that the maxima are found by, so that it is above 0 where the
maximum in summary.csv is beyond the threshold, and 0 elsewhere:

- contact pressure: share of the skin's outline, by reference length, whose 3 mm running mean is
  beyond the threshold;
- any other outcome: share of the tissue's area in the reference section that lies in pairs of
  neighbouring elements which hold a level beyond the threshold (`outcomes.signed_levels`). Stress
  and strain components count by their magnitude, pressure in compression.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import pandas as pd

from calfsocket.io.errors import InputError
from calfsocket.meshes.quality import determinant, jacobians
from calfsocket.postprocess.contact_line import ContactLine
from calfsocket.postprocess.fields import GAUSS_POINTS, TISSUES, SectionFields
from calfsocket.postprocess.quantities import (
    SIGNED,
    SUMMARY_COLUMNS,
    SUMMARY_TISSUES,
    UNITS,
    cell_outcomes,
    neighbours,
    running_mean,
    signed_levels,
)

CONTACT_PRESSURE = "contact_pressure"
THRESHOLD_UNITS = {CONTACT_PRESSURE: "kPa", **UNITS}


@dataclass(frozen=True)
class Threshold:
    """A level of an outcome in a tissue.

    Attributes
    ----------
    outcome : str
        "contact_pressure", on the skin, or one of `outcomes.UNITS`.
    tissue : str
        One of `outcomes.SUMMARY_TISSUES`.
    value : float
        In the outcome's unit, above 0.
    """

    outcome: str
    tissue: str
    value: float

    def __post_init__(self) -> None:
        if self.outcome not in THRESHOLD_UNITS:
            raise InputError(
                f"outcome is {self.outcome!r}; use one of {', '.join(THRESHOLD_UNITS)}"
            )
        tissues = ("skin",) if self.outcome == CONTACT_PRESSURE else SUMMARY_TISSUES
        if self.tissue not in tissues:
            raise InputError(
                f"tissue is {self.tissue!r}; for {self.outcome} use one of {', '.join(tissues)}"
            )
        if not (math.isfinite(self.value) and self.value > 0):
            raise InputError(f"value is {self.value} {self.unit}; give a finite number above 0")

    @property
    def unit(self) -> str:
        """Unit of the outcome."""
        return THRESHOLD_UNITS[self.outcome]

    @property
    def name(self) -> str:
        """Name of the share in summary.csv, e.g. ``share_of_contact_pressure_above_60_kPa``."""
        unit = {"%": "percent"}.get(self.unit, self.unit)
        return f"share_of_{self.outcome}_above_{self.value:.10g}_{unit}"


def threshold_rows(
    fields: SectionFields,
    contact: ContactLine,
    thresholds: Iterable[Threshold],
    socket: str,
    material_set: str,
) -> pd.DataFrame:
    """Rows of summary.csv: the share, %, of each tissue beyond its threshold.

    A tissue that the section does not have is left out.
    """
    rows = []
    for threshold in thresholds:
        if TISSUES.index(threshold.tissue) not in fields.tissue:
            continue
        if threshold.outcome == CONTACT_PRESSURE:
            share = outline_share(contact, threshold.value)
        else:
            share = area_share(fields, threshold)
        rows.append(
            {
                "socket": socket,
                "material_set": material_set,
                "tissue": threshold.tissue,
                "outcome": threshold.name,
                "value": 100 * share,
                "unit": "%",
                "x_mm": np.nan,
                "y_mm": np.nan,
                "region": "",
            }
        )
    return pd.DataFrame(rows, columns=list(SUMMARY_COLUMNS))


def outline_share(contact: ContactLine, value: float) -> float:
    """Share of the skin's outline whose running mean of contact pressure is above a value, kPa."""
    beyond = running_mean(contact) > value
    return float(contact.weight_mm[beyond].sum() / contact.weight_mm.sum())


def area_share(fields: SectionFields, threshold: Threshold) -> float:
    """Share of a tissue's area in pairs of elements that hold a level beyond a threshold."""
    pairs = neighbours(fields)
    level = signed_levels(cell_outcomes(fields), pairs, threshold.outcome)
    if threshold.outcome in SIGNED:
        level = np.abs(level)
    inside = fields.tissue == TISSUES.index(threshold.tissue)
    holds = np.zeros(len(fields.cells), dtype=bool)
    holds[pairs.cells[level > threshold.value]] = True
    area = np.abs(determinant(jacobians(fields.points[fields.cells], GAUSS_POINTS))).sum(axis=1)
    return float(area[holds & inside].sum() / area[inside].sum())
