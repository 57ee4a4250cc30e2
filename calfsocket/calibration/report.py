"""A calibration written to its folder, and as tables for people."""

from pathlib import Path
from typing import Any

import pandas as pd
from rich.console import Console
from rich.table import Column, Table

from calfsocket.calibration.fit import NU, Fit
from calfsocket.calibration.names import FITTED, IGNORED, LABELS, TABLE1
from calfsocket.calibration.record import CalibrationRecord, write_curves
from calfsocket.calibration.run import Calibration, Settings, separate_laws
from calfsocket.calibration.specimen import LIMB_PLATE
from calfsocket.materials.file import write_material
from calfsocket.materials.laws import Ogden
from calfsocket.materials.tissues import KPA, MUSCLE_AND_FASCIA

MATERIAL_FILE = "combined.toml"


def write(calibration: Calibration, settings: Settings, folder: Path) -> None:
    """Write the curves, the record and the fitted material."""
    record(calibration, settings).write(folder)
    write_curves(folder, calibration.displacement, calibration.force_per_metre)
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


def record(calibration: Calibration, settings: Settings) -> CalibrationRecord:
    """Return inputs, fits, ordering and how the curves were solved."""
    specimen = calibration.specimen
    on_compound = settings.specimen == "compound"
    geometry = settings.compound if on_compound else settings.limb
    separate = separate_laws(settings)
    return CalibrationRecord.model_validate(
        {
            "inputs": {
                "specimen": settings.specimen,
                "size": settings.size,
                "points": settings.points,
                "free_d": settings.free_d,
                "geometry": geometry.model_dump(mode="json"),
                "plate": settings.compound.plate if on_compound else LIMB_PLATE,
                "cells": specimen.section.mesh.topology.index_map(2).size_global,
                "stroke_mm": specimen.stroke,
                "contact": settings.contact.model_dump(),
                "nu": None if settings.free_d else NU,
                "laws": {tissue: law.model_dump(mode="json") for tissue, law in separate.items()},
            },
            "fits": [_fitted(fit) for fit in calibration.fits],
            "table1": _parameters(MUSCLE_AND_FASCIA),
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
    )


def _parameters(law: Ogden) -> dict[str, float]:
    return {"mu_kPa": law.mu[0] / KPA, "alpha": law.alpha[0], "d1_per_MPa": law.d1}


def _fitted(fit: Fit) -> dict[str, Any]:
    return {
        **_parameters(fit.law),
        "start": {"mu_kPa": fit.start.mu[0] / KPA, "alpha": fit.start.alpha[0]},
        "alpha_at_limit": fit.alpha_at_limit,
        "rms_share_of_largest_force": fit.rms,
        "parameters": fit.names,
        "relative_covariance": fit.relative_covariance.tolist(),
        "correlation": fit.correlation.tolist(),
        "curves_solved": fit.curves,
    }


def show(calibration: Calibration, console: Console) -> None:
    """Print the curves, the fits and the ordering."""
    forces = pd.DataFrame(calibration.force_per_metre)[list(LABELS)].map("{:.1f}".format)
    forces.insert(0, "u, mm", [f"{u:.3g}" for u in calibration.displacement])
    off = [f"{100 * calibration.deviation(name):.1f} %" for name in list(LABELS)[1:]]
    forces.loc[len(forces)] = ["rms deviation", "", *off]
    _print(console, "Force of the plate, N per metre of limb", forces.rename(columns=LABELS))

    rows = []
    for fit in calibration.fits:
        parameters = [f"{value:.4g}" for value in _parameters(fit.law).values()]
        for i, share in enumerate(fit.relative_deviation):
            parameters[i] += f" ± {100 * float(share):.2g} %" if share < 1 else " (not determined)"
        start = f"{fit.start.mu[0] / KPA:g}; {fit.start.alpha[0]:g}"
        rows.append([start, *parameters, f"{100 * fit.rms:.2f} %"])
    paper = [f"{value:.3g}" for value in _parameters(MUSCLE_AND_FASCIA).values()]
    rows.append(["the paper's Table 1", *paper, f"{100 * calibration.deviation(TABLE1):.2f} %"])
    columns = ["start mu, kPa; alpha", "mu, kPa", "alpha", "D1, 1/MPa", "rms deviation"]
    laws = pd.DataFrame(rows, columns=columns)
    _print(console, "Combined material of muscle and fascia", laws)
    for line in remarks(calibration):
        console.print(line)


def _print(console: Console, title: str, frame: pd.DataFrame) -> None:
    """Print a table whose last row is set apart."""
    table = Table(*(Column(str(column), justify="right") for column in frame), title=title)
    for number, row in enumerate(frame.to_numpy(), 2):
        table.add_row(*row, end_section=number == len(frame))
    console.print(table)


def remarks(calibration: Calibration) -> list[str]:
    """Return remarks on how good the fit is, and which of the paper's observations hold."""
    best = calibration.fits[0]
    lines = [
        f"correlation of mu and alpha {best.correlation[0, 1]:.3f}; ± is from the misfit of two "
        "models, not from noise"
    ]
    if best.alpha_at_limit:
        lines.append(
            f"alpha is at a limit of its range ({best.law.alpha[0]:.3g}): the curve does not "
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
