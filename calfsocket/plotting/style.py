"""The look of the figures: width, type, colours, legends; panels side by side."""

import textwrap
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager

import matplotlib
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from calfsocket.meshes.frame import Frame
from calfsocket.plotting import section as drawing

WIDTH_MM = 180.0  # a page of A4 or letter without its margins
PNG_DPI = 300
INCH_MM, POINTS = 25.4, 72.0  # an inch in mm and in points

TYPE = {
    "font.family": "DejaVu Sans",
    "font.size": 7.5,
    "axes.titlesize": 8.5,
    "axes.labelsize": 7.5,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "legend.fontsize": 7,
    "figure.titlesize": 9.5,
    "axes.linewidth": 0.6,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "hatch.linewidth": 0.6,
    "pdf.fonttype": 42,  # text stays text
    "pdf.compression": 1,  # a third of the time of 6, and a tenth more
}

# Of panels, mm.
TOP_MM, LINE_MM = 6.0, 3.4  # room for a title, and for each further line of it
MOST_ABREAST, MOST_SHOWN = 4, 12  # panels in a row, and in a figure
LETTER_EM = 0.55  # width of a letter over the size of its type, on average
LETTER_MM = 1.7  # width of a letter of a title, on average
LARGEST_PANEL_MM = 90.0


def type_set() -> AbstractContextManager[None]:
    """Return a context in which drawings have this type."""
    return matplotlib.rc_context(TYPE)  # type: ignore[arg-type]


def new_figure(height: float) -> Figure:
    """Make a figure of the full width and a height in mm."""
    return Figure(figsize=(WIDTH_MM / INCH_MM, height / INCH_MM), dpi=PNG_DPI)


def heading(title: str, width: float) -> str:
    """Return the title of a panel: on lines that fit in mm, and a new one for each change."""
    parts = title.replace("@", ",@").split(",") if "@" in title else [title]
    letters = int(width / LETTER_MM)
    lines = (textwrap.wrap(part.strip(" @"), letters, break_on_hyphens=False) for part in parts)
    return "\n".join(line for wrapped in lines for line in wrapped)


def fitting(text: str, width: float, largest: float) -> float:
    """Return the size of type, up to the largest, in which the lines of a text fit in mm."""
    longest = max(map(len, text.split("\n")))
    return min(largest, width / (longest * LETTER_EM) / INCH_MM * POINTS)


def width_mm(axes: Axes) -> float:
    """Width of axes in a figure of the full width, mm."""
    return axes.get_position().width * WIDTH_MM


def height_mm(figure: Figure) -> float:
    """Height of a figure, mm."""
    return float(figure.get_figheight() * INCH_MM)


def add_axes(figure: Figure, left: float, bottom: float, width: float, height: float) -> Axes:
    """Add axes at a place in mm of paper."""
    total = height_mm(figure)
    return figure.add_axes((left / WIDTH_MM, bottom / total, width / WIDTH_MM, height / total))


def compass(figure: Figure, limb: Frame) -> None:
    """Draw the directions of all sections at the figure's lower right, once."""
    width, height = 26.0, 15.0
    axes = add_axes(figure, WIDTH_MM - width - 1, 1.0, width, height)
    drawing.frame(axes, (-width / 2, width / 2, -height / 2, height / 2))
    places = (
        (1, 0, "left", "center"),
        (0, 1, "center", "bottom"),
        (-1, 0, "right", "center"),
        (0, -1, "center", "top"),
    )
    for text, (x, y, ha, va) in zip(limb.words, places, strict=True):
        axes.plot([0, 3.6 * x], [0, 3.6 * y], color=drawing.QUIET, linewidth=0.7)
        axes.text(4.2 * x, 4.2 * y, text, ha=ha, va=va, fontsize=6.5, color=drawing.QUIET)


def legend_at(
    figure: Figure, left: float, bottom: float, handles: Sequence[Artist], title: str | None = None
) -> None:
    """Draw a legend in one line at a place in mm of paper."""
    figure.legend(
        handles=list(handles),
        title=title,
        title_fontsize=7,
        alignment="left",
        ncols=len(handles),
        loc="lower left",
        bbox_to_anchor=(left / WIDTH_MM, bottom / height_mm(figure)),
        frameon=False,
        borderaxespad=0,
        handlelength=1.6,
        handletextpad=0.5,
        columnspacing=1.4,
    )


def window_around(*points: NDArray[np.float64], margin_mm: float) -> drawing.Window:
    """Return the window that holds all points, (n, 2) each."""
    every = np.vstack(points)
    (left, bottom), (right, top) = every.min(axis=0) - margin_mm, every.max(axis=0) + margin_mm
    return (left, right, bottom, top)


def abreast(sockets: Sequence[str]) -> list[Sequence[str]]:
    """Divide the sockets that a figure shows into rows."""
    shown = sockets[:MOST_SHOWN]
    return [shown[i : i + MOST_ABREAST] for i in range(0, len(shown), MOST_ABREAST)]


def panels(
    titles: Mapping[str, str],
    rows: Sequence[str],
    window: drawing.Window,
    draw: Callable[[Axes, str, int], None],
    limb: Frame,
    key: float,
    below: float = 0.0,
) -> Figure:
    """Draw sections to one scale, a column a socket, with titles of sockets and labels of rows.

    `limb` has the directions. `draw` draws on a panel's axes for a socket and the number of a row.
    `key` and `below` are room for a key at the figure's foot and below each row, mm of paper.
    """
    sockets = list(titles)
    blocks = abreast(sockets)
    left = 5.0 if any(rows) else 0.0
    width = min((WIDTH_MM - left) / max(map(len, blocks)), LARGEST_PANEL_MM)
    heads = {socket: heading(title, width) for socket, title in titles.items()}
    height = width * (window[3] - window[2]) / (window[1] - window[0])
    rooms = [
        TOP_MM + LINE_MM * max(heads[socket].count("\n") for socket in block) for block in blocks
    ]
    total = sum(rooms) + len(blocks) * len(rows) * (height + below) + key
    figure = new_figure(total)
    bottom = total
    for block, room in zip(blocks, rooms, strict=True):
        bottom -= room
        for i, row in enumerate(rows):
            bottom -= height
            for j, socket in enumerate(block):
                axes = add_axes(figure, left + j * width, bottom, width, height)
                drawing.frame(axes, window)
                draw(axes, socket, i)
                if i == 0:
                    axes.set_title(heads[socket], pad=3, y=1.0)  # a place needs no search
                if i == len(rows) - 1 and j == 0 and block is blocks[-1]:
                    drawing.scale_bar(axes, window, fontsize=6, margin=0.5)
            if row:
                x, y = left / 2 / WIDTH_MM, (bottom + height / 2) / total
                figure.text(x, y, row, rotation=90, ha="center", va="center", fontsize=8.5)
            bottom -= below
    if len(sockets) > MOST_SHOWN:
        figure.text(
            0.99, 0.998, f"the first {MOST_SHOWN} of {len(sockets)} sockets; each case has its own "
            "picture.png", ha="right", va="top", fontsize=6,
        )  # fmt: skip
    compass(figure, limb)
    return figure
