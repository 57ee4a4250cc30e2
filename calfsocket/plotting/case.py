"""A picture of one case.

The deformed section with the effective (Mises) stress of the soft tissues, and around it the
contact pressure on the skin, on the same scales in all pictures.
"""

from pathlib import Path

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from scipy.spatial import cKDTree

from calfsocket.meshes.frame import Frame
from calfsocket.plotting import files, pressure_band
from calfsocket.plotting import section as drawing
from calfsocket.plotting.names import PICTURE
from calfsocket.plotting.pressure_band import PressureBand, outward_normals
from calfsocket.postprocess.contact_line import ContactLine
from calfsocket.postprocess.fields import SectionFields
from calfsocket.postprocess.quantities import Quantities

STRESS_LIMIT_KPA = 10.0  # as PRESSURE_MM_PER_KPA
PRESSURE_MM_PER_KPA = 0.4  # the same in every picture, so that pictures can be compared
PRESSURE_STEP_KPA = 20.0
FRAME = 1.55  # size over the limb's, so that one limb's pictures match; grows for the pressure
PIXELS = 2100
LONGEST_TITLE = 60  # letters; longer ones are written smaller


def place_band(fields: SectionFields, contact: ContactLine) -> PressureBand:
    """Place the pressure outside the socket, so that it hides nothing."""
    skin = contact.points
    normal = outward_normals(skin)
    foot_mm = 1.5
    socket = fields.cells[fields.cells_of("socket")]
    if len(socket):
        to_skin, _ = cKDTree(skin).query(fields.deformed[np.unique(socket)])
        foot_mm += to_skin.max()
    return PressureBand(skin + foot_mm * normal, normal, contact.pressure_kPa, PRESSURE_MM_PER_KPA)


def _draw_legend(figure: Figure, stress: ScalarMappable, fields: SectionFields) -> None:
    bar = figure.add_axes((0.06, 0.045, 0.40, 0.015))
    figure.colorbar(
        stress,
        cax=bar,
        orientation="horizontal",
        extend="max",
        extendfrac=0.08,
    )
    bar.tick_params(labelsize=8)
    bar.set_title("effective (Mises) stress, kPa; arrow: above", fontsize=8.5, y=1.0)
    handles = [
        pressure_band.key("contact pressure on the skin"),
        Line2D([], [], **pressure_band.LEVEL_LINE, label=f"lines every {PRESSURE_STEP_KPA:g} kPa"),
        *drawing.key(fields, bone=drawing.BONE, socket=drawing.SOCKET),
    ]
    figure.legend(
        handles=handles,
        ncols=2,
        loc="center right",
        bbox_to_anchor=(0.97, 0.045),
        fontsize=8,
        frameon=False,
    )


def draw(quantities: Quantities, contact: ContactLine, title: str, directions: Frame) -> Figure:
    """Draw a case: its deformed section, and the contact pressure around it.

    `directions` are written at the sides.
    """
    fields = quantities.fields
    band = place_band(fields, contact)
    skin = contact.points
    x, y = 0.5 * (skin.min(axis=0) + skin.max(axis=0))
    reach = np.abs(band.at(band.pressure_kPa) - (x, y)).max() + 10
    limb_mm = np.ptp(fields.points[fields.cells[fields.cells_of("skin")]], axis=(0, 1)).max()
    half = max(0.5 * FRAME * limb_mm, reach)
    window = (x - half, x + half, y - half, y + half)

    figure = Figure(figsize=(7.0, 8.0), dpi=PIXELS / 7.0)
    axes = figure.add_axes((0.0, 0.08, 1.0, 7.0 / 8.0))
    drawing.frame(axes, window)
    stress = drawing.colour_scale(0, STRESS_LIMIT_KPA, drawing.STRESS_COLOURS, drawing.ABOVE)
    drawing.draw_field(
        axes,
        drawing.DeformedSection(fields),
        quantities.nodal["effective_stress"],
        stress,
        linewidth=0.55,
        zorder=3,
    )
    highest = max(band.pressure_kPa.max(), PRESSURE_STEP_KPA)
    levels = [PRESSURE_STEP_KPA * k for k in range(1, int(highest / PRESSURE_STEP_KPA) + 1)]
    band.draw(axes, levels, fontsize=7)
    drawing.mark_directions(axes, window, directions, fontsize=9)
    drawing.scale_bar(axes, window, fontsize=8)
    _draw_legend(figure, stress, fields)
    fontsize = 13 * min(1.0, LONGEST_TITLE / len(title))
    figure.text(0.5, 0.965, title, ha="center", fontsize=fontsize, parse_math=False)
    return figure


def save(figure: Figure, folder: Path, form: str) -> Path:
    """Write a picture into a case's folder; return its path."""
    return files.save(figure, Path(folder) / f"{PICTURE}.{form}")


def case_title(socket: str, material_set: str) -> str:
    """Return the title of a case's picture."""
    return f"{socket} socket, {material_set} set"
