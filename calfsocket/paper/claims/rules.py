"""How a claim is checked: a fact found in the study, a rule, and what the paper has.

A row of ``data/checks.csv`` is a claim: ``fact`` names a function of `claims.given` or
`claims.found`, all of whose public functions are facts; it finds the actual value, for what ``of``
says; ``rule`` names how the value is compared with ``expected``. ``ours`` and ``why``
are what a reader sees of the fact, and of the reason where the claim does not hold, with the parts
of the fact in braces (`Words`); ``paper`` is what the paper has. ``judges`` separates claims on
results from those that only restate an input of the study or compare the paper with itself; those
hold by construction, and ``given`` says by which.
"""

import string
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from calfsocket.paper.claims.tolerances import (
    ABOUT_COUNT,
    SAME,
    THREE_FIGURES,
    about,
    about_change,
)
from calfsocket.report.words import change, number

RESULT, INPUT, PAPER = "result", "input", "paper"
"""What a claim may judge: results, an input of the study, or the paper's own numbers."""

Fact = dict[str, Any]
"""What a study says on a claim: "value", which a rule judges, and other parts of the texts."""

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


class Words(string.Formatter):
    """Formats the parts of a fact as people read them.

    ``{part:n}`` is a number of three digits, ``{part:c}`` a change with its sign, ``{part:r}`` the
    range of several; what follows after a blank stands behind every value. Lists are joined by
    commas, mappings as "name value"; mappings of mappings or of lists by semicolons.
    """

    def format_field(self, value: Any, spec: str) -> str:
        """Format one part."""
        if isinstance(value, Mapping):
            nested = any(isinstance(each, Mapping | list) for each in value.values())
            return ("; " if nested else ", ").join(
                f"{name}{':' if nested else ''} {self.format_field(each, spec)}"
                for name, each in value.items()
            )
        if isinstance(value, list | tuple) and not spec.startswith("r"):
            return ", ".join(self.format_field(each, spec) for each in value) or "none"
        kind, blank, unit = spec.partition(" ")
        if kind == "r":
            ends = dict.fromkeys(number(float(end(value))) for end in (np.min, np.max))
            text = " to ".join(ends)
        else:
            plain = {"n": number, "c": change}.get(kind)
            text = plain(value) if plain else format(value, kind)
        return f"{text}{blank}{unit}"


def in_words(template: str, found: Fact) -> str:
    """Return a text with the parts of a fact filled in."""
    return Words().vformat(template, (), found)
