"""Claims on the indentation test that calibrates the combined material, and on the curve fits."""

import numpy as np
from numpy.typing import NDArray

from calfsocket.calibration.names import FITTED, IGNORED, SEPARATE, TABLE1
from calfsocket.io.errors import InputError
from calfsocket.report.calibration import Calibration
from calfsocket.report.claims.evidence import Evidence, NotChecked
from calfsocket.report.claims.registry import Finding, claim
from calfsocket.report.claims.tolerances import FLAT, about
from calfsocket.report.table import number


def _calibration(e: Evidence) -> Calibration:
    try:
        return e.results.calibration
    except InputError as reason:
        raise NotChecked(str(reason)) from None


def _range(values: NDArray[np.float64]) -> str:
    return f"{number(values.min())} to {number(values.max())}"


@claim("C033")
def matched_curve(e: Evidence) -> Finding:
    """Check that the force with Table 1's combined law is about Separate's at every displacement.

    A law fitted here is close to Separate by construction, so it cannot decide.
    """
    found = _calibration(e)
    ratio = {name: found.force[name] / found.force[SEPARATE] for name in (TABLE1, FITTED)}
    near = np.array([about(value, 1.0) for value in ratio[TABLE1]])
    fit = found.fit
    return Finding(
        bool(near.all()),
        f"force with Table 1's combined law {_range(ratio[TABLE1])} times Separate's; with one "
        f"fitted here (mu {number(fit.mu_kPa)} kPa, alpha {number(fit.alpha)}) "
        f"{_range(ratio[FITTED])}",
        "close over the whole curve",
        f"about equal at {near.sum()} of {len(near)} displacements: the parameters depend on the "
        "model's dimensions and stroke, which the paper does not give",
    )


@claim("C034")
def ignoring_fascia_is_softer(e: Evidence) -> Finding:
    """Check that muscle's law in the fascia gives the smallest force at every displacement."""
    force = _calibration(e).force
    ratio = {name: force[IGNORED] / force[name] for name in (SEPARATE, TABLE1, FITTED)}
    return Finding(
        all(bool((values < 1).all()) for values in ratio.values()),
        f"force without fascia {_range(ratio[SEPARATE])} times Separate's, {_range(ratio[TABLE1])} "
        f"times Combined's with Table 1's law, {_range(ratio[FITTED])} with the fitted one",
        "softer than both",
        "not at every displacement",
    )


@claim("C035")
def ignoring_fascia_deviates_more(e: Evidence) -> Finding:
    """Check that ignoring fascia is further from Separate than both combined laws are."""
    found = _calibration(e)
    off = {name: found.deviation_pct(name) for name in (IGNORED, TABLE1, FITTED)}
    return Finding(
        off[IGNORED] > max(off[TABLE1], off[FITTED]),
        f"root mean square, share of the largest force: fascia ignored {number(off[IGNORED])} %, "
        f"Combined {number(off[TABLE1])} % (Table 1), {number(off[FITTED])} % (fitted)",
        "ignored further than Combined",
        "Table 1's law is as far off in this model"
        if off[IGNORED] > off[FITTED]
        else "even the fitted law is as far off",
    )


@claim("C036")
def flat_compression(e: Evidence) -> Finding:
    """Check that the face that presses is flat between its rounded edges."""
    inputs = _calibration(e).inputs
    flat = inputs.plate.width - 2 * inputs.plate.edge_radius
    return Finding(
        flat >= FLAT * inputs.plate.width,
        f"plate of {number(inputs.plate.width)} mm, flat over {number(flat)} mm, pressed "
        f"{number(inputs.stroke_mm)} mm into the {inputs.specimen}",
        "like compression by a flat surface",
        "the plate's rounded edges are wider than its face",
    )


@claim("C037")
def ogden_does_not_converge_on_fascia(e: Evidence) -> Finding:
    """Say why the curve fits of fascia cannot be repeated."""
    raise NotChecked(
        "the data are in Pavan et al., not in the paper; docs/materials.md shows on synthetic data "
        "why Ogden's law does not converge where Yeoh's does"
    )
