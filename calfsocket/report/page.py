"""The report as one page that needs nothing else: no network, no script."""

import base64
import io
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from markupsafe import Markup
from PIL import Image

import calfsocket
from calfsocket.io.files import replacing
from calfsocket.report.chapters import Chapter, Content, Drawn, Line, Note
from calfsocket.report.table import Table
from calfsocket.report.templates import read, render

PAGE_FILE = "report.html"
WIDTH_PX = 1600  # of a figure: sharp on a phone at three pixels a point, on paper at 220 dpi


@dataclass(frozen=True)
class Page:
    """What the page shows: the answer with notes below it, chapters whose figures are drawn."""

    title: str
    summary: str
    warnings: Sequence[str]
    answer: Sequence[Line]
    notes: Sequence[str]
    chapters: Sequence[Chapter]
    method: Sequence[Table]


def write_page(page: Page, folder: Path) -> Path:
    """Write report.html into a folder; return its path."""
    text = render(
        "report.html",
        style=Markup(read("report.css")),
        version=calfsocket.__version__,
        page=page,
        chapters=[
            {"about": chapter, "content": [_shown(each, folder) for each in chapter.content]}
            for chapter in page.chapters
        ],
        method=[table.html() for table in page.method],
        files={name: text for name, text in FILES.items() if (folder / name).is_file()},
    )
    path = folder / PAGE_FILE
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return path


FILES = {
    "run.json": "all inputs and checks (run.json)",
    "steps.csv": "load steps",
    "summary.csv": "maxima",
    "contact.csv": "contact",
}
"""Files of a study, and what the page calls them."""


def data_uri(png: Path) -> tuple[str, int, int]:
    """Return an image, scaled down, as WebP without loss in a data URI; and its size in pixels."""
    with Image.open(png) as full:
        image = full.convert("RGB")
    width = min(WIDTH_PX, image.width)
    height = round(image.height * width / image.width)
    small = image.resize((width, height), Image.Resampling.LANCZOS)
    buffer = io.BytesIO()
    small.save(buffer, format="WEBP", lossless=True)
    text = base64.b64encode(buffer.getvalue()).decode("ascii")
    return f"data:image/webp;base64,{text}", width, height


def _shown(content: Content, folder: Path) -> dict[str, Any]:
    """Return what the template needs of a chapter's content."""
    if isinstance(content, Drawn):
        uri, width, height = data_uri(content.png)
        png, pdf = (
            Path(os.path.relpath(file, folder)).as_posix() for file in (content.png, content.pdf)
        )
        size = {"uri": Markup(uri), "width": width, "height": height}
        return {"kind": "figure", "figure": content, **size, "png": png, "pdf": pdf}
    if isinstance(content, Table):
        return {"kind": "table", "name": content.name, "html": content.html()}
    if isinstance(content, Note):
        return {"kind": "note", "text": content.text}
    return {"kind": "html", "html": content}
