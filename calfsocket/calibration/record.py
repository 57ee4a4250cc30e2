"""What a calibration leaves in its folder: calibration.json and curves.csv, written and read."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, Self

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from pydantic import Field, field_validator

from calfsocket.calibration.names import CURVES_FILE, LABELS, RESULT_FILE, SEPARATE
from calfsocket.io.errors import InputError
from calfsocket.io.files import replacing, write_json
from calfsocket.io.schema import Strict, read_json
from calfsocket.io.tables import FLOAT_FORMAT
from calfsocket.io.versions import versions
from calfsocket.meshes.plate import Plate

FloatArray = NDArray[np.float64]


class Parameters(Strict):
    """Ogden's parameters of one term, such as those where a search began."""

    mu_kPa: float
    alpha: float


class CombinedLaw(Parameters):
    """Ogden's law of one term for muscle and fascia."""

    d1_per_MPa: float


class FittedLaw(CombinedLaw):
    """The law fitted, and how well it is determined."""

    start: Parameters
    alpha_at_limit: bool  #: whether alpha ended at an end of its range
    rms_share_of_largest_force: float  #: of the difference to Separate's curve
    parameters: tuple[str, ...]  #: what was free: mu, alpha and perhaps d1
    #: Of the parameters' relative changes, (k, k).
    relative_covariance: tuple[tuple[float, ...], ...] = Field(min_length=2)
    correlation: tuple[tuple[float, ...], ...]
    curves_solved: int

    @field_validator("relative_covariance")
    @classmethod
    def _is_covariance(cls, rows: tuple[tuple[float, ...], ...]) -> object:
        if any(len(row) != len(rows) or row[i] < 0 for i, row in enumerate(rows)):
            raise ValueError("it must be square, without negative numbers on its diagonal")
        return rows

    @property
    def deviation_pct(self) -> FloatArray:
        """Standard deviation of each parameter, % of it."""
        return 100 * np.sqrt(np.diag(self.relative_covariance))


class Inputs(Strict):
    """What the test was made with; laws are those of the Separate set (MPa)."""

    specimen: str
    geometry: dict[str, Any]
    plate: Plate
    size: str
    cells: int
    stroke_mm: float
    points: int
    contact: dict[str, Any]
    free_d: bool
    nu: float | None
    laws: dict[str, dict[str, Any]]


class CurveChecks(Strict):
    """How a curve was solved; negative modes at each point are 0 at a stable equilibrium."""

    negative_modes: tuple[int, ...]
    newton_iterations: int
    cutbacks: int


class CalibrationRecord(Strict):
    """The content of calibration.json; the best of the fits comes first."""

    program: Literal["calfsocket calibrate"] = "calfsocket calibrate"
    versions: dict[str, Any] = Field(default_factory=versions)
    inputs: Inputs
    fits: tuple[FittedLaw, ...] = Field(min_length=1)
    table1: CombinedLaw
    deviation_from_separate: dict[str, float]
    ordering: dict[str, bool]
    curves: dict[str, CurveChecks]

    def write(self, folder: Path) -> None:
        """Write calibration.json."""
        write_json(folder / RESULT_FILE, self.model_dump(mode="json"))

    @classmethod
    def read(cls, folder: Path) -> Self:
        """Read calibration.json; raise an `InputError` when it cannot be used."""
        return read_json(folder / RESULT_FILE, cls)


def deviation(force: Mapping[str, FloatArray], name: str) -> float:
    """Return the rms difference of a curve to Separate's, as a share of its largest force."""
    reference = force[SEPARATE]
    difference = (force[name] - reference) / np.abs(reference).max()
    return float(np.sqrt(np.mean(difference**2)))


def write_curves(folder: Path, displacement: FloatArray, force: Mapping[str, FloatArray]) -> None:
    """Write curves.csv: displacement, mm, and the forces of all curves, N per metre of limb."""
    columns = {f"{name}_N_per_m": values for name, values in force.items()}
    table = pd.DataFrame({"displacement_mm": displacement, **columns})
    with replacing(folder / CURVES_FILE) as temporary:
        table.to_csv(temporary, index=False, float_format=FLOAT_FORMAT)


def read_curves(folder: Path) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Read curves.csv as `write_curves` wrote it; raise an `InputError` when it cannot be used."""
    path = folder / CURVES_FILE
    try:
        table = pd.read_csv(path)
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read ({error}); calibrate again") from None

    def column(name: str) -> FloatArray:
        if name not in table:
            raise InputError(f"{path}: has no column '{name}'; calibrate again")
        numeric = pd.api.types.is_numeric_dtype(table[name])
        if table.empty or not numeric or not (table[name] > 0).all():
            raise InputError(f"{path}: column '{name}' must contain only numbers above 0")
        return table[name].to_numpy()

    return column("displacement_mm"), {name: column(f"{name}_N_per_m") for name in LABELS}
