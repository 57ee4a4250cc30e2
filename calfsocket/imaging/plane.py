"""The plane of a section: where along the limb it lies, and what a surface leaves in it."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, Self

import numpy as np
import pyvista
import shapely
from shapely.geometry.base import BaseGeometry

from calfsocket.io.errors import InputError
from calfsocket.meshes.curves import Array

End = Literal["distal", "proximal"]
#: Gap, mm, in a cut surface that is closed by a straight line: what a scanner resolves.
BRIDGE = 0.2
#: Pieces of a cut surface smaller than this share of the largest are debris.
DEBRIS = 0.01
_MILLIMETRES = re.compile(r"(\d+(?:\.\d*)?|\.\d+)\s*mm(?:\s+from\s+(?:the\s+)?(\w+)(?:\s+end)?)?")


@dataclass(frozen=True)
class Level:
    """Where along the limb a section lies.

    Attributes
    ----------
    share : float, optional
        Of the height: 0 is the distal end of the source, 1 its proximal end.
    mm : float, optional
        Distance from an end instead.
    end : {"distal", "proximal"}
        Which.
    """

    share: float | None = None
    mm: float | None = None
    end: End = "distal"

    @classmethod
    def parse(cls, text: "str | float | Level") -> Self:
        """Read a share of the height such as 0.5, or a distance such as "80 mm from proximal"."""
        if isinstance(text, cls):
            return text
        words = str(text).strip()
        try:
            share = float(words)
        except ValueError:
            found = _MILLIMETRES.fullmatch(words)
            if found and found[2] in (None, "distal", "proximal"):
                return cls(mm=float(found[1]), end=found[2] or "distal")  # type: ignore[arg-type]
            raise InputError(
                f"level: is '{words}'; give a share of the height such as 0.5 (0 distal, 1"
                " proximal), or a distance such as '80 mm' or '80 mm from proximal'"
            ) from None
        if not 0 <= share <= 1:
            raise InputError(
                f"level: is {share:g}; a share of the height lies between 0 (distal) and 1"
                f" (proximal); for a distance write '{share:g} mm'"
            )
        return cls(share=share)

    def height(self, low: float, high: float) -> float:
        """Return the place along the axis, mm, of a source that extends from `low` to `high`."""
        if self.share is not None:
            return low + self.share * (high - low)
        assert self.mm is not None
        if self.mm > high - low:
            raise InputError(f"level: {self} lies outside: the source is {high - low:.0f} mm high")
        return low + self.mm if self.end == "distal" else high - self.mm

    def __str__(self) -> str:
        if self.share is not None:
            return f"{self.share:g}"
        return f"{self.mm:g} mm from the {self.end} end"


@dataclass(frozen=True)
class Plane:
    """A plane with axes of its own: x, y and the normal are at right angles and right-handed."""

    origin: Array  #: mm
    x: Array
    y: Array

    @classmethod
    def square_to(cls, normal: Array, origin: Array, y: Array | None = None) -> Self:
        """Return the plane through `origin` square to `normal`, with +y near a direction."""
        normal = np.asarray(normal / np.linalg.norm(normal))
        near = np.eye(3)[np.argmin(np.abs(normal))] if y is None else y
        along = near - (near @ normal) * normal
        along /= np.linalg.norm(along)
        return cls(origin, np.cross(along, normal), along)

    @property
    def normal(self) -> Array:
        """Unit normal, toward the one who looks at the section."""
        return np.asarray(np.cross(self.x, self.y), dtype=float)

    def flat(self, points: Array) -> Array:
        """Return coordinates in the plane, shape (..., 3) -> (..., 2)."""
        return np.asarray((points - self.origin) @ np.column_stack([self.x, self.y]))


@dataclass(frozen=True)
class Cut:
    """What a surface leaves in a plane.

    Attributes
    ----------
    bodies : sequence of Polygon
        Closed outlines with their holes, mm, the largest first; empty where it is not met.
    gap : float
        Widest opening of an outline that does not close, mm; 0 where all close.
    place : Array
        Where.
    """

    bodies: Sequence[shapely.Polygon]
    gap: float = 0.0
    place: Array | None = None

    @property
    def area(self) -> float:
        """Of all bodies, mm^2."""
        return float(sum(body.area for body in self.bodies))

    @property
    def centre(self) -> Array:
        """Centroid of all bodies."""
        return np.array(shapely.MultiPolygon(list(self.bodies)).centroid.coords[0])


def cut(surface: pyvista.PolyData, plane: Plane) -> Cut:
    """Cut a surface by a plane and join what it leaves to closed outlines."""
    lines = surface.slice(normal=plane.normal, origin=plane.origin)
    if not lines.n_lines:
        return Cut(())
    points = np.round(plane.flat(lines.points), 6) + 0.0
    ends = points[lines.lines.reshape(-1, 3)[:, 1:]]
    ends = ends[np.any(ends[:, 0] != ends[:, 1], axis=1)]
    # Each side once: a triangle that lies in the plane would bring its own twice.
    ends = np.unique(np.sort(ends.view([("x", float), ("y", float)])[..., 0], axis=1), axis=0)
    sides = np.asarray(shapely.linestrings(np.stack([ends["x"], ends["y"]], axis=-1)))
    merged = shapely.line_merge(shapely.multilinestrings(sides))
    rings, gap, place, longest_open = [], 0.0, None, 0.0
    for line in shapely.get_parts(merged):
        if line.is_empty:
            continue
        start, end = (np.array(line.coords[i]) for i in (0, -1))
        opening = float(np.linalg.norm(end - start))
        if len(line.coords) > 3 and opening <= BRIDGE:
            rings.append(shapely.Polygon(line.coords))
        elif line.length > longest_open:
            gap, place, longest_open = max(opening, BRIDGE), (start + end) / 2, line.length
    bodies = _with_holes(rings)
    # A flap inside a closed outline does not open it.
    if place is not None and bodies and longest_open < 0.1 * bodies[0].exterior.length:
        gap, place = 0.0, None
    return Cut(tuple(bodies), gap, place)


def _with_holes(rings: Sequence[shapely.Polygon]) -> list[shapely.Polygon]:
    """Return nested outlines as bodies with holes, the largest first, without debris."""
    body: BaseGeometry = shapely.Polygon()
    for ring in sorted(rings, key=lambda each: -each.area):
        body = shapely.symmetric_difference(body, shapely.make_valid(ring))
    parts = [each for each in shapely.get_parts(body) if isinstance(each, shapely.Polygon)]
    parts.sort(key=lambda each: -each.area)
    return [each for each in parts if each.area > DEBRIS * parts[0].area]
