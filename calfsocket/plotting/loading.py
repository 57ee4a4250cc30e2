"""Curves of the stages of loading: moment over rotation, force over displacement, slip, work."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from calfsocket.mechanics.loading import DONNED
from calfsocket.plotting import files
from calfsocket.plotting.names import CURVE_PICTURE
from calfsocket.plotting.style import new_figure, type_set

PANEL_MM, KEY_MM = 65.0, 9.0
MOST_ABREAST, STAGES_ABREAST = 3, 6  # panels in a row; stages in a line of the key

NAMES = {
    "slipping_percent": "part of the contact that slips, %",
    "dissipated_N_mm_per_mm": "work of friction, N mm/mm",
    "pressing_N_per_mm": "pressing force, N/mm",
}
"""Words for columns whose names say less."""

SMALLEST_CHANGE = 1e-6
"""Of a load in N/mm, N mm/mm or %: less is what Newton's tolerance leaves of one that stays."""


def columns_of(curve: pd.DataFrame, start: str) -> list[str]:
    """Return the columns that begin with a word."""
    return [name for name in curve.columns if name.startswith(start)]


def _words(column: str) -> str:
    """Return a column's name in words, its unit behind a comma."""
    if column in NAMES:
        return NAMES[column]
    if column.startswith("volume_"):
        return f"change of volume of {column.removeprefix('volume_').removesuffix('_percent')}, %"
    for unit, written in (
        ("_N_mm_per_mm", ", N mm/mm"),
        ("_N_per_mm", ", N/mm"),
        ("_percent", ", %"),
        ("_deg", ", deg"),
        ("_mm", ", mm"),
    ):
        if column.endswith(unit):
            return column.removesuffix(unit).replace("_", " ") + written
    return column.replace("_", " ")


def panels_of(curve: pd.DataFrame) -> list[tuple[str, str]]:
    """Return what is drawn over what: pairs of columns, those whose load changes."""
    loads = ["moment_N_mm_per_mm", *columns_of(curve, "force_")]
    ways = ["rotation_deg", *columns_of(curve, "displacement_")]
    volumes = columns_of(curve, "volume_")
    if _change_together(curve):
        volumes = volumes[:1]
    return [
        *(
            (way, load)
            for load, way in zip(loads, ways, strict=True)
            if np.ptp(curve[load]) > SMALLEST_CHANGE
        ),
        *(
            (volume, "pressing_N_per_mm")
            for volume in volumes
            if np.ptp(curve[volume]) > SMALLEST_CHANGE
        ),
    ]


def _change_together(curve: pd.DataFrame) -> bool:
    """Whether the volumes of several tissues change, all of them by the same share."""
    volumes = curve[columns_of(curve, "volume_")]
    return volumes.shape[1] > 1 and bool(np.ptp(volumes.to_numpy(), axis=1).max() == 0.0)


def _label(curve: pd.DataFrame, column: str) -> str:
    """Return the label of an axis; a volume is that of all tissues that change with it."""
    if not column.startswith("volume_"):
        return _words(column)
    together = columns_of(curve, "volume_") if _change_together(curve) else [column]
    tissues = [name.removeprefix("volume_").removesuffix("_percent") for name in together]
    return f"volume of {' and '.join(tissues)}, %"


def draw(curve: pd.DataFrame) -> Figure:
    """Draw the curves, a colour a stage, and slip and dissipated work over the steps."""
    driven = panels_of(curve)
    pairs = [*driven, (None, "slipping_percent"), (None, "dissipated_N_mm_per_mm")]
    # Rows as even as they can be, so that no place stays empty; slip and work have their own.
    parts = np.array_split(np.arange(len(driven)), -(-len(driven) // MOST_ABREAST) or 1)
    rows = [part for part in (*parts, np.arange(len(driven), len(pairs))) if len(part)]
    columns = math.lcm(*map(len, rows))
    layout: list[Any] = [np.repeat(row, columns // len(row)).tolist() for row in rows]
    with type_set():
        figure = new_figure(PANEL_MM * len(rows) + KEY_MM)
        figure.set_layout_engine("constrained")
        every: dict[int, Axes] = figure.subplot_mosaic(layout)
        for number, (x, y) in enumerate(pairs):
            axes = every[number]
            _draw_stages(axes, curve, x, y)
            axes.set(xlabel=_label(curve, x) if x else "equilibrium", ylabel=_label(curve, y))
        stages = axes.get_legend_handles_labels()
        figure.legend(*stages, title="stage", loc="outside lower center", ncols=STAGES_ABREAST)
    return figure


def _draw_stages(axes: Axes, curve: pd.DataFrame, x: str | None, y: str) -> None:
    """Draw each stage that changes what is driven, from where the one before it ended."""
    stages = [stage for stage in dict.fromkeys(curve.stage) if stage != DONNED]
    driven = x if x and x.startswith("volume_") else y
    for number, stage in enumerate(stages):
        part = curve.index[curve.stage == stage]
        whole = curve.loc[max(part[0] - 1, 0) : part[-1]]
        if x is None or np.ptp(whole[driven]) > SMALLEST_CHANGE:
            at = whole[x] if x else whole.index
            axes.plot(at, whole[y], ".-", color=f"C{number}", ms=3, lw=1.0, label=stage)
    axes.axhline(0.0, color="0.8", lw=0.5, zorder=0)


def save(figure: Figure, folder: Path, form: str) -> Path:
    """Write the curves into a case's folder; return their path."""
    return files.save(figure, Path(folder) / f"{CURVE_PICTURE}.{form}")
