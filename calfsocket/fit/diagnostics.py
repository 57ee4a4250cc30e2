"""What a fit's user should know before its numbers are used, in plain sentences."""

from collections.abc import Sequence

import numpy as np
from scipy import stats

from calfsocket.fit.regression import LEVEL, Fit
from calfsocket.materials.stability import StableRange
from calfsocket.materials.tissues import KPA

CONDITION_LIMIT = 1e6
"""Condition number above which terms are nearly redundant: variances go with its square, so that
twelve of their sixteen digits are lost."""


UNLOADED = 1e-3
"""How near to 1 a stretch counts as unloaded: the elongation that an extensometer resolves."""

PRELOAD = 0.02
"""Share of the largest stress from which one at a stretch of 1 is no noise: load cells have 0.5 %
of their range, of which a test of soft tissue uses a part."""


def diagnostics(fit: Fit, stable: Sequence[StableRange]) -> list[str]:
    """Return sentences about what the data do not determine and where the law is not stable."""
    return [
        *_data(fit),
        *_preload(fit),
        *_searches(fit),
        *_misfit(fit),
        *_patterns(fit),
        *_parameters(fit),
        *_stability(fit, stable),
    ]


def _data(fit: Fit) -> list[str]:
    return [
        f"Columns of {test.path.name} that are not used: {', '.join(test.unused)}."
        for test in fit.tests
        if test.unused
    ]


def _preload(fit: Fit) -> list[str]:
    """Find stresses at a stretch of 1 that are no noise: there every law has none."""
    found = []
    for test in fit.tests:
        unloaded = test.stress[np.argmin(np.abs(test.stretch - 1))]
        share = abs(unloaded) / np.max(np.abs(test.stress))
        if np.min(np.abs(test.stretch - 1)) <= UNLOADED and share > PRELOAD:
            found.append(
                f"The stress of {test.path.name} is {unloaded / KPA:.3g} kPa at a stretch of 1, "
                f"{share:.0%} of the largest, where the law has none: a preload, or a sensor that "
                "was not at zero. Count stretch and stress from the unloaded length."
            )
    return found


def _searches(fit: Fit) -> list[str]:
    found = []
    if fit.unconverged:
        found.append(
            f"{fit.unconverged} of {fit.searches} searches, each from other exponents, did not "
            "converge."
        )
    if len(fit.minima) > 1:
        sets = [fit.family.split(minimum.parameters)[1] for minimum in fit.minima]
        ranges = [
            f"{name} {_either(values)}"
            for name, values in zip(fit.family.exponents, zip(*sets, strict=True), strict=True)
        ]
        found.append(
            f"{len(fit.minima)} sets of parameters fit equally well within the noise "
            f"({', '.join(ranges)}); the one of the smallest residual is given."
        )
    if fit.condition > CONDITION_LIMIT:
        found.append(
            f"Terms are nearly redundant (condition number {fit.condition:.0e}); use fewer."
        )
    return found


def _misfit(fit: Fit) -> list[str]:
    if fit.chi_squared is None:
        return []
    if fit.chi_squared <= stats.chi2.ppf(LEVEL, fit.degrees_of_freedom):
        return []
    return [
        f"Residuals are larger than stress_sd explains (chi-squared {fit.chi_squared:.3g} for "
        f"{fit.degrees_of_freedom} degrees of freedom); intervals are too narrow."
    ]


def _patterns(fit: Fit) -> list[str]:
    """Find residuals that follow each other along the stretch, as noise would not.

    The squared differences of successive residuals of noise have a sum of twice that of the squared
    residuals, give or take 2/sqrt(n) of it (von Neumann 1941, doi:10.1214/aoms/1177731677).
    """
    found = []
    for test in fit.tests:
        residual = fit.residual(test)
        ratio = np.sum(np.diff(residual) ** 2) / np.sum(residual**2)
        if (2 - ratio) * np.sqrt(len(residual)) / 2 > stats.norm.ppf(LEVEL):
            found.append(
                f"The residuals of {test.path.name} follow a pattern: the law cannot follow the "
                "data, and intervals are too narrow."
            )
    return found


def _either(values: Sequence[float]) -> str:
    if len(values) == 2:
        return " or ".join(f"{value:.3g}" for value in values)
    return f"{min(values):.3g} to {max(values):.3g}"


def _parameters(fit: Fit) -> list[str]:
    names = np.array(fit.family.names)
    found = []
    if fit.at_bound.any():
        found.append(
            f"At a bound, and so without an interval: {', '.join(names[fit.at_bound])}; "
            "use fewer terms."
        )
    with np.errstate(invalid="ignore"):
        loose = np.abs(fit.parameters) < fit.half_widths()
    if loose.any():
        found.append(
            f"Not determined, since the {LEVEL:.0%} interval contains 0: {', '.join(names[loose])}."
        )
    return found


def _stability(fit: Fit, stable: Sequence[StableRange]) -> list[str]:
    found = []
    for test in fit.tests:
        if not all(r.holds(test.stretch) for r in stable if r.is_of(test.mode)):
            found.append(f"Not stable (Drucker) within the data of {test.path.name}.")
    return found + [f"Not stable (Drucker) in {r.words}." for r in stable if r.words]
