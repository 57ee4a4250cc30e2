"""Figures made small enough to travel inside a page."""

import base64
import io
from pathlib import Path

from PIL import Image

WIDTH_PX = 1600  # sharp on a phone at three pixels a point, and on paper at 220 dpi


def data_uri(png: Path) -> tuple[str, int, int]:
    """Scale an image down and write it as a data URI.

    Returns
    -------
    uri, width, height
        The image as WebP without loss, and its size in pixels.
    """
    with Image.open(png) as full:
        image = full.convert("RGB")
    width = min(WIDTH_PX, image.width)
    height = round(image.height * width / image.width)
    small = image.resize((width, height), Image.Resampling.LANCZOS)
    buffer = io.BytesIO()
    small.save(buffer, format="WEBP", lossless=True)
    text = base64.b64encode(buffer.getvalue()).decode("ascii")
    return f"data:image/webp;base64,{text}", width, height
