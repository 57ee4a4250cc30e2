"""Chaos of a field, such as a pressure along a line: one for each of its principal modes."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from calfsocket.uncertainty.chaos import BAND, Basis, Chaos, drawn, fit
from calfsocket.uncertainty.inputs import Array

KEPT = 0.99
"""Share of the field's variance that its modes have together."""

MOST_MODES = 12


@dataclass(frozen=True, eq=False)
class Field:
    """A field whose modes have a chaos each.

    Attributes
    ----------
    mean : array
        Of the cases, (m,).
    modes : array
        Directions, orthonormal, (modes, m).
    chaos : tuple of Chaos
        Of the coordinates along them.
    residuals : array
        By how much each case differs from what is fitted without it, (n, m).
    q2 : float
        1 minus the mean square of the residuals over the variance, both summed over the field.
    """

    mean: Array
    modes: Array
    chaos: tuple[Chaos, ...]
    residuals: Array
    q2: float

    def __call__(self, values: Array) -> Array:
        """Return the field at values of the inputs, (n, m)."""
        fields = np.repeat(self.mean[None, :], len(values), axis=0)
        if self.chaos:
            fields += np.column_stack([each(values) for each in self.chaos]) @ self.modes
        return fields

    @cached_property
    def band(self) -> Array:
        """Lower end, median and upper end of the band of 95 % at each point, (3, m)."""
        shares = [BAND[0], 0.5, BAND[1]]
        if not self.chaos:
            return np.array([self.mean] * 3)
        basis = self.chaos[0].basis
        scores = np.column_stack([each.at_germs(basis.sample) for each in self.chaos])
        left = drawn(len(self.residuals))
        columns = [
            np.quantile(scores @ self.modes[:, i] + self.residuals[left, i], shares)
            for i in range(len(self.mean))
        ]
        return self.mean[None, :] + np.column_stack(columns)


def fit_field(basis: Basis, values: Array, fields: Array) -> Field:
    """Fit the fields (n, m) of cases at values of the inputs (n, d).

    Modes are those of the cases' covariance (the discrete Karhunen-Loeve expansion).
    """
    mean = fields.mean(axis=0)
    left, sizes, modes = np.linalg.svd(fields - mean, full_matrices=False)
    variance = sizes**2
    if not variance.sum() > 0:
        return Field(mean, modes[:0], (), np.zeros_like(fields), np.nan)
    enough = int(np.searchsorted(np.cumsum(variance) / variance.sum(), KEPT)) + 1
    kept = min(enough, MOST_MODES)
    scores = left[:, :kept] * sizes[:kept]
    chaos = tuple(fit(basis, values, column) for column in scores.T)
    fitted = np.column_stack([each.residuals for each in chaos]) @ modes[:kept]
    residuals = fields - mean - scores @ modes[:kept] + fitted
    q2 = 1 - float((residuals**2).sum() / variance.sum())
    return Field(mean, modes[:kept], chaos, residuals, q2)
