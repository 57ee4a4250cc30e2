"""How a claim is checked: a fact found in the study, a rule, and what the paper has.

A row of ``data/checks.csv`` is a claim. ``fact`` is an expression of Jinja for the actual value, of
the public functions of `claims.given` and `claims.found` and of the evidence, ``e``; ``rule`` names
how the value is compared with ``expected``. ``ours`` and ``why`` are what a reader sees of the
fact, and of the reason where the claim does not hold: templates with the same names, ``value`` and,
where the fact is a mapping with that key, its other parts. ``paper`` is what the paper has.
``judges`` separates claims on results from those that only restate an input of the study or compare
the paper with itself; those hold by construction, and ``given`` says by which.
"""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from jinja2 import Environment, StrictUndefined

from calfsocket.paper.claims.tolerances import (
    ABOUT_COUNT,
    MMHG_KPA,
    SAME,
    SEVERAL_HUNDRED_PCT,
    THREE_FIGURES,
    about,
    about_change,
)
from calfsocket.report.words import change, number

RESULT, INPUT, PAPER = "result", "input", "paper"
"""What a claim may judge: results, an input of the study, or the paper's own numbers."""

Fact = dict[str, Any]
"""What a study says on a claim: "value", which a rule judges, and other parts of the texts."""

OF_A_VALUE: dict[str, Callable[[Any, str], bool]] = {
    "true": lambda value, _: bool(value),
    "none": lambda value, _: not value,
    "is": lambda value, expected: str(value) == expected,
}
OF_EACH_NUMBER: dict[str, Callable[[Any, str], bool]] = {
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
RULES = OF_A_VALUE | OF_EACH_NUMBER
"""Name -> whether a value, or each of its numbers, agrees with what is expected."""


def holds(rule: str, value: Any, expected: str) -> bool:
    """Judge a fact's value: a number, several, or something else by a rule for it as a whole."""
    if rule in OF_A_VALUE:
        return OF_A_VALUE[rule](value, expected)
    several = [*value.values()] if isinstance(value, Mapping) else value
    return all(OF_EACH_NUMBER[rule](each, expected) for each in np.ravel(several))


def worded(value: Any, spec: str = "") -> str:
    """Return a part of a fact as people read it.

    The spec ``n`` means three digits, ``c`` a change with its sign, ``r`` the range of several,
    others are Python's; what follows after a blank stands behind every value. Lists are joined by
    commas, mappings as "name value"; mappings of mappings or of lists by semicolons.
    """
    if isinstance(value, Mapping):
        nested = any(isinstance(each, Mapping | list) for each in value.values())
        return ("; " if nested else ", ").join(
            f"{name}{':' if nested else ''} {worded(each, spec)}" for name, each in value.items()
        )
    if isinstance(value, list | tuple) and not spec.startswith("r"):
        return ", ".join(worded(each, spec) for each in value) or "none"
    kind, blank, unit = spec.partition(" ")
    if kind == "r":
        ends = dict.fromkeys(number(float(end(value))) for end in (np.min, np.max))
        text = " to ".join(ends)
    else:
        known: dict[str, Callable[[float], str]] = {"n": number, "c": change}
        plain = known.get(kind)
        text = plain(value) if plain else format(value, kind)
    return f"{text}{blank}{unit}"


ENVIRONMENT = Environment(undefined=StrictUndefined, finalize=worded)
ENVIRONMENT.globals |= {"several_hundred": SEVERAL_HUNDRED_PCT, "mmhg": MMHG_KPA}
ENVIRONMENT.filters["f"] = worded
ENVIRONMENT.tests["about"] = about


def fact(expression: str, known: Mapping[str, Any]) -> Fact:
    """Evaluate the expression of a fact."""
    found = ENVIRONMENT.compile_expression(expression, undefined_to_none=False)(**known)
    return found if isinstance(found, dict) and "value" in found else {"value": found}


def in_words(template: str, known: Mapping[str, Any]) -> str:
    """Fill in a text."""
    return ENVIRONMENT.from_string(template).render(**known)
