"""The calibration of the combined material beside a study, read from its folder: Figure 3."""

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
from calfsocket.calibration.record import CalibrationRecord, CombinedLaw, deviation, read_curves
from calfsocket.io.errors import InputError
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
        record = CalibrationRecord.read(folder)
        self.inputs, self.fit, self.table1 = record.inputs, record.fits[0], record.table1
        self.unstable = tuple(
            name for name, curve in record.curves.items() if any(curve.negative_modes)
        )
        self.displacement, self.force = read_curves(folder)
        files = (folder / f"{FIGURE}.png", folder / f"{FIGURE}.pdf")
        self.figure = Drawn(NAME, TITLE, CAPTION, NUMBER, *files)
        _check_figure(self.figure)

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
    return Calibration(folder)


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
    law = set(CombinedLaw.model_fields)
    rows: list[dict[str, Any]] = [
        {"curve": SEPARATE},
        {"curve": FITTED, "mu_sd_pct": sd[0], "alpha_sd_pct": sd[1], **fit.model_dump(include=law)},
        {"curve": TABLE1, **calibration.table1.model_dump()},
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
    """Return remarks on what the fit is worth."""
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
