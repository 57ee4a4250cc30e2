"""Units of stress as people write them; inside, a stress is MPa.

Decimal arithmetic, so that a number keeps its digits on the way to a file and back.
"""

import re
from collections.abc import Mapping
from decimal import Decimal

STRESS: dict[str, Decimal] = {
    "Pa": Decimal("1e-6"),
    "kPa": Decimal("1e-3"),
    "MPa": Decimal(1),
    "GPa": Decimal("1e3"),
    "N/mm^2": Decimal(1),
    "N/cm^2": Decimal("1e-2"),
    "N/m^2": Decimal("1e-6"),
    "mmHg": Decimal("1.33322387415e-4"),
}
"""MPa in a unit of stress."""

COMPLIANCE: dict[str, Decimal] = {
    "1/Pa": Decimal("1e6"),
    "1/kPa": Decimal("1e3"),
    "1/MPa": Decimal(1),
}
"""1/MPa in a unit of D1."""

_QUANTITY = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(\S.*?)?\s*")


def parse(text: object, units: Mapping[str, Decimal]) -> float:
    """Value of a quantity such as ``"12 kPa"`` in the internal unit.

    Parameters
    ----------
    text
        A number and a unit.
    units
        Internal units in each allowed unit: `STRESS` or `COMPLIANCE`.

    Raises
    ------
    ValueError
        When the text is no number with one of these units.
    """
    found = _QUANTITY.fullmatch(text) if isinstance(text, str) else None
    if not found:
        raise ValueError(f'{text!r} is no number with a unit; write e.g. "12 {next(iter(units))}"')
    return float(Decimal(found[1]) * units[known(found[2] or "", units)])


def known(unit: str, units: Mapping[str, Decimal]) -> str:
    """Return the unit, when it is an allowed one.

    Raises
    ------
    ValueError
        When it is not; the message names those that are.
    """
    if unit not in units:
        raise ValueError(f"unit {unit!r} is unknown; use one of {', '.join(units)}")
    return unit


def text(value: float, unit: str, units: Mapping[str, Decimal]) -> str:
    """Write a value of the internal unit in another unit, to its last digit."""
    number = (Decimal(repr(float(value))) / units[unit]).normalize()
    digits = f"{number:f}" if -5 < number.adjusted() < 15 else str(number)
    return f"{digits} {unit}"
