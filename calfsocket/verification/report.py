"""What a verification problem shows: checks against exact values, figures and tables."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
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


def check_each(
    measured: Mapping[str, float], bar: float, source: str, unit: str = "", rule: Rule = "at most"
) -> list[Check]:
    """Compare several numbers, by name, with one bar."""
    return [Check(name, value, bar, source, unit, rule) for name, value in measured.items()]


def order(x: Any, y: Any) -> float:
    """Slope of log y over log x, fitted: the observed order; NaN with fewer than two values."""
    if len(x) < 2:
        return np.nan
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])


Draw = Callable[[Axes], None]
"""Draws a figure on given axes."""

Curve = tuple[Any, Any, str, str | None]
"""x, y, matplotlib's format, and the label; None for none."""

LOG = {"xscale": "log", "yscale": "log"}
"""Settings of a figure with logarithms on both axes."""


def curves(labels: tuple[str, str], lines: Sequence[Curve], **settings: Any) -> Draw:
    """Make a figure of curves with labels of the axes and more of their settings, e.g. xlim."""

    def draw(axes: Axes) -> None:
        for at, values, style, label in lines:
            axes.plot(at, values, style, label=label, lw=1.2, ms=4)
        axes.set(xlabel=labels[0], ylabel=labels[1], **settings)
        if any(label for *_, label in lines):
            axes.legend(fontsize="small")

    return draw


@dataclass(frozen=True)
class Section:
    """What a subject's template in ``pages/`` is filled with."""

    checks: list[Check]  #: measured numbers
    figures: Mapping[str, Draw] = field(default_factory=dict)  #: by file name without extension
    tables: Mapping[str, pd.DataFrame] = field(default_factory=dict)  #: columns are the heads
    #: tables too long for the page, by the name of their CSV file
    files: Mapping[str, pd.DataFrame] = field(default_factory=dict)
    values: Mapping[str, Any] = field(default_factory=dict)  #: numbers and words of the text
