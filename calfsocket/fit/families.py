"""Families of laws that can be fitted: their parameters, their stress, and where fits start.

In every family the stress is linear in the coefficients (Yeoh's Cn0, Ogden's mu in Abaqus's form);
Ogden's exponents alpha are the only other parameters.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from calfsocket.io.errors import InputError
from calfsocket.materials.law import STEP
from calfsocket.materials.laws import Law, Ogden, Yeoh
from calfsocket.materials.modes import Array, Mode, engineering_stress

START_ALPHAS = (-54.0, -18.0, -6.0, -2.0, 2.0, 6.0, 18.0, 54.0)
"""Exponents from which fits start, in all combinations of as many as there are terms."""

MAX_TERMS = 3
LAWS = ("yeoh", "ogden", "neo-hookean")


@dataclass(frozen=True)
class Family:
    """Laws with the same parameters."""

    title: str  #: name for people
    kind: type[Law]
    fields: Callable[[Array, Array], dict[str, Any]]
    """(coefficients in MPa, exponents) -> parameters of the law by name."""
    coefficients: tuple[str, ...]  #: names of the coefficients, which are stresses
    exponents: tuple[str, ...] = ()  #: names of the exponents, one for each coefficient, or none
    starts: tuple[tuple[float, ...], ...] = ((),)  #: exponents to start from

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all parameters, coefficients first."""
        return self.coefficients + self.exponents

    def split(self, parameters: Array) -> tuple[Array, Array]:
        """Part parameters into coefficients and exponents."""
        n = len(self.coefficients)
        return parameters[:n], parameters[n:]

    def law(self, parameters: Array, nu: float) -> Law:
        """Make the law, with D1 by Poisson's ratio where it has one.

        Raises
        ------
        InputError
            When the parameters make no law.
        """
        fields = self.fields(*self.split(parameters))
        if "d1" in self.kind.model_fields:
            fields["nu"] = nu
        # No other notation: Poisson's ratio is in the settings of the fit.
        return self.kind(**fields).model_copy(update={"given": None})

    def stress(self, parameters: Array, mode: Mode, stretch: Array) -> Array:
        """Engineering stress, in the unit of the coefficients, (n,).

        Parameters need not make a stable law, and may be complex.
        """
        law = self.kind.model_construct(**self.fields(*self.split(parameters)))
        return engineering_stress(law, mode, stretch)

    def gradient(self, parameters: Array, mode: Mode, stretch: Array) -> Array:
        """Differentiate the engineering stress by all parameters, (n, n_parameters)."""
        moved = parameters + 1j * STEP * np.eye(len(parameters))
        return np.column_stack([self.stress(each, mode, stretch).imag / STEP for each in moved])


def family(law: str, terms: int) -> Family:
    """Choose a family by the law's name.

    Raises
    ------
    InputError
        For a number of terms that the law does not have.
    """
    most = 1 if law == "neo-hookean" else MAX_TERMS
    if not 1 <= terms <= most:
        raise InputError(
            f"--terms: is {terms}; for {law} it must be 1{f' to {most}' if most > 1 else ''}"
        )
    numbers = range(1, terms + 1)
    count = f"{terms} term{'s' if terms > 1 else ''}"
    match law:
        case "yeoh":
            names = ("C10", "C20", "C30")[:terms]
            return Family(f"Yeoh, {count}", Yeoh, _yeoh, names)
        case "ogden":
            return Family(
                f"Ogden, {count}",
                Ogden,
                _ogden,
                coefficients=tuple(f"mu{i}" for i in numbers),
                exponents=tuple(f"alpha{i}" for i in numbers),
                starts=tuple(combinations(START_ALPHAS, terms)),
            )
        case "neo-hookean":
            return Family("neo-Hookean", Ogden, _neo_hookean, ("mu",))
    raise InputError(f"--law: unknown law '{law}'; use one of {', '.join(LAWS)}")


def _yeoh(coefficients: Array, _: Array) -> dict[str, Any]:
    return dict(zip(("c10", "c20", "c30"), coefficients.tolist(), strict=False))


def _ogden(mu: Array, alpha: Array) -> dict[str, Any]:
    return {"mu": tuple(mu.tolist()), "alpha": tuple(alpha.tolist()), "form": "abaqus"}


def _neo_hookean(mu: Array, _: Array) -> dict[str, Any]:
    return {"mu": tuple(mu.tolist()), "alpha": (2.0,)}
