"""The calibration of the combined material beside a study, read from its folder: Figure 3."""

from pathlib import Path
from typing import Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from PIL import Image
from pydantic import BaseModel, ConfigDict, Field, PositiveFloat, field_validator

from calfsocket.calibration.names import (
    CURVES_FILE,
    FIGURE,
    FITTED,
    FOLDER,
    IGNORED,
    LABELS,
    RESULT_FILE,
    SEPARATE,
    TABLE1,
)
from calfsocket.io.errors import InputError
from calfsocket.io.schema import read_json
from calfsocket.report.chapters import Drawn
from calfsocket.report.table import TOGETHER, Table, number

NUMBER, NAME = "3", "figure3_calibration"
TITLE = "Calibration of the combined material"
CAPTION = (
    "A flat plate presses a piece of tissue. Force over displacement of the Separate set, of one "
    "law for muscle and fascia fitted to it, of the paper's Combined law, and of muscle's law in "
    "the place of fascia's. The paper gives neither dimensions nor stroke of its model."
)


class NoCalibration(InputError):
    """There is no calibration beside the study; the text says how to get one."""


class _Content(BaseModel):
    model_config = ConfigDict(frozen=True, allow_inf_nan=False)


class CombinedLaw(_Content):
    """Ogden's law of one term for muscle and fascia."""

    mu_kPa: float
    alpha: float
    d1_per_MPa: float


class FittedLaw(CombinedLaw):
    """The law fitted; covariance of the parameters as shares of them."""

    alpha_at_limit: bool
    relative_covariance: list[list[float]] = Field(min_length=2)

    @field_validator("relative_covariance")
    @classmethod
    def _is_covariance(cls, rows: list[list[float]]) -> list[list[float]]:
        if any(len(row) != len(rows) or row[i] < 0 for i, row in enumerate(rows)):
            raise ValueError("it must be square, without negative numbers on its diagonal")
        return rows

    @property
    def deviation_pct(self) -> NDArray[np.float64]:
        """Standard deviation of each parameter, % of it."""
        return 100 * np.sqrt(np.diag(self.relative_covariance))


class Plate(_Content):
    """Width over all, and radius of the edges towards the skin, mm."""

    width: PositiveFloat
    edge_radius: PositiveFloat


class Inputs(_Content):
    """What the test was made with; laws are those of the Separate set (MPa)."""

    specimen: str
    size: str
    stroke_mm: float
    plate: Plate
    laws: dict[str, dict[str, Any]]


class Checks(_Content):
    """Negative modes at each point of a curve: 0 at a stable equilibrium."""

    negative_modes: list[int]


class CalibrationRecord(_Content):
    """What calibration.json holds of use here."""

    program: Literal["calfsocket calibrate"]
    inputs: Inputs
    fits: list[FittedLaw] = Field(min_length=1)
    table1: CombinedLaw
    curves: dict[str, Checks]


class Calibration:
    """A calibration: its inputs, the law found, and forces over displacement.

    Attributes
    ----------
    inputs : Inputs
        Of the test.
    fit : FittedLaw
        The best of the fits.
    table1 : CombinedLaw
        The paper's.
    unstable : tuple of str
        Curves with an unstable equilibrium.
    displacement : (n,) array
        Of the plate, mm.
    force : dict of str to (n,) array
        `SEPARATE`, `FITTED`, `TABLE1`, `IGNORED` -> force, N per metre of limb.
    figure : Drawn
        Figure 3.
    """

    def __init__(self, folder: Path) -> None:
        """Read a calibration's folder.

        Raises
        ------
        InputError
            When a file is missing or cannot be used.
        """
        found = read_json(folder / RESULT_FILE, CalibrationRecord)
        self.inputs, self.fit, self.table1 = found.inputs, found.fits[0], found.table1
        self.unstable = tuple(
            name for name, curve in found.curves.items() if any(curve.negative_modes)
        )
        curves = _read_curves(folder / CURVES_FILE)
        self.displacement = curves.displacement_mm.to_numpy()
        self.force = {name: curves[f"{name}_N_per_m"].to_numpy() for name in LABELS}
        files = (folder / f"{FIGURE}.png", folder / f"{FIGURE}.pdf")
        self.figure = Drawn(NAME, TITLE, CAPTION, NUMBER, *files)
        _check_figure(self.figure)

    def deviation_pct(self, name: str) -> float:
        """Root mean square difference of a curve to Separate's, % of its largest force."""
        reference = self.force[SEPARATE]
        difference = self.force[name] - reference
        return float(100 * np.sqrt(np.mean(difference**2)) / np.abs(reference).max())


def read_calibration(study: Path) -> Calibration:
    """Read the calibration in a study's folder.

    Raises
    ------
    NoCalibration
        When there is none.
    InputError
        When it cannot be used.
    """
    folder = study / FOLDER
    if not folder.exists():
        raise NoCalibration(
            "needs the calibration of the combined material: solve `python3 -m calfsocket "
            f"calibrate --out FOLDER/{FOLDER}`, FOLDER being this study's, and report again"
        )
    return Calibration(folder)


def _read_curves(path: Path) -> pd.DataFrame:
    try:
        curves = pd.read_csv(path)
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read ({error}); calibrate again") from None
    columns = ["displacement_mm", *(f"{name}_N_per_m" for name in LABELS)]
    for column in columns:
        if column not in curves:
            raise InputError(f"{path}: has no column '{column}'; calibrate again")
        numeric = pd.api.types.is_numeric_dtype(curves[column])
        if curves.empty or not numeric or not (curves[column] > 0).all():
            raise InputError(f"{path}: column '{column}' holds other than numbers above 0")
    return curves[columns]


def _check_figure(figure: Drawn) -> None:
    try:
        with Image.open(figure.png) as image:
            image.load()
    except (OSError, SyntaxError) as error:
        raise InputError(f"{figure.png}: cannot be read ({error}); calibrate again") from None
    if not figure.pdf.is_file():
        raise InputError(f"{figure.pdf}: is missing; calibrate again")


def table(calibration: Calibration, laws: dict[str, dict[str, Any]]) -> Table:
    """Return the laws compared, and how far their curves are from Separate's.

    Parameters
    ----------
    calibration : Calibration
        To show.
    laws : dict
        Laws of the study's Separate set, tissue by tissue, which a note compares.
    """
    inputs, fit = calibration.inputs, calibration.fit
    muscle = inputs.laws.get("muscle", {})
    sd = fit.deviation_pct
    rows: list[dict[str, Any]] = [
        {"curve": SEPARATE},
        {"curve": FITTED, "mu_sd_pct": sd[0], "alpha_sd_pct": sd[1], **_law(fit)},
        {"curve": TABLE1, **_law(calibration.table1)},
        {"curve": IGNORED},
    ]
    if muscle.get("law") == "ogden" and len(muscle["mu"]) == 1:
        rows[3] |= {
            "mu_kPa": 1e3 * muscle["mu"][0],
            "alpha": muscle["alpha"][0],
            "d1_per_MPa": muscle["d1"],
        }
    for row in rows:
        row["rms_off_separate_pct"] = calibration.deviation_pct(row["curve"])
        row["largest_force_N_per_m"] = calibration.force[row["curve"]][-1]
    data = pd.DataFrame(rows)
    shown = pd.DataFrame(
        {
            "mu, kPa": _with_deviation(data.mu_kPa, data.mu_sd_pct),
            "alpha": _with_deviation(data.alpha, data.alpha_sd_pct),
            "D1, 1/MPa": [number(value) for value in data.d1_per_MPa],
            "off Separate, %": [number(value) for value in data.rms_off_separate_pct],
            f"force at {inputs.stroke_mm:g} mm, N/m": [
                number(value) for value in data.largest_force_N_per_m
            ],
        }
    )
    shown.index = pd.Index([LABELS[name] for name in data.curve])
    return Table(
        FOLDER,
        "Laws of muscle and fascia in the calibration",
        f"Indentation of the {inputs.specimen}, mesh “{inputs.size}”. Off Separate: root mean "
        "square over the curve, % of Separate's largest force. ±: one standard deviation, from "
        "the misfit of two models and not from noise.",
        data,
        shown,
        tuple(_notes(calibration, laws)),
    )


def _law(law: CombinedLaw) -> dict[str, float]:
    return {"mu_kPa": law.mu_kPa, "alpha": law.alpha, "d1_per_MPa": law.d1_per_MPa}


def _with_deviation(values: pd.Series, deviations: pd.Series) -> list[str]:
    texts = []
    for value, deviation in zip(values, deviations, strict=True):
        text = number(value)
        if deviation >= 100:
            text += " (not determined)"
        elif np.isfinite(deviation):
            text += f"{TOGETHER}±{TOGETHER}{deviation:.2g}{TOGETHER}%"
        texts.append(text)
    return texts


def _notes(calibration: Calibration, laws: dict[str, dict[str, Any]]) -> list[str]:
    """Say what the fit is worth."""
    notes = []
    if calibration.fit.alpha_at_limit:
        notes.append(
            f"alpha ended at an end of its range ({number(calibration.fit.alpha)}): the curve "
            "does not determine it."
        )
    if calibration.unstable:
        names = ", ".join(LABELS.get(name, name) for name in calibration.unstable)
        notes.append(f"Unstable at some displacement: {names}.")
    test = calibration.inputs.laws
    differ = [tissue for tissue in laws if tissue in test and test[tissue] != laws[tissue]]
    if differ:
        notes.append(f"Calibrated with other laws than this study's: {', '.join(differ)}.")
    return notes
