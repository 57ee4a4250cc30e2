"""A family fitted to tests: parameters, how well the data determine them, and other minima."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from calfsocket.fit.data import Test
from calfsocket.fit.families import Family
from calfsocket.fit.problem import Problem
from calfsocket.io.errors import InputError
from calfsocket.materials.laws import Law
from calfsocket.materials.modes import Array, Mode
from calfsocket.materials.ogden import ALPHA_MAX

LEVEL = 0.95
"""Confidence of intervals, and of the statement that another minimum fits as well."""

SAME = 1e-3
"""Relative difference of parameters below which two searches found the same minimum."""


@dataclass(frozen=True)
class Minimum:
    """Where searches ended."""

    parameters: Array  #: coefficients in MPa, then exponents, (n,)
    sum_of_squares: float  #: of the weighted residuals
    searches: int  #: how many converged searches ended here


@dataclass(frozen=True)
class Fit:
    """A fitted law."""

    family: Family
    tests: tuple[Test, ...]
    law: Law  #: the best one, with D1 by Poisson's ratio where it has one
    minima: tuple[Minimum, ...]
    """The best one first, then those that fit as well: the data's noise (F-test, chi-squared where
    standard deviations are known) does not tell them from the best at `LEVEL`."""
    covariance: Array  #: of the parameters, MPa, (n, n); not a number where one is at its bound
    condition: float  #: condition number of the derivatives, columns scaled to 1
    degrees_of_freedom: int  #: data minus parameters that are not at their bounds
    chi_squared: float | None  #: squared residuals in standard deviations, where these are known
    r_squared: float  #: 1 - residual / total sum of squares, both weighted
    rms: float  #: root mean square of the residual engineering stresses, MPa
    searches: int  #: searches from different exponents
    unconverged: int  #: those that did not end

    @property
    def parameters(self) -> Array:
        """Coefficients in MPa, then exponents, (n,)."""
        return self.minima[0].parameters

    def stress(self, mode: Mode, stretch: Array) -> Array:
        """Engineering stress of the fitted law, MPa, (n,)."""
        return self.family.stress(self.parameters, mode, stretch)

    def residual(self, test: Test) -> Array:
        """Fitted minus measured engineering stress of a test, MPa, (n,)."""
        return self.stress(test.mode, test.stretch) - test.stress

    @property
    def at_bound(self) -> NDArray[np.bool_]:
        """Which parameters are at a bound and have no interval, (n,)."""
        return np.isnan(np.diag(self.covariance))

    @property
    def standard_errors(self) -> Array:
        """Square roots of the covariance's diagonal, (n,)."""
        return np.sqrt(np.diag(self.covariance))

    def half_widths(self, level: float = LEVEL) -> Array:
        """Half the width of each parameter's confidence interval (Student's t, or normal), (n,)."""
        return np.asarray(self._quantile(level) * self.standard_errors)

    def band(self, mode: Mode, stretch: Array) -> Array:
        """Half the width of the engineering stress's confidence interval at `LEVEL`, MPa, (n,)."""
        free = ~self.at_bound
        gradient = self.family.gradient(self.parameters, mode, stretch)[:, free]
        covariance = self.covariance[np.ix_(free, free)]
        variance = np.einsum("ni,ij,nj->n", gradient, covariance, gradient)
        return np.asarray(self._quantile(LEVEL) * np.sqrt(variance))

    def _quantile(self, level: float) -> float:
        freedom = self.degrees_of_freedom if self.chi_squared is None else np.inf
        return float(stats.t.ppf(0.5 + 0.5 * level, freedom))


def fit(family: Family, tests: Sequence[Test], nu: float = 0.495, free_signs: bool = False) -> Fit:
    """Fit a family to tests together, by weighted least squares on the engineering stress.

    The material is taken as incompressible; Poisson's ratio `nu` gives the law its D1, where it has
    one. Coefficients may be negative with `free_signs`.

    Raises
    ------
    InputError
        When there are too few data, no search converges, or the best parameters make no law.
    """
    problem = Problem(family, tests, free_signs)
    ends = [problem.search(start) for start in family.starts]
    converged = [parameters for parameters, done in ends if done]
    if not converged:
        raise InputError(
            f"{problem.files}: none of {len(ends)} searches for {family.title} converged; "
            "use fewer terms or another law"
        )
    minima = _distinct(problem, converged)
    best = minima[0]
    try:
        law = family.law(best.parameters, nu)
    except InputError as error:
        raise InputError(
            f"{problem.files}: the best fit of {family.title} is not stable ({error}); use other "
            f"terms or another law{', or omit --free-signs' if free_signs else ''}"
        ) from None
    free = _free(problem, best.parameters)
    n_free = int(np.count_nonzero(free))
    covariance, condition = _covariance(problem, best, free)
    mean = np.average(problem.measured, weights=problem.weight**2)
    total = np.sum((problem.weight * (problem.measured - mean)) ** 2)
    misfit = problem.residual(best.parameters) / problem.weight
    limit = _largest_as_good(problem, best.sum_of_squares, n_free)
    return Fit(
        family=family,
        tests=tuple(tests),
        law=law,
        minima=tuple(m for m in minima if m.sum_of_squares <= limit),
        covariance=covariance,
        condition=condition,
        degrees_of_freedom=len(problem.measured) - n_free,
        chi_squared=best.sum_of_squares if problem.known_sd else None,
        r_squared=1 - best.sum_of_squares / float(total),
        rms=float(np.sqrt(np.mean(misfit**2))),
        searches=len(ends),
        unconverged=len(ends) - len(converged),
    )


def _distinct(problem: Problem, ends: Sequence[Array]) -> list[Minimum]:
    """Different minima, the best first."""
    n = len(problem.family.coefficients)
    found = sorted(
        (Minimum(end, problem.sum_of_squares(end), 1) for end in ends),
        key=lambda minimum: minimum.sum_of_squares,
    )
    minima: list[Minimum] = []
    for end in found:
        for i, minimum in enumerate(minima):
            size = np.abs(minimum.parameters)
            size[:n] = np.max(size[:n])  # a small coefficient need not agree to many digits
            if np.all(np.abs(end.parameters - minimum.parameters) <= SAME * size):
                minima[i] = replace(minimum, searches=minimum.searches + 1)
                break
        else:
            minima.append(end)
    return minima


def _free(problem: Problem, parameters: Array) -> NDArray[np.bool_]:
    """Return which parameters are not at a bound; a term of zero has no exponent either."""
    coefficients, exponents = problem.family.split(parameters)
    there = np.ones(len(coefficients), dtype=bool) if problem.free_signs else coefficients > 0
    inside = np.abs(exponents) < ALPHA_MAX * (1 - SAME)
    return np.concatenate([there, inside & there[: len(exponents)]])


def _covariance(problem: Problem, best: Minimum, free: NDArray[np.bool_]) -> tuple[Array, float]:
    """Covariance of the parameters by the linearised residuals, and the condition of these."""
    jacobian = problem.jacobian(best.parameters)[:, free]
    norm = np.linalg.norm(jacobian, axis=0)
    _, singular, vt = np.linalg.svd(jacobian / norm, full_matrices=False)
    # Where terms coincide, an infinite variance would give no interval but "not a number".
    singular = np.maximum(singular, np.finfo(float).eps * singular[0])
    root = vt.T / singular / norm[:, None]
    rest = len(problem.measured) - int(np.count_nonzero(free))
    variance = 1.0 if problem.known_sd else best.sum_of_squares / rest
    covariance = np.full((len(free), len(free)), np.nan)
    covariance[np.ix_(free, free)] = variance * root @ root.T
    return covariance, float(singular[0] / singular[-1])


def _largest_as_good(problem: Problem, squares: float, n_free: int) -> float:
    """Largest sum of squares that the noise does not tell from the smallest."""
    if problem.known_sd:
        return squares + float(stats.chi2.ppf(LEVEL, n_free))
    rest = len(problem.measured) - n_free
    return squares * (1 + n_free / rest * float(stats.f.ppf(LEVEL, n_free, rest)))
