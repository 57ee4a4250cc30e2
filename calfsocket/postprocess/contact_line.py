"""The contact along the skin: pressure, friction and gap at the skin's quadrature points."""

from dataclasses import dataclass, fields
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from calfsocket.contact.friction import STATUS_NAMES

if TYPE_CHECKING:
    import pandas as pd

RUNNING_MEAN_MM = 3.0
"""Window of the running mean of contact pressure, which drops single spikes."""


@dataclass(frozen=True)
class ContactLine:
    """Contact at the skin's quadrature points, sorted by arc length; arrays of shape (n,)."""

    arc_mm: NDArray[np.float64]
    """Reference arc length along the closed skin outline, from 0 to less than all of it."""
    angle_deg: NDArray[np.float64]
    """Angle of the reference position about the origin, counter-clockwise from +x (lateral)."""
    x_mm: NDArray[np.float64]
    """Deformed position, with `y_mm`."""
    y_mm: NDArray[np.float64]
    pressure_kPa: NDArray[np.float64]
    """>= 0 in compression, 0 where open."""
    shear_kPa: NDArray[np.float64]
    """Friction traction along the skin, signed along increasing arc length."""
    gap_mm: NDArray[np.float64]
    """Normal gap, >= 0 open."""
    weight_mm: NDArray[np.float64]
    """Reference length that each point stands for; they add up to that of the outline."""
    status: NDArray[np.str_]
    """"open", "stick" or "slip"."""

    def __post_init__(self) -> None:
        n = len(self.arc_mm)
        for name in COLUMNS[:-1]:
            if getattr(self, name).shape != (n,):
                raise ValueError(f"{name} has shape {getattr(self, name).shape}, not {(n,)}")
            if not np.isfinite(getattr(self, name)).all():
                raise ValueError(f"{name} has values that are not finite")
        if self.status.shape != (n,) or not np.isin(self.status, STATUS_NAMES).all():
            raise ValueError(f"status must hold {n} of {', '.join(STATUS_NAMES)}")
        if np.any(np.diff(self.arc_mm) <= 0):
            raise ValueError("arc_mm does not increase: sort the points by arc length")
        if self.weight_mm.min() <= 0:
            raise ValueError("weight_mm has a value that is not positive")

    @property
    def points(self) -> NDArray[np.float64]:
        """Deformed positions, mm, (n, 2)."""
        return np.column_stack([self.x_mm, self.y_mm])

    @cached_property
    def running_mean_kPa(self) -> NDArray[np.float64]:
        """Contact pressure averaged over `RUNNING_MEAN_MM` along the skin, kPa, (n,)."""
        return running_mean(self)

    @cached_property
    def table(self) -> "pd.DataFrame":
        """One row a point: all arrays as columns."""
        import pandas as pd

        return pd.DataFrame({name: getattr(self, name) for name in COLUMNS})

    @classmethod
    def from_table(cls, table: "pd.DataFrame") -> "ContactLine":
        """Return the contact that `table` was made of."""
        arrays = {name: table[name].to_numpy() for name in COLUMNS}
        return cls(**{**arrays, "status": arrays["status"].astype(str)})


COLUMNS = tuple(each.name for each in fields(ContactLine))
"""Names of the arrays, status the last."""


def running_mean(
    contact: ContactLine,
    window_mm: float = RUNNING_MEAN_MM,
    values: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """Return the contact pressure averaged over a window along the closed skin outline, kPa, (n,).

    Or other `values` at the points.

    Each point stands for its own piece of the outline; the window is centred on the piece and
    takes parts of pieces at its ends.
    """
    of_points = contact.pressure_kPa if values is None else values
    width = contact.weight_mm
    ends = np.concatenate([[0.0], np.cumsum(width)])
    total = ends[-1]
    if window_mm > total:
        raise ValueError(f"the window of {window_mm} mm is longer than the outline, {total:.4g} mm")
    integral = np.concatenate([[0.0], np.cumsum(width * of_points)])
    # once around before and after, so that windows across the start see both sides
    ends = np.concatenate([ends[:-1] - total, ends[:-1], ends + total])
    integral = np.concatenate(
        [integral[:-1] - integral[-1], integral[:-1], integral + integral[-1]],
    )
    middle = np.cumsum(width) - 0.5 * width
    upper = np.interp(middle + 0.5 * window_mm, ends, integral)
    lower = np.interp(middle - 0.5 * window_mm, ends, integral)
    return (upper - lower) / window_mm
