"""Figure 9: contact pressure drawn around the limb."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from calfsocket.plotting import pressure_band
from calfsocket.plotting import section as drawing
from calfsocket.plotting.pressure_band import PressureBand, outward_normals
from calfsocket.postprocess.quantities import RUNNING_MEAN_MM, running_mean
from calfsocket.report.figures.geometry import BONE_DARK, LIMB
from calfsocket.report.figures.panels import case_panels, window_around
from calfsocket.report.figures.style import legend_at
from calfsocket.report.results import Results

HIGHEST_BAND_MM = 26.0


def contact_pressure(results: Results) -> Figure:
    """Draw the pressure of every case on one scale, the point of the largest mean over 3 mm."""
    contacts = {key: results.case(*key).contact for key in results.cases}
    highest = max(contact.pressure_kPa.max() for contact in contacts.values())
    mm_per_kPa = HIGHEST_BAND_MM / highest if highest else 1.0
    levels = [level for level in MaxNLocator(3).tick_values(0.0, highest) if 0 < level <= highest]

    bands = {}
    for key, contact in contacts.items():
        skin = np.column_stack([contact.x_mm, contact.y_mm])
        bands[key] = PressureBand(skin, outward_normals(skin), contact.pressure_kPa, mm_per_kPa)
    reach = [
        np.vstack([b.at(b.pressure_kPa), b.at(max(levels, default=0.0))]) for b in bands.values()
    ]
    window = window_around(*reach, margin_mm=3.0)

    def draw(axes: Axes, key: tuple[str, str]) -> None:
        fields, band, contact = results.fields(*key), bands[key], contacts[key]
        points = drawing.deformed(fields)
        limb = drawing.limb_boundary(fields, points)
        drawing.draw_path(axes, limb, facecolor=LIMB, linewidth=0, zorder=3)
        drawing.draw_tissue(axes, fields, points, "bone", facecolor=BONE_DARK, zorder=4)
        band.draw(axes, levels, fontsize=6)
        smooth = running_mean(contact)
        peak = int(np.argmax(smooth))
        x, y = band.at(band.pressure_kPa)[peak]
        axes.plot(x, y, "o", markersize=3.4, color=drawing.ABOVE, zorder=6)
        mean = results.value(*key, "skin", "contact_pressure_mean")
        share = results.value(*key, "skin", "contact_share")
        x, y = limb.get_extents().get_points().mean(axis=0)
        axes.text(
            x, y - 22,
            f"largest {smooth[peak]:.1f} kPa\nmean {mean:.1f} kPa\n{share:.3g} % in contact",
            ha="center", va="center", fontsize=6.5, zorder=5, linespacing=1.4,
        )  # fmt: skip

    figure = case_panels(results, window, draw)
    legend_at(
        figure,
        2.0,
        11.0,
        [
            Patch(facecolor=pressure_band.FILL, edgecolor=pressure_band.EDGE, linewidth=0.9,
                  label="contact pressure, drawn outward from the skin"),
            Line2D([], [], **pressure_band.LEVEL_LINE, label="lines of equal pressure, kPa"),
        ],
    )  # fmt: skip
    legend_at(
        figure,
        2.0,
        5.0,
        [
            Line2D([], [], marker="o", linestyle="", color=drawing.ABOVE, markersize=3.4,
                   label=f"largest running mean over {RUNNING_MEAN_MM:g} mm"),
            Patch(color=LIMB, label="limb"),
            Patch(color=BONE_DARK, label="bone"),
        ],
    )  # fmt: skip
    return figure
