"""The paper's Figure 3: the calibration model, and the force-displacement curves."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from calfsocket.calibration.names import FIGURE, FITTED, IGNORED, SEPARATE, TABLE1
from calfsocket.calibration.run import Calibration
from calfsocket.calibration.specimen import Specimen
from calfsocket.materials.laws import Ogden
from calfsocket.materials.tissues import KPA, MUSCLE_AND_FASCIA
from calfsocket.plotting import section as drawing
from calfsocket.plotting.files import Drawing
from calfsocket.plotting.style import WIDTH_MM, add_axes, legend_at, new_figure, type_set
from calfsocket.postprocess.fields import SectionFields

COLOURS = {**drawing.TISSUE_COLOURS, "socket": drawing.SOCKET}
NAMES = {"socket": "plate"}

# Sizes on paper, mm.
MODELS_MM, KEY_MM, TITLE_MM, GAP_MM = 92.0, 12.0, 6.0, 3.0
CURVES_LEFT_MM, CURVES_BOTTOM_MM, LEAST_HEIGHT_MM = 108.0, 20.0, 76.0

ARROW, MARGIN = 0.14, 0.02
"""Length of the arrow and margin around the model, as shares of its size."""

SCALE_BAR_ROOM = 6.0
"""Below the model, mm of the section."""


def draw(calibration: Calibration, folder: Path) -> tuple[Path, Path]:
    """Write figure3.png and figure3.pdf; return their paths."""
    with type_set():
        return Drawing.of(figure(calibration)).write(folder, FIGURE)


def figure(calibration: Calibration) -> Figure:
    """Draw the model, loaded and not, and the curves beside it."""
    fields, specimen = calibration.fields, calibration.specimen
    assert fields is not None
    window = _window(fields, specimen)
    aspect = (window[3] - window[2]) / (window[1] - window[0])
    below = aspect < 1  # a flat model's two states stand one below the other
    width = MODELS_MM if below else (MODELS_MM - GAP_MM) / 2
    height = aspect * width + TITLE_MM
    models = 2 * height if below else height
    top = max(models + KEY_MM, LEAST_HEIGHT_MM)
    page = new_figure(top)
    for place in range(2):
        left = 0.0 if below else place * (width + GAP_MM)
        bottom = top - height * (1 + place * below)
        axes = add_axes(page, left, bottom, width, height - TITLE_MM)
        drawing.frame(axes, window)
        _draw_model(axes, fields, specimen, window, deformed=place == 1)
    curves = add_axes(
        page, CURVES_LEFT_MM, CURVES_BOTTOM_MM, WIDTH_MM - CURVES_LEFT_MM - 2,
        top - CURVES_BOTTOM_MM - TITLE_MM,
    )  # fmt: skip
    _draw_curves(curves, calibration)
    present = specimen.tissues.values()
    legend_at(
        page,
        1.0,
        2.0,
        [
            Patch(facecolor=colour, edgecolor="black", linewidth=0.4, label=NAMES.get(name, name))
            for name, colour in COLOURS.items()
            if name in present
        ],
    )
    return page


def _window(fields: SectionFields, specimen: Specimen) -> drawing.Window:
    """Return the piece of the plane that both states and the arrow need."""
    way = np.array(specimen.direction)
    both = np.concatenate([fields.points, fields.deformed])
    size = np.ptp(fields.points, axis=0).max()
    start = both.min(axis=0) - MARGIN * size - ARROW * size * np.clip(way, 0, 1)
    end = both.max(axis=0) + MARGIN * size + ARROW * size * np.clip(-way, 0, 1)
    return start[0], end[0], start[1] - SCALE_BAR_ROOM, end[1]


def _draw_model(
    axes: Axes, fields: SectionFields, specimen: Specimen, window: drawing.Window, deformed: bool
) -> None:
    points = fields.deformed if deformed else fields.points
    for tissue, colour in COLOURS.items():
        drawing.draw_tissue(axes, fields, points, tissue, facecolor=colour)
    drawing.draw_outlines(axes, fields, points, linewidth=0.5)
    if deformed:
        axes.set_title(f"Separate set at u = {specimen.stroke:g} mm", pad=2)
        return
    axes.set_title("Calibration model", pad=2)
    drawing.scale_bar(axes, window, fontsize=6, margin=0.5)
    plate = points[np.unique(fields.cells[fields.cells_of("socket")])]
    _draw_arrow(axes, plate, np.array(specimen.direction), f"u, up to {specimen.stroke:g} mm")


def _draw_arrow(
    axes: Axes, plate: NDArray[np.float64], way: NDArray[np.float64], text: str
) -> None:
    """Draw an arrow that ends at the middle of the plate's back."""
    middle = plate.mean(axis=0)
    tip = middle + ((plate @ way).min() - middle @ way) * way
    left, right = axes.get_xlim()
    bottom, top = axes.get_ylim()
    room = ((tip - (left, bottom)) if way.sum() > 0 else ((right, top) - tip)) @ np.abs(way)
    arrow = {"arrowstyle": "-|>,head_width=0.2,head_length=0.4", "linewidth": 1.2}
    arrow |= {"color": "black", "shrinkA": 0.0, "shrinkB": 0.0}
    axes.annotate("", xy=tip, xytext=tip - room * way, arrowprops=arrow)
    x, y = tip - 0.5 * room * way
    axes.annotate(text, (x, y), (3, 0), textcoords="offset points", va="center", fontsize=7)


def _draw_curves(axes: Axes, calibration: Calibration) -> None:
    def parameters(law: Ogden) -> str:
        return f"{law.mu[0] / KPA:.3g} kPa, {law.alpha[0]:.3g}"

    way, force = calibration.displacement, calibration.force_per_metre

    for name, label, style, colour in (
        (SEPARATE, "Separate", "-", "black"),
        (FITTED, f"Combined, fitted: {parameters(calibration.law)}", "-.", "#b2182b"),
        (TABLE1, f"Combined, Table 1: {parameters(MUSCLE_AND_FASCIA)}", "--", "#e08214"),
        (IGNORED, "fascia ignored (muscle)", ":", "#2166ac"),
    ):
        x, y = np.append(0.0, way), np.append(0.0, force[name])
        axes.plot(x, y, style, color=colour, label=label, linewidth=1.5)
    axes.plot(way, force[SEPARATE], "ko", markersize=3, clip_on=False)
    axes.set(
        xlabel="displacement of the plate u, mm",
        ylabel="reaction force, N per metre of limb",
        xlim=(0.0, calibration.specimen.stroke),
    )
    axes.set_ylim(bottom=0.0)
    axes.set_title("Force over displacement (points: fitted to)", pad=2)
    axes.grid(color="0.9", linewidth=0.5)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(
        title="muscle and fascia (mu, alpha)", title_fontsize=7, alignment="left", frameon=False
    )
