r"""What each input explains of an output's variance.

Of an input :math:`x_i` and all others, :math:`x_{-i}`,

.. math:: S_i = \frac{\operatorname{Var} E[y \mid x_i]}{\operatorname{Var} y}, \qquad
    T_i = 1 - \frac{\operatorname{Var} E[y \mid x_{-i}]}{\operatorname{Var} y}.

Where inputs are independent these are Sobol's first-order and total indices, exact sums of the
chaos's squared coefficients. An input that is correlated with others has the same two numbers with
another meaning (Mara and Tarantola 2012, doi:10.1016/j.ress.2011.08.008): :math:`S_i` is what it
explains alone, with what it shares with those, and :math:`T_i` what only it explains, which may be
less. They are integrals over conditional normal distributions then, by a low-discrepancy sequence.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from calfsocket.uncertainty.chaos import Basis, Chaos
from calfsocket.uncertainty.inputs import Array, uniform_design

PAIRS = 2**13
"""Pairs of points for a share of a correlated input: some 1 % of its value."""


@dataclass(frozen=True)
class Shares:
    """Shares of an output's variance, (inputs,): see the module."""

    first: Array
    total: Array

    @property
    def order(self) -> list[int]:
        """Inputs from the one that matters most: by the mean of both shares.

        Of two inputs, correlated or not, that mean is Shapley's value.
        """
        return [int(i) for i in np.argsort(-(self.first + self.total), kind="stable")]


class Explained:
    """Shares of outputs whose chaos has one basis."""

    def __init__(self, basis: Basis) -> None:
        self.basis = basis
        d = len(basis.joint.names)
        self._pairs = {
            kept: self._pair(kept)
            for i in np.flatnonzero(basis.joint.dependent)
            for kept in ((int(i),), tuple(j for j in range(d) if j != i))
        }

    def __call__(self, chaos: Chaos) -> Shares:
        """Return the shares of an output; NaN where it does not vary."""
        return self.of([chaos])

    def of(self, modes: Iterable[Chaos]) -> Shares:
        """Return the shares of a field: those of its uncorrelated modes, by their variances."""
        modes = list(modes)
        d = len(self.basis.joint.names)
        variance = sum(each.variance for each in modes)
        if not variance:
            return Shares(np.full(d, np.nan), np.full(d, np.nan))
        parts = np.array([self._parts(each) for each in modes]).sum(axis=0)
        return Shares(*(parts / variance))

    def _parts(self, chaos: Chaos) -> Array:
        """Return the two parts of the variance of each input, (2, d)."""
        squares, touched = chaos.coefficients**2, chaos.terms > 0
        alone = touched.sum(axis=1) == 1
        first = squares[alone] @ touched[alone]
        total = squares @ touched
        every = range(touched.shape[1])
        for i in np.flatnonzero(self.basis.joint.dependent):
            first[i] = self._common(chaos, (int(i),))
            total[i] = chaos.variance - self._common(chaos, tuple(j for j in every if j != i))
        return np.array([first, total])

    def _common(self, chaos: Chaos, kept: tuple[int, ...]) -> float:
        """Return the variance that some inputs explain: by how points correlate that share them.

        The others are drawn anew for the second point, as the shared ones let them be.
        """
        one, other = (chaos.at_germs(germs) for germs in self._pairs[kept])
        return chaos.variance * float(np.clip(np.corrcoef(one, other)[0, 1], 0.0, 1.0))

    def _pair(self, kept: tuple[int, ...]) -> tuple[Array, Array]:
        from scipy.stats import norm

        joint = self.basis.joint
        d = len(joint.names)
        order = [*kept, *(i for i in range(d) if i not in kept)]
        lower = np.linalg.cholesky(joint.correlation[np.ix_(order, order)])
        drawn = norm.ppf(uniform_design("sobol", PAIRS, 2 * d, seed=1))
        first, second = drawn[:, :d], drawn[:, d:].copy()
        second[:, : len(kept)] = first[:, : len(kept)]
        back = np.argsort(order)
        points = []
        for numbers in (first, second):
            normal = (numbers @ lower.T)[:, back]
            points.append(self.basis.germs(joint.of_normal(normal, norm.cdf(normal))))
        return points[0], points[1]
