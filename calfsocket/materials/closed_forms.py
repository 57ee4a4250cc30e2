"""The laws in principal stretches, by numpy: independent of UFL and of the forms' invariants.

Stretches are (l1, l2, l3), each a number or an array of them, and J = l1 l2 l3. Complex stretches
are allowed, for derivatives by a complex step.

Ogden 1972, doi:10.1098/rspa.1972.0026; Yeoh 1993, doi:10.5254/1.3538343; Anand 1979 (Hencky),
doi:10.1115/1.3424532.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from calfsocket.materials.laws import Hencky, Law, Ogden, Yeoh

Array = NDArray[Any]


def closed_energy(law: Law, stretches: Array) -> Any:
    r"""Isochoric energy per reference volume, MPa, with lb_k = J^(-1/3) l_k.

    Ogden: sum_i f_i (sum_k lb_k^alpha_i - 3), f = 2 mu/alpha^2 ("abaqus") or mu/alpha;
    Yeoh: sum_n Cn0 (sum_k lb_k^2 - 3)^n; Hencky: E / (2 (1 + nu)) sum_k ln^2 lb_k.

    Parameters
    ----------
    law
        With its parameters.
    stretches : (3, ...)
        Principal stretches.
    """
    lb = _deviatoric(stretches)
    match law:
        case Ogden():
            factor = {"abaqus": lambda m, a: 2 * m / a**2, "as-printed": lambda m, a: m / a}
            return sum(
                factor[law.form](m, a) * (np.sum(lb**a, axis=0) - 3)
                for m, a in zip(law.mu, law.alpha, strict=True)
            )
        case Yeoh():
            i = np.sum(lb**2, axis=0) - 3
            return law.c10 * i + law.c20 * i**2 + law.c30 * i**3
        case Hencky():
            return law.e / (2 * (1 + law.nu)) * np.sum(np.log(lb) ** 2, axis=0)


def closed_kirchhoff(law: Law, stretches: Array) -> Array:
    """Isochoric Kirchhoff stress, principal: l_k d(energy)/d(l_k), MPa; (3, ...)."""
    lb = _deviatoric(stretches)
    tau = np.zeros_like(lb)
    match law:
        case Ogden():
            factor = {"abaqus": lambda m, a: 2 * m / a, "as-printed": lambda m, a: m}
            for m, a in zip(law.mu, law.alpha, strict=True):
                tau += factor[law.form](m, a) * (lb**a - np.mean(lb**a, axis=0))
        case Yeoh():
            i = np.sum(lb**2, axis=0) - 3
            slope = law.c10 + 2 * law.c20 * i + 3 * law.c30 * i**2
            tau += 2 * slope * (lb**2 - np.mean(lb**2, axis=0))
        case Hencky():
            tau += law.e / (1 + law.nu) * np.log(lb)
    return tau


def closed_cauchy(law: Law, F: Array, p: float) -> Array:
    """Cauchy stress s11, s22, s33, s12, MPa, from the spectral form of b = F F^T; (4,).

    Parameters
    ----------
    law
        With its parameters.
    F : (2, 2)
        In-plane deformation gradient.
    p : float
        Pressure, MPa, > 0 in tension.
    """
    squared, n = np.linalg.eigh(F @ F.T)
    stretches = np.sqrt(np.append(squared, 1.0))
    tau = closed_kirchhoff(law, stretches)
    sigma = n @ np.diag(tau[:2]) @ n.T / np.prod(stretches) + p * np.eye(2)
    return np.array([sigma[0, 0], sigma[1, 1], tau[2] / np.prod(stretches) + p, sigma[0, 1]])


def _deviatoric(stretches: Array) -> Array:
    """J^(-1/3) l_k."""
    return np.asarray(stretches / np.prod(stretches, axis=0) ** (1 / 3))
