"""The three tests of an incompressible material, in closed form.

With the principal stretches (l1, l2, l3), l1 l2 l3 = 1, and the load along axis 1,

    uniaxial (l, l^-1/2, l^-1/2),   equibiaxial (l, l, l^-2),   planar (l, 1, 1/l),

the free direction 3 gives the pressure, and the engineering stress is P = (t1 - t3)/l with the
principal Kirchhoff stresses t of `Law.kirchhoff`. The Cauchy stress is P l.

Treloar, The physics of rubber elasticity, 1975, chapters 4 and 5.
"""

from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calfsocket.materials.law import Law

Mode = Literal["uniaxial", "equibiaxial", "planar"]
MODES: tuple[Mode, ...] = get_args(Mode)

Array = NDArray[Any]

_POWERS: dict[Mode, tuple[float, float, float]] = {
    "uniaxial": (1.0, -0.5, -0.5),
    "equibiaxial": (1.0, 1.0, -2.0),
    "planar": (1.0, 0.0, -1.0),
}


def log_stretches(mode: Mode, stretch: ArrayLike) -> Array:
    """Principal logarithmic stretches (ln l1, ln l2, ln l3), (3, n)."""
    return np.multiply.outer(_POWERS[mode], np.log(np.asarray(stretch, dtype=float)))


def engineering_stress(law: Law, mode: Mode, stretch: ArrayLike) -> Array:
    """Force per reference area along axis 1, in the unit of the moduli, (n,).

    The law is taken as incompressible; `stretch` is that along axis 1, > 0, (n,).
    """
    stretches = np.exp(log_stretches(mode, stretch))
    tau = law.kirchhoff(stretches)
    return np.asarray((tau[0] - tau[2]) / stretches[0])
