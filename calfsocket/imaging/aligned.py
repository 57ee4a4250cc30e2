"""A section of a limb turned into the axes of the atlas."""

from dataclasses import dataclass

import numpy as np
import shapely

from calfsocket.imaging.landmarks import Ring
from calfsocket.imaging.outlines import SectionOutlines
from calfsocket.io.errors import InputError
from calfsocket.meshes.curves import Array, ClosedCurve, Point
from calfsocket.meshes.frame import Frame
from calfsocket.meshes.limb import FIBULA, MIN_GAP

#: Names of outlines that no region can have.
NOT_REGIONS = "skin", "envelope", "cavity", "tibia", "fibula"
_AXES = (1, 0), (0, 1), (-1, 0), (0, -1)


@dataclass(frozen=True)
class AlignedSection:
    """Outlines of a section with +x lateral and +y anterior, as of a right leg from above.

    Attributes
    ----------
    outlines : SectionOutlines
        As given.
    matrix : Array
        From their axes to lateral and anterior, (2, 2).
    rings : dict of str to Ring
        ``skin``, bones by name, ``envelope``, further regions by name, ``cavity`` of the tibia.
    """

    outlines: SectionOutlines
    matrix: Array
    rings: dict[str, Ring]

    @classmethod
    def of(cls, outlines: SectionOutlines) -> "AlignedSection":
        """Turn outlines into the atlas's axes.

        Raises
        ------
        InputError
            When axes are not known, or bones are not those of a calf, or not where theirs are.
        """
        frame = outlines.frame
        if not frame.known:
            raise InputError(
                "the section has no axes, and the atlas needs to know what is lateral and anterior;"
                " give the axes, or the side"
            )
        names = set(outlines.bones)
        if names and (names - {"tibia", "fibula"} or "tibia" not in names):
            raise InputError(
                f"the section has {' and '.join(sorted(names))}, and the atlas is a calf with tibia"
                " and fibula; choose a level between knee and ankle, or tissues lumped"
            )
        matrix = _to_atlas(frame)
        every = {"skin": outlines.skin, **outlines.bones}
        every |= {name: outline for name, (_, outline) in outlines.regions.items()}
        if outlines.muscle_envelope:
            every["envelope"] = outlines.muscle_envelope
        if "tibia" in outlines.cavities:
            every["cavity"] = outlines.cavities["tibia"]
        rings = {name: _turned(each.curve, matrix) for name, each in every.items()}
        found = cls(outlines, matrix, rings)
        found._check_fibula()
        return found

    def _check_fibula(self) -> None:
        if "fibula" not in self.rings:
            return
        tibia, fibula = (shapely.Polygon(self.rings[name].points) for name in ("tibia", "fibula"))
        if tibia.distance(fibula) < MIN_GAP:
            place = shapely.get_coordinates(shapely.shortest_line(tibia, fibula))[0]
            raise InputError(
                f"tibia and fibula overlap or touch at {self.at(place)}; correct the outlines"
            )
        x, y = self.rings["fibula"].centroid - self.rings["tibia"].centroid
        angle = np.rad2deg(np.arctan2(y, x)) % 360
        if FIBULA[0] > angle > FIBULA[1]:
            where = Frame("lateral", "anterior").direction(x, y)
            raise InputError(
                f"the fibula lies {where} of the tibia, but in every leg it is lateral and further"
                " back; correct side or axes, or which bone is which"
            )

    @property
    def skin(self) -> Ring:
        """Its surface."""
        return self.rings["skin"]

    def at(self, point: Array) -> str:
        """Return words for a place that is given in the atlas's axes."""
        return self.outlines.frame.at(self.matrix.T @ point)

    def points(self, curve: ClosedCurve) -> tuple[Point, ...]:
        """Return the points of a spline, given in the atlas's axes, in the section's own."""
        points = curve.evaluate(curve.knots[:-1]) @ self.matrix
        if np.linalg.det(self.matrix) < 0:
            points = points[::-1]
        return tuple((round(float(x), 5), round(float(y), 5)) for x, y in points)


def _to_atlas(frame: Frame) -> Array:
    """Return the matrix from the axes of a frame to lateral and anterior."""
    rows = [_AXES[frame.words.index(wanted)] for wanted in ("lateral", "anterior")]
    return np.array(rows, dtype=float)


def _turned(curve: ClosedCurve, matrix: Array) -> Ring:
    points = Ring.of(curve).points @ matrix.T
    return Ring(points if np.linalg.det(matrix) > 0 else points[::-1])
