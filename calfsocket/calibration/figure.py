"""The paper's Figure 3: the calibration model, and the force-displacement curves."""

from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.patches import Patch
from numpy.typing import NDArray

from calfsocket.calibration.run import FITTED, IGNORED, SEPARATE, TABLE1, Calibration
from calfsocket.laws import Ogden
from calfsocket.section_fields import SectionFields
from calfsocket.tissues import KPA, MUSCLE_AND_FASCIA
from calfsocket.writers import replacing

COLOURS = {
    "skin": "#e8b89b",
    "fat": "#f7e6a8",
    "fascia": "#4a6fa5",
    "muscle": "#c96a5f",
    "bone": "#e3e3de",
    "vessel": "#7b4a8c",
    "socket": "#666666",
}
NAMES = {"socket": "plate"}
OUTLINE = "#222222"
RING = [0, 3, 1, 4, 2, 5]
"""Nodes of a cell one after the other around it."""

ARROW, MARGIN = 0.14, 0.02
"""Length of the arrow and margin around the model, as shares of its size."""

NEWTON_PER_M = 1000.0
"""N per metre of limb in N per mm of it."""


def draw(calibration: Calibration, folder: Path) -> list[Path]:
    """Write figure3.png and figure3.pdf; return their paths."""
    assert calibration.fields is not None
    figure = plt.figure(figsize=(11.0, 5.2), dpi=200)
    grid = figure.add_gridspec(
        1, 2, width_ratios=(1.1, 1.0), left=0.02, right=0.98, top=0.93, bottom=0.12, wspace=0.17
    )
    width, height = np.ptp(calibration.fields.points, axis=0)
    shape = (2, 1) if width > height else (1, 2)
    models = grid[0].subgridspec(*shape, wspace=0.05, hspace=0.12)
    for place, deformed in enumerate((False, True)):
        _draw_model(figure.add_subplot(models[place]), calibration, deformed)
    _draw_curves(figure.add_subplot(grid[1]), calibration)
    present = calibration.specimen.tissues.values()
    figure.legend(
        handles=[
            Patch(facecolor=colour, edgecolor=OUTLINE, linewidth=0.5, label=NAMES.get(name, name))
            for name, colour in COLOURS.items()
            if name in present
        ],
        loc="lower left",
        bbox_to_anchor=(0.01, 0.01),
        ncols=len(COLOURS),
        frameon=False,
        fontsize=8.5,
        handlelength=1.2,
        columnspacing=1.1,
    )
    paths = []
    for ending in ("png", "pdf"):
        paths.append(folder / f"figure3.{ending}")
        with replacing(paths[-1]) as temporary:
            # Without a date, the same results give the same file.
            metadata = {"CreationDate": None} if ending == "pdf" else None
            figure.savefig(temporary, facecolor="white", metadata=metadata)
    plt.close(figure)
    return paths


def _draw_model(axes: Axes, calibration: Calibration, deformed: bool) -> None:
    fields, specimen = calibration.fields, calibration.specimen
    assert fields is not None
    points = fields.points + deformed * fields.displacement
    tissue = np.array([fields.region_tissues[int(region)] for region in fields.region])
    axes.add_collection(
        PolyCollection(
            list(points[fields.cells[:, RING]]),
            facecolors=[COLOURS[name] for name in tissue],
            edgecolors="face",
            linewidths=0.2,
        )
    )
    axes.add_collection(
        LineCollection(list(points[_outlines(fields)]), colors=OUTLINE, linewidths=0.5)
    )
    plate = points[np.unique(fields.cells[tissue == "socket"])]
    way = np.array(specimen.direction)
    back = plate[np.argmin(plate @ way)] @ way
    middle = plate.mean(axis=0)
    tail = middle + (back - middle @ way) * way
    size = np.ptp(fields.points, axis=0).max()
    if not deformed:
        axes.annotate(
            "",
            xy=tail,
            xytext=tail - ARROW * size * way,
            arrowprops={
                "arrowstyle": "-|>,head_width=0.25,head_length=0.5",
                "linewidth": 1.5,
                "color": "black",
                "shrinkA": 0.0,
            },
        )
        x, y = tail - 0.5 * ARROW * size * way
        axes.text(
            x + 0.02 * size,
            y,
            f"u, up to {specimen.stroke:g} mm",
            va="center",
            fontsize=9,
        )
    both = np.concatenate([fields.points, fields.points + fields.displacement])
    start = both.min(axis=0) - MARGIN * size - ARROW * size * np.clip(way, 0, 1)
    end = both.max(axis=0) + MARGIN * size + ARROW * size * np.clip(-way, 0, 1)
    axes.set(xlim=(start[0], end[0]), ylim=(start[1], end[1]), aspect="equal")
    axes.set_title(
        f"Separate set at u = {specimen.stroke:g} mm" if deformed else "Calibration model",
        fontsize=10,
    )
    axes.axis("off")


def _outlines(fields: SectionFields) -> NDArray[np.int64]:
    """Return the edges at which regions end: a corner, the node between, a corner; (n, 3)."""
    corners = fields.cells[:, :3]
    edges = np.stack([corners, fields.cells[:, 3:], np.roll(corners, -1, axis=1)], axis=2)
    edges = edges.reshape(-1, 3)
    # The node between two corners names an edge; within a region it is in two cells.
    key = np.stack([np.repeat(fields.region, 3), edges[:, 1]], axis=1)
    _, index, count = np.unique(key, axis=0, return_index=True, return_counts=True)
    outline: NDArray[np.int64] = edges[index[count == 1]]
    return outline


def _draw_curves(axes: Axes, calibration: Calibration) -> None:
    def parameters(law: Ogden) -> str:
        return f"{law.mu[0] / KPA:.3g} kPa, {law.alpha[0]:.3g}"

    for name, label, style, colour in (
        (SEPARATE, "Separate", "-", "black"),
        (FITTED, f"Combined, fitted: {parameters(calibration.law)}", "-.", "#b2182b"),
        (TABLE1, f"Combined, Table 1: {parameters(MUSCLE_AND_FASCIA)}", "--", "#e08214"),
        (IGNORED, "fascia ignored (muscle)", ":", "#2166ac"),
    ):
        curve = calibration.curves[name]
        axes.plot(
            np.append(0.0, curve.displacement),
            NEWTON_PER_M * np.append(0.0, curve.force),
            style,
            color=colour,
            label=label,
            linewidth=2.0,
        )
    reference = calibration.curves[SEPARATE]
    axes.plot(reference.displacement, NEWTON_PER_M * reference.force, "ko", markersize=4)
    axes.set(
        xlabel="displacement of the plate u, mm",
        ylabel="reaction force, N per metre of limb",
        xlim=(0.0, calibration.specimen.stroke),
    )
    axes.set_ylim(bottom=0.0)
    axes.set_title("Force over displacement (points: fitted to)", fontsize=10)
    axes.grid(color="0.9", linewidth=0.6)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(title="muscle and fascia (mu, alpha)", frameon=False, fontsize=9)
