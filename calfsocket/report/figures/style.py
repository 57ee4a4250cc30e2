"""The look of the report's figures: width, type, colours; and how they are saved."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import matplotlib.pyplot as plt
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from calfsocket.io.files import replacing
from calfsocket.plotting import section as drawing
from calfsocket.plotting.section import SOCKET_NAMES

WIDTH_MM = 180.0  # a page of A4 or letter without its margins
PNG_DPI = 300
INCH_MM = 25.4

# After Okabe and Ito: told apart by colour-blind eyes, and in print by their lightness.
SOCKET_COLOURS = {"TC": "#e69f00", "TSB": "#56b4e9", "HS": "#1b4f72"}
OTHER_SOCKET = "#777777"

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
}


@contextmanager
def type_set() -> Iterator[None]:
    """Use the report's type within."""
    with plt.rc_context(TYPE):
        yield


def new_figure(height: float) -> Figure:
    """Make a figure of the report's width and a height in mm."""
    return plt.figure(figsize=(WIDTH_MM / INCH_MM, height / INCH_MM))


def socket_title(socket: str) -> str:
    """Name a socket: the paper's also in words, others with what is changed on lines below."""
    if socket in SOCKET_NAMES:
        return f"{socket}, {SOCKET_NAMES[socket]}"
    return socket.replace("@", "\n").replace(",", "\n")


def height_mm(figure: Figure) -> float:
    """Height of a figure, mm."""
    return figure.get_figheight() * INCH_MM


def add_axes(figure: Figure, left: float, bottom: float, width: float, height: float) -> Axes:
    """Add axes at a place given in mm of paper."""
    total = height_mm(figure)
    return figure.add_axes((left / WIDTH_MM, bottom / total, width / WIDTH_MM, height / total))


def compass(figure: Figure) -> None:
    """Draw the directions of all sections (a right leg) at the figure's lower right, once."""
    width, height = 26.0, 15.0
    axes = add_axes(figure, WIDTH_MM - width - 1, 1.0, width, height)
    drawing.frame(axes, (-width / 2, width / 2, -height / 2, height / 2))
    for text, x, y, ha, va in (
        ("anterior", 0, 1, "center", "bottom"),
        ("posterior", 0, -1, "center", "top"),
        ("medial", -1, 0, "right", "center"),
        ("lateral", 1, 0, "left", "center"),
    ):
        axes.plot([0, 3.6 * x], [0, 3.6 * y], color=drawing.QUIET, linewidth=0.7)
        axes.text(4.2 * x, 4.2 * y, text, ha=ha, va=va, fontsize=6.5, color=drawing.QUIET)


def legend_at(
    figure: Figure, left: float, bottom: float, handles: Sequence[Artist], title: str | None = None
) -> None:
    """Write a legend in one line at a place given in mm of paper."""
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


def save(figure: Figure, folder: Path, name: str) -> tuple[Path, Path]:
    """Write a figure as PNG and as PDF, the same bytes for the same figure; return both paths."""
    png, pdf = folder / f"{name}.png", folder / f"{name}.pdf"
    with replacing(png) as temporary:
        figure.savefig(temporary, dpi=PNG_DPI, facecolor="white")
    with replacing(pdf) as temporary:
        # no date: it alone would differ from one writing to the next
        figure.savefig(temporary, dpi=PNG_DPI, metadata={"CreationDate": None})
    plt.close(figure)
    return png, pdf
