"""A law as people write it in files: its name and its parameters, with units.

Used by material files, a law a file, and by study files, where laws stand in tables.
"""

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from calfsocket.io.errors import InputError
from calfsocket.io.quantity import Written
from calfsocket.io.schema import Strict
from calfsocket.io.units import COMPLIANCE, STRESS
from calfsocket.materials.laws import (
    Hencky,
    Law,
    Ogden,
    OgdenForm,
    Yeoh,
    d1_from_poisson,
    neo_hookean,
)

Stress = Annotated[float, Written(STRESS, "12 kPa")]
Compliance = Annotated[float, Written(COMPLIANCE, "1.67e-6 1/Pa")]


class Entry(Strict):
    """What all laws may have beside their parameters: where these come from, for people."""

    provenance: dict[str, Any] = Field(default_factory=dict)

    def to_law(self) -> Law:
        """Return the law with its parameters in MPa.

        Raises
        ------
        InputError
            When a parameter is outside its range.
        """
        raise NotImplementedError

    @model_validator(mode="after")
    def _is_a_law(self) -> "Entry":
        self.to_law()
        return self


class _NearlyIncompressible(Entry):
    d1: Compliance | None = None
    nu: float | None = None

    def d1_of(self, mu: float) -> float:
        """Return D1 as given, or by Poisson's ratio."""
        if self.d1 is not None and self.nu is None:
            return self.d1
        if self.nu is not None and self.d1 is None:
            return d1_from_poisson(mu, self.nu)
        raise InputError("give either d1 or nu")


class OgdenEntry(_NearlyIncompressible):
    """Ogden's law; as many mu as alpha, and d1 or nu."""

    law: Literal["ogden"]
    mu: tuple[Stress, ...]
    alpha: tuple[float, ...]
    form: OgdenForm = "abaqus"

    def to_law(self) -> Law:
        """Return it."""
        incompressible = Ogden(self.mu, self.alpha, 0.0, self.form)
        d1 = self.d1_of(incompressible.initial_shear_modulus)
        return Ogden(self.mu, self.alpha, d1, self.form)


class NeoHookeanEntry(_NearlyIncompressible):
    """Neo-Hookean law: shear modulus mu, and d1 or nu."""

    law: Literal["neo-hookean"]
    mu: Stress

    def to_law(self) -> Law:
        """Return it as Ogden's with alpha = 2."""
        return neo_hookean(self.mu, self.d1_of(self.mu))


class YeohEntry(Entry):
    """Yeoh's law, incompressible."""

    law: Literal["yeoh"]
    c10: Stress
    c20: Stress = 0.0
    c30: Stress = 0.0

    def to_law(self) -> Law:
        """Return it."""
        return Yeoh(self.c10, self.c20, self.c30)


class HenckyEntry(Entry):
    """Linear elasticity in the logarithmic strain: Young's modulus e and Poisson's ratio nu."""

    law: Literal["hencky"]
    e: Stress
    nu: float

    def to_law(self) -> Law:
        """Return it."""
        return Hencky(self.e, self.nu)


ENTRIES: dict[str, type[Entry]] = {
    "ogden": OgdenEntry,
    "neo-hookean": NeoHookeanEntry,
    "yeoh": YeohEntry,
    "hencky": HenckyEntry,
}


def entry_of(content: dict[str, Any]) -> type[Entry]:
    """Return the model of a law's table.

    Raises
    ------
    InputError
        When it names no law.
    """
    name = content.get("law")
    if not isinstance(name, str) or name not in ENTRIES:
        what = "is missing" if name is None else f"is {name!r}"
        raise InputError(f"law {what}; use one of {', '.join(ENTRIES)}")
    return ENTRIES[name]
