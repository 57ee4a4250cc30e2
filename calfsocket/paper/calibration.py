"""The calibration of the combined material beside a study, read from its folder: Figure 3."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from PIL import Image

from calfsocket.calibration.names import (
    FIGURE,
    FITTED,
    FOLDER,
    IGNORED,
    LABELS,
    SEPARATE,
    TABLE1,
)
from calfsocket.calibration.record import (
    CalibrationRecord,
    CombinedLaw,
    FittedLaw,
    FloatArray,
    deviation,
    read_curves,
)
from calfsocket.io.errors import InputError
from calfsocket.report.table import Table
from calfsocket.report.words import TOGETHER, number


class NoCalibration(InputError):
    """There is no calibration beside the study; the text says how to get one."""


@dataclass(frozen=True)
class Calibration:
    """A calibration as its folder has it."""

    record: CalibrationRecord
    force: dict[str, FloatArray]
    """Curve -> forces over displacement, N per metre of limb."""
    figure: tuple[Path, Path]
    """Figure 3, as PNG and as PDF."""

    @property
    def fit(self) -> FittedLaw:
        """The best of the fits."""
        return self.record.fits[0]

    def deviation_pct(self, name: str) -> float:
        """Root mean square difference of a curve to Separate's, % of its largest force."""
        return 100 * deviation(self.force, name)


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
    record = CalibrationRecord.read(folder)
    _, force = read_curves(folder)
    png, pdf = folder / f"{FIGURE}.png", folder / f"{FIGURE}.pdf"
    try:
        with Image.open(png) as image:
            image.load()
    except (OSError, SyntaxError) as error:
        raise InputError(f"{png}: cannot be read ({error}); calibrate again") from None
    if not pdf.is_file():
        raise InputError(f"{pdf}: is missing; calibrate again")
    return Calibration(record, force, (png, pdf))


def table(calibration: Calibration, laws: dict[str, dict[str, Any]]) -> Table:
    """Return the laws compared, and how far their curves are from Separate's.

    `laws` are those of the study's Separate set, tissue by tissue, which a note compares.
    """
    inputs, fit = calibration.record.inputs, calibration.fit
    muscle = inputs.laws.get("muscle", {})
    sd = fit.deviation_pct
    law = set(CombinedLaw.model_fields)
    rows: list[dict[str, Any]] = [
        {"curve": SEPARATE},
        {"curve": FITTED, "mu_sd_pct": sd[0], "alpha_sd_pct": sd[1], **fit.model_dump(include=law)},
        {"curve": TABLE1, **calibration.record.table1.model_dump()},
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
            "D1, 1/MPa": data.d1_per_MPa.map(number),
            "off Separate, %": data.rms_off_separate_pct.map(number),
            f"force at {inputs.stroke_mm:g} mm, N/m": data.largest_force_N_per_m.map(number),
        }
    )
    shown.index = pd.Index([LABELS[name] for name in data.curve])
    return Table(FOLDER, data, shown, tuple(_notes(calibration, laws)))


def _with_deviation(values: pd.Series, deviations: pd.Series) -> list[str]:
    texts = []
    for value, sd in zip(values, deviations, strict=True):
        text = number(value)
        if sd >= 100:
            text += " (not determined)"
        elif np.isfinite(sd):
            text += f"{TOGETHER}±{TOGETHER}{sd:.2g}{TOGETHER}%"
        texts.append(text)
    return texts


def _notes(calibration: Calibration, laws: dict[str, dict[str, Any]]) -> list[str]:
    """Return how good the fit is, in words."""
    notes = []
    if calibration.fit.alpha_at_limit:
        notes.append(
            f"alpha is at a limit of its range ({number(calibration.fit.alpha)}): the curve "
            "does not determine it."
        )
    curves = calibration.record.curves
    unstable = [LABELS.get(name, name) for name in curves if any(curves[name].negative_modes)]
    if unstable:
        notes.append(f"Unstable at some displacement: {', '.join(unstable)}.")
    test = calibration.record.inputs.laws
    differ = [tissue for tissue in laws if tissue in test and test[tissue] != laws[tissue]]
    if differ:
        notes.append(f"Calibrated with other laws than this study's: {', '.join(differ)}.")
    return notes
