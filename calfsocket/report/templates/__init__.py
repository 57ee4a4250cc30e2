"""Templates of the page and its parts, and how they are filled."""

from functools import cache
from importlib.resources import files
from typing import Any

from jinja2 import Environment, FunctionLoader, StrictUndefined
from markupsafe import Markup


def render(template: str, package: str = "calfsocket.report.templates", **values: Any) -> Markup:
    """Fill a template of a package; values are escaped."""
    return Markup(_environment(package).get_template(template).render(**values))


def read(name: str, package: str = "calfsocket.report.templates") -> str:
    """Read a file beside the templates."""
    return (files(package) / name).read_text(encoding="utf-8")


@cache
def _environment(package: str) -> Environment:
    return Environment(
        loader=FunctionLoader(lambda name: read(name, package)),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
