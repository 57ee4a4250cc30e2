"""Coulomb friction: the tangential traction that contact pressure can hold."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

OPEN, STICK, SLIP = 0, 1, 2
STATUS_NAMES = ("open", "stick", "slip")


@dataclass(frozen=True)
class ContactTraction:
    """Contact traction at n points and its derivatives with respect to the trial values.

    Attributes
    ----------
    pressure : (n,)
        Contact pressure in MPa, >= 0 in compression.
    shear : (n,)
        Tangential traction on the skin along the socket's tangent, in MPa.
    status : (n,)
        `OPEN`, `STICK` or `SLIP`.
    d_pressure : (n,)
        d pressure / d trial pressure.
    d_shear_pressure, d_shear_shear : (n,)
        d shear / d trial pressure and d shear / d trial shear.
    """

    pressure: FloatArray
    shear: FloatArray
    status: NDArray[np.int64]
    d_pressure: FloatArray
    d_shear_pressure: FloatArray
    d_shear_shear: FloatArray


def coulomb(
    trial_pressure: FloatArray, trial_shear: FloatArray, friction: float
) -> ContactTraction:
    """Project trial tractions on the Coulomb cone.

    pressure = max(trial_pressure, 0);
    shear = trial_shear clipped to [-friction pressure, friction pressure].

    Parameters
    ----------
    trial_pressure, trial_shear : (n,)
        Trial values in MPa.
    friction : float
        Coefficient of friction, >= 0 (the paper, section 2.3: 0.4).
    """
    closed = trial_pressure > 0
    pressure = np.where(closed, trial_pressure, 0.0)
    limit = friction * pressure
    stick = closed & (np.abs(trial_shear) <= limit)
    slip = closed & ~stick
    direction = np.sign(trial_shear)
    return ContactTraction(
        pressure=pressure,
        shear=np.where(stick, trial_shear, np.where(slip, limit * direction, 0.0)),
        status=np.where(stick, STICK, np.where(slip, SLIP, OPEN)),
        d_pressure=closed.astype(float),
        d_shear_pressure=np.where(slip, friction * direction, 0.0),
        d_shear_shear=stick.astype(float),
    )
