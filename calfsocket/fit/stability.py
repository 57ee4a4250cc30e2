"""Drucker's stability of an incompressible law.

Stable means that every small increment of logarithmic strain e that keeps the volume does positive
work on the increment of Kirchhoff stress it causes: the matrix

    D_ij = d(t_i - t_3)/d(e_j),   i, j = 1, 2,   e_3 = -e_1 - e_2,

is positive definite. D is the second derivative of the energy: laws whose Yeoh coefficients, or
Ogden moduli in Abaqus's form, are none of them negative have energies convex in the logarithmic
strains, and are stable at every strain.

Drucker 1959, doi:10.1115/1.4012025; the same test as Abaqus makes.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from calfsocket.fit.families import STEP
from calfsocket.fit.modes import MODES, Array, Mode, log_stretches
from calfsocket.materials.law import Law

SCANNED = (0.25, 4.0)
"""Stretches between which stability is checked."""

POINTS = 400
"""Stretches that are checked on each side of 1, evenly spaced in their logarithm."""

ROUNDING = 1e-10
"""Share of the larger eigenvalue below which the smaller one is rounding, and counts as 0."""


@dataclass(frozen=True)
class StableRange:
    """Stretches of a test between which a law is stable; None is the end of `SCANNED`."""

    mode: Mode
    low: float | None
    high: float | None

    def holds(self, stretch: ArrayLike) -> bool:
        """Whether the law is stable at all of these stretches, which lie in `SCANNED`."""
        values = np.asarray(stretch)
        return bool(
            (self.low is None or np.all(values > self.low))
            and (self.high is None or np.all(values < self.high))
        )


def stable_ranges(law: Law) -> list[StableRange]:
    """Stable ranges of a law in the three tests."""
    return [StableRange(mode, *(_loss(law, mode, end) for end in SCANNED)) for mode in MODES]


def tangents(law: Law, mode: Mode, stretch: ArrayLike) -> Array:
    """Eigenvalues of D, in the unit of the moduli, (n, 2); 2 mu_0 and 6 mu_0 at stretch 1."""
    e = log_stretches(mode, stretch)
    tangent = np.empty((e.shape[1], 2, 2))
    for j in range(2):
        step = np.zeros((3, 1), dtype=complex)
        step[j], step[2] = 1j * STEP, -1j * STEP
        tau = law.kirchhoff(np.exp(e + step))
        tangent[:, :, j] = (tau[:2] - tau[2]).imag.T / STEP
    return np.asarray(np.linalg.eigvalsh(tangent))


def _loss(law: Law, mode: Mode, end: float) -> float | None:
    """Stretch nearest to 1, towards `end`, at which stability is lost."""

    def margin(stretch: ArrayLike) -> Array:
        smaller, larger = tangents(law, mode, stretch).T
        return np.asarray(smaller + ROUNDING * larger)

    stretches = np.geomspace(1.0, end, POINTS)
    unstable = np.flatnonzero(margin(stretches) <= 0)
    if not unstable.size:
        return None
    first = int(unstable[0])
    bracket = stretches[first - 1 : first + 1]
    return float(brentq(lambda stretch: margin([stretch])[0], *bracket))
