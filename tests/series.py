"""How accurate the truncated series of the kinematics are: numpy, no UFL."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calfsocket.forms.kinematics import cosh_minus_one, log_ratio_squared


def series_error(alpha: float, stretch_ratio: ArrayLike) -> NDArray[np.float64]:
    """Relative error of the stress that an Ogden term's distortion l1/l2 > 1 causes.

    That stress is proportional to d(cosh(alpha d/2))/dx = alpha sinh(alpha d/2) / (2 sinh d) with
    d = ln(l1/l2) and x = cosh(d) - 1; alpha = 0 is the limit, which is Hencky's law. Rounding
    leaves about 1e-15.
    """
    d = np.log(np.asarray(stretch_ratio, dtype=float))
    squared = log_ratio_squared(2.0 * np.sinh(0.5 * d) ** 2, sqrt=np.sqrt)
    if alpha == 0:
        computed, exact = squared.first, 2.0 * d / np.sinh(d)
    else:
        inner = 0.25 * alpha**2 * squared
        computed = cosh_minus_one(inner.value).of(inner).first
        exact = 0.5 * alpha * np.sinh(0.5 * alpha * d) / np.sinh(d)
    return np.abs(computed / exact - 1.0)
