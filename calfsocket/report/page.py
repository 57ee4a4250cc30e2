"""The report as one page that needs nothing else: no network, no script."""

import base64
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from itertools import count
from pathlib import Path
from typing import Any

from markupsafe import Markup
from PIL import Image

import calfsocket
from calfsocket.io.files import replacing
from calfsocket.plotting.files import Drawing, PageImage
from calfsocket.report.table import Table
from calfsocket.report.templates import read, render, tidy, together

FIGURES, TABLES = "figures", "tables"
"""Folders beside the page."""

PAGE_FILE = "report.html"

FILES = {
    "run.json": "all inputs and checks (run.json)",
    "steps.csv": "load steps",
    "summary.csv": "maxima",
    "levels.csv": "levels by area",
    "contact.csv": "contact",
}
"""Files of a study, and what the page calls them."""


@dataclass
class Page:
    """What a template shows, and writes beside the page when it does.

    Its methods are the template's: what they are called with is there in words, what they show is
    here by name. What is not here, and a chapter or a line without content, is left out.
    """

    folder: Path
    figures: Mapping[str, Drawing | tuple[Path, Path]]
    """Drawn now, or the files of one, PNG and PDF."""
    tables: Mapping[str, Table]
    numbers: Mapping[str, str] = field(default_factory=dict)
    """Of figures; those without one are counted in the order of the page."""
    chapters: list[tuple[str, str]] = field(default_factory=list)
    """Anchor and title of those shown so far."""
    _figures_shown: int = 0
    _taken: set[str] = field(default_factory=set)
    """Numbers of figures that no other one may have."""

    def __post_init__(self) -> None:
        self._taken |= {*self.numbers.values()}

    def write(self, template: str, package: str, **values: Any) -> Path:
        """Write the page into the folder; return its path."""
        found = {name: text for name, text in FILES.items() if (self.folder / name).is_file()}
        text = render(
            template,
            package,
            page=self,
            style=Markup(read("report.css")),
            version=calfsocket.__version__,
            files=found,
            **values,
        )
        path = self.folder / PAGE_FILE
        with replacing(path) as temporary:
            temporary.write_text(text, encoding="utf-8")
        return path

    def chapter(self, anchor: str, title: str, caller: Callable[[], str]) -> Markup:
        """Return a chapter of the page."""
        content = caller()
        if not content.strip():
            return Markup()
        self.chapters.append((anchor, title))
        return render("chapter.html", anchor=anchor, title=title, content=content)

    def line(self, topic: str, caller: Callable[[], str]) -> Markup:
        """Return a line of the answer, whose numbers and units stay together."""
        text = together(tidy(caller()))
        line = Markup("<li><strong>{}.</strong> {}</li>\n").format(topic, text)
        return line if text else Markup()

    def figure(self, name: str, title: str, caller: Callable[[], Markup]) -> Markup:
        """Return a figure, whose files are written now."""
        if name not in self.figures:
            return Markup()
        self._figures_shown += 1
        if (number := self.numbers.get(name)) is None:
            number = next(n for n in map(str, count(self._figures_shown)) if n not in self._taken)
        self._taken.add(number)
        found = self.figures[name]
        if isinstance(found, Drawing):
            image = found.small
            paths = found.write(self.folder / FIGURES, f"figure{number}_{name}")
        else:
            paths = found
            with Image.open(paths[0]) as full:
                image = PageImage.of(full.convert("RGB"))
        png, pdf = (Path(os.path.relpath(path, self.folder)).as_posix() for path in paths)
        return render(
            "figure.html",
            name=f"figure{number}_{name}",
            title=title,
            caption=tidy(caller().striptags()),
            number=number,
            uri=Markup("data:image/webp;base64,{}").format(base64.b64encode(image.data).decode()),
            width=image.width,
            height=image.height,
            png=png,
            pdf=pdf,
        )

    def table(self, name: str, title: str, caller: Callable[[], Markup]) -> Markup:
        """Return a table, whose files are written now."""
        if name not in self.tables:
            return Markup()
        table = replace(self.tables[name], title=title, caption=tidy(caller().striptags()))
        table.write(self.folder / TABLES)
        return table.html + Markup(
            '<p class="files"><a href="{0}.csv">CSV</a> <a href="{0}.md">Markdown</a></p>\n'
        ).format(f"{TABLES}/{name}")
