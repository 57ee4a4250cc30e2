"""Drucker's stability of an incompressible law.

Stable means that every small increment of logarithmic strain e that keeps the volume does positive
work on the increment of Kirchhoff stress it causes: the matrix

    D_ij = d(t_i - t_3)/d(e_j),   i, j = 1, 2,   e_3 = -e_1 - e_2,

is positive definite. D is the second derivative of the energy: laws whose Yeoh coefficients, or
Ogden moduli in Abaqus's form, are none of them negative have energies convex in the logarithmic
strains, and are stable at every strain. Without strain D has the eigenvalues 2 mu_0 and 6 mu_0, so
that laws, which have mu_0 > 0, are stable there.

Drucker 1959, doi:10.1115/1.4012025; the same test as Abaqus makes.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from calfsocket.materials.law import STEP, Law
from calfsocket.materials.modes import Array, Mode, log_stretches

SCANNED = (0.25, 4.0)
"""Stretches between which stability is checked."""

SOCKET_STRETCHES = (0.5, 2.0)
"""Stretches that a socket may impose on soft tissue, generously: the largest principal logarithmic
strain of the paper's Table 4 is 0.495, a stretch of 1.64."""

SMALL = (0.98, 1.02)
"""Stretches of small strain: what loses stability between them has no use as a tissue."""

MODES: tuple[Mode, ...] = ("uniaxial", "equibiaxial", "planar")
"""Deformations that are scanned; simple shear has the principal stretches of the planar one, which
is also that of a limb's section, in plane strain."""

POINTS = 400
"""Stretches that are checked on each side of 1, evenly spaced in their logarithm."""

ROUNDING = 1e-10
"""Share of the larger eigenvalue below which the smaller one is rounding, and counts as 0."""

REAL_STEP = 1e-5
"""Step in the logarithmic strain where a law takes no complex stretches: its square, the relative
error of the central difference, is `ROUNDING`."""


@dataclass(frozen=True)
class StableRange:
    """Stretches of a test between which a law is stable; None is the end of `SCANNED`."""

    mode: Mode
    low: float | None
    high: float | None

    def is_of(self, mode: Mode) -> bool:
        """Whether a test of this kind has these principal stretches."""
        return self.mode == ("planar" if mode == "shear" else mode)

    def holds(self, stretch: ArrayLike) -> bool:
        """Whether the law is stable at all of these stretches, which lie in `SCANNED`."""
        values = np.asarray(stretch)
        return bool(
            (self.low is None or np.all(values > self.low))
            and (self.high is None or np.all(values < self.high))
        )

    @property
    def words(self) -> str:
        """Where stability is lost, empty where it is not."""
        limits = [f"below stretch {self.low:.3g}"] if self.low else []
        limits += [f"above stretch {self.high:.3g}"] if self.high else []
        return f"{self.mode} tests {' and '.join(limits)}" if limits else ""


@lru_cache(maxsize=1000)
def stable_ranges(law: Law) -> tuple[StableRange, ...]:
    """Stable ranges of a law in the three tests."""
    return tuple(StableRange(mode, *(_loss(law, mode, end) for end in SCANNED)) for mode in MODES)


def instability(law: Law) -> str:
    """Say where a law loses stability, and what that means to a limb; empty where it does not."""
    ranges = [r for r in stable_ranges(law) if r.words]
    if not ranges:
        return ""
    where = _places(ranges)
    low, high = SOCKET_STRETCHES
    if all(r.holds(SOCKET_STRETCHES) for r in ranges):
        return (
            f"loses stability (Drucker) in {where}: beyond stretches of {low:g} to {high:g}, which "
            "no socket is expected to impose"
        )
    return (
        f"loses stability (Drucker) in {where}; sockets strain soft tissue to stretches between "
        f"{low:g} and {high:g}, so that load steps may fail there; check its parameters"
    )


def unstable_at_small_strain(law: Law) -> str:
    """Say where a law loses stability within `SMALL`; empty where it does not."""
    ranges = [r for r in stable_ranges(law) if not r.holds(SMALL)]
    if not ranges:
        return ""
    return (
        f"loses stability (Drucker) at small strain, in {_places(ranges)}: no limb can be solved "
        "with it"
    )


def _places(ranges: Sequence[StableRange]) -> str:
    return "; in ".join(each.words for each in ranges)


def tangents(law: Law, mode: Mode, stretch: ArrayLike) -> Array:
    """Eigenvalues of D, in the unit of the moduli, (n, 2); 2 mu_0 and 6 mu_0 at stretch 1.

    Not a number where the law has no energy.
    """
    e = log_stretches(mode, stretch)
    # Columns d(t)/d(e_1) and d(t)/d(e_2) at constant volume, (3, 2, n).
    slopes = np.stack([_slope(law, e, np.eye(3)[j] - np.eye(3)[2]) for j in range(2)], axis=1)
    (d11, d12), (d21, d22) = slopes[:2] - slopes[2]
    mean, off = (d11 + d22) / 2, (d12 + d21) / 2
    radius = np.hypot((d11 - d22) / 2, off)
    eigenvalues = np.stack([mean - radius, mean + radius], axis=1)
    with np.errstate(all="ignore"):
        # Beyond the limit of a law that locks, complex steps find a number all the same.
        return np.where(np.isfinite(law.energy(np.exp(e)))[:, None], eigenvalues, np.nan)


def _slope(law: Law, e: Array, direction: Array) -> Array:
    """Differentiate the Kirchhoff stress in a direction of logarithmic strains, (3, n)."""
    step = direction[:, None]
    with np.errstate(all="ignore"):
        try:
            return np.asarray(law.kirchhoff(np.exp(e + 1j * STEP * step)).imag / STEP)
        except TypeError:  # a custom law that takes real stretches only
            ahead, behind = (law.kirchhoff(np.exp(e + h * step)) for h in (REAL_STEP, -REAL_STEP))
            return np.asarray((ahead - behind) / (2 * REAL_STEP))


def _loss(law: Law, mode: Mode, end: float) -> float | None:
    """Stretch nearest to 1, towards `end`, at which stability is lost."""

    def margin(stretch: ArrayLike) -> Array:
        smaller, larger = tangents(law, mode, stretch).T
        return np.asarray(smaller + ROUNDING * larger)

    stretches = np.geomspace(1.0, end, POINTS)
    margins = margin(stretches)
    defined = np.logical_and.accumulate(np.isfinite(margins))
    unstable = np.flatnonzero(defined & (margins <= 0))
    if not unstable.size:
        return None
    first = int(unstable[0])
    bracket = stretches[first - 1 : first + 1]
    return float(brentq(lambda stretch: margin([stretch])[0], *bracket))
