"""The least-squares problem: weighted residuals of all tests, and searches for their minimum."""

from collections.abc import Sequence

import numpy as np
from scipy.optimize import least_squares, nnls

from calfsocket.fit.data import Test
from calfsocket.fit.families import Family
from calfsocket.io.errors import InputError
from calfsocket.materials.modes import Array
from calfsocket.materials.ogden import ALPHA_MAX

TOLERANCE = 1e-10
"""Relative change of residual and parameters at which a search has converged."""

MAX_EVALUATIONS = 300
"""Evaluations after which a search counts as not converged."""


class Problem:
    """Weighted residuals of a family's engineering stress.

    Stresses `measured`, MPa, (n,), count by `weight`, 1/MPa, (n,): 1/sd where every test has a
    standard deviation (`known_sd`), and 1 over the largest stress where none has. Unless
    coefficients have `free_signs`, they stay at 0 or above: the law is stable at every strain
    (`stability`).

    Raises
    ------
    InputError
        When some tests have standard deviations and others do not, or there are too few data.
    """

    def __init__(self, family: Family, tests: Sequence[Test], free_signs: bool = False) -> None:
        self.family, self.tests, self.free_signs = family, tests, free_signs
        self.measured = np.concatenate([test.stress for test in tests])
        given = [test.sd for test in tests if test.sd is not None]
        if given and len(given) < len(tests):
            without = next(test.path for test in tests if test.sd is None)
            raise InputError(
                f"{without}: has no column stress_sd, but another file does; give it in all "
                "files or in none"
            )
        self.known_sd = bool(given)
        largest = np.full_like(self.measured, np.max(np.abs(self.measured)))
        self.weight = 1.0 / (np.concatenate(given) if given else largest)
        distinct = {(t.mode, s) for t in tests for s in t.stretch.tolist() if s != 1}
        n_parameters = len(family.names)
        if len(distinct) <= n_parameters:
            raise InputError(
                f"{self.files}: {len(distinct)} stretches other than 1, but {family.title} has "
                f"{n_parameters} parameters: give at least {n_parameters + 1} stretches"
            )

    @property
    def files(self) -> str:
        """Names of the files, for messages."""
        return ", ".join(str(test.path) for test in self.tests)

    def residual(self, parameters: Array) -> Array:
        """Weighted difference of computed and measured stress."""
        stress = [self.family.stress(parameters, t.mode, t.stretch) for t in self.tests]
        return np.asarray(self.weight * (np.concatenate(stress) - self.measured))

    def jacobian(self, parameters: Array) -> Array:
        """Differentiate the residual by the parameters."""
        gradient = [self.family.gradient(parameters, t.mode, t.stretch) for t in self.tests]
        return np.asarray(self.weight[:, None] * np.concatenate(gradient))

    def sum_of_squares(self, parameters: Array) -> float:
        """Sum of the squared residuals."""
        residual = self.residual(parameters)
        return float(residual @ residual)

    def best_coefficients(self, exponents: Array) -> Array:
        """Coefficients of least squares for given exponents."""
        n = len(self.family.coefficients)
        columns = self.jacobian(np.append(np.ones(n), exponents))[:, :n]  # linear: at any of them
        target = self.weight * self.measured
        # Columns of large exponents are larger by many orders.
        norm = np.linalg.norm(columns, axis=0)
        if self.free_signs:
            return np.asarray(np.linalg.lstsq(columns / norm, target, rcond=None)[0] / norm)
        return np.asarray(nnls(columns / norm, target)[0] / norm)

    def search(self, start: Sequence[float]) -> tuple[Array, bool]:
        """Search from given exponents; coefficients start where they fit these best.

        Returns the parameters, terms in order of their exponents, and whether the search ended
        before `MAX_EVALUATIONS`.
        """
        coefficients = self.best_coefficients(np.array(start))
        if not start:  # linear: there is nothing to search
            return coefficients, True
        n = len(coefficients)
        least = -np.inf if self.free_signs else 0.0
        found = least_squares(
            self.residual,
            np.concatenate([coefficients, start]),
            self.jacobian,
            bounds=([least] * n + [-ALPHA_MAX] * n, [np.inf] * n + [ALPHA_MAX] * n),
            x_scale="jac",
            ftol=TOLERANCE,
            xtol=TOLERANCE,
            gtol=TOLERANCE,
            max_nfev=MAX_EVALUATIONS,
        )
        exponents = np.sort(found.x[n:])
        return np.concatenate([self.best_coefficients(exponents), exponents]), found.status > 0
