"""The tests of an incompressible material, in closed form.

With the principal stretches (l1, l2, l3), l1 l2 l3 = 1, and the load along axis 1,

    uniaxial (l, l^-1/2, l^-1/2),   equibiaxial (l, l, l^-2),   planar (l, 1, 1/l),

the free direction 3 gives the pressure, and the engineering stress is P = (t1 - t3)/l with the
principal Kirchhoff stresses t of `Law.kirchhoff`. The Cauchy stress is P l.

Simple shear by the amount g has the principal stretches (l, 1, 1/l) with g = l - 1/l, so that the
shear stress, the derivative of the energy by g, is (t1 - t3)/(l + 1/l). It is the engineering and
the Cauchy shear stress: the sheared face keeps its area.

Treloar, The physics of rubber elasticity, 1975, chapters 4 and 5; Ogden, Non-linear elastic
deformations, 1984, section 2.2.6 (simple shear).
"""

from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calfsocket.materials.law import Law

Mode = Literal["uniaxial", "equibiaxial", "planar", "shear"]
MODES: tuple[Mode, ...] = get_args(Mode)

Array = NDArray[Any]

_POWERS: dict[Mode, tuple[float, float, float]] = {
    "uniaxial": (1.0, -0.5, -0.5),
    "equibiaxial": (1.0, 1.0, -2.0),
    "planar": (1.0, 0.0, -1.0),
    "shear": (1.0, 0.0, -1.0),
}


def log_stretches(mode: Mode, stretch: ArrayLike) -> Array:
    """Principal logarithmic stretches (ln l1, ln l2, ln l3), (3, n)."""
    return np.multiply.outer(_POWERS[mode], np.log(np.asarray(stretch, dtype=float)))


def engineering_stress(law: Law, mode: Mode, stretch: ArrayLike) -> Array:
    """Force per reference area, along axis 1 or of shear, in the unit of the moduli, (n,).

    The law is taken as incompressible; `stretch` is the principal one along axis 1, > 0, (n,).
    """
    stretches = np.exp(log_stretches(mode, stretch))
    tau = law.kirchhoff(stretches)
    lever = stretches[0] + stretches[2] if mode == "shear" else stretches[0]
    return np.asarray((tau[0] - tau[2]) / lever)


def amount_of_shear(stretch: ArrayLike) -> Array:
    """Amount of shear, the tangent of its angle, that has this larger principal stretch, (n,)."""
    stretch = np.asarray(stretch)
    return np.asarray(stretch - 1 / stretch)


def sheared_stretch(amount: ArrayLike) -> Array:
    """Principal stretch of simple shear, below 1 where the amount is negative, (n,)."""
    half = np.asarray(amount, dtype=float) / 2
    return np.asarray(half + np.hypot(1.0, half))
