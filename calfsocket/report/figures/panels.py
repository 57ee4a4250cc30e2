"""A grid of sections, material sets by sockets, as figures 4, 7 and 9 have it."""

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from calfsocket import drawing
from calfsocket.report.figures.style import (
    SET_NAMES,
    WIDTH_MM,
    add_axes,
    compass,
    new_figure,
    socket_title,
)
from calfsocket.report.results import Results

TOP_MM, KEY_MM, LEFT_MM = 6.0, 21.0, 5.0
LARGEST_PANEL_MM = 90.0


def window_around(*points: NDArray[np.float64], margin_mm: float) -> drawing.Window:
    """Give the window that holds all points, (n, 2) each."""
    every = np.vstack(points)
    (left, bottom), (right, top) = every.min(axis=0) - margin_mm, every.max(axis=0) + margin_mm
    return (left, right, bottom, top)


def case_panels(
    results: Results,
    window: drawing.Window,
    draw: Callable[[Axes, tuple[str, str]], None],
) -> Figure:
    """Draw every case in a panel of its own, all to one scale, with room for a key below.

    Parameters
    ----------
    results
        Of the study.
    window
        What each panel shows, mm of the section.
    draw
        Draws a case (socket, material set) on its axes.
    """
    columns, rows = len(results.sockets), len(results.material_sets)
    width = min((WIDTH_MM - LEFT_MM) / columns, LARGEST_PANEL_MM)
    height = width * (window[3] - window[2]) / (window[1] - window[0])
    figure = new_figure(TOP_MM + rows * height + KEY_MM)
    for i, material_set in enumerate(results.material_sets):
        bottom = KEY_MM + (rows - 1 - i) * height
        for j, socket in enumerate(results.sockets):
            axes = add_axes(figure, LEFT_MM + j * width, bottom, width, height)
            drawing.frame(axes, window)
            if (socket, material_set) in results.cases:
                draw(axes, (socket, material_set))
            else:
                axes.text(0.5, 0.5, "not solved", transform=axes.transAxes, ha="center")
            if i == 0:
                axes.set_title(socket_title(socket), pad=3)
            if i == rows - 1 and j == 0:
                drawing.scale_bar(axes, window, fontsize=6, margin=0.5)
        label = add_axes(figure, 0.0, bottom, LEFT_MM, height)
        drawing.frame(label, (0, LEFT_MM, 0, height))
        label.text(
            LEFT_MM / 2, height / 2, f"{SET_NAMES[material_set]} set",
            rotation=90, ha="center", va="center", fontsize=8.5,
        )  # fmt: skip
    compass(figure)
    return figure
