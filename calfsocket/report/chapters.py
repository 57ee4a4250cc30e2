"""What a report is made of, and what a guest may add to it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from markupsafe import Markup
from matplotlib import figure

from calfsocket.report.table import Table


@dataclass(frozen=True)
class Figure:
    """A figure that a report draws into files called ``figure<number>_<name>``."""

    name: str
    title: str
    caption: str
    draw: Callable[[], figure.Figure]
    number: str = ""
    """Figures without one are counted in the order of the page."""


@dataclass(frozen=True)
class Drawn:
    """A figure whose files are there."""

    name: str
    """That of the files, without ending."""
    title: str
    caption: str
    number: str
    png: Path
    pdf: Path


@dataclass(frozen=True)
class Note:
    """A sentence in the place of what is missing."""

    text: str


Content = Figure | Drawn | Table | Note | Markup


@dataclass(frozen=True)
class Chapter:
    """A chapter of the page: heading, the paragraph below it, and what it holds."""

    anchor: str
    """Name within the page. What a guest's chapter holds is added to the report's of that name."""
    title: str = ""
    intro: str = ""
    content: tuple[Content, ...] = ()
    after: str = ""
    """Anchor of the report's chapter that a guest's follows."""


@dataclass(frozen=True)
class Line:
    """A line of the answer: what it is about, and the sentence."""

    topic: str
    text: str


@dataclass(frozen=True)
class Guest:
    """What a guest adds to a report."""

    title: str = ""
    """Of the page, where the study has none of its own."""
    chapters: tuple[Chapter, ...] = ()
    lines: tuple[Line, ...] = ()
    """Of the answer; one whose topic the report has is added to that line."""
    warnings: tuple[str, ...] = ()
    note: str = ""
    """Paragraph below the answer."""
    numbers: Mapping[str, str] = field(default_factory=dict)
    """Of the report's figures, by their names."""
    captions: Mapping[str, str] = field(default_factory=dict)
    """Sentences added to those of the report's figures, by their names."""
    tables: tuple[Table, ...] = ()
    """Written beside the page's, but not shown as tables."""
    replaces: tuple[str, ...] = ()
    """Names of tables of the report that say no more than those of the guest."""
