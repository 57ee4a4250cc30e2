"""The figure of a fit: stress measured and fitted, the residuals below, and what to know beside."""

import textwrap
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from calfsocket.fit.data import Test
from calfsocket.fit.regression import LEVEL, Fit
from calfsocket.fit.tables import parameter_lines, stress_unit
from calfsocket.io.files import replacing

COLOURS = ("tab:blue", "tab:orange", "tab:green", "tab:purple", "tab:red", "tab:brown")

BEYOND = 0.2
"""Share of the data's range of stretches by which curves continue beyond it, dotted."""

WIDTH = 50
"""Letters in a line beside the curves."""


def draw(fit: Fit, notes: Sequence[str], png: Path, pdf: Path) -> None:
    """Draw a fit, with its diagnostics in words, as PNG and PDF."""
    figure = Figure(figsize=(10.5, 6.0), layout="constrained")
    left, right = figure.subfigures(1, 2, width_ratios=(1.9, 1.0))
    stress, residual = left.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    unit, mpa = stress_unit(fit.tests)
    for number, test in enumerate(fit.tests):
        _draw_test(stress, residual, fit, test, COLOURS[number % len(COLOURS)], mpa)
    stress.set_title(f"{fit.family.title}, $R^2$ = {fit.r_squared:.4f}")
    stress.set_ylabel(f"engineering stress [{unit}]")
    stress.legend(fontsize="small")
    residual.axhline(0.0, color="black", linewidth=0.8)
    residual.set_ylabel(f"fit - data [{unit}]")
    sheared = any(test.mode == "shear" for test in fit.tests)
    residual.set_xlabel(f"stretch [-]{', of shear the larger principal one' if sheared else ''}")
    stress.grid(alpha=0.3)
    residual.grid(alpha=0.3)
    right.text(0.0, 0.97, _words(fit, notes), va="top", fontsize="small", linespacing=1.35)
    for path, settings in ((png, {"dpi": 150}), (pdf, {"metadata": {"CreationDate": None}})):
        with replacing(path) as temporary:
            figure.savefig(temporary, **settings)


def _draw_test(stress: Axes, residual: Axes, fit: Fit, test: Test, colour: str, mpa: float) -> None:
    low, high = float(np.min(test.stretch)), float(np.max(test.stretch))
    margin = BEYOND * (high - low)
    inside = np.linspace(low, high, 200)
    fitted = fit.stress(test.mode, inside) / mpa
    band = fit.band(test.mode, inside) / mpa
    stress.fill_between(inside, fitted - band, fitted + band, color=colour, alpha=0.2, lw=0)
    for minimum in fit.minima[1:]:
        wide = np.linspace(low - margin, high + margin, 200)
        other = fit.family.stress(minimum.parameters, test.mode, wide) / mpa
        label = "fits as well" if minimum is fit.minima[1] and test is fit.tests[0] else None
        stress.plot(wide, other, color="grey", linestyle="--", linewidth=1.0, label=label)
    stress.plot(inside, fitted, color=colour, label=f"fit, {test.mode}, with {LEVEL:.0%} band")
    for beyond in (np.linspace(low - margin, low), np.linspace(high, high + margin)):
        stress.plot(beyond, fit.stress(test.mode, beyond) / mpa, ":", color=colour)
    sd = None if test.sd is None else test.sd / mpa
    stress.errorbar(
        test.stretch,
        test.stress / mpa,
        sd,
        fmt="o",
        markersize=4,
        color=colour,
        label=f"data, {test.mode}",
    )
    residual.errorbar(
        test.stretch, fit.residual(test) / mpa, sd, fmt="o", markersize=4, color=colour
    )


def _words(fit: Fit, notes: Sequence[str]) -> str:
    unit, mpa = stress_unit(fit.tests)
    paragraphs = list(dict.fromkeys(test.title for test in fit.tests))
    paragraphs += ["\n".join(parameter_lines(fit))]
    paragraphs += [f"rms of the residual {fit.rms / mpa:.3g} {unit}"]
    paragraphs += notes
    return "\n\n".join(
        "\n".join(textwrap.fill(line, WIDTH) for line in paragraph.splitlines())
        for paragraph in paragraphs
    )
