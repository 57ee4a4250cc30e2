"""A limb as data: closed curves and the regions between them, read and checked."""

from collections import Counter
from collections.abc import Iterator
from functools import cache
from itertools import combinations, pairwise, permutations
from pathlib import Path
from typing import Annotated, Literal, Self

import numpy as np
import shapely
from pydantic import Field, PositiveFloat, PositiveInt, field_validator, model_validator
from scipy.interpolate import PchipInterpolator
from scipy.spatial import cKDTree

from calfsocket.io.errors import InputError
from calfsocket.io.schema import Strict, nearest, read_json
from calfsocket.meshes import curves, tags
from calfsocket.meshes.curves import ClosedCurve, Point, Points, Thickness, at, polar_angle

Tissue = Literal["skin", "fat", "fascia", "muscle", "bone", "vessel"]
Units = Literal["mm, deg"]
#: Curves closer than this, mm, are taken for touching: no element would fit between them.
MIN_GAP = 0.1
#: Distance of the points at which curves are compared, mm.
SAMPLE_STEP = 0.1


class SplineCurve(Strict):
    """Closed C2 periodic cubic spline through the points, mm."""

    type: Literal["spline"]
    points: Points

    def closed_curve(self) -> ClosedCurve:
        """Return the curve."""
        return curves.through(self.points)


class EllipseCurve(Strict):
    """Ellipse: centre and semi-axes in mm, angle of the first semi-axis from +x in degrees."""

    type: Literal["ellipse"]
    center: Point
    semi_axes: tuple[Thickness, Thickness]
    angle_deg: float

    def closed_curve(self) -> ClosedCurve:
        """Return the curve."""
        return curves.ellipse(self.center, self.semi_axes, self.angle_deg)


class OffsetCurve(Strict):
    """Another curve moved along its inward normal by the thickness of the named layers."""

    type: Literal["offset"]
    of: str
    law: Literal["skin", "skin+fat"]


Curve = Annotated[SplineCurve | EllipseCurve | OffsetCurve, Field(discriminator="type")]


class Layers(Strict):
    """Thickness of skin, mm, and of fat, (polar angle in degrees, mm) at several angles."""

    skin_thickness: Thickness
    fat_thickness: Annotated[tuple[tuple[float, Thickness], ...], Field(min_length=2)]

    @field_validator("fat_thickness")
    @classmethod
    def _angles_increase(cls, value: tuple[tuple[float, float], ...]) -> object:
        angles = [angle for angle, _ in value]
        if not (0 <= angles[0] and angles[-1] < 360):
            raise ValueError("angles must lie in 0 <= angle < 360 degrees")
        if any(b <= a for a, b in pairwise(angles)):
            raise ValueError("angles must increase from pair to pair")
        return value

    def inward(self, law: str) -> curves.Distance:
        """Return how far outward (so negative) the curve under the named layers lies."""
        if law == "skin":
            return lambda points: np.full(len(points), -self.skin_thickness)
        angles, thickness = np.array(self.fat_thickness).T
        # Two turns more than one make the interpolation, which is local, periodic.
        fat = PchipInterpolator(
            np.concatenate([angles - 360, angles, angles + 360]), np.tile(thickness, 3)
        )
        return lambda points: -(self.skin_thickness + fat(polar_angle(points)))


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

    @staticmethod
    @cache
    def reference() -> "Limb":
        """Return the calf of the package (a right leg, seen from above)."""
        return Limb.read(Path(__file__).with_name("calf.json"))

    @classmethod
    def read(cls, path: Path | str) -> Self:
        """Read a limb from a JSON file such as ``meshes/calf.json``.

        Raises
        ------
        InputError
            When the file cannot be read, a key is wrong, or curves touch, cross or are not nested
            as the regions say.
        """
        return read_json(Path(path), cls)

    @model_validator(mode="after")
    def _consistent(self) -> "Limb":
        for problem in self._problems():
            raise ValueError(problem)
        _check_nesting(self)
        return self

    def _problems(self) -> Iterator[str]:
        """Yield what is wrong between the parts, the first reason first."""
        for name, curve in self.curves.items():
            if isinstance(curve, OffsetCurve):
                if curve.of not in self.curves:
                    hint = nearest(curve.of, self.curves)
                    yield f"curves.{name}.of: no curve '{curve.of}'; {hint}"
                elif isinstance(self.curves[curve.of], OffsetCurve):
                    yield (
                        f"curves.{name}.of: '{curve.of}' is itself an offset; name the curve that"
                        " it is made from"
                    )
        names = [region.name for region in self.regions]
        for key in ("id", "name"):
            counts = Counter(getattr(region, key) for region in self.regions)
            for value in (value for value, count in counts.items() if count > 1):
                yield f"regions: {key} {value} is used by two regions; make it unique"
        for region in self.regions:
            place = f"regions.{region.name}"
            if region.id >= tags.SOCKET_ID:
                yield f"{place}.id: {region.id} is reserved; choose one below {tags.SOCKET_ID}"
            if region.name == tags.SOCKET:
                yield f"{place}.name: reserved for the socket; choose another"
        owner: dict[str, str] = {}
        hole_of: dict[str, str] = {}
        for region in self.regions:
            place = f"regions.{region.name}"
            for loop in region.loops:
                if loop not in self.curves:
                    yield f"{place}: no curve '{loop}'; {nearest(loop, self.curves)}"
            for loop in region.holes:
                if loop in hole_of:
                    yield f"{place}.holes: '{loop}' is already a hole of {hole_of[loop]}"
                hole_of[loop] = region.name
            if region.outer in owner:
                outer, other = region.outer, owner[region.outer]
                yield f"{place}.outer: '{outer}' is already the outer curve of {other}"
            owner[region.outer] = region.name
            for other in (*region.adjacent, *region.across_fascia):
                if other not in names:
                    yield f"{place}: no region '{other}'; {nearest(other, names)}"
        # A hole is filled by another region, or by nothing where the limb is constrained.
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

    @property
    def tissues(self) -> dict[str, str]:
        """Region name -> tissue."""
        return {region.name: region.tissue for region in self.regions}

    @property
    def region_tags(self) -> dict[str, int]:
        """Region name -> tag of its cells, without the socket."""
        return {region.name: region.id for region in self.regions}


def limb_curves(limb: Limb) -> dict[str, ClosedCurve]:
    """Return the curves that bound regions, by name; unused ones of the file are left out."""
    used = {name for region in limb.regions for name in region.loops}

    def make(name: str) -> ClosedCurve:
        curve = limb.curves[name]
        if isinstance(curve, OffsetCurve):
            return curves.offset(make(curve.of), limb.layers.inward(curve.law))
        return curve.closed_curve()

    return {name: make(name) for name in limb.curves if name in used}


def _check_nesting(limb: Limb) -> None:
    """Raise an InputError unless curves are simple, disjoint and nested as the regions say."""
    loops = limb_curves(limb)
    for name, curve in loops.items():
        if curve.area <= 0:
            raise InputError(f"curves.{name}: runs clockwise; reverse its points")
        crossing = curves.crossing_of(curve)
        if crossing is not None:
            raise InputError(
                f"curves.{name}: crosses itself at {at(crossing)}; move its points apart"
            )
    samples = {name: curve.evaluate(curve.sample(SAMPLE_STEP)) for name, curve in loops.items()}
    bodies = {name: shapely.Polygon(points) for name, points in samples.items()}
    if not shapely.contains_xy(bodies[limb.contact_boundary], 0.0, 0.0):
        raise InputError(
            f"curves.{limb.contact_boundary}: does not enclose the origin, about which"
            " angles are measured; shift all curves so that it does"
        )
    trees = {name: cKDTree(points) for name, points in samples.items()}
    for name, other in combinations(samples, 2):
        gaps = trees[name].query(samples[other], distance_upper_bound=MIN_GAP)[0]
        if gaps.min() < MIN_GAP:
            raise InputError(
                f"curves.{name}: comes within {gaps.min():.3f} mm of '{other}' at"
                f" {at(samples[other][np.argmin(gaps)])}; keep curves {MIN_GAP} mm apart"
            )

    def inside(name: str, other: str) -> bool:
        # Curves that do not touch lie inside one another wholly or not at all: one point decides.
        return bool(shapely.contains_xy(bodies[other], *samples[name][0]))

    for region in limb.regions:
        place = f"regions.{region.name}"
        for hole in region.holes:
            if not inside(hole, region.outer):
                raise InputError(f"{place}: hole '{hole}' is not inside '{region.outer}'")
        for hole, other in permutations(region.holes, 2):
            if inside(hole, other):
                raise InputError(f"{place}: hole '{hole}' lies inside hole '{other}'")
