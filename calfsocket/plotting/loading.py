"""Curves of the stages of loading: moment over rotation, force over displacement, slip, work."""

from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from calfsocket.mechanics.loading import DONNED
from calfsocket.plotting import files
from calfsocket.plotting.names import CURVE_PICTURE
from calfsocket.plotting.style import new_figure, type_set

PANEL_MM = 70.0

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
    found = []
    loads = ["moment_N_mm_per_mm", *columns_of(curve, "force_")]
    ways = ["rotation_deg", *columns_of(curve, "displacement_")]
    reach = {name: float(np.ptp(curve[name])) for name in (*loads, *ways)}
    for load, way in zip(loads, ways, strict=True):
        if reach[load] > SMALLEST_CHANGE:
            found.append((way, load))
    for tissue in columns_of(curve, "volume_")[:1]:
        found.append((tissue, "pressing_N_per_mm"))
    return found


def draw(curve: pd.DataFrame) -> Figure:
    """Draw the curves, a colour a stage, and slip and dissipated work over the steps."""
    with type_set():
        over = panels_of(curve)
        pairs: list[tuple[str | None, str]] = [
            *over,
            (None, "slipping_percent"),
            (None, "dissipated_N_mm_per_mm"),
        ]
        rows = -(-len(pairs) // 2)
        figure = new_figure(PANEL_MM * rows)
        every = figure.subplots(rows, 2, squeeze=False).ravel()
        for axes, (x, y) in zip(every, pairs, strict=False):
            _draw_stages(axes, curve, x, y)
            axes.set(xlabel=_words(x) if x else "equilibrium", ylabel=_words(y))
        for axes in every[len(pairs) :]:
            axes.remove()
        every[len(over)].legend(title="stage", fontsize=6)
        figure.tight_layout()
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
