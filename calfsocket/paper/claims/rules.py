"""How a claim is checked: a fact found in the study, a rule, and what the paper has.

A row of ``data/checks.csv`` is a claim: ``fact`` names a function that finds the actual value, for
what ``of`` says; ``rule`` names how the value is held against ``expected``. ``paper`` is what a
reader sees of the paper, ``why`` what is said where the claim does not hold and the fact says
nothing more precise. ``judges`` tells claims on results from those that only restate an input of
the study or compare the paper with itself; those hold by construction, and ``given`` says by which.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from calfsocket.paper.claims.tolerances import (
    ABOUT_COUNT,
    SAME,
    THREE_FIGURES,
    about,
    about_change,
)
from calfsocket.paper.evidence import Evidence

RESULT, INPUT, PAPER = "result", "input", "paper"
"""What a claim may judge: results, an input of the study, or the paper's own numbers."""


@dataclass(frozen=True)
class Fact:
    """What a study says on a claim.

    Attributes
    ----------
    value
        What a rule judges: a number, a text, a truth; of several, every one has to pass.
    text : str
        The numbers, with units.
    why : str
        One line on the difference; shown where the claim does not hold.
    """

    value: Any
    text: str
    why: str = ""


Finder = Callable[[Evidence, str], Fact]

FACTS: dict[str, Finder] = {}


def fact(function: Finder) -> Finder:
    """Register a function under its name."""
    if function.__name__ in FACTS:
        raise ValueError(f"fact {function.__name__} has two functions")
    FACTS[function.__name__] = function
    return function


RULES: dict[str, Callable[[Any, str], bool]] = {
    "true": lambda value, _: bool(value),
    "none": lambda value, _: not value,
    "is": lambda value, expected: str(value) == expected,
    "same": lambda value, e: abs(value - float(e)) <= SAME * abs(float(e)),
    "to three figures": lambda value, e: abs(value / float(e) - 1) <= THREE_FIGURES,
    "rounded": lambda value, e: round(value) == int(e),
    "about": lambda value, e: about(value, float(e)),
    "about, a count": lambda value, e: about(value, float(e), ABOUT_COUNT),
    "about, a change": lambda value, e: about_change(value, float(e)),
    "above": lambda value, e: bool(value > float(e)),
    "below": lambda value, e: bool(value < float(e)),
    "at least": lambda value, e: bool(value >= float(e)),
    "at most": lambda value, e: bool(value <= float(e)),
    "between": lambda value, e: float(e.split()[0]) <= value <= float(e.split()[1]),
}
"""Name -> whether a value agrees with what is expected."""


def holds(rule: str, value: Any, expected: str) -> bool:
    """Judge a fact's value; of a tuple, every element has to pass."""
    values = value if isinstance(value, tuple) else (value,)
    return all(RULES[rule](each, expected) for each in values)
