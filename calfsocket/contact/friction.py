"""Coulomb friction: the tangential traction that contact pressure can hold."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

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
    branch : (n,)
        `OPEN`, `STICK`, or `SLIP` with the sign of the shear.
    d_pressure : (n,)
        d pressure / d trial pressure.
    d_shear_pressure, d_shear_shear : (n,)
        d shear / d trial pressure and d shear / d trial shear.
    """

    pressure: FloatArray
    shear: FloatArray
    branch: IntArray
    d_pressure: FloatArray
    d_shear_pressure: FloatArray
    d_shear_shear: FloatArray

    @property
    def status(self) -> IntArray:
        """`OPEN`, `STICK` or `SLIP` of each point."""
        return np.abs(self.branch)


def branches(trial_pressure: FloatArray, trial_shear: FloatArray, friction: float) -> IntArray:
    """Return the branch of Coulomb's law of trial tractions; arguments as of `coulomb`."""
    closed = trial_pressure > 0
    stick = np.abs(trial_shear) <= friction * np.where(closed, trial_pressure, 0.0)
    backwards = (trial_shear < 0) & (friction > 0)  # without friction there is but one way to slip
    slip = np.where(backwards, -SLIP, SLIP)
    return np.where(closed, np.where(stick, STICK, slip), OPEN)


def coulomb(
    trial_pressure: FloatArray,
    trial_shear: FloatArray,
    friction: float,
    branch: IntArray | None = None,
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
    branch : (n,), optional
        Branches whose law counts, in place of those of the trial values: the shear of `STICK` is
        not limited then, that of `SLIP` is at its limit.
    """
    if branch is None:
        branch = branches(trial_pressure, trial_shear, friction)
    closed = branch != OPEN
    stick, slip = branch == STICK, np.abs(branch) == SLIP
    pressure = np.where(closed, trial_pressure, 0.0)
    limit = friction * np.sign(branch)
    return ContactTraction(
        pressure=pressure,
        shear=np.where(stick, trial_shear, np.where(slip, limit * pressure, 0.0)),
        branch=branch,
        d_pressure=closed.astype(float),
        d_shear_pressure=np.where(slip, limit, 0.0),
        d_shear_shear=stick.astype(float),
    )
