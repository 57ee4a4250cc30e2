"""The three tests of an incompressible material, in closed form.

With the principal stretches (l1, l2, l3), l1 l2 l3 = 1, and the load along axis 1,

    uniaxial (l, l^-1/2, l^-1/2),   equibiaxial (l, l, l^-2),   planar (l, 1, 1/l),

the free direction 3 gives the pressure, and the engineering stress is P = (t1 - t3)/l with the
principal Kirchhoff stresses t of `closed_forms.closed_kirchhoff`. The Cauchy stress is P l.

Treloar, The physics of rubber elasticity, 1975, chapters 4 and 5.
"""

from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calfsocket.materials.closed_forms import closed_kirchhoff
from calfsocket.materials.laws import Law, Ogden, Yeoh

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

    Parameters
    ----------
    law
        Taken as incompressible.
    mode
        Which test.
    stretch : (n,)
        Stretch along axis 1, > 0.
    """
    stretches = np.exp(log_stretches(mode, stretch))
    tau: Any = closed_kirchhoff(law, stretches)
    return np.asarray((tau[0] - tau[2]) / stretches[0])


def yeoh_columns(terms: int, mode: Mode, stretch: ArrayLike) -> Array:
    """Differentiate the engineering stress by C10, C20 and C30, (n, terms)."""
    first = engineering_stress(Yeoh(1.0), mode, stretch)
    # C20 and C30 alone are no law; the stress is linear in them.
    others = [
        engineering_stress(law, mode, stretch) - first
        for law in (Yeoh(1.0, 1.0), Yeoh(1.0, 0.0, 1.0))
    ]
    return np.column_stack([first, *others])[:, :terms]


def ogden_columns(alpha: ArrayLike, mode: Mode, stretch: ArrayLike) -> Array:
    """Differentiate the engineering stress by the moduli mu (Abaqus's form), (n, terms)."""
    laws = [Ogden((1.0,), (float(a),), d1=0.0) for a in np.asarray(alpha)]
    return np.column_stack([engineering_stress(law, mode, stretch) for law in laws])


def ogden_slopes(alpha: ArrayLike, mode: Mode, stretch: ArrayLike) -> Array:
    """Differentiate `ogden_columns` by alpha, (n, terms)."""
    e1, _, e3 = log_stretches(mode, stretch)[:, :, None]
    a = np.asarray(alpha)
    powers = np.exp(a * e1) * e1 - np.exp(a * e3) * e3
    return (2 * powers * np.exp(-e1) - ogden_columns(a, mode, stretch)) / a
