"""The laws in principal stretches, by numpy: independent of UFL and of the forms' invariants.

Stretches are (l1, l2, l3), and J = l1 l2 l3.
"""

import numpy as np

from calfsocket.laws import Hencky, Law, Ogden, Yeoh


def closed_energy(law: Law, stretches: np.ndarray) -> float:
    lb = stretches / np.prod(stretches) ** (1 / 3)
    match law:
        case Ogden():
            factor = {"abaqus": lambda m, a: 2 * m / a**2, "as-printed": lambda m, a: m / a}
            return sum(
                factor[law.form](m, a) * (np.sum(lb**a) - 3)
                for m, a in zip(law.mu, law.alpha, strict=True)
            )
        case Yeoh():
            i = np.sum(lb**2) - 3
            return law.c10 * i + law.c20 * i**2 + law.c30 * i**3
        case Hencky():
            return law.e / (2 * (1 + law.nu)) * np.sum(np.log(lb) ** 2)


def closed_kirchhoff(law: Law, stretches: np.ndarray) -> np.ndarray:
    """Isochoric Kirchhoff stress, principal: l_k d(energy)/d(l_k)."""
    lb = stretches / np.prod(stretches) ** (1 / 3)
    match law:
        case Ogden():
            factor = {"abaqus": lambda m, a: 2 * m / a, "as-printed": lambda m, a: m}
            return sum(
                factor[law.form](m, a) * (lb**a - np.mean(lb**a))
                for m, a in zip(law.mu, law.alpha, strict=True)
            )
        case Yeoh():
            i = np.sum(lb**2) - 3
            slope = law.c10 + 2 * law.c20 * i + 3 * law.c30 * i**2
            return 2 * slope * (lb**2 - np.mean(lb**2))
        case Hencky():
            return law.e / (1 + law.nu) * np.log(lb)


def closed_cauchy(law: Law, F: np.ndarray, p: float) -> np.ndarray:
    """s11, s22, s33, s12 from the spectral form of b = F F^T."""
    squared, n = np.linalg.eigh(F @ F.T)
    stretches = np.sqrt(np.append(squared, 1.0))
    tau = closed_kirchhoff(law, stretches)
    sigma = n @ np.diag(tau[:2]) @ n.T / np.prod(stretches) + p * np.eye(2)
    return np.array([sigma[0, 0], sigma[1, 1], tau[2] / np.prod(stretches) + p, sigma[0, 1]])
