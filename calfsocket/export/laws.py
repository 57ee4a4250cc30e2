"""Laws in the words of other programs, and what they have no words for.

Ogden's and Yeoh's laws are the same in all of them, the moduli of Ogden's in Abaqus's form,
2 mu/alpha^2, and FEBio's with c = 2 mu; so is the volumetric energy K/2 (J - 1)^2, with D1 = 2/K,
which FEBio has as its `pressure_model` "Abaqus". What has to be said is in `remarks`:

- Hencky's law of a soft material becomes Ogden's with two terms, whose exponents are
  +-`EXPONENT` and whose moduli are mu/2: in their limit that is the law, and at a stretch of 2 it
  differs by 1e-5. That of a stiff one, whose strain is small, is the linear elasticity of each
  program.
- Incompressible materials are compressible in programs without a pressure of its own, by
  `BULK_RATIO`.
"""

import math
from dataclasses import dataclass

from calfsocket.io.errors import InputError
from calfsocket.materials.hencky import Hencky
from calfsocket.materials.law import Law, readable
from calfsocket.materials.ogden import Ogden
from calfsocket.materials.yeoh import Yeoh

EXPONENT = 0.01
"""Of the terms that Hencky's law becomes: smaller ones would lose digits."""

STIFF = 1.0
"""Shear modulus from which a material is taken for stiff, MPa: bone, plastic; tissue and liners
have less, and large strains."""

BULK_RATIO = 100.0
"""Ratio K/mu, nu = 0.495, of what stands for an incompressible material."""


@dataclass(frozen=True)
class Series:
    """Ogden's law in Abaqus's form: moduli (MPa) and exponents."""

    mu: tuple[float, ...]
    alpha: tuple[float, ...]


@dataclass(frozen=True)
class Invariant:
    """Yeoh's law: coefficients, MPa."""

    c: tuple[float, float, float]


@dataclass(frozen=True)
class Linear:
    """Linear elasticity: Young's modulus (MPa) and Poisson's ratio."""

    e: float
    nu: float


Form = Series | Invariant | Linear


@dataclass(frozen=True)
class Converted:
    """A law as the other programs have it.

    Attributes
    ----------
    form : Form
        The isochoric part, or all of a linear one.
    bulk : float
        Bulk modulus, MPa; infinite where incompressible.
    """

    form: Form
    bulk: float


def converted(name: str, law: Law, mixed: bool) -> tuple[Converted, list[str]]:
    """Return a law for other programs, and what differs.

    Parameters
    ----------
    name : str
        Of the material, for the remarks.
    law : Law
        The law.
    mixed : bool
        Whether the program has elements with a pressure of their own, which take incompressible
        materials.

    Raises
    ------
    InputError
        For a law of a script's own.
    """
    bulk, remarks = law.bulk_modulus, []
    if not mixed and math.isinf(bulk):
        bulk = BULK_RATIO * law.initial_shear_modulus
        remarks.append(
            f"{name}: incompressible in calfsocket; here its bulk modulus is {BULK_RATIO:g} times"
            f" its shear modulus, {readable(bulk)}"
        )
    # A script's own law may extend one of these, with another energy.
    own = type(law) not in (Ogden, Yeoh, Hencky)
    match law:
        case _ if own:
            raise InputError(
                f"{name}: the law {law.name} is one of a script's own, and other programs have no "
                "such law; use ogden, yeoh or hencky"
            )
        case Ogden():
            numbers = law.coefficients()
            return Converted(Series(numbers[::2], numbers[1::2]), bulk), remarks
        case Yeoh():
            return Converted(Invariant((law.c10, law.c20, law.c30)), bulk), remarks
        case Hencky() if law.initial_shear_modulus >= STIFF:
            nu = law.nu if mixed or law.nu < 0.5 else _poisson(BULK_RATIO)
            return Converted(Linear(law.e, nu), bulk), remarks
        case Hencky():
            half = 0.5 * law.initial_shear_modulus
            remarks.append(
                f"{name}: Hencky's law is Ogden's with the exponents {EXPONENT:g} and -{EXPONENT:g}"
                f" here, each with half of the shear modulus of {readable(2 * half)}: the same to"
                " 1e-5 at a stretch of 2"
            )
            return Converted(Series((half, half), (EXPONENT, -EXPONENT)), bulk), remarks
        case _:
            raise AssertionError(law)


def _poisson(ratio: float) -> float:
    """Poisson's ratio of a ratio K/mu."""
    return (3 * ratio - 2) / (2 * (3 * ratio + 1))
