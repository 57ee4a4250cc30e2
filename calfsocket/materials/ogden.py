"""Ogden's law."""

import math
from collections.abc import Mapping, Sequence
from itertools import takewhile
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import ConfigDict, Field, ModelWrapValidatorHandler, model_validator

from calfsocket.forms import ogden
from calfsocket.materials.law import (
    Array,
    Compliance,
    Law,
    PoissonRatio,
    PositiveStress,
    Stress,
    as_written,
    deviatoric,
    in_files,
    readable,
)

OgdenForm = Literal["abaqus", "as-printed"]
"""Forms that the paper's laws may be taken in."""

Form = Literal["abaqus", "textbook", "febio", "as-printed"]

ALPHA_MAX = 100.0
"""Largest |alpha| up to which the forms are right to 1e-9 at l1/l2 = 2 (a test measures it)."""

_CONVERTED = ("textbook", "febio")

_OTHER_NAMES = {"c": "mu", "m": "alpha", "kappa": "k"}


def _without_default(schema: dict[str, Any]) -> None:
    del schema["default"]


def _with_other_names(schema: dict[str, Any], law: type) -> None:
    """Describe the law in files, with FEBio's constants in the place of moduli and exponents."""
    in_files(schema, law)
    keys = schema["properties"]
    keys |= {other: {**keys[name], "title": other} for other, name in _OTHER_NAMES.items()}
    schema["required"] = ["law"]
    schema["anyOf"] = [{"required": ["mu", "alpha"]}, {"required": ["c", "m"]}]


class Ogden(Law):
    r"""Ogden's law with one or more terms, compressible or not.

    .. math:: \psi = \sum_i f_i \Big( \sum_{k=1}^3 \bar l_k^{\alpha_i} - 3 \Big),
              \qquad U = \frac{1}{D_1} (J - 1)^2,

    with f_i = 2 mu_i / alpha_i^2 in Abaqus's form, whose initial shear modulus is
    mu_0 = sum_i mu_i; f_i = mu_i / alpha_i in Ogden's own, that of textbooks and of the paper's
    equation (1), with mu_0 = sum_i mu_i alpha_i / 2; and f_i = c_i / m_i^2 in FEBio's, with
    mu_0 = sum_i c_i / 2. The bulk modulus is K = 2 / D1.

    Ogden, Large deformation isotropic elasticity, 1972, doi:10.1098/rspa.1972.0026; FEBio user
    manual 3.4, section 4.1.2.9. FEBio's k is the same bulk modulus, but its default volumetric
    energy is K/2 ln^2 J: at a volume lost of 2 % its pressure is 3 % larger.

    Attributes
    ----------
    mu : tuple of float
        Moduli, MPa; mu_0 is positive. With `alpha`, or `c` and `m`.
    alpha : tuple of float
        Exponents, not 0, as many as moduli.
    c, m : tuple of float
        FEBio's constants, in the place of `mu` and `alpha`; the form is FEBio's.
    d1 : float
        D1 = 2/K, 1/MPa, >= 0; 0 where incompressible.
    k, kappa : float
        A way to give `d1`: the bulk modulus K, MPa, > 0. Not kept.
    nu : float
        A way to give `d1`: Poisson's ratio at small strain, -1 < nu <= 0.5, from which
        D1 = 3 (1 - 2 nu) / (mu_0 (1 + nu)). Not kept.
    form : {"abaqus", "textbook", "febio", "as-printed"}
        Factor of the terms. Moduli in the form "textbook" or "febio" become Abaqus's; "as-printed"
        is the textbook's, kept as it is.

    Raises
    ------
    InputError
        Where a parameter is outside its range, or not exactly one of `d1`, `k` and `nu` is given.

    Examples
    --------
    >>> Ogden(mu=(0.22,), alpha=(12.0,), d1=0.0912).initial_shear_modulus
    0.22
    >>> Ogden(mu=(0.22,), alpha=(12.0,), d1=0.0912, form="textbook").mu
    (1.32,)
    >>> Ogden(c=("440 kPa",), m=(12.0,), k="22 MPa").mu
    (0.22,)
    >>> Ogden(mu=("220 kPa",), alpha=(12.0,), nu=0.5).bulk_modulus
    inf
    """

    model_config = ConfigDict(json_schema_extra=_with_other_names)

    law: Literal["ogden"] = "ogden"
    mu: tuple[Stress, ...]
    alpha: tuple[float, ...]
    # The default is never used: it, k or nu is given.
    d1: Annotated[Compliance, Field(ge=0)] = Field(default=0.0, json_schema_extra=_without_default)
    k: PositiveStress | None = Field(default=None, exclude=True, repr=False)
    nu: PoissonRatio | None = Field(default=None, exclude=True, repr=False)
    form: Form = "abaqus"

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
            hint = f"; {self.doubt}" if self.doubt else ""
            raise ValueError(
                f"initial shear modulus is {readable(mu)}; it must be greater than 0{hint}"
            )
        one_of({"d1": "d1" in self.model_fields_set or None, "k": self.k, "nu": self.nu})
        return self

    # Below the check of what was written: validators of a model run in this order.
    @model_validator(mode="wrap")
    @classmethod
    def _in_one_way(cls, data: Any, handler: ModelWrapValidatorHandler["Ogden"]) -> "Ogden":
        """Keep the parameters in one way, so that equal laws compare equal, and what was given."""
        law = handler(_by_one_name(data))
        converted = law.form in _CONVERTED or law.k is not None or law.nu is not None
        if not (isinstance(data, dict) and converted):
            return law
        d1 = law.d1
        if law.k is not None:
            d1 = 2 / law.k
        elif law.nu is not None:
            d1 = 3 * (1 - 2 * law.nu) / (law.initial_shear_modulus * (1 + law.nu))
        used: dict[str, Any] = {"d1": d1, "k": None, "nu": None}
        if law.form in _CONVERTED:
            used |= {"mu": law._abaqus_mu, "form": "abaqus"}
        used["given"] = law.given or as_written({"law": law.law, **data})
        for name, value in used.items():
            object.__setattr__(law, name, value)  # frozen only for users
        # As if `d1` had been given: the law may be checked again, inside another model.
        law.model_fields_set.add("d1")
        return law

    @property
    def doubt(self) -> str:
        """What makes one doubt the form, where it was not given; empty where nothing does.

        Ogden's own form is stable where every mu has the sign of its alpha, so that negative ones
        come in pairs; in Abaqus's form a negative mu is the exception.
        """
        pairs = zip(self.mu, self.alpha, strict=True)
        if "form" in self.model_fields_set or not any(mu < 0 > alpha for mu, alpha in pairs):
            return ""
        forms: tuple[Form, ...] = ("abaqus", "textbook", "febio")
        abaqus, textbook, febio = (
            readable(math.fsum(_abaqus_mu(form, self.mu, self.alpha))) for form in forms
        )
        return (
            "a negative mu with a negative alpha is usual in the form mu/alpha; the initial shear "
            f'modulus is {textbook} with form = "textbook" (mu/alpha), {abaqus} with "abaqus" '
            f'(2 mu/alpha^2, taken unless given), {febio} with "febio" (c/m^2): write the form'
        )

    def coefficients(self) -> tuple[float, ...]:
        """(mu_1, alpha_1, mu_2, alpha_2, ...), moduli of Abaqus's form in MPa."""
        pairs = zip(self._abaqus_mu, self.alpha, strict=True)
        return tuple(number for pair in pairs for number in pair)

    @property
    def _abaqus_mu(self) -> tuple[float, ...]:
        return _abaqus_mu(self.form, self.mu, self.alpha)

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


def _abaqus_mu(form: Form, mu: Sequence[float], alpha: Sequence[float]) -> tuple[float, ...]:
    """Moduli that give the same energy in Abaqus's form, MPa."""
    if form == "abaqus":
        return tuple(mu)
    if form == "febio":
        return tuple(c / 2 for c in mu)
    return tuple(m * a / 2 for m, a in zip(mu, alpha, strict=True))


def one_of(bulk: Mapping[str, object]) -> None:
    """Refuse any number but one of the parameters that give the bulk modulus."""
    given = [key for key, value in bulk.items() if value is not None]
    if len(given) != 1:
        what = f"; {' and '.join(given)} are given" if given else ""
        raise ValueError(f"give one of d1, k and nu{what}")


def _by_one_name(data: Any) -> Any:
    """Return the keys of a law by the names of its fields.

    FEBio's constants are c and m. In the place of lists, terms may be numbered, mu1 and alpha1, or
    a single one given as it is.
    """
    if not isinstance(data, dict):
        return data
    named = dict(data)
    for base in {"mu", "alpha", "c", "m"} - named.keys():
        terms = [f"{base}{i}" for i in range(1, len(data) + 1)]
        if numbered := [named.pop(term) for term in takewhile(named.__contains__, terms)]:
            named[base] = numbered
    named |= {
        base: [named[base]]
        for base in ("mu", "alpha", "c", "m")
        if isinstance(named.get(base), str | int | float)
    }
    if "c" in named or "m" in named:
        if named.setdefault("form", "febio") != "febio" or not {"c", "m"} <= named.keys():
            raise ValueError('c and m go together, in FEBio\'s form only (form = "febio")')
    for other, name in _OTHER_NAMES.items():
        if other in named:
            if name in named:
                raise ValueError(f"{other} and {name} are the same; give one of them")
            named[name] = named.pop(other)
    return named
