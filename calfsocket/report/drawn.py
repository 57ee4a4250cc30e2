"""A figure of the report: what a reader is told of it, and its files."""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Heading:
    """What a reader is told of a figure.

    Attributes
    ----------
    number, name
        Its number, and its name without blanks.
    title, caption
        What it shows.
    """

    number: str
    name: str
    title: str
    caption: str


@dataclass(frozen=True)
class Drawn:
    """A figure and its files."""

    heading: Heading
    png: Path
    pdf: Path
