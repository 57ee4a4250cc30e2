"""How much of a tissue is beyond a threshold: the one definition that tables and reports use.

- Contact pressure: share of the skin's outline, by reference length, whose 3 mm running mean is
  above the threshold.
- Any other quantity: share of the tissue's area in the reference section whose Gauss points are
  beyond the threshold. Each Gauss point stands for its part of the area, as the damage risk volume
  is counted. Stress and strain components count by their magnitude, pressure in compression and
  tensile strain in tension.

The share is of points, the maximum in the summary is a level that two neighbouring elements hold:
a share may be above 0 where the maximum does not reach the threshold.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from calfsocket.io.errors import InputError
from calfsocket.postprocess.contact_line import ContactLine
from calfsocket.postprocess.fields import TISSUES, SectionFields
from calfsocket.postprocess.quantities import (
    MEASURES,
    NOWHERE,
    REPORTED,
    SIGNED,
    Quantities,
    summary_table,
)

if TYPE_CHECKING:
    import pandas as pd

CONTACT_PRESSURE = "contact_pressure"
THRESHOLD_UNITS = {CONTACT_PRESSURE: "kPa", **MEASURES}

SHARE = "share_of_"
"""Start of the name of a share in the summary."""


@dataclass(frozen=True)
class Threshold:
    """A value above 0 of a quantity in one of `REPORTED`."""

    quantity: str
    """One of `THRESHOLD_UNITS`; "contact_pressure" is that on the skin."""
    tissue: str
    value: float
    """In the quantity's unit."""

    def __post_init__(self) -> None:
        if self.quantity not in THRESHOLD_UNITS:
            raise InputError(f"quantity is {self.quantity!r}; use {', '.join(THRESHOLD_UNITS)}")
        tissues = ("skin",) if self.quantity == CONTACT_PRESSURE else REPORTED
        if self.tissue not in tissues:
            raise InputError(
                f"tissue is {self.tissue!r}; for {self.quantity} use {', '.join(tissues)}"
            )
        if not (math.isfinite(self.value) and self.value > 0):
            raise InputError(f"value is {self.value} {self.unit}; use a finite number above 0")

    @property
    def unit(self) -> str:
        """Unit of the quantity."""
        return THRESHOLD_UNITS[self.quantity]

    @property
    def name(self) -> str:
        """Name of the share in summary.csv, e.g. ``share_of_contact_pressure_above_60_kPa``."""
        unit = {"%": "percent"}.get(self.unit, self.unit)
        return f"{SHARE}{self.quantity}_above_{self.value:.10g}_{unit}"


def tissue_area(fields: SectionFields, tissue: str) -> float:
    """Area of a tissue in the reference section, mm^2."""
    return float(fields.gauss_area[fields.cells_of(tissue)].sum())


def area_beyond(quantities: Quantities, threshold: Threshold) -> float:
    """Area of a tissue in the reference section that is beyond a threshold, mm^2."""
    fields, values = quantities.fields, quantities.gauss[threshold.quantity]
    if threshold.quantity in SIGNED:
        values = np.abs(values)
    inside = (fields.tissue == TISSUES.index(threshold.tissue))[:, None]
    return float(fields.gauss_area[inside & (values > threshold.value)].sum())


def share_beyond(quantities: Quantities, contact: ContactLine, threshold: Threshold) -> float:
    """Return the share of a tissue, 0 to 1, that is beyond a threshold (see this module)."""
    if threshold.quantity == CONTACT_PRESSURE:
        beyond = contact.running_mean_kPa > threshold.value
        return float(contact.weight_mm[beyond].sum() / contact.weight_mm.sum())
    return area_beyond(quantities, threshold) / tissue_area(quantities.fields, threshold.tissue)


def shares_beyond(
    quantities: Quantities, contact: ContactLine, thresholds: Iterable[Threshold]
) -> "pd.DataFrame":
    """Return the share, %, of each tissue beyond its threshold, as rows of the summary.

    A tissue that the section does not have is left out.
    """
    present = set(quantities.fields.tissue)
    return summary_table(
        (
            threshold.tissue,
            threshold.name,
            "%",
            replace(NOWHERE, value=100 * share_beyond(quantities, contact, threshold)),
        )
        for threshold in thresholds
        if TISSUES.index(threshold.tissue) in present
    )
