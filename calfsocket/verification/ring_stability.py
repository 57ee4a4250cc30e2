r"""Which equilibria of the concentric limb are stable: the second variation, wave by wave.

About an axisymmetric equilibrium (`radial`) the displacements a(R) cos(n theta) along the
radius and b(R) sin(n theta) around it, with the pressure q(R) cos(n theta), change the potential by

    int [ H_rr a'^2 + 2 (H_rt + p) a' h + H_tt h^2 + A (s^2 + b'^2) + 2 (C - p) s b'
          + 2 q (l_t a' + l_r h) - q^2/K ] R dR,    h = (a + n b)/R,    s = -(n a + b)/R

per turn, with the Hessian H of the isochoric energy W in the stretches and the two shear moduli
A = (T + S)/2 and C = (S - T)/2, S = (W_r - W_t)/(l_r - l_t), T = (W_r + W_t)/(l_r + l_t). Friction
glues the socket to the skin. A wave n >= 1 comes twice, as cosine and as sine. Waves of different n
do not mix, so that the inertia of one small matrix each is the number of ways in which the ring is
unstable: independent of the finite elements' count.

The coefficients are those of Ogden, Non-linear Elastic Deformations (1984), section 6.1.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, eigvalsh

from calfsocket.materials.laws import Law
from calfsocket.verification.radial import RadialSolution, Ring, exact_ring

FloatArray = NDArray[np.float64]
Array = NDArray[Any]

DEGREE = 10
"""Polynomial degree of a and b in a ring; q has two less. 10, 14 and 18 count the same."""


def unstable_waves(
    solution: RadialSolution, waves: Sequence[int], degree: int = DEGREE
) -> dict[int, int]:
    """Count the unstable modes of each wave number, cosine and sine apart.

    Parameters
    ----------
    solution : RadialSolution
        The equilibrium.
    waves : sequence of int
        Wave numbers n >= 0.
    degree : int
        Polynomial degree in a ring.

    Returns
    -------
    dict
        Number of negative modes of each wave number that has any.
    """
    parts = [_RingForm(solution, ring, degree) for ring in solution.rings]
    counts = {wave: _negative(parts, wave) for wave in waves}
    return {wave: (2 if wave else 1) * count for wave, count in counts.items() if count}


def onset(
    laws: Mapping[str, Law], largest: float, waves: Sequence[int], digits: float = 1e-3
) -> tuple[float, int]:
    """Smallest overclosure of the limb that is unstable, mm, and its wave number.

    Parameters
    ----------
    laws : mapping of tissue to law
        A material set that is unstable at the largest overclosure.
    largest : float
        mm.
    waves : sequence of int
        Wave numbers.
    digits : float
        Absolute accuracy, mm.
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
    """What the second variation needs of one ring, at Gauss points."""

    def __init__(self, solution: RadialSolution, ring: Ring, degree: int) -> None:
        at, weight = np.polynomial.legendre.leggauss(degree + 4)
        half = 0.5 * (ring.outer - ring.inner)
        self.radius = ring.inner + half * (1.0 + at)
        self.weight = half * weight * self.radius
        # Legendre's differences vanish at both ends; the first two functions are 1 at one of them.
        legendre: Array = np.polynomial.legendre.legvander(at, degree)
        slopes: Array = np.stack(
            [
                np.polynomial.legendre.Legendre.basis(k).deriv()(at) if k else 0.0 * at
                for k in range(degree + 1)
            ],
            axis=1,
        )
        change: FloatArray = np.zeros((degree + 1, degree + 1))
        change[0, 0], change[1, 0], change[0, 1], change[1, 1] = 0.5, -0.5, 0.5, 0.5
        for k in range(2, degree + 1):
            change[k, k], change[k - 2, k] = 1.0, -1.0
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
        m, k = self.value.shape[1], self.q.shape[1]
        none, no_q = np.zeros_like(self.value), np.zeros_like(self.q)
        R = self.radius[:, None]
        stretch_r = np.hstack([self.slope, none, no_q])
        stretch_t = np.hstack([self.value / R, wave * self.value / R, no_q])
        shear_rt = np.hstack([-wave * self.value / R, -self.value / R, no_q])
        shear_tr = np.hstack([none, self.slope, no_q])
        q = np.hstack([np.zeros((len(self.q), 2 * m)), self.q])
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
        assert matrix.shape == (2 * m + k, 2 * m + k)
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
    blocks = [part.matrix(wave) for part in parts]
    m, k = parts[0].value.shape[1], parts[0].q.shape[1]
    loose = block_diag(*blocks)
    # The outer end of a ring is the inner end of the next; the innermost end is fixed.
    glue: Array = np.zeros((len(loose), len(loose)))
    column = 0
    ends: list[int] = []
    for ring in range(len(parts)):
        start = ring * (2 * m + k)
        for component in range(2):
            row = start + component * m
            if ring:
                glue[row, ends[component]] = 1.0
        ends = []
        for component in range(2):
            row = start + component * m
            ends.append(column)
            for inner in range(1, m):
                glue[row + inner, column] = 1.0
                column += 1
        for pressure in range(k):
            glue[start + 2 * m + pressure, column] = 1.0
            column += 1
    glue = glue[:, :column]
    matrix: Array = np.asarray(glue.T @ loose @ glue, dtype=float)
    # Tissues differ by 1e7; a congruence brings the rows to one size and keeps the inertia.
    for _ in range(20):
        size = np.sqrt(np.abs(matrix).max(axis=1))
        matrix /= np.outer(size, size)
    return int(np.sum(eigvalsh(matrix) < 0)) - k * len(parts)
