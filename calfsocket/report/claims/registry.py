"""Claims by id, and what a check of one finds."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

from calfsocket.report.claims.evidence import Evidence


@dataclass(frozen=True)
class Finding:
    """What a check found.

    Attributes
    ----------
    holds : bool
        Whether the claim holds in our model or runs.
    ours, paper : str
        The numbers, with units.
    why : str
        One line on the difference; shown where the claim does not hold.
    """

    holds: bool
    ours: str
    paper: str
    why: str = ""


CHECKS: dict[str, Callable[[Evidence], Finding]] = {}

Function = TypeVar("Function", bound=Callable[..., Finding])


def claim(identifier: str, **about: Any) -> Callable[[Function], Function]:
    """Register a function for a claim; `about` is passed on to it, for families of claims."""

    def register(function: Function) -> Function:
        if identifier in CHECKS:
            raise ValueError(f"claim {identifier} has two functions")
        CHECKS[identifier] = partial(function, **about)
        return function

    return register
