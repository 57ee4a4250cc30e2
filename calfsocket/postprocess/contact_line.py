"""The contact along the skin: pressure, friction and gap at the skin's quadrature points."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from calfsocket.contact.friction import STATUS_NAMES


@dataclass(frozen=True)
class ContactLine:
    """Contact at the skin's quadrature points, sorted by arc length; arrays of shape (n,).

    Attributes
    ----------
    arc_mm
        Reference arc length along the closed skin outline, mm, in [0, circumference_mm).
    angle_deg
        Angle of the reference position about the origin from +x (lateral) counter-clockwise, deg.
    x_mm, y_mm
        Deformed position, mm.
    pressure_kPa
        Contact pressure, kPa, >= 0 in compression, 0 where open.
    shear_kPa
        Friction traction along the skin, kPa, signed along increasing arc length.
    gap_mm
        Normal gap, mm, >= 0 open.
    weight_mm
        Reference length that each point stands for, mm; they add up to circumference_mm.
    status
        "open", "stick" or "slip".
    circumference_mm
        Reference length of the whole outline, mm.
    """

    arc_mm: NDArray[np.float64]
    angle_deg: NDArray[np.float64]
    x_mm: NDArray[np.float64]
    y_mm: NDArray[np.float64]
    pressure_kPa: NDArray[np.float64]
    shear_kPa: NDArray[np.float64]
    gap_mm: NDArray[np.float64]
    weight_mm: NDArray[np.float64]
    status: NDArray[np.str_]
    circumference_mm: float

    def __post_init__(self) -> None:
        n = len(self.arc_mm)
        for name in (
            "arc_mm",
            "angle_deg",
            "x_mm",
            "y_mm",
            "pressure_kPa",
            "shear_kPa",
            "gap_mm",
            "weight_mm",
        ):
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
        if not np.isclose(self.weight_mm.sum(), self.circumference_mm, rtol=1e-3):
            raise ValueError(
                f"weight_mm adds up to {self.weight_mm.sum():.6g} mm, "
                f"circumference_mm is {self.circumference_mm:.6g} mm"
            )

    def rows(self, socket: str, material_set: str) -> pd.DataFrame:
        """Rows of contact.csv, one a point."""
        return pd.DataFrame(
            {
                "socket": socket,
                "material_set": material_set,
                "arc_mm": self.arc_mm,
                "angle_deg": self.angle_deg,
                "x_mm": self.x_mm,
                "y_mm": self.y_mm,
                "pressure_kPa": self.pressure_kPa,
                "shear_kPa": self.shear_kPa,
                "gap_mm": self.gap_mm,
                "status": self.status,
            }
        )
