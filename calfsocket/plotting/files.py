"""Figures as they are written: PNG, PDF, SVG, and a small image for a page."""

import io
import struct
import zlib
from dataclasses import dataclass
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import (
    Image,
    WebPImagePlugin,  # noqa: F401  # else Pillow loads every plugin that it has
)

from calfsocket.io.files import replacing

PNG_LEVEL, WEBP_EFFORT = 2, 0
"""How hard files are packed: the most takes three times as long, and saves a tenth of the size."""

MANY_COLOURS = 5000
"""Of an image for which WebP's method 1 takes six times as long as 0, and saves a fifth."""

PAGE_PX = 1600
"""Width of an image on a page: sharp on a phone at three pixels a point, on paper at 220 dpi."""


@dataclass(frozen=True)
class PageImage:
    """An image for a page, as WebP without loss."""

    data: bytes
    width: int
    height: int

    @classmethod
    def of(cls, image: Image.Image) -> "PageImage":
        """Scale an image down to `PAGE_PX`."""
        width = min(PAGE_PX, image.width)
        height = round(image.height * width / image.width)
        small = image.resize((width, height), Image.Resampling.HAMMING)
        method = 0 if small.getcolors(MANY_COLOURS) is None else 1
        buffer = io.BytesIO()
        small.save(buffer, format="WEBP", lossless=True, method=method, quality=WEBP_EFFORT)
        return cls(buffer.getvalue(), width, height)


@dataclass(frozen=True)
class Drawing:
    """A figure in its files: the same bytes for the same figure."""

    png: bytes
    pdf: bytes
    small: PageImage

    @classmethod
    def of(cls, figure: Figure) -> "Drawing":
        """Draw a figure at its resolution: once in pixels, once in vectors."""
        image = pixels(figure)
        return cls(png(image, figure.dpi), vectors(figure, "pdf"), PageImage.of(image))

    def write(self, folder: Path, name: str) -> tuple[Path, Path]:
        """Write PNG and PDF; return their paths."""
        paths = folder / f"{name}.png", folder / f"{name}.pdf"
        for path, content in zip(paths, (self.png, self.pdf), strict=True):
            with replacing(path) as temporary:
                temporary.write_bytes(content)
        return paths


def pixels(figure: Figure) -> Image.Image:
    """Return a figure as an image at its resolution."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")


def png(image: Image.Image, dpi: float) -> bytes:
    """Return an image as a PNG file.

    Pillow would try all of PNG's filters on every row, in twice the time: drawings are smallest
    without one.
    """
    pixels = np.asarray(image)
    height, width, _ = pixels.shape
    rows = np.zeros((height, 1 + 3 * width), np.uint8)  # each begins with 0: no filter
    rows[:, 1:] = pixels.reshape(height, -1)
    per_metre = round(dpi / 0.0254)
    chunks = (
        (b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)),  # 8 bits, RGB
        (b"pHYs", struct.pack(">IIB", per_metre, per_metre, 1)),
        (b"IDAT", zlib.compress(rows, PNG_LEVEL)),
        (b"IEND", b""),
    )
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in chunks
    )


def vectors(figure: Figure, form: str) -> bytes:
    """Return a figure as a PDF or SVG file."""
    from calfsocket.plotting.fonts import cut_once  # a fifth of a second, which PNG may do without

    buffer = io.BytesIO()
    date = {"pdf": "CreationDate", "svg": "Date"}[form]  # alone differs from writing to writing
    with matplotlib.rc_context({"svg.hashsalt": "calfsocket"}), cut_once():
        figure.savefig(
            buffer, format=form, dpi=figure.dpi, facecolor="white", metadata={date: None}
        )
    return buffer.getvalue()


def save(figure: Figure, path: Path) -> Path:
    """Write a figure as the file that a path names, one of `names.FORMATS`; return the path.

    The same figure gives the same bytes.
    """
    form = path.suffix[1:]
    content = png(pixels(figure), figure.dpi) if form == "png" else vectors(figure, form)
    with replacing(path) as temporary:
        temporary.write_bytes(content)
    return path
