"""Units as people write them, converted by pint; inside, a stress is MPa and a length mm.

Decimal arithmetic, so that a number keeps its digits on the way to a file and back. Only units that
a laboratory uses are allowed: pint would take mPa, a slip of the shift key, for a billionth of MPa.
Powers may be written as in print, N/mm² or MPa⁻¹, or without a mark, N/mm2 or MPa-1.
"""

import re
from dataclasses import dataclass
from decimal import Decimal
from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pint

_QUANTITY = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*([^\s,].*?)?\s*")

_POWERS = (("²", "2"), ("⁻¹", "-1"), ("**", ""), ("^", ""))
"""Marks of powers, and what is left of them when spellings are compared."""


@cache
def _registry() -> "pint.UnitRegistry":
    import pint  # late: most files need none of it

    return pint.UnitRegistry(non_int_type=Decimal)


def _plain(unit: str) -> str:
    """Return a unit without marks of powers; "/kPa", behind a number, is 1/kPa."""
    for mark, left in _POWERS:
        unit = unit.replace(mark, left)
    return f"1{unit}" if unit.startswith("/") else unit


@dataclass(frozen=True)
class Dimension:
    """A kind of quantity."""

    internal: str  #: the unit inside the program
    allowed: tuple[str, ...]  #: units that may be written

    def factor(self, unit: str) -> Decimal:
        """Return how many internal units a unit is; a ValueError names those that are allowed."""
        known = self._allowed(unit)
        if known is None:
            raise ValueError(f"unit {unit!r} is unknown; use {', '.join(self.allowed)}")
        return _registry().Quantity(Decimal(1), known).to(self.internal).magnitude

    def has(self, unit: str) -> bool:
        """Whether a unit may be written."""
        return self._allowed(unit) is not None

    def _allowed(self, unit: str) -> str | None:
        return next((each for each in self.allowed if _plain(each) == _plain(unit)), None)

    def parse(self, text: object) -> float:
        """Value of a text such as ``"12 kPa"`` in the internal unit; else a ValueError."""
        found = _QUANTITY.fullmatch(text) if isinstance(text, str) else None
        if not found:
            example = f'"1.2 {self.allowed[0]}"'
            raise ValueError(f"{text!r} is not a number with a unit; write e.g. {example}")
        return float(Decimal(found[1]) * self.factor(found[2] or ""))

    def json_schema(self, example: str) -> dict[str, object]:
        """Describe such a text to an editor."""
        units = "|".join(re.escape(unit) for unit in self.allowed)
        return {
            "type": "string",
            "pattern": rf"^\s*[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\s*({units})\s*$",
            "description": f"a number with a unit: {', '.join(self.allowed)}",
            "examples": [example],
        }

    def text(self, value: float, unit: str) -> str:
        """Write a value of the internal unit in another unit, to its last digit."""
        number = (Decimal(repr(float(value))) / self.factor(unit)).normalize()
        digits = f"{number:f}" if -5 < number.adjusted() < 15 else str(number)
        return f"{digits} {unit}"


STRESS = Dimension(
    "MPa",
    ("Pa", "kPa", "MPa", "GPa", "N/mm^2", "N/cm^2", "N/m^2", "psi", "ksi", "mmHg"),
)
COMPLIANCE = Dimension(
    "1/MPa",
    tuple(f"1/{unit}" for unit in ("Pa", "kPa", "MPa", "psi", "ksi"))
    + tuple(f"{unit}^-1" for unit in ("Pa", "kPa", "MPa", "psi", "ksi"))
    + ("mm^2/N",),
)
LENGTH = Dimension("mm", ("mm", "cm", "m", "um", "inch"))
ANGLE = Dimension("deg", ("deg", "rad"))
SHARE = Dimension("dimensionless", ("%",))
FORCE = Dimension("N/mm", ("N/mm", "N/cm", "N/m", "kN/m"))
"""Of each length of limb."""
MOMENT = Dimension("N mm/mm", ("N mm/mm", "N*mm/mm", "N m/m", "N m/mm", "N cm/cm"))
"""Of each length of limb."""
DIMENSIONS = (STRESS, COMPLIANCE, LENGTH, ANGLE, SHARE, FORCE, MOMENT)


def like(text: object, value: float) -> str:
    """Write a value of the internal unit in the unit of a text, if it has one.

    >>> like("120 %", 1.0), like("2 kPa", 0.5), like(2, 0.5)
    ('100 %', '500 kPa', '0.5')
    """
    found = _QUANTITY.fullmatch(text) if isinstance(text, str) else None
    for dimension in DIMENSIONS:
        if found and dimension.has(found[2] or ""):
            return dimension.text(value, found[2])
    return f"{value:g}"


def unit_of(text: str) -> str:
    """Return the unit of a text such as ``"12 kPa"``; else a ValueError."""
    found = _QUANTITY.fullmatch(text)
    if not found or not found[2]:
        raise ValueError(f"{text!r} is not a number with a unit, e.g. '1.2 kPa'")
    if not any(dimension.has(found[2]) for dimension in DIMENSIONS):
        known = ", ".join(unit for dimension in DIMENSIONS for unit in dimension.allowed[:3])
        raise ValueError(f"unit {found[2]!r} is unknown; use one such as {known}")
    return found[2]


def in_unit(text: str, unit: str) -> float:
    """Return the number that a text such as ``"12 kPa"`` has in another unit.

    >>> in_unit("12 kPa", "MPa")
    0.012
    """
    own = unit_of(text)
    for dimension in DIMENSIONS:
        if unit and dimension.has(unit):
            if not dimension.has(own):
                break
            number = Decimal(_QUANTITY.fullmatch(text)[1])  # type: ignore[index]
            return float(number * dimension.factor(own) / dimension.factor(unit))
    raise ValueError(f"{text!r} has another dimension than the input, which is in {unit or '1'}")
