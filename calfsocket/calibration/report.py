"""What a calibration leaves: curves.csv, calibration.json, a material file, and tables to read."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

import pandas as pd
from rich.console import Console
from rich.table import Table

from calfsocket.calibration.fit import NU, Fit
from calfsocket.calibration.names import (
    CURVES_FILE,
    FITTED,
    IGNORED,
    LABELS,
    RESULT_FILE,
    SEPARATE,
    TABLE1,
)
from calfsocket.calibration.run import Calibration, Settings
from calfsocket.calibration.specimen import LIMB_PLATE
from calfsocket.io.files import replacing, write_json
from calfsocket.io.tables import FLOAT_FORMAT
from calfsocket.io.versions import versions
from calfsocket.materials.file import write_material
from calfsocket.materials.tissues import KPA, MUSCLE_AND_FASCIA, material_set

MATERIAL_FILE = "combined.toml"


def write(calibration: Calibration, settings: Settings, folder: Path) -> None:
    """Write the tables, the result and the fitted material."""
    write_json(folder / RESULT_FILE, content(calibration, settings))
    with replacing(folder / CURVES_FILE) as temporary:
        curves(calibration).to_csv(temporary, index=False, float_format=FLOAT_FORMAT)
    fit = calibration.fits[0]
    write_material(
        folder / MATERIAL_FILE,
        calibration.law,
        {
            "command": "calibrate",
            "tissue": "combined",
            "specimen": settings.specimen,
            "stroke_mm": calibration.specimen.stroke,
            "rms_share_of_largest_force": fit.rms,
            "alpha_at_limit": fit.alpha_at_limit,
        },
    )


def curves(calibration: Calibration) -> pd.DataFrame:
    """Displacement (mm) and forces (N per metre of limb) of all curves."""
    table = pd.DataFrame({"displacement_mm": calibration.curves[SEPARATE].displacement})
    for name, curve in calibration.curves.items():
        table[f"{name}_N_per_m"] = curve.force / KPA  # N/mm in N/m, as MPa in kPa
    return table


def content(calibration: Calibration, settings: Settings) -> dict[str, Any]:
    """Versions, inputs, fits, ordering and how the curves were solved."""
    specimen = calibration.specimen
    on_compound = settings.specimen == "compound"
    geometry = settings.compound if on_compound else settings.limb
    plate = settings.compound.plate if on_compound else LIMB_PLATE
    separate = material_set("separate", settings.fascia_c10, materials=settings.materials)
    return {
        "program": "calfsocket calibrate",
        "versions": versions(),
        "inputs": {
            "specimen": settings.specimen,
            "geometry": geometry.model_dump(mode="json"),
            "plate": plate.model_dump(mode="json"),
            "size": settings.size,
            "cells": specimen.section.mesh.topology.index_map(2).size_global,
            "stroke_mm": specimen.stroke,
            "points": settings.points,
            "contact": asdict(settings.contact),
            "free_d": settings.free_d,
            "nu": None if settings.free_d else NU,
            "laws": {tissue: {"law": law.name, **asdict(law)} for tissue, law in separate.items()},
        },
        "fits": [_fit(fit) for fit in calibration.fits],
        "table1": {
            "mu_kPa": MUSCLE_AND_FASCIA.mu[0] / KPA,
            "alpha": MUSCLE_AND_FASCIA.alpha[0],
            "d1_per_MPa": MUSCLE_AND_FASCIA.d1,
        },
        "deviation_from_separate": {
            name: calibration.deviation(name) for name in (FITTED, TABLE1, IGNORED)
        },
        "ordering": calibration.ordering(),
        "curves": {
            name: {
                "negative_modes": curve.negative_modes.tolist(),
                "newton_iterations": curve.newton_iterations,
                "cutbacks": curve.cutbacks,
            }
            for name, curve in calibration.curves.items()
        },
    }


def _fit(fit: Fit) -> dict[str, Any]:
    return {
        "start": {"mu_kPa": fit.start.mu[0] / KPA, "alpha": fit.start.alpha[0]},
        "mu_kPa": fit.law.mu[0] / KPA,
        "alpha": fit.law.alpha[0],
        "d1_per_MPa": fit.law.d1,
        "alpha_at_limit": fit.alpha_at_limit,
        "rms_share_of_largest_force": fit.rms,
        "parameters": list(fit.names),
        "relative_covariance": fit.relative_covariance.tolist(),
        "correlation": fit.correlation.tolist(),
        "curves_solved": fit.curves,
    }


def show(calibration: Calibration, console: Console) -> None:
    """Print the curves, the fits and the ordering."""
    forces = Table(title="Force of the plate, N per metre of limb")
    forces.add_column("u, mm", justify="right")
    for name in LABELS:
        forces.add_column(LABELS[name], justify="right")
    table = curves(calibration)
    for row in table.to_dict("records"):
        shown = [f"{row[f'{name}_N_per_m']:.1f}" for name in LABELS]
        forces.add_row(f"{row['displacement_mm']:.3g}", *shown)
    off = ["", *(f"{100 * calibration.deviation(name):.1f} %" for name in list(LABELS)[1:])]
    forces.add_section()
    forces.add_row("rms off", *off)
    console.print(forces)

    found = Table(title="Combined material of muscle and fascia")
    for column in ("start mu, kPa; alpha", "mu, kPa", "alpha", "D1, 1/MPa", "rms off"):
        found.add_column(column, justify="right")
    for fit in calibration.fits:
        shown = [f"{fit.law.mu[0] / KPA:.4g}", f"{fit.law.alpha[0]:.4g}", f"{fit.law.d1:.4g}"]
        for i, share in enumerate(fit.relative_deviation):
            shown[i] += f" ± {100 * float(share):.2g} %" if share < 1 else " (not determined)"
        start = f"{fit.start.mu[0] / KPA:g}; {fit.start.alpha[0]:g}"
        found.add_row(start, *shown, f"{100 * fit.rms:.2f} %")
    paper = MUSCLE_AND_FASCIA
    found.add_row(
        "the paper's Table 1",
        f"{paper.mu[0] / KPA:g}",
        f"{paper.alpha[0]:g}",
        f"{paper.d1:.3g}",
        f"{100 * calibration.deviation(TABLE1):.2f} %",
    )
    console.print(found)
    for line in remarks(calibration):
        console.print(line)


def remarks(calibration: Calibration) -> list[str]:
    """Say what the fit is worth, and which of the paper's observations hold."""
    best = calibration.fits[0]
    lines = [
        f"correlation of mu and alpha {best.correlation[0, 1]:.3f}; ± is from the misfit of two "
        "models, not from noise"
    ]
    if best.alpha_at_limit:
        lines.append(
            f"alpha ended at an end of its range ({best.law.alpha[0]:.3g}): the curve does not "
            "determine it"
        )
    lines.append(
        "the paper gives neither dimensions nor stroke of its model, and alpha depends on both: "
        "compare --specimen, --stroke"
    )
    for fit in calibration.fits[1:]:
        if fit.rms > 1.1 * best.rms:
            lines.append(
                f"the search from {fit.start.mu[0] / KPA:g} kPa, {fit.start.alpha[0]:g} ended in "
                "another, worse minimum"
            )
    for name, curve in calibration.curves.items():
        if (curve.negative_modes != 0).any():
            lines.append(
                f"{LABELS[name]}: unstable at some displacement, negative modes "
                f"{curve.negative_modes.tolist()}"
            )
    lines += [
        f"{'holds' if holds else 'does not hold'}: {statement}"
        for statement, holds in calibration.ordering().items()
    ]
    return lines
