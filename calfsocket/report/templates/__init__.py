"""Templates of the page and its parts, and how they are filled."""

import re
from functools import cache
from importlib.resources import files
from typing import Any

from jinja2 import Environment, FunctionLoader, StrictUndefined
from markupsafe import Markup, escape

from calfsocket.report import names
from calfsocket.report.words import TOGETHER, change, changes, listed, number

PACKAGE = "calfsocket.report.templates"

WITHIN_LINES = (" \N{PLUS-MINUS SIGN} ", " %", " kPa")
"""What begins no line."""


def render(template: str, package: str = PACKAGE, **values: Any) -> Markup:
    """Fill a template of this package, or of another whose templates extend these.

    Values are escaped.
    """
    text = environment(package).get_template(template).render(**values)
    # two steps, which skip long lines: images are lines of half a million letters
    lines = "\n".join(line.rstrip() for line in text.split("\n"))
    return Markup(re.sub(r"\n\s*", "\n", lines))


def tidy(text: str) -> str:
    """Return a text on one line, without blanks before commas and full stops."""
    return re.sub(r"\s+(?=[,.;:)])", "", " ".join(text.split()))


def together(text: str) -> Markup:
    """Return an escaped text whose numbers, mesh errors and units do not part at a line's end."""
    for words in WITHIN_LINES:
        text = text.replace(words, words.replace(" ", TOGETHER))
    return Markup(text)


def commands(text: str) -> Markup:
    """Return a text in which what stands in backticks is set as code, options unbroken."""
    code = re.sub("`([^`]+)`", r"<code>\1</code>", escape(text))
    return Markup(re.sub(r"(?<![a-z-])(--[a-z-]+)", r'<span class="option">\1</span>', code))


def read(name: str, package: str = PACKAGE) -> str | None:
    """Read a file beside the templates; None where there is none."""
    path = files(package) / name
    return path.read_text(encoding="utf-8") if path.is_file() else None


@cache
def environment(package: str) -> Environment:
    """Return the environment of a package's templates, with the filters that all have."""
    made = Environment(
        loader=FunctionLoader(lambda name: read(name, package) or read(name)),
        autoescape=True,
        undefined=StrictUndefined,
    )
    made.filters |= {
        "number": number,
        "change": change,
        "changes": changes,
        "listed": listed,
        "set": names.material_set,
        "region": names.region,
        "tissue": names.TISSUES.get,
        "quantity": names.QUANTITIES.get,
        "commands": commands,
        "together": together,
        "upper_first": lambda text: text[:1].upper() + text[1:],
    }
    return made
