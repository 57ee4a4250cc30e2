"""A fit as numbers for people and files: parameter lines, curves, and fit.json."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
import scipy

import calfsocket
from calfsocket.fit.data import Test
from calfsocket.fit.regression import LEVEL, Fit
from calfsocket.materials.modes import amount_of_shear
from calfsocket.materials.stability import SCANNED, StableRange
from calfsocket.materials.tissues import KPA


def stress_unit(tests: Sequence[Test]) -> tuple[str, float]:
    """Choose the unit in which these tests' stresses read well; return it and its MPa."""
    largest = max(float(np.max(np.abs(test.stress))) for test in tests)
    return ("MPa", 1.0) if largest >= 1 else ("kPa", KPA)


def parameter_lines(fit: Fit) -> list[str]:
    """Each parameter with its interval, e.g. ``C10 = 4.91 ± 0.31 MPa``."""
    unit, mpa = stress_unit(fit.tests)
    lines = []
    for i, (name, value, half) in enumerate(
        zip(fit.family.names, fit.parameters, fit.half_widths(), strict=True)
    ):
        scale, written = (mpa, f" {unit}") if i < len(fit.family.coefficients) else (1.0, "")
        if np.isnan(half):
            lines.append(f"{name} = {value / scale:.4g}{written}, at its bound")
        else:
            two_digits = float(f"{half / scale:.1e}")
            lines.append(f"{name} = {value / scale:.4g} ± {two_digits:g}{written}")
    return [*lines, f"(± {LEVEL:.0%} interval)"]


def summary(fit: Fit, stable: Sequence[StableRange], notes: Sequence[str]) -> str:
    """Summarise a fit for the terminal."""
    unit, mpa = stress_unit(fit.tests)
    lines = [
        f"{test.path.name}{f' ({test.branch})' if test.branch else ''}: {test.title}"
        for test in fit.tests
    ]
    lines += [f"{fit.family.title}:", *(f"  {line}" for line in parameter_lines(fit))]
    lines += [f"R^2 {fit.r_squared:.5f}, rms of the residual {fit.rms / mpa:.3g} {unit}"]
    if not any(r.words for r in stable):
        lines += ["stable (Drucker) at stretches of {} to {} in all tests".format(*SCANNED)]
    lines += [f"note: {note}" for note in notes]
    return "\n".join(lines)


def curve_rows(fit: Fit) -> pd.DataFrame:
    """Tabulate data, fit and residual of every point, kPa, for curve.csv."""
    return pd.concat(
        [
            pd.DataFrame(
                {
                    "file": test.path.name,
                    "mode": test.mode,
                    "stretch": test.stretch,
                    "shear_strain": amount_of_shear(test.stretch) if test.mode == "shear" else "",
                    "engineering_stress_kPa": test.stress / KPA,
                    "fitted_kPa": fit.stress(test.mode, test.stretch) / KPA,
                    "residual_kPa": fit.residual(test) / KPA,
                }
            )
            for test in fit.tests
        ],
        ignore_index=True,
    )


def fit_record(
    fit: Fit, stable: Sequence[StableRange], notes: Sequence[str], settings: dict[str, Any]
) -> dict[str, Any]:
    """Everything about a fit, for fit.json; stresses in kPa."""
    n = len(fit.family.coefficients)
    scale = np.array([KPA] * n + [1.0] * (len(fit.family.names) - n))
    half = fit.half_widths()
    return {
        "program": "calfsocket",
        "versions": {
            "calfsocket": calfsocket.__version__,
            "numpy": np.__version__,
            "scipy": scipy.__version__,
        },
        "settings": settings,
        "data": [
            {
                "file": test.path.name,
                "title": test.title,
                "sha256": test.sha256,
                "mode": test.mode,
                "measured": f"{test.measure} stress",
                "branch": test.branch,
                "points": len(test.stretch),
                "stretch": [float(np.min(test.stretch)), float(np.max(test.stretch))],
            }
            for test in fit.tests
        ],
        "law": fit.family.title,
        "parameters": {
            name: {
                "value": fit.parameters[i] / scale[i],
                "unit": "kPa" if i < n else "",
                "standard_error": _number(fit.standard_errors[i] / scale[i]),
                "half_width": _number(half[i] / scale[i]),
                "at_bound": bool(fit.at_bound[i]),
            }
            for i, name in enumerate(fit.family.names)
        },
        "level": LEVEL,
        "covariance": [
            [_number(value) for value in row] for row in fit.covariance / np.outer(scale, scale)
        ],
        "condition_number": fit.condition,
        "degrees_of_freedom": fit.degrees_of_freedom,
        "chi_squared": fit.chi_squared,
        "r_squared": fit.r_squared,
        "rms_residual_kPa": fit.rms / KPA,
        "searches": fit.searches,
        "unconverged": fit.unconverged,
        "minima_that_fit_as_well": [
            {
                "parameters": (minimum.parameters / scale).tolist(),
                "sum_of_squares": minimum.sum_of_squares,
                "searches": minimum.searches,
            }
            for minimum in fit.minima
        ],
        "drucker": {
            "checked_stretches": list(SCANNED),
            **{r.mode: {"stable_above": r.low, "stable_below": r.high} for r in stable},
        },
        "diagnostics": list(notes),
    }


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
