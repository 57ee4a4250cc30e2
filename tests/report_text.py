"""Writes reports with small figures and reads them as people do."""

import html
import json
import re
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

from calfsocket.paper.guest import guest
from calfsocket.plotting import style
from calfsocket.plotting.files import Drawing, PageImage, pixels, png
from calfsocket.report.findings import Findings
from calfsocket.report.page import FIGURES
from calfsocket.report.write import Guest, write_report
from calfsocket.simulation.results import Results

ENDS = "p|li|h1|h2|h3|tr|figcaption|section|nav|div|title"


@dataclass(frozen=True)
class Report:
    """A report: the page's text, one paragraph, row or caption a line, and what figures say."""

    text: str
    drawn: dict[str, list[str]]

    @property
    def answer(self) -> dict[str, str]:
        """Topic -> what the answer says on it."""
        part = self.text.partition("\nThe answer\n")[2].partition("\nNothing here is")[0]
        lines = [line.partition(". ") for line in part.splitlines()]
        return {topic: text for topic, _, text in lines if text}

    @property
    def everything(self) -> str:
        """All words, of the page and of its figures."""
        return "\n".join([self.text, *(text for texts in self.drawn.values() for text in texts)])


def written(results: Results, invite: Callable[[Findings], Guest | None] = guest) -> Report:
    """Write the report of results into their folder and read it."""
    shutil.rmtree(results.folder / FIGURES, ignore_errors=True)
    page = write_small(results, invite)
    files = (results.folder / FIGURES).glob("*.pdf")
    drawn = {path.stem: json.loads(path.read_text(encoding="utf-8")) for path in files}
    return Report(plain(page.read_text(encoding="utf-8")), drawn)


def write_small(results: Results, invite: Callable[[Findings], Guest | None] = guest) -> Path:
    """Write a report whose figures have few pixels; return its page.

    Nearly all of a report's time goes into those; `test_report_figures` looks at real ones.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Drawing, "of", _small)
        patch.setattr(style, "PNG_DPI", 40)
        return write_report(results, invite)


def _small(figure: Figure) -> Drawing:
    """Draw a figure with few pixels; in the place of its PDF are the texts that it shows."""
    # an axis that is not shown still has its ticks
    texts = [
        text.get_text()
        for text in figure.findobj(Text)
        if (text.get_text() and (text.axes is None or text.axes.axison))
        or text in (text.axes.texts if text.axes else ())
    ]  # fmt: skip
    image = pixels(figure)
    return Drawing(png(image, 40), json.dumps(texts).encode(), PageImage.of(image))


def plain(page: str) -> str:
    """Return the text of a page."""
    page = re.sub(r"<style>.*?</style>", "", page.replace("\n", " "))
    page = re.sub(rf"</(?:{ENDS})>", "\n", page)
    page = re.sub(r"</t[hd]>", " | ", page)
    text = html.unescape(re.sub(r"<[^>]+>", "", page))
    return "\n".join(" ".join(line.split()) for line in text.splitlines() if line.split())
