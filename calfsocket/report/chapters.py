"""What a report is made of, and what a guest may add to it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from markupsafe import Markup
from matplotlib import figure

from calfsocket.report.table import Table


@dataclass(frozen=True)
class Figure:
    """A figure that a report draws.

    Attributes
    ----------
    name
        Without blanks; the files are called ``figure<number>_<name>``.
    title, caption
        What it shows.
    draw
        Draws it.
    number
        Its number; figures without one are counted in the order of the page.
    """

    name: str
    title: str
    caption: str
    draw: Callable[[], figure.Figure]
    number: str = ""


@dataclass(frozen=True)
class Drawn:
    """A figure whose files are there.

    Attributes
    ----------
    name, title, caption, number
        As of `Figure`; the name is that of the files.
    png, pdf
        The files.
    """

    name: str
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
    """A chapter of the page.

    Attributes
    ----------
    anchor
        Name within the page. What a guest's chapter holds is added to the report's of that name.
    title, intro
        Heading, and the paragraph below it.
    content
        Figures, tables and more, in order.
    after
        Anchor of the report's chapter that a guest's follows.
    """

    anchor: str
    title: str = ""
    intro: str = ""
    content: tuple[Content, ...] = ()
    after: str = ""


@dataclass(frozen=True)
class Line:
    """A line of the answer: what it is about, and the sentence."""

    topic: str
    text: str


@dataclass(frozen=True)
class Guest:
    """What a guest adds to a report.

    Attributes
    ----------
    title
        Of the page, where the study has none of its own.
    chapters
        See `Chapter`.
    lines
        Of the answer; one whose topic the report has is added to that line.
    warnings
        What a reader must know before using a number.
    note
        Paragraph below the answer.
    numbers, captions
        Numbers of the report's figures by their names, and sentences added to their captions.
    tables
        Written beside the page's, but not shown as tables.
    replaces
        Names of tables of the report that say no more than those of the guest.
    """

    title: str = ""
    chapters: tuple[Chapter, ...] = ()
    lines: tuple[Line, ...] = ()
    warnings: tuple[str, ...] = ()
    note: str = ""
    numbers: Mapping[str, str] = field(default_factory=dict)
    captions: Mapping[str, str] = field(default_factory=dict)
    tables: tuple[Table, ...] = ()
    replaces: tuple[str, ...] = ()
