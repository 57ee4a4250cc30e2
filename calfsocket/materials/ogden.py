"""Ogden's law, and the neo-Hookean one as its special case."""

import math
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from calfsocket.forms import ogden
from calfsocket.io.schema import Strict
from calfsocket.materials.law import (
    Array,
    Compliance,
    Law,
    PoissonRatio,
    PositiveStress,
    Stress,
    deviatoric,
)

OgdenForm = Literal["abaqus", "as-printed"]


def _without_default(schema: dict[str, Any]) -> None:
    del schema["default"]


class Ogden(Law):
    r"""Ogden's law with one or more terms, compressible or not.

    .. math:: \psi = \sum_i f_i \Big( \sum_{k=1}^3 \bar l_k^{\alpha_i} - 3 \Big),
              \qquad U = \frac{1}{D_1} (J - 1)^2,

    with f_i = 2 mu_i / alpha_i^2 in Abaqus's form, whose initial shear modulus is
    mu_0 = sum_i mu_i, and f_i = mu_i / alpha_i in the form of the paper's equation (1), which has
    mu_0 = sum_i mu_i alpha_i / 2. The bulk modulus is K = 2 / D1.

    Ogden, Large deformation isotropic elasticity, 1972, doi:10.1098/rspa.1972.0026.

    Attributes
    ----------
    mu : tuple of float
        Moduli, MPa; mu_0 is positive.
    alpha : tuple of float
        Exponents, not 0, as many as moduli.
    d1 : float
        D1 = 2/K, 1/MPa, >= 0; 0 where incompressible.
    nu : float
        A way to give `d1`: Poisson's ratio at small strain, -1 < nu <= 0.5, from which
        D1 = 3 (1 - 2 nu) / (mu_0 (1 + nu)). Not kept.
    form : {"abaqus", "as-printed"}
        Factor of the terms.

    Raises
    ------
    InputError
        Where a parameter is outside its range, or not exactly one of `d1` and `nu` is given.

    Examples
    --------
    >>> Ogden(mu=(0.22,), alpha=(12.0,), d1=0.0912).initial_shear_modulus
    0.22
    >>> Ogden(mu=(0.22,), alpha=(12.0,), d1=0.0912, form="as-printed").initial_shear_modulus
    1.32
    >>> Ogden(mu=("220 kPa",), alpha=(12.0,), nu=0.5).bulk_modulus
    inf
    """

    law: Literal["ogden"] = "ogden"
    mu: tuple[Stress, ...]
    alpha: tuple[float, ...]
    # The default is never used: either it or nu is given.
    d1: Annotated[Compliance, Field(ge=0)] = Field(default=0.0, json_schema_extra=_without_default)
    nu: PoissonRatio | None = Field(default=None, exclude=True, repr=False)
    form: OgdenForm = "abaqus"

    energy_form = staticmethod(ogden.energy)

    @model_validator(mode="after")
    def _check(self) -> "Ogden":
        if not self.mu or len(self.mu) != len(self.alpha):
            raise ValueError(
                f"mu has length {len(self.mu)}, alpha {len(self.alpha)}; "
                "give one mu and one alpha for each term, and at least one term"
            )
        if 0 in self.alpha:
            raise ValueError("alpha is 0; it must not be 0")
        mu = self.initial_shear_modulus
        if not (mu > 0 and math.isfinite(mu)):
            raise ValueError(f"initial shear modulus is {mu:g} MPa; it must be greater than 0")
        if ("d1" in self.model_fields_set) == (self.nu is not None):
            raise ValueError("give either d1 or nu")
        if self.nu is not None:
            # Kept in one way, so that equal laws compare equal; frozen only for users.
            object.__setattr__(self, "d1", 3 * (1 - 2 * self.nu) / (mu * (1 + self.nu)))
            object.__setattr__(self, "nu", None)
            # as if `d1` had been given: the law may be checked again, inside another model
            self.model_fields_set.add("d1")
        return self

    def coefficients(self) -> tuple[float, ...]:
        """(mu_1, alpha_1, mu_2, alpha_2, ...), moduli of Abaqus's form in MPa."""
        pairs = zip(self._abaqus_mu, self.alpha, strict=True)
        return tuple(number for pair in pairs for number in pair)

    @property
    def _abaqus_mu(self) -> tuple[float, ...]:
        """Moduli that give this energy in Abaqus's form, MPa."""
        if self.form == "abaqus":
            return self.mu
        return tuple(mu * alpha / 2 for mu, alpha in zip(self.mu, self.alpha, strict=True))

    @property
    def initial_shear_modulus(self) -> float:
        """Sum of the moduli in Abaqus's form, MPa."""
        return math.fsum(self._abaqus_mu)

    @property
    def bulk_modulus(self) -> float:
        """K = 2/D1, MPa; infinite where incompressible."""
        return 2 / self.d1 if self.d1 else math.inf

    def energy(self, stretches: Array) -> Any:
        """sum_i f_i (sum_k lb_k^alpha_i - 3), MPa."""
        lb = deviatoric(stretches)
        return sum(f * (np.sum(lb**a, axis=0) - 3) for f, a in self._terms)

    def kirchhoff(self, stretches: Array) -> Array:
        """sum_i f_i alpha_i (lb_k^alpha_i - mean_k lb_k^alpha_i), MPa; (3, ...)."""
        lb = deviatoric(stretches)
        return np.asarray(sum(f * a * (lb**a - np.mean(lb**a, axis=0)) for f, a in self._terms))

    @property
    def _terms(self) -> list[tuple[float, float]]:
        """Factor f_i, MPa, and exponent of each term."""
        abaqus = self.form == "abaqus"
        pairs = zip(self.mu, self.alpha, strict=True)
        return [(2 * mu / a**2 if abaqus else mu / a, a) for mu, a in pairs]


def neo_hookean(mu: float, *, d1: float | None = None, nu: float | None = None) -> Ogden:
    """Neo-Hookean law, psi = mu/2 (I1b - 3): Ogden's of one term with alpha = 2.

    Parameters
    ----------
    mu : float
        Initial shear modulus, MPa, > 0.
    d1, nu : float
        One of the two, as of `Ogden`.

    Raises
    ------
    InputError
        As of `Ogden`.
    """
    given: dict[str, Any] = {
        key: value for key, value in (("d1", d1), ("nu", nu)) if value is not None
    }
    return Ogden(mu=(mu,), alpha=(2.0,), **given)


class _NeoHookean(Strict):
    """Neo-Hookean law: shear modulus mu, and d1 or nu; the same as Ogden's with alpha = 2."""

    law: Literal["neo-hookean"]
    mu: PositiveStress
    d1: Compliance | None = None
    nu: float | None = None


NeoHookean = Annotated[
    _NeoHookean,
    AfterValidator(lambda law: neo_hookean(law.mu, d1=law.d1, nu=law.nu)),
]
"""How files may write Ogden's law with alpha = 2."""
