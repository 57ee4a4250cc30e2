"""Where lateral and anterior lie in the plane of a limb's data."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from calfsocket.meshes.curves import Array, polar_angle, xy

Direction = Literal["lateral", "anterior", "medial", "posterior"]
View = Literal["above", "below"]
#: A quarter of a turn apart, in the direction in which anatomical angles grow.
QUARTERS: tuple[Direction, ...] = ("lateral", "anterior", "medial", "posterior")
_SECTORS = (
    "lateral", "anterolateral", "anterior", "anteromedial",
    "medial", "posteromedial", "posterior", "posterolateral",
)  # fmt: skip
#: What is true of a limb whose axes are not known.
_PLAIN_SECTORS = ("+x", "+x +y", "+y", "-x +y", "-x", "-x -y", "-y", "+x -y")


@dataclass(frozen=True)
class Frame:
    """What the axes of a limb point to, and so how its polar angle becomes anatomical.

    The anatomical angle is 0 lateral, 90 anterior, 180 medial and 270 degrees posterior, for a left
    leg as for a right one, so that a socket's reliefs are where they belong on either. Where the
    axes are not known it is the polar angle.

    Attributes
    ----------
    x, y : str, optional
        Where +x and +y point; None where that is not known.
    """

    x: Direction | None = None
    y: Direction | None = None

    def __post_init__(self) -> None:
        if self.known and (QUARTERS.index(self.y) - QUARTERS.index(self.x)) % 2 == 0:  # type: ignore[arg-type]
            raise ValueError(
                f"+x {self.x} and +y {self.y} are not at right angles; one of them must be lateral"
                " or medial, the other anterior or posterior"
            )

    @property
    def known(self) -> bool:
        """Whether the axes are known."""
        return self.x is not None and self.y is not None

    @property
    def words(self) -> tuple[str, str, str, str]:
        """What +x, +y, -x and -y point to, for the sides of a picture."""
        if not self.known:
            return "+x", "+y", "-x", "-y"
        first = QUARTERS.index(self.x)  # type: ignore[arg-type]
        right, top, left, bottom = (QUARTERS[first + self._turn * i & 3] for i in range(4))
        return right, top, left, bottom

    @property
    def _turn(self) -> int:
        """1 where anatomical angles grow counter-clockwise, -1 where they grow clockwise."""
        if not self.known:
            return 1
        quarter = QUARTERS.index(self.y) - QUARTERS.index(self.x)  # type: ignore[arg-type]
        return 1 if quarter % 4 == 1 else -1

    def view(self, side: Literal["left", "right"]) -> View:
        """Return whether a left or right limb with these axes is seen from above or below."""
        return "above" if (self._turn == 1) == (side == "right") else "below"

    def anatomical(self, angle: ArrayLike) -> Array:
        """Return anatomical angles of polar angles, degrees, 0 <= angle < 360."""
        of_x = 90.0 * QUARTERS.index(self.x) if self.x and self.known else 0.0
        return (of_x + self._turn * np.asarray(angle, dtype=float)) % 360.0

    def angle(self, points: Array) -> Array:
        """Return the anatomical angle of points about the origin, shape (..., 2) -> (...)."""
        return self.anatomical(polar_angle(points))

    def direction(self, x_mm: float, y_mm: float) -> str:
        """Return on which side of the limb a point lies, to an eighth of a turn.

        Such as ``"anteromedial"``; ``"+x +y side"`` where the axes are not known.
        """
        eighth = round(float(self.angle(np.array([x_mm, y_mm]))) / 45) % 8
        return _SECTORS[eighth] if self.known else f"{_PLAIN_SECTORS[eighth]} side"

    def at(self, point: Array) -> str:
        """Return the anatomical angle and the coordinates of a point for messages."""
        return f"{round(float(self.angle(point))) % 360} degrees, {xy(point)}"
