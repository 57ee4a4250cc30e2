"""What a verification problem shows: checks against exact values, tables and figures."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import pandas as pd
from matplotlib.axes import Axes

Rule = Literal["at most", "at least", "exactly"]


@dataclass(frozen=True)
class Check:
    """A measured number and its bar.

    Attributes
    ----------
    name : str
        What was measured.
    measured : float
        The number, in `unit`.
    bar : float
        What the number is held against, in `unit`.
    source : str
        Where the exact value comes from.
    unit : str
        Unit; empty for a ratio.
    rule : str
        "at most": an error, its magnitude is no larger than the bar; "at least": an order or a
        share, no smaller than the bar; "exactly": a count, equal to the bar.
    """

    name: str
    measured: float
    bar: float
    source: str
    unit: str = ""
    rule: Rule = "at most"

    @property
    def passes(self) -> bool:
        """Whether the number keeps its bar; one that is not finite does not."""
        match self.rule:
            case "at most":
                return abs(self.measured) <= self.bar
            case "at least":
                return self.measured >= self.bar
            case "exactly":
                return self.measured == self.bar


@dataclass(frozen=True)
class Figure:
    """A plot of a verification problem.

    Attributes
    ----------
    name : str
        File name without ending.
    draw : callable
        Draws on given axes.
    caption : str
        What it shows.
    """

    name: str
    draw: Callable[[Axes], None]
    caption: str


Curve = tuple[Any, Any, str, str | None]
"""x, y, matplotlib's format, and the label; None for none."""


def curves(
    name: str, caption: str, labels: tuple[str, str], lines: Sequence[Curve], **settings: Any
) -> Figure:
    """Make a figure of curves.

    Parameters
    ----------
    name, caption : str
        As of `Figure`.
    labels : (str, str)
        Of the axes.
    lines : sequence of Curve
        The curves, in order.
    **settings
        More settings of the axes: xscale="log", xlim=(0, 1), ...
    """

    def draw(axes: Axes) -> None:
        for at, values, style, label in lines:
            axes.plot(at, values, style, label=label, lw=1.2, ms=4)
        axes.set(xlabel=labels[0], ylabel=labels[1], **settings)
        if any(label for *_, label in lines):
            axes.legend(fontsize="small")

    return Figure(name, draw, caption)


LOG = {"xscale": "log", "yscale": "log"}
"""Settings of a figure with logarithms on both axes."""


@dataclass(frozen=True)
class Table:
    """Numbers shown on the page as they are.

    Attributes
    ----------
    caption : str
        What they are.
    frame : DataFrame
        Its columns are the heads.
    digits : int
        Of its numbers.
    """

    caption: str
    frame: pd.DataFrame
    digits: int = 4


@dataclass(frozen=True)
class Section:
    """A subject of the verification page.

    Attributes
    ----------
    title, text : str
        Heading, and what the problem is, in Markdown.
    checks : list of Check
        Measured numbers.
    figures : list of Figure
        Plots.
    tables : list of Table
        More numbers, below the checks.
    files : mapping of str to DataFrame
        Tables too long for the page, by the name of their CSV file.
    """

    title: str
    text: str
    checks: list[Check]
    figures: list[Figure] = field(default_factory=list)
    tables: list[Table] = field(default_factory=list)
    files: Mapping[str, pd.DataFrame] = field(default_factory=dict)
