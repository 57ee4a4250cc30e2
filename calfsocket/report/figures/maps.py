"""Effective stress and shear strain over the deformed section, material sets by sockets."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from calfsocket.plotting import section as drawing
from calfsocket.plotting.style import add_axes, legend_at
from calfsocket.postprocess.fields import SectionFields
from calfsocket.report.figures.cases import case_panels
from calfsocket.report.findings import Findings
from calfsocket.simulation.result import Result

MARKERS = {"skin": "o", "fat": "^", "muscle": "s", "fascia": "D", "vessel": "v"}
MARKER: dict[str, Any] = {"color": "white", "markeredgecolor": "black", "markeredgewidth": 0.6}


@dataclass(frozen=True)
class Map:
    """A field, its limits, and its colours below, within and above them."""

    quantity: str
    label: str
    low: float
    high: float
    colours: str
    beyond: str

    @property
    def scale(self) -> ScalarMappable:
        """Colours within and beyond the limits."""
        return drawing.colour_scale(self.low, self.high, self.colours, self.beyond)


EFFECTIVE_STRESS = Map(
    quantity="effective_stress",
    label="effective (Mises) stress, kPa",
    low=0.0,
    high=10.0,
    colours=drawing.STRESS_COLOURS,
    beyond=drawing.ABOVE,
)
SHEAR_STRAIN = Map(
    quantity="shear_log_strain",
    label="logarithmic shear strain LE12, %",
    low=-50.0,  # the threshold of damage in muscle
    high=50.0,
    colours="RdBu_r",
    beyond="#ffd400",
)

MAPS = {"effective_stress": EFFECTIVE_STRESS, "shear_strain": SHEAR_STRAIN}
"""By their figures, which are drawn together: where a case's pixels are is found once."""


def draw_map(findings: Findings, what: Map) -> Figure:
    """Draw the field of every case on one scale, with the site of each tissue's maximum."""

    def draw(axes: Axes, result: Result) -> None:
        drawing.draw_field(
            axes,
            findings.section(result),
            result.quantities.nodal[what.quantity],
            what.scale,
            linewidth=0.3,
        )
        for tissue in findings.soft_tissues:
            level = result.quantities.maximum(tissue, what.quantity)
            if level.region and level.value:
                site = deformed_site(result.fields, level.x_mm, level.y_mm)
                axes.plot(*site, MARKERS[tissue], **MARKER, markersize=3.2, zorder=5)

    figure = case_panels(findings, findings.window, draw)
    _draw_key(figure, what, findings)
    return figure


def deformed_site(fields: SectionFields, x_mm: float, y_mm: float) -> np.ndarray:
    """Move a site of the reference section with its nearest node."""
    x, y = fields.points.T
    node = np.argmin((x - x_mm) ** 2 + (y - y_mm) ** 2)
    return np.array([x_mm, y_mm]) + fields.displacement[node]


def _draw_key(figure: Figure, what: Map, findings: Findings) -> None:
    bar = add_axes(figure, 7.0, 7.0, 65.0, 2.6)
    both = what.low < 0
    figure.colorbar(
        what.scale,
        cax=bar,
        orientation="horizontal",
        extend="both" if both else "max",
        extendfrac=0.07,
    )
    bar.set_title(what.label, fontsize=7.5, pad=3, y=1.0)
    tissues = [
        Line2D([], [], marker=MARKERS[tissue], linestyle="", **MARKER, markersize=3.8, label=tissue)
        for tissue in findings.soft_tissues
    ]
    legend_at(figure, 78.0, 7.5, tissues, title="largest in")
    beyond = f"beyond ±{what.high:g} %" if both else f"above {what.high:g} kPa"
    areas = [
        Patch(color=what.beyond, label=beyond),
        *drawing.key(findings.fields, bone=drawing.BONE, socket=drawing.SOCKET),
    ]
    legend_at(figure, 78.0, 2.0, areas)
