"""Which equilibria of the concentric limb are stable: the second variation, wave by wave.

Ogden, Non-linear Elastic Deformations (1984), section 6.1.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.linalg import eigvalsh

from calfsocket.materials.laws import Law
from calfsocket.verification.radial import RadialSolution, Ring, exact_ring
from calfsocket.verification.sampling import Array, FloatArray

DEGREE = 10
"""Polynomial degree of a and b in a ring; q has two less. 10, 14 and 18 count the same."""


def unstable_waves(
    solution: RadialSolution, waves: Sequence[int], degree: int = DEGREE
) -> dict[int, int]:
    """Count the unstable modes of each wave number n >= 0 that has any, cosine and sine apart."""
    parts = [_RingForm(solution, ring, degree) for ring in solution.rings]
    counts = {wave: _negative(parts, wave) for wave in waves}
    return {wave: (2 if wave else 1) * count for wave, count in counts.items() if count}


def onset(
    laws: Mapping[str, Law], largest: float, waves: Sequence[int], digits: float = 1e-3
) -> tuple[float, int]:
    """Smallest overclosure of the limb that is unstable, mm, and its wave number.

    The laws are a material set that is unstable at the largest overclosure, mm; the result is
    accurate to `digits`, mm.
    """
    stable, unstable = 0.0, largest
    first = unstable_waves(exact_ring(laws, largest).solution, waves)
    while unstable - stable > digits:
        middle = 0.5 * (stable + unstable)
        found = unstable_waves(exact_ring(laws, middle).solution, waves)
        if found:
            unstable, first = middle, found
        else:
            stable = middle
    return unstable, min(first)


class _RingForm:
    """The second variation of the potential in one ring, at Gauss points.

    For displacements a cos(n theta) along the radius and b sin(n theta) around it, and a pressure
    q cos(n theta), per turn,

        int [ H_rr a'^2 + 2 (H_rt + p) a' h + H_tt h^2 + A (s^2 + b'^2) + 2 (C - p) s b'
              + 2 q (l_t a' + l_r h) - q^2/K ] R dR,    h = (a + n b)/R,    s = -(n a + b)/R.
    """

    def __init__(self, solution: RadialSolution, ring: Ring, degree: int) -> None:
        at, weight = np.polynomial.legendre.leggauss(degree + 4)
        half = 0.5 * (ring.outer - ring.inner)
        self.radius = ring.inner + half * (1.0 + at)
        self.weight = half * weight * self.radius
        # Legendre's differences vanish at both ends; the first two functions are 1 at one of them.
        legendre: Array = np.polynomial.legendre.legvander(at, degree)
        slopes = np.polynomial.legendre.legval(
            at, np.polynomial.legendre.legder(np.eye(degree + 1), axis=0)
        ).T
        change = np.eye(degree + 1) - np.eye(degree + 1, k=2)
        change[:2, :2] = [[0.5, 0.5], [-0.5, 0.5]]
        self.value, self.slope = legendre @ change, slopes @ change / half
        self.q = legendre[:, : degree - 1]
        profile = solution.profile(ring.name, self.radius)
        law = solution.laws[ring.name].law
        self.stretch = profile.stretch
        self.p = profile.stress.sum(axis=0) / 3.0
        self.H, self.A, self.C = _moduli(law, *profile.stretch)
        self.inverse_bulk = 1.0 / law.bulk_modulus

    def matrix(self, wave: int) -> FloatArray:
        """Matrix of the quadratic form over the unknowns a, b and q."""
        none, no_q = np.zeros_like(self.value), np.zeros_like(self.q)
        R = self.radius[:, None]
        stretch_r = np.hstack([self.slope, none, no_q])
        stretch_t = np.hstack([self.value / R, wave * self.value / R, no_q])
        shear_rt = np.hstack([-wave * self.value / R, -self.value / R, no_q])
        shear_tr = np.hstack([none, self.slope, no_q])
        q = np.hstack([none, none, self.q])
        volume = self.stretch[1][:, None] * stretch_r + self.stretch[0][:, None] * stretch_t

        def product(factor: Array, left: Array, right: Array) -> FloatArray:
            one = left.T @ ((self.weight * factor)[:, None] * right)
            return np.asarray(0.5 * (one + one.T))

        one = np.ones_like(self.p)
        matrix = product(self.H[0, 0], stretch_r, stretch_r)
        matrix += 2.0 * product(self.H[0, 1] + self.p, stretch_r, stretch_t)
        matrix += product(self.H[1, 1], stretch_t, stretch_t)
        matrix += product(self.A, shear_rt, shear_rt) + product(self.A, shear_tr, shear_tr)
        matrix += 2.0 * product(self.C - self.p, shear_rt, shear_tr)
        matrix += 2.0 * product(one, q, volume) - product(self.inverse_bulk * one, q, q)
        return matrix


def _moduli(law: Law, radial: FloatArray, hoop: FloatArray) -> tuple[Array, Array, Array]:
    """Hessian of the isochoric energy in the stretches, and the shear moduli A and C, MPa."""

    def first(radial: Array, hoop: Array) -> Array:
        stretches = np.array([radial, hoop, np.ones_like(radial)])
        return np.asarray((law.kirchhoff(stretches) / stretches)[:2])

    step = 1e-30j
    H = np.array(
        [
            first(radial + step, hoop + 0j).imag / step.imag,
            first(radial + 0j, hoop + step).imag / step.imag,
        ]
    )
    W = first(radial, hoop)
    difference = radial - hoop
    # Equal stretches: the limit; below 1e-7 the difference has lost the digits of the quotient.
    near = np.abs(difference) < 1e-7
    S = np.where(near, H[0, 0] - H[0, 1], (W[0] - W[1]) / np.where(near, 1.0, difference))
    T = (W[0] + W[1]) / (radial + hoop)
    return H, 0.5 * (T + S), 0.5 * (S - T)


def _negative(parts: Sequence[_RingForm], wave: int) -> int:
    """Negative eigenvalues of the assembled form that are not those of the pressure."""
    m, k = parts[0].value.shape[1], parts[0].q.shape[1]
    number = np.arange(len(parts) * (2 * m + k)).reshape(len(parts), -1)
    # The inner end of a ring is the outer end of the one before; the innermost end is fixed.
    number[1:, [0, m]] = number[:-1, [1, m + 1]]
    whole: FloatArray = np.zeros((number.size, number.size))
    for part, at in zip(parts, number, strict=True):
        whole[np.ix_(at, at)] += part.matrix(wave)
    free = np.setdiff1d(number, number[0, [0, m]])
    matrix = whole[np.ix_(free, free)]
    # Tissues differ by 1e7; a congruence brings the rows to one size and keeps the inertia.
    for _ in range(20):
        size = np.sqrt(np.abs(matrix).max(axis=1))
        matrix /= np.outer(size, size)
    return int(np.sum(eigvalsh(matrix) < 0)) - k * len(parts)
