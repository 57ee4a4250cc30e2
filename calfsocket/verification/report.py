"""What a verification problem shows: checks against exact values, tables and figures."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import pandas as pd
from matplotlib.axes import Axes

Rule = Literal["at most", "at least", "exactly"]


@dataclass(frozen=True)
class Check:
    """A measured number and its bar."""

    name: str  #: what was measured
    measured: float  #: the number, in `unit`
    bar: float  #: what the number is compared with, in `unit`
    source: str  #: where the exact value comes from
    unit: str = ""  #: unit; empty for a ratio
    #: "at most": an error, its magnitude is no larger than the bar; "at least": an order or a
    #: share, no smaller than the bar; "exactly": a count, equal to the bar
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
    """A plot of a verification problem."""

    name: str  #: file name without extension
    draw: Callable[[Axes], None]  #: draws on given axes
    caption: str  #: what it shows


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
    """Numbers shown on the page as they are."""

    caption: str  #: what they are
    frame: pd.DataFrame  #: its columns are the heads
    digits: int = 4  #: of its numbers


@dataclass(frozen=True)
class Section:
    """A subject of the verification page."""

    #: heading, and what the problem is, in Markdown
    title: str
    text: str
    checks: list[Check]  #: measured numbers
    figures: list[Figure] = field(default_factory=list)  #: plots
    tables: list[Table] = field(default_factory=list)  #: more numbers, below the checks
    #: tables too long for the page, by the name of their CSV file
    files: Mapping[str, pd.DataFrame] = field(default_factory=dict)
