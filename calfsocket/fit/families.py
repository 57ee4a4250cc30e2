"""Families of laws that can be fitted: their parameters, their stress, and where fits start.

In every family the stress is linear in the coefficients (Yeoh's Cn0, Ogden's mu in Abaqus's form);
Ogden's exponents alpha are the only other parameters.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from calfsocket.fit.modes import Array, Mode, ogden_columns, ogden_slopes, yeoh_columns
from calfsocket.io.errors import InputError
from calfsocket.materials.laws import Law, Ogden, Yeoh, d1_from_poisson, neo_hookean

ALPHA_MAX = 100.0
"""Largest |alpha|: there the study's forms are right to 1e-9 up to l1/l2 = 2 (`forms.accuracy`)."""

START_ALPHAS = (-54.0, -18.0, -6.0, -2.0, 2.0, 6.0, 18.0, 54.0)
"""Exponents from which fits start, in all combinations of as many as there are terms."""

MAX_TERMS = 3
LAWS = ("yeoh", "ogden", "neo-hookean")


@dataclass(frozen=True)
class Family:
    """Laws with the same parameters.

    Attributes
    ----------
    title : str
        Name for people.
    coefficients : tuple of str
        Names of the coefficients, which are stresses.
    exponents : tuple of str
        Names of the exponents, one for each coefficient, or none.
    starts : tuple
        Exponents to start from.
    columns : callable
        (exponents, mode, stretch) -> engineering stress differentiated by the coefficients, (n, k).
    slopes : callable
        (exponents, mode, stretch) -> each column differentiated by its exponent, (n, k) or (n, 0).
    law : callable
        (coefficients in MPa, exponents, nu) -> law; nu gives D1 where the law has one.
    """

    title: str
    coefficients: tuple[str, ...]
    exponents: tuple[str, ...]
    starts: tuple[tuple[float, ...], ...]
    columns: Callable[[Array, Mode, Array], Array]
    slopes: Callable[[Array, Mode, Array], Array]
    law: Callable[[Array, Array, float], Law]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all parameters, coefficients first."""
        return self.coefficients + self.exponents

    def split(self, parameters: Array) -> tuple[Array, Array]:
        """Part parameters into coefficients and exponents."""
        n = len(self.coefficients)
        return parameters[:n], parameters[n:]

    def stress(self, parameters: Array, mode: Mode, stretch: Array) -> Array:
        """Engineering stress, in the unit of the coefficients, (n,)."""
        coefficients, exponents = self.split(parameters)
        return np.asarray(self.columns(exponents, mode, stretch) @ coefficients)

    def gradient(self, parameters: Array, mode: Mode, stretch: Array) -> Array:
        """Differentiate the engineering stress by all parameters, (n, n_parameters)."""
        coefficients, exponents = self.split(parameters)
        slopes = self.slopes(exponents, mode, stretch)
        columns = self.columns(exponents, mode, stretch)
        return np.hstack([columns, slopes * coefficients[: slopes.shape[1]]])


def family(law: str, terms: int) -> Family:
    """Choose a family by the law's name.

    Raises
    ------
    InputError
        For a number of terms that the law does not have.
    """
    most = 1 if law == "neo-hookean" else MAX_TERMS
    if not 1 <= terms <= most:
        raise InputError(f"--terms {terms}: {law} has 1{f' to {most}' if most > 1 else ''}")
    match law:
        case "yeoh":
            return _yeoh(terms)
        case "ogden":
            return _ogden(terms)
        case "neo-hookean":
            return _neo_hookean()
    raise InputError(f"--law {law}: use one of {', '.join(LAWS)}")


def _yeoh(terms: int) -> Family:
    return Family(
        title=f"Yeoh, {_count(terms)}",
        coefficients=("C10", "C20", "C30")[:terms],
        exponents=(),
        starts=((),),
        columns=lambda _, mode, stretch: yeoh_columns(terms, mode, stretch),
        slopes=_no_slopes,
        law=lambda c, _, nu: Yeoh(*map(float, c)),
    )


def _ogden(terms: int) -> Family:
    numbers = range(1, terms + 1)

    def law(mu: Array, alpha: Array, nu: float) -> Law:
        incompressible = Ogden(tuple(map(float, mu)), tuple(map(float, alpha)), d1=0.0)
        d1 = d1_from_poisson(incompressible.initial_shear_modulus, nu)
        return Ogden(incompressible.mu, incompressible.alpha, d1)

    return Family(
        title=f"Ogden, {_count(terms)}",
        coefficients=tuple(f"mu{i}" for i in numbers),
        exponents=tuple(f"alpha{i}" for i in numbers),
        starts=tuple(combinations(START_ALPHAS, terms)),
        columns=ogden_columns,
        slopes=ogden_slopes,
        law=law,
    )


def _neo_hookean() -> Family:
    return Family(
        title="neo-Hookean",
        coefficients=("mu",),
        exponents=(),
        starts=((),),
        columns=lambda _, mode, stretch: ogden_columns([2.0], mode, stretch),
        slopes=_no_slopes,
        law=lambda mu, _, nu: neo_hookean(float(mu[0]), d1_from_poisson(float(mu[0]), nu)),
    )


def _no_slopes(_: Array, mode: Mode, stretch: Array) -> Array:
    return np.empty((len(stretch), 0))


def _count(terms: int) -> str:
    return f"{terms} term{'s' if terms > 1 else ''}"
