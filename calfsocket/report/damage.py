"""Where strains pass a damage threshold: how much of muscle and of fascia, and by how much.

Default thresholds are 50 % shear strain in muscle, whose volume beyond it is the damage risk volume
(Moerman et al.), and 27 % strain of leg fascia in tensile tests (Stecco et al.). Fascia is compared
with the latter by its absolute maximum principal strain, also where that is compressive, by its
tensile principal strain and by its shear strain.
"""

import math
from dataclasses import dataclass

import numpy as np
import pandas as pd

from calfsocket.io.errors import InputError
from calfsocket.postprocess.fields import TISSUES
from calfsocket.postprocess.levels import NEARLY_ALL, levels_of
from calfsocket.postprocess.mesh_error import MESH_ERROR, error_of
from calfsocket.postprocess.quantities import summary_table
from calfsocket.postprocess.thresholds import Threshold, shares_beyond, tissue_area
from calfsocket.simulation.result import Result
from calfsocket.simulation.results import KEY, Key, Results

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
        the damage risk volume of a slice. Where cases have a second mesh, each of these numbers has
        a column with its mesh error behind them.
    """
    parts = [_of_case(key, result, thresholds) for key, result in results.items()]
    found = pd.concat([part for part in parts if len(part)] or [pd.DataFrame(columns=[*COLUMNS])])
    return found.reset_index(drop=True)


def damage_after_stages(results: Results, thresholds: DamageThresholds) -> pd.DataFrame:
    """Return the rows of `damage` at the end of each stage of loading, its name in `state`."""
    parts = [
        _of_case(key, at_end, thresholds).assign(state=name)
        for key, result in results.items()
        for name, at_end in result.states.items()
    ]
    found = pd.concat([part for part in parts if len(part)] or [pd.DataFrame(columns=[*COLUMNS])])
    return found.reset_index(drop=True)


def _of_case(key: Key, result: Result, thresholds: DamageThresholds) -> pd.DataFrame:
    """Return the rows of a case."""
    asked = [each for each in thresholds.all if TISSUES.index(each.tissue) in result.fields.tissue]
    maxima = result.with_mesh_error(
        lambda of: summary_table(
            (each.tissue, each.quantity, each.unit, of.quantities.maximum(*_pair(each)))
            for each in asked
        )
    )
    below = result.levels_with_error(lambda of: levels_of(of.quantities, map(_pair, asked)))
    shares = result.with_mesh_error(lambda of: shares_beyond(of.quantities, of.line, asked))
    areas = np.array([tissue_area(result.fields, each.tissue) / 100 for each in asked])
    found = pd.DataFrame(
        {
            **dict(zip(KEY, key, strict=True)),
            "tissue": maxima.tissue,
            "quantity": maxima["quantity"],
            "threshold_pct": [each.value for each in asked],
            "level_pct": maxima.value.abs(),
            "region": maxima.region,
            "below_99.9_pct": below[NEARLY_ALL],
            "area_mm2": areas * shares.value,
            "area_share_pct": shares.value,
        }
    )
    if result.second is None:
        return found
    errors = {
        "level_pct": maxima[MESH_ERROR],
        "below_99.9_pct": below[error_of(NEARLY_ALL)],
        "area_mm2": areas * shares[MESH_ERROR],
        "area_share_pct": shares[MESH_ERROR],
    }
    return found.assign(**{error_of(column): error for column, error in errors.items()})


def _pair(threshold: Threshold) -> tuple[str, str]:
    return threshold.tissue, threshold.quantity
