"""Contact pressure drawn around the limb."""

from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from calfsocket.plotting import pressure_band
from calfsocket.plotting import section as drawing
from calfsocket.plotting.pressure_band import PressureBand, outward_normals
from calfsocket.plotting.style import (
    INCH_MM,
    POINTS,
    fitting,
    legend_at,
    width_mm,
    window_around,
)
from calfsocket.postprocess.contact_line import RUNNING_MEAN_MM
from calfsocket.postprocess.mesh_error import with_error
from calfsocket.report.figures.cases import case_panels
from calfsocket.report.figures.geometry import BONE_DARK, LIMB
from calfsocket.report.findings import Findings
from calfsocket.simulation.result import Result
from calfsocket.simulation.results import Results

HIGHEST_BAND = 0.25
"""Height of the band at the largest pressure, as a share of the limb's size."""

LARGEST_TYPE, ROOM = 6.5, 0.75
"""Of what is written into a limb: points, and share of the limb's width."""

PEAK: dict[str, Any] = {"marker": "o", "linestyle": "", "color": drawing.ABOVE, "markersize": 3.4}

WRITTEN = (
    ("contact_pressure_max", ".1f"),
    ("contact_pressure_mean", ".1f"),
    ("contact_share", ".3g"),
)
"""Numbers that are written into a limb, and how."""


def contact_pressure(findings: Findings) -> Figure:
    """Draw the pressure of every case on one scale, the point of the largest mean over 3 mm."""
    results = findings.results
    highest = max(result.line.pressure_kPa.max() for result in results.values())
    size = max(np.ptp(result.line.points, axis=0).max() for result in results.values())
    mm_per_kPa = HIGHEST_BAND * size / highest if highest else 1.0
    levels = [level for level in MaxNLocator(3).tick_values(0.0, highest) if 0 < level <= highest]

    bands = {}
    for key, result in results.items():
        skin = result.line.points
        bands[key] = PressureBand(skin, outward_normals(skin), result.line.pressure_kPa, mm_per_kPa)
    reach = [
        np.vstack([b.at(b.pressure_kPa), b.at(max(levels, default=0.0))]) for b in bands.values()
    ]
    window = window_around(*reach, margin_mm=3.0)

    def draw(axes: Axes, result: Result) -> None:
        section, band = findings.section(result), bands[result.record.key]
        drawing.draw_path(axes, section.limb, facecolor=LIMB, linewidth=0, zorder=3)
        drawing.draw_path(axes, section.bone, facecolor=BONE_DARK, linewidth=0, zorder=4)
        apart = mm_per_kPa * levels[0] / (window[1] - window[0]) * width_mm(axes) if levels else 0.0
        band.draw(axes, levels, fontsize=min(6.0, apart / INCH_MM * POINTS))
        smooth = result.line.running_mean_kPa
        peak = int(np.argmax(smooth))
        if smooth[peak]:
            axes.plot(*band.at(band.pressure_kPa)[peak], **PEAK, zorder=6)
        largest, mean, share = (_said(results, result, *each) for each in WRITTEN)
        outline = np.asarray(section.limb.vertices)
        low, high = outline.min(axis=0), outline.max(axis=0)
        x, y = 0.5 * (low + high)
        text = f"largest {largest} kPa\nmean {mean} kPa\n{share} % in contact"
        room = (high - low)[0] / (window[1] - window[0]) * width_mm(axes)
        axes.text(
            x, y - 0.3 * (high - low)[1], text, ha="center", va="center", zorder=5,
            fontsize=fitting(text, ROOM * room, LARGEST_TYPE), linespacing=1.4,
        )  # fmt: skip

    figure = case_panels(findings, window, draw)
    bone = drawing.key(findings.fields, bone=BONE_DARK)
    rest: list[Artist] = [Patch(color=LIMB, label="limb"), *bone]
    if highest:
        label = f"largest running mean over {RUNNING_MEAN_MM:g} mm"
        rest.insert(0, Line2D([], [], **PEAK, label=label))
        pressure = [
            pressure_band.key("contact pressure, drawn outward from the skin"),
            Line2D([], [], **pressure_band.LEVEL_LINE, label="lines of equal pressure, kPa"),
        ]
        legend_at(figure, 2.0, 11.0, pressure)
    legend_at(figure, 2.0, 5.0, rest)
    return figure


def _said(results: Results, result: Result, quantity: str, form: str) -> str:
    """Return a number of the contact with its mesh error."""
    value = result.contact_levels[quantity].value
    error = results.mesh_error(*result.record.key, "skin", quantity)
    return with_error(format(value, form), value, error)
