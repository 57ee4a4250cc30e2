"""A hand-made calibration in a folder, as `calibrate` writes it, for the tests of the report."""

from pathlib import Path

import pandas as pd
from PIL import Image

from calfsocket.calibration.record import CalibrationRecord
from calfsocket.materials.material_set import MaterialSet

FORCE = {
    "separate": (10.0, 20.0, 30.0, 40.0),
    "combined_fitted": (10.0, 20.0, 30.0, 44.0),
    "combined_table1": (10.0, 20.0, 36.0, 48.0),
    "fascia_ignored": (5.0, 8.0, 9.0, 10.0),
}


def write_calibration(
    folder: Path, force: dict | None = None, inputs: dict | None = None, fit: dict | None = None
) -> Path:
    """Write a calibration; forces (N/m) at 1, 2, 3, 4 mm, inputs and fit beside the usual ones."""
    folder.mkdir(parents=True)
    fitted = {"mu_kPa": 11.0, "alpha": 9.0, "d1_per_MPa": 1.83, "alpha_at_limit": False}
    fitted |= {"start": {"mu_kPa": 5.0, "alpha": 5.0}, "rms_share_of_largest_force": 0.05}
    fitted |= {"parameters": ["mu", "alpha"], "correlation": [[1, 0], [0, 1]], "curves_solved": 9}
    covariance = [[0.0004, 0.0], [0.0, 0.0225]]
    separate = MaterialSet.paper("separate").tissue_laws()
    laws = {tissue: law.model_dump(mode="json") for tissue, law in separate.items()}
    content = {
        "inputs": {
            "specimen": "compound",
            "size": "coarse",
            "stroke_mm": 4.0,
            "plate": {"width": 30.0, "edge_radius": 5.0, "thickness": 8.0},
            "laws": laws,
            "geometry": {},
            "cells": 700,
            "points": 4,
            "contact": {},
            "free_d": False,
            "nu": 0.495,
        }
        | (inputs or {}),
        "fits": [fitted | {"relative_covariance": covariance} | (fit or {})],
        "table1": {"mu_kPa": 12.0, "alpha": 14.0, "d1_per_MPa": 1.67},
        "deviation_from_separate": {},
        "ordering": {},
        "curves": {
            name: {"negative_modes": [0, 0, 0, 0], "newton_iterations": 9, "cutbacks": 0}
            for name in FORCE
        },
    }
    CalibrationRecord.model_validate(content).write(folder)
    curves = {f"{name}_N_per_m": values for name, values in (FORCE | (force or {})).items()}
    pd.DataFrame({"displacement_mm": (1.0, 2.0, 3.0, 4.0)} | curves).to_csv(
        folder / "curves.csv", index=False
    )
    Image.new("RGB", (900, 400), "#c96a5f").save(folder / "figure3.png")
    (folder / "figure3.pdf").write_bytes(b"%PDF-1.4")
    return folder
