"""What a verification problem tells: checks against exact values, and figures."""

from collections.abc import Callable
from dataclasses import dataclass, field

from matplotlib.axes import Axes


@dataclass(frozen=True)
class Check:
    """A measured number and its bar.

    Attributes
    ----------
    name : str
        What was measured.
    measured : float
        The number, an error or a deficit, in `unit`.
    bar : float
        Largest absolute value that passes, in `unit`.
    unit : str
        Unit; empty for a ratio.
    source : str
        Where the exact value comes from.
    """

    name: str
    measured: float
    bar: float
    unit: str
    source: str

    @property
    def passes(self) -> bool:
        """Whether the number is within its bar; one that is not finite is not."""
        return abs(self.measured) <= self.bar


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
    """

    title: str
    text: str
    checks: list[Check]
    figures: list[Figure] = field(default_factory=list)
