"""The limb and the sockets as data: calf.json and sockets.json, read and checked."""

import math
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Literal

from pydantic import (
    AfterValidator,
    Field,
    PositiveFloat,
    PositiveInt,
    field_validator,
    model_validator,
)

from calfsocket.io.errors import InputError
from calfsocket.io.schema import Strict, nearest, read_json
from calfsocket.meshes import tags

#: A length, mm, with a sign. No section of a limb is wider; sampling one of 10 km would not end.
Length = Annotated[float, Field(ge=-1000, le=1000)]
Thickness = Annotated[float, Field(gt=0, le=1000)]
#: How far a socket's face may lie from the skin, mm.
Offset = Annotated[float, Field(ge=-100, le=100)]
Point = tuple[Length, Length]
Angle = float
#: Points of a curve that are closer together than this, mm, are one.
SAME_POINT = 1e-3
Tissue = Literal["skin", "fat", "fascia", "muscle", "bone", "vessel"]
Units = Literal["mm, deg"]


def _neighbours_differ(value: tuple[Point, ...]) -> tuple[Point, ...]:
    for point, following in pairwise((*value, value[0])):
        if math.dist(point, following) <= SAME_POINT:
            raise ValueError(f"point {list(point)} follows itself; do not repeat points")
    return value


#: Points of a closed curve, the first not repeated.
Points = Annotated[tuple[Point, ...], Field(min_length=4), AfterValidator(_neighbours_differ)]


class SplineCurve(Strict):
    """Closed C2 periodic cubic spline through the points, mm."""

    type: Literal["spline"]
    points: Points


class EllipseCurve(Strict):
    """Ellipse: centre and semi-axes in mm, angle of the first semi-axis from +x in degrees."""

    type: Literal["ellipse"]
    center: Point
    semi_axes: tuple[Thickness, Thickness]
    angle_deg: Angle


class OffsetCurve(Strict):
    """Another curve moved along its inward normal by the thickness of the named layers."""

    type: Literal["offset"]
    of: str
    law: Literal["skin", "skin+fat"]


Curve = Annotated[SplineCurve | EllipseCurve | OffsetCurve, Field(discriminator="type")]


class Layers(Strict):
    """Thickness of skin, mm, and of fat, (polar angle in degrees, mm) at several angles."""

    skin_thickness: Thickness
    fat_thickness: Annotated[tuple[tuple[Angle, Thickness], ...], Field(min_length=2)]

    @field_validator("fat_thickness")
    @classmethod
    def _angles_increase(cls, value: tuple[tuple[float, float], ...]) -> object:
        angles = [angle for angle, _ in value]
        if not (0 <= angles[0] and angles[-1] < 360):
            raise ValueError("angles must lie in 0 <= angle < 360 degrees")
        if any(b <= a for a, b in pairwise(angles)):
            raise ValueError("angles must increase from pair to pair")
        return value


class Region(Strict):
    """What lies inside the outer curve and outside the holes; areas in mm^2."""

    id: PositiveInt
    name: Annotated[str, Field(pattern=r"^[a-z0-9_]+$")]
    latin: str = ""
    tissue: Tissue
    side: str = ""
    target_area: PositiveFloat
    area: PositiveFloat
    outer: str
    holes: tuple[str, ...] = ()
    adjacent: tuple[str, ...] = ()
    across_fascia: tuple[str, ...] = ()

    @property
    def loops(self) -> tuple[str, ...]:
        """Names of all curves that bound the region, the outer one first."""
        return (self.outer, *self.holes)


class Limb(Strict):
    """A transverse section of a limb: named closed curves, and the regions between them."""

    title: str
    units: Units
    side: str = ""
    axes: dict[str, str] = Field(default_factory=dict)
    curve_types: dict[str, str] = Field(default_factory=dict)
    fat_law: str = ""
    topology: str = ""
    fixed_boundary: str
    contact_boundary: str
    layers: Layers
    curves: dict[str, Curve]
    regions: Annotated[tuple[Region, ...], Field(min_length=1)]

    @field_validator("fixed_boundary", "contact_boundary")
    @classmethod
    def _first_word(cls, value: str) -> str:
        """Drop a remark in brackets behind the curve's name."""
        return value.split(" (")[0]

    @model_validator(mode="after")
    def _consistent(self) -> "Limb":
        for problem in self._problems():
            raise ValueError(problem)
        return self

    def _problems(self) -> Iterator[str]:
        """Yield what is wrong between the parts, the first reason first."""
        for name, curve in self.curves.items():
            if isinstance(curve, OffsetCurve):
                if curve.of not in self.curves:
                    hint = nearest(curve.of, self.curves)
                    yield f"curves.{name}.of: no curve '{curve.of}'; {hint}"
                elif isinstance(self.curves[curve.of], OffsetCurve):
                    yield f"curves.{name}.of: '{curve.of}' is an offset itself; name its origin"
        owner: dict[str, str] = {}
        hole_of: dict[str, str] = {}
        for key in ("id", "name"):
            values = [getattr(region, key) for region in self.regions]
            for value in values:
                if values.count(value) > 1:
                    yield f"regions: {key} {value} stands for two regions; make each unique"
        for region in self.regions:
            if region.id >= tags.SOCKET_ID:
                yield (
                    f"regions.{region.name}.id: {region.id} is reserved;"
                    f" choose one below {tags.SOCKET_ID}"
                )
            if region.name == tags.SOCKET:
                yield "regions.socket.name: reserved for the socket itself; choose another"
        for region in self.regions:
            place = f"regions.{region.name}"
            for loop in region.loops:
                if loop not in self.curves:
                    yield f"{place}: no curve '{loop}'; {nearest(loop, self.curves)}"
            if region.outer in owner:
                yield f"{place}.outer: '{region.outer}' is already that of {owner[region.outer]}"
            owner[region.outer] = region.name
            for hole in region.holes:
                if hole in hole_of:
                    yield f"{place}.holes: '{hole}' is already a hole of {hole_of[hole]}"
                hole_of[hole] = region.name
            names = [other.name for other in self.regions]
            for other in (*region.adjacent, *region.across_fascia):
                if other not in names:
                    yield f"{place}: no region '{other}'; {nearest(other, names)}"
        # What lies in a hole is another region, or nothing where the limb is held.
        empty = [hole for hole in hole_of if hole not in owner]
        if empty != [self.fixed_boundary]:
            yield (
                f"fixed_boundary: '{self.fixed_boundary}' must be the one hole that is the outer"
                f" curve of no region; these are: {', '.join(empty) or 'none'}"
            )
        outside = [outer for outer in owner if outer not in hole_of]
        if outside != [self.contact_boundary]:
            yield (
                f"contact_boundary: '{self.contact_boundary}' must be the one outer curve that is"
                f" the hole of no region; these are: {', '.join(outside) or 'none'}"
            )

    def region(self, name: str) -> Region:
        """Return the region of this name."""
        for region in self.regions:
            if region.name == name:
                return region
        raise InputError(
            f"limb: no region '{name}'; {nearest(name, [region.name for region in self.regions])}"
        )

    @property
    def region_tags(self) -> dict[str, int]:
        """Region name -> tag of its cells, without the socket."""
        return {region.name: region.id for region in self.regions}


class Bump(Strict):
    """A Gaussian of the polar angle: centre and width (standard deviation) in degrees, mm."""

    site: str = ""
    center: Angle
    width: PositiveFloat
    amplitude: Offset


class _Shape(Strict):
    title: str
    wall_thickness: Thickness | None = None


class NormalOffset(_Shape):
    """Inner face: the skin moved inward along its normal by base + bumps, mm.

    A wall thickness is the socket's own, in the place of that of the file, mm.
    """

    law: Literal["normal_offset"]
    base: Offset
    bumps: tuple[Bump, ...] = ()


class CircleBlend(_Shape):
    """Inner face: the skin blended with a circle, of an area reduced by this part, minus bumps."""

    law: Literal["circle_blend"]
    area_reduction: Annotated[float, Field(gt=-1, lt=1)]
    roundness: Annotated[float, Field(ge=0, le=1)]
    bumps: tuple[Bump, ...] = ()


class Outline(_Shape):
    """Inner face: a closed spline through points, moved: turned about the origin, then shifted."""

    law: Literal["outline"]
    points: Points
    shift: Point = (0.0, 0.0)
    rotation: Angle = 0.0


Shape = Annotated[NormalOffset | CircleBlend | Outline, Field(discriminator="law")]


class Socket(Strict):
    """One socket: its name, the law of its inner face, and its wall, mm."""

    name: str
    shape: Shape
    wall_thickness: Thickness


class Sockets(Strict):
    """All sockets of a file."""

    units: Units
    applies_to: str = ""
    wall_thickness: Thickness
    wall_rule: str = ""
    laws: dict[str, str] = Field(default_factory=dict)
    sockets: Annotated[dict[str, Shape], Field(min_length=1)]

    def socket(self, name: str) -> Socket:
        """Return the socket of this name."""
        if name not in self.sockets:
            raise InputError(f"sockets: no socket '{name}'; {nearest(name, self.sockets)}")
        shape = self.sockets[name]
        return Socket(
            name=name, shape=shape, wall_thickness=shape.wall_thickness or self.wall_thickness
        )


def load_limb(path: Path | str | None = None) -> Limb:
    """Read a limb, by default the calf of the package; check its curves as well.

    Raises
    ------
    InputError
        When the file cannot be read, a key is wrong, or curves touch, cross or are not nested as
        the regions say.
    """
    from calfsocket.meshes.loops import check_loops

    path = Path(path) if path is not None else Path(__file__).with_name("calf.json")
    limb = read_json(path, Limb)
    check_loops(limb, path)
    return limb


def load_sockets(path: Path | str | None = None) -> Sockets:
    """Read the sockets, by default those of the package."""
    path = Path(path) if path is not None else Path(__file__).with_name("sockets.json")
    return read_json(path, Sockets)
