"""Where strains pass a damage threshold: how much of muscle and of fascia, and by how much.

Default thresholds are 50 % shear strain in muscle, whose volume beyond it is the damage risk volume
(Moerman et al.), and 27 % strain of leg fascia in tensile tests (Stecco et al.). Fascia is compared
with the latter by its absolute maximum principal strain, also where that is compressive, by its
tensile principal strain and by its shear strain.
"""

import math
from dataclasses import dataclass

import pandas as pd

from calfsocket.io.errors import InputError
from calfsocket.postprocess.fields import TISSUES
from calfsocket.postprocess.levels import NEARLY_ALL, statistics_of
from calfsocket.postprocess.thresholds import Threshold, area_beyond, tissue_area
from calfsocket.simulation.results import KEY, Results

COLUMNS = (
    *KEY,
    "tissue",
    "quantity",
    "threshold_pct",
    "level_pct",
    "region",
    "below_99.9_pct",
    "area_mm2",
    "area_share_pct",
)


@dataclass(frozen=True)
class DamageThresholds:
    """Strains beyond which tissue is counted as at risk, %."""

    muscle_shear_pct: float = 50.0
    """Of |LE12|, the engineering shear."""
    fascia_strain_pct: float = 27.0
    """Of |AMP|, of the tensile principal strain, and of |LE12|."""

    def __post_init__(self) -> None:
        for key, value in vars(self).items():
            if not (math.isfinite(value) and value > 0):
                raise InputError(f"{key} is {value} %; it must be above 0")

    @property
    def all(self) -> tuple[Threshold, ...]:
        """One threshold a tissue and strain."""
        return (
            Threshold("shear_log_strain", "muscle", self.muscle_shear_pct),
            Threshold("amp_log_strain", "fascia", self.fascia_strain_pct),
            Threshold("tensile_log_strain", "fascia", self.fascia_strain_pct),
            Threshold("shear_log_strain", "fascia", self.fascia_strain_pct),
        )


def damage(results: Results, thresholds: DamageThresholds) -> pd.DataFrame:
    """Compare strains with damage thresholds.

    Returns
    -------
    DataFrame
        One row a solved case and threshold: socket, material_set, tissue, quantity, threshold_pct;
        level_pct, the magnitude of the maximum, with its region; below_99.9_pct, the magnitude that
        99.9 % of the tissue's area stays below; area_mm2 and area_share_pct, the
        part of the tissue beyond the threshold (`calfsocket.postprocess.thresholds`): for muscle
        the damage risk volume of a slice.
    """
    rows = []
    for key, result in results.items():
        for threshold in thresholds.all:
            tissue, quantity = threshold.tissue, threshold.quantity
            if TISSUES.index(tissue) not in result.fields.tissue:
                continue
            level = result.quantities.maximum(tissue, quantity)
            area = area_beyond(result.quantities, threshold)
            share = 100 * area / tissue_area(result.fields, tissue)
            below = statistics_of(result.quantities, tissue, quantity)[NEARLY_ALL]
            about = tissue, quantity, threshold.value, abs(level.value), level.region, below
            rows.append((*key, *about, area, share))
    return pd.DataFrame(rows, columns=list(COLUMNS))
