"""A grid of sections, material sets by sockets, as figures 4, 7 and 9 have it."""

from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from calfsocket.plotting import section as drawing
from calfsocket.report import names
from calfsocket.report.figures.style import WIDTH_MM, add_axes, compass, new_figure, socket_title
from calfsocket.report.results import Results

TOP_MM, KEY_MM, LEFT_MM = 6.0, 21.0, 5.0
LINE_MM = 3.4  # of a title's further lines
MOST_ABREAST, MOST_SHOWN = 4, 12  # sockets in a row, and in a figure
LARGEST_PANEL_MM = 90.0


def window_around(*points: NDArray[np.float64], margin_mm: float) -> drawing.Window:
    """Give the window that holds all points, (n, 2) each."""
    every = np.vstack(points)
    (left, bottom), (right, top) = every.min(axis=0) - margin_mm, every.max(axis=0) + margin_mm
    return (left, right, bottom, top)


def abreast(sockets: Sequence[str]) -> list[Sequence[str]]:
    """Part the sockets that a figure shows into rows."""
    shown = sockets[:MOST_SHOWN]
    return [shown[i : i + MOST_ABREAST] for i in range(0, len(shown), MOST_ABREAST)]


def title_mm(sockets: Sequence[str]) -> float:
    """Room that the titles of a row of sockets need."""
    lines = max(socket_title(socket).count("\n") for socket in sockets)
    return TOP_MM + LINE_MM * lines


def tell_hidden(figure: Figure, results: Results) -> None:
    """Say in a figure how many sockets it does not show."""
    hidden = len(results.sockets) - MOST_SHOWN
    if hidden > 0:
        figure.text(
            0.99, 0.998, f"the first {MOST_SHOWN} of {len(results.sockets)} sockets; each case "
            "has its own picture.png", ha="right", va="top", fontsize=6,
        )  # fmt: skip


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
    blocks = abreast(results.sockets)
    sets = results.material_sets
    width = min((WIDTH_MM - LEFT_MM) / max(map(len, blocks)), LARGEST_PANEL_MM)
    height = width * (window[3] - window[2]) / (window[1] - window[0])
    heads = [title_mm(block) for block in blocks]
    total = sum(heads) + len(blocks) * len(sets) * height + KEY_MM
    figure = new_figure(total)
    bottom = total
    for block, head in zip(blocks, heads, strict=True):
        bottom -= head
        for i, material_set in enumerate(sets):
            bottom -= height
            for j, socket in enumerate(block):
                axes = add_axes(figure, LEFT_MM + j * width, bottom, width, height)
                drawing.frame(axes, window)
                if (socket, material_set) in results.cases:
                    draw(axes, (socket, material_set))
                else:
                    axes.text(0.5, 0.5, "not solved", transform=axes.transAxes, ha="center")
                if i == 0:
                    axes.set_title(socket_title(socket), pad=3)
                if i == len(sets) - 1 and j == 0 and block is blocks[-1]:
                    drawing.scale_bar(axes, window, fontsize=6, margin=0.5)
            label = add_axes(figure, 0.0, bottom, LEFT_MM, height)
            drawing.frame(label, (0, LEFT_MM, 0, height))
            label.text(
                LEFT_MM / 2, height / 2, f"{names.material_set(material_set)} set",
                rotation=90, ha="center", va="center", fontsize=8.5,
            )  # fmt: skip
    tell_hidden(figure, results)
    compass(figure)
    return figure
