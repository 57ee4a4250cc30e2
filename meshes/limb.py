"""A limb as data: closed curves and the regions between them, read and checked."""

import re
from collections import Counter
from collections.abc import Iterator, Mapping
from functools import cache
from itertools import combinations, count, pairwise, permutations
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
import shapely
from pydantic import (
    Field,
    PositiveFloat,
    PositiveInt,
    SerializerFunctionWrapHandler,
    field_validator,
    model_serializer,
    model_validator,
)
from scipy.spatial import cKDTree

from calfsocket.io.errors import InputError
from calfsocket.io.files import kind_of, write_json
from calfsocket.io.schema import Strict, nearest, read_json
from calfsocket.meshes import curves, tags
from calfsocket.meshes.curves import (
    Array,
    ClosedCurve,
    Point,
    Points,
    Thickness,
    at,
    polar_angle,
)
from calfsocket.meshes.frame import Direction, Frame, View
from calfsocket.meshes.given import GivenMesh

Tissue = Literal["skin", "fat", "fascia", "muscle", "bone", "vessel"]
Units = Literal["mm, deg"]
Origin = Literal["measured", "atlas", "assumed"]
#: Curves closer than this, mm, are taken for touching: no element would fit between them.
MIN_GAP = 0.1
#: Distance of the points at which curves are compared, mm.
SAMPLE_STEP = 0.1
#: By how much a region's area may differ from what the file says: a share, for it may have been
#: measured on the polygon through the points, and mm^2 more for an area written to a tenth.
AREA_TOLERANCE, AREA_DIGIT = 0.05, 0.05
#: Anatomical angles, degrees, from and to which the fibula lies about the tibia: it is lateral and
#: further back, at -38 degrees in the reference calf; the rest allows for axes that are turned.
FIBULA = 270.0, 15.0


class SplineCurve(Strict):
    """Closed C2 periodic cubic spline through the points, mm, in either direction."""

    type: Literal["spline"]
    points: Points

    def closed_curve(self) -> ClosedCurve:
        """Return the curve, counter-clockwise: mirrored limbs have theirs clockwise."""
        clockwise = not shapely.LinearRing(self.points).is_ccw
        return curves.through(self.points[:1] + self.points[:0:-1] if clockwise else self.points)


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
        from scipy.interpolate import PchipInterpolator

        angles, thickness = np.array(self.fat_thickness).T
        # Two turns more than one make the interpolation, which is local, periodic.
        fat = PchipInterpolator(
            np.concatenate([angles - 360, angles, angles + 360]), np.tile(thickness, 3)
        )
        return lambda points: -(self.skin_thickness + fat(polar_angle(points)))


class Region(Strict):
    """What lies inside the outer curve and outside the holes, or the triangles of its number.

    A limb with a mesh of its own needs no outer curves.

    The number `id` is the next free one unless given. An `area`, mm^2, is compared with that of the
    curves, so that a slip in a point is found. Where the limb was made from a source, `origin` says
    whether the source has the region or where else it comes from, and `deviation_mm` how far its
    outer curve is from the source's points at most.
    """

    id: PositiveInt
    name: Annotated[str, Field(pattern=r"^[a-z0-9_]+$")]
    tissue: Tissue
    area: PositiveFloat | None = None
    outer: str = ""
    holes: tuple[str, ...] = ()
    origin: Origin | None = None
    deviation_mm: Annotated[float, Field(ge=0)] | None = None

    @property
    def loops(self) -> tuple[str, ...]:
        """Names of all curves that bound the region, the outer one first."""
        return tuple(name for name in (self.outer, *self.holes) if name)


class Provenance(Strict):
    """Where a limb was made from.

    Attributes
    ----------
    files : mapping of str to str
        Names of the source's files, and their hashes (SHA-256).
    level : str, optional
        Where the section lies, as it was asked for.
    height : float
        The same as a share of the source's height, 0 distal and 1 proximal.
    height_mm : float
        The same in mm from the distal end.
    origin, normal, anterior : tuple of float
        The section's origin, mm, its normal to the proximal end and its +y, in the source's axes.
    tolerance_mm : float
        Largest distance of the curves from the source's points.
    program : str
        What made it, with its version.
    found, assumed, notes : tuple of str
        How side and directions were found; what the source does not have; where layers are thinner
        than in the atlas, and what was changed to fit.
    """

    files: dict[str, str]
    level: str | None = None
    height: float | None = None
    height_mm: float | None = None
    origin: tuple[float, float, float] | None = None
    normal: tuple[float, float, float] | None = None
    anterior: tuple[float, float, float] | None = None
    tolerance_mm: float
    program: str
    found: tuple[str, ...] = ()
    assumed: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


#: Keys that files of earlier versions have and from which nothing follows: of a limb, of a region.
_REMARKS = ("curve_types", "fat_law", "topology"), (
    "latin", "side", "target_area", "adjacent", "across_fascia",
)  # fmt: skip
_SIDE = re.compile(r"(l|left|r|right)\b(?:.*\b(above|proximal|below|distal)\b)?.*", re.IGNORECASE)


class Limb(Strict):
    """A transverse section of a limb: named closed curves, and the regions between them.

    Attributes
    ----------
    title : str
        For reports.
    side : {"left", "right"}, optional
        Of the body.
    seen_from : {"above", "below"}, optional
        From where the section is seen; that is above the end of the limb at the trunk.
    axes : mapping
        What ``"+x"`` and ``"+y"`` point to: lateral, anterior, medial or posterior. They decide
        what is called medial and where a socket's reliefs lie (`frame`).
    fixed_boundary, contact_boundary : str
        The curves where the limb is fixed, and of the skin.
    layers : Layers, optional
        Needed by curves that are offsets.
    curves : mapping
        By name.
    regions : tuple of Region
        What is meshed.
    remarks : tuple of str
        Keys of the file that nothing is computed from (`notices` names them).
    source : Provenance, optional
        What it was made from.
    mesh : GivenMesh, optional
        A mesh that was made elsewhere and is solved as it is. Its regions need no curves; the
        curve of the skin is what sockets are made for.
    """

    title: str = "A limb"
    units: Units
    side: Literal["left", "right"] | None = None
    seen_from: View | None = None
    axes: dict[str, Direction] = Field(default_factory=dict)
    fixed_boundary: str
    contact_boundary: str
    layers: Layers | None = None
    curves: dict[str, Curve]
    regions: Annotated[tuple[Region, ...], Field(min_length=1)]
    remarks: tuple[str, ...] = ()
    source: Provenance | None = None
    mesh: GivenMesh | None = None

    @model_serializer(mode="wrap")
    def _without_empty(self, dumped: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Leave out what few limbs have, so that the others are written as before."""
        content: dict[str, Any] = dumped(self)
        if content.get("mesh", self) is None:
            del content["mesh"]
        return content

    @model_validator(mode="before")
    @classmethod
    def _as_in_earlier_files(cls, data: Any) -> Any:
        """Set remarks apart, read a side such as "left leg seen from above", number regions."""
        if not isinstance(data, dict):
            return data
        if "levels" in data and "curves" not in data:
            raise ValueError(
                "lists the levels of a limb; name one of the sections that it lists, or use it as"
                " `limb` of a study"
            )
        data, found = dict(data), []
        regions = data.get("regions")
        if isinstance(regions, list | tuple) and all(isinstance(each, dict) for each in regions):
            regions = data["regions"] = [dict(each) for each in regions]
            taken = [each["id"] for each in regions if "id" in each]
            free = (number for number in count(1) if number not in taken)
            for each in regions:
                found += [
                    f"regions.{key}" for key in _REMARKS[1] if each.pop(key, None) is not None
                ]
                each.setdefault("id", next(free))
        found += [key for key in _REMARKS[0] if data.pop(key, None) is not None]
        if isinstance(data.get("axes"), dict) and "origin" in data["axes"]:
            data["axes"] = {key: data["axes"][key] for key in data["axes"] if key != "origin"}
            found.append("axes.origin")
        if found:
            data["remarks"] = tuple(dict.fromkeys(found))
        side = _SIDE.fullmatch(data["side"]) if isinstance(data.get("side"), str) else None
        if side:
            data["side"] = "left" if side[1].lower().startswith("l") else "right"
            if side[2]:
                from_above = side[2].lower() in ("above", "proximal")
                data.setdefault("seen_from", "above" if from_above else "below")
        elif data.get("side") in ("", "unknown"):
            del data["side"]
        return data

    @field_validator("axes")
    @classmethod
    def _two_axes(cls, value: dict[str, Direction]) -> dict[str, Direction]:
        if value and set(value) != {"+x", "+y"}:
            raise ValueError("give '+x' and '+y', or leave the axes out where they are not known")
        Frame(value.get("+x"), value.get("+y"))
        return value

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
        path = Path(path)
        if kind := kind_of(path):
            raise InputError(
                f"{path}: is {kind}; a limb is a JSON file, which `python3 -m calfsocket limb`"
                " makes of scans, label maps, outlines and meshes: see its --help"
            )
        return read_json(path, cls)

    def write(self, path: Path | str) -> None:
        """Write the limb so that `read` gives it back."""
        path = Path(path)
        if path.suffix != ".json":
            raise InputError(f"{path}: limbs are JSON files; use a name that ends in .json")
        write_json(path, self.model_dump(mode="json", exclude_defaults=True))

    @model_validator(mode="after")
    def _consistent(self) -> "Limb":
        # Pydantic asks again where a limb becomes a part of another model: the same parts are
        # checked once. They are noted outside the fields, so that equal limbs stay equal.
        parts = [id(getattr(self, name)) for name in type(self).model_fields]
        if self.__dict__.get("_checked") == parts:
            return self
        for problem in self._problems():
            raise ValueError(problem)
        loops = limb_curves(self)
        _check_nesting(self, loops)
        _check_areas(self, loops)
        _check_frame(self, loops)
        self.__dict__["_checked"] = parts
        return self

    def _problems(self) -> Iterator[str]:
        """Yield what is wrong between the parts, the first reason first."""
        for name, curve in self.curves.items():
            if isinstance(curve, OffsetCurve):
                if self.layers is None:
                    yield f"layers: is missing, but curves.{name} is an offset; add it"
                if curve.of not in self.curves:
                    hint = nearest(curve.of, self.curves)
                    yield f"curves.{name}.of: no curve '{curve.of}'; {hint}"
                elif isinstance(self.curves[curve.of], OffsetCurve):
                    yield (
                        f"curves.{name}.of: '{curve.of}' is itself an offset; name the curve that"
                        " it is made from"
                    )
        for key in ("id", "name"):
            counts = Counter(getattr(region, key) for region in self.regions)
            for value in (value for value, uses in counts.items() if uses > 1):
                yield f"regions: {key} {value} is used by two regions; make it unique"
        for region in self.regions:
            place = f"regions.{region.name}"
            if region.id >= tags.SOCKET_ID:
                yield f"{place}.id: {region.id} is reserved; choose one below {tags.SOCKET_ID}"
            if region.name in (tags.SOCKET, tags.LINER):
                yield f"{place}.name: reserved for the socket; choose another"
        if self.mesh is not None:
            yield from self._mesh_problems(self.mesh)
            return
        owner: dict[str, str] = {}
        hole_of: dict[str, str] = {}
        for region in self.regions:
            place = f"regions.{region.name}"
            if not region.outer:
                yield f"{place}.outer: is missing; add it"
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

    def _mesh_problems(self, mesh: GivenMesh) -> Iterator[str]:
        """Yield what of a mesh of its own does not fit the regions."""
        if self.contact_boundary not in self.curves:
            yield f"contact_boundary: no curve '{self.contact_boundary}'; add that of the skin"
        for name in (tags.SKIN_SURFACE, tags.TIBIA_MEDULLARY):
            if name not in mesh.boundaries:
                yield f"mesh.boundaries: '{name}' is missing; import the mesh again"
        numbers = {int(number) for number in np.unique(mesh.cell_tags)}
        known = {region.id: region.name for region in self.regions}
        for number in sorted(numbers - set(known)):
            yield f"mesh.regions: has triangles of a region {number}, which is not listed"
        for number in sorted(set(known) - numbers):
            yield f"regions.{known[number]}: has no triangles; remove it"

    @property
    def tissues(self) -> dict[str, str]:
        """Region name -> tissue."""
        return {region.name: region.tissue for region in self.regions}

    @property
    def region_tags(self) -> dict[str, int]:
        """Region name -> tag of its cells, without the socket."""
        return {region.name: region.id for region in self.regions}

    @property
    def frame(self) -> Frame:
        """Where lateral and anterior are."""
        return Frame(self.axes.get("+x"), self.axes.get("+y"))

    @property
    def skin(self) -> ClosedCurve:
        """The curve of the skin's surface."""
        return _curve(self, self.contact_boundary)

    @property
    def areas(self) -> dict[str, float]:
        """Region name -> area between its curves, or of its triangles, mm^2."""
        return _areas(self, limb_curves(self))

    def bodies(self, step: float) -> dict[str, shapely.Polygon | shapely.MultiPolygon]:
        """Return the area of each region, its curves sampled every `step` mm."""
        if self.mesh is not None:
            return {region.name: self.mesh.body(region.id) for region in self.regions}
        loops = {name: c.evaluate(c.sample(step)) for name, c in limb_curves(self).items()}
        return {
            region.name: shapely.Polygon(
                loops[region.outer], [loops[hole] for hole in region.holes]
            )
            for region in self.regions
        }

    def hard_edges(self, step: float) -> Array:
        """Return pieces of the outlines of what does not give way, shape (n, 2, 2), mm.

        Of bones and where the limb is fixed; curves are sampled every `step` mm.
        """
        if self.mesh is not None:
            bones = [each.id for each in self.regions if each.tissue == "bone"]
            return np.concatenate([self.mesh.outline(bones), self.mesh.edges(tags.TIBIA_MEDULLARY)])
        hard = [region.outer for region in self.regions if region.tissue == "bone"]
        edges = [_curve(self, name) for name in (*hard, self.fixed_boundary)]
        points = [curve.evaluate(curve.sample(step)) for curve in edges]
        return np.concatenate(
            [np.stack([each, np.roll(each, -1, axis=0)], axis=1) for each in points]
        )

    def notices(self) -> Iterator[str]:
        """Yield what whoever wrote the file should know, a line each; nothing is wrong with it."""
        if not self.frame.known:
            place = _fibula(self, limb_curves(self))
            wrong = place is not None and not _can_be_fibula(self.frame, place)
            x, y = _likely_axes(self, place)
            yield (
                "no axes are given, so sides are called +x and +y, and angles of sockets count"
                " from +x counter-clockwise"
                + (", which by the fibula is not lateral by anterior" if wrong else "")
                + f'; add e.g. "axes": {{"+x": "{x}", "+y": "{y}"}}'
            )
        elif self.side and not self.seen_from and self.frame.view(self.side) == "below":
            yield f"with these axes it is a {self.side} limb seen from below"
        if self.mesh is not None:
            of = f"that of {', '.join(self.source.files)}" if self.source else "its own"
            yield f"its mesh, {len(self.mesh.cell_tags)} triangles, is {of}, solved as it is"
        if self.remarks:
            yield f"nothing is computed from {', '.join(self.remarks)}"
        used = {name for region in self.regions for name in region.loops}
        used |= {self.contact_boundary}
        used |= {each.of for each in self.curves.values() if isinstance(each, OffsetCurve)}
        if unused := [name for name in self.curves if name not in used]:
            yield f"curves that bound no region: {', '.join(unused)}"


def _curve(limb: Limb, name: str) -> ClosedCurve:
    curve = limb.curves[name]
    if isinstance(curve, OffsetCurve):
        assert limb.layers is not None  # or the limb would have been refused
        return curves.offset(_curve(limb, curve.of), limb.layers.inward(curve.law))
    return curve.closed_curve()


def limb_curves(limb: Limb) -> dict[str, ClosedCurve]:
    """Return the curves that bound regions, by name; unused ones of the file are left out."""
    used = {name for region in limb.regions for name in region.loops} | {limb.contact_boundary}
    return {name: _curve(limb, name) for name in limb.curves if name in used}


def _areas(limb: Limb, loops: Mapping[str, ClosedCurve]) -> dict[str, float]:
    if limb.mesh is not None:
        of = limb.mesh.areas
        return {region.name: of[region.id] for region in limb.regions}
    return {
        region.name: loops[region.outer].area - sum(loops[hole].area for hole in region.holes)
        for region in limb.regions
    }


def _check_areas(limb: Limb, loops: Mapping[str, ClosedCurve]) -> None:
    """Raise an InputError where a region is not as large as the file says."""
    areas = _areas(limb, loops)
    for region in limb.regions:
        drawn = areas[region.name]
        if region.area and abs(drawn - region.area) > AREA_DIGIT + AREA_TOLERANCE * drawn:
            raise InputError(
                f"regions.{region.name}.area: is {region.area:g} mm^2, but its curves enclose"
                f" {drawn:.1f}; correct the curves, or leave `area` out"
            )


def _check_frame(limb: Limb, loops: Mapping[str, ClosedCurve]) -> None:
    """Raise an InputError where side, axes and the place of the fibula contradict each other."""
    frame = limb.frame
    if not frame.known:
        return
    axes = f"+x is {limb.axes['+x']} and +y {limb.axes['+y']}"
    if limb.side and limb.seen_from and frame.view(limb.side) != limb.seen_from:
        raise InputError(
            f"axes: {axes}, which is a {limb.side} limb seen from {frame.view(limb.side)}, not from"
            f" {limb.seen_from}; correct axes, side or seen_from"
        )
    if (place := _fibula(limb, loops)) is not None and not _can_be_fibula(frame, place):
        raise InputError(
            f"axes: {axes}, so that the fibula would lie {frame.direction(*place)} of the tibia,"
            " but in every leg it is lateral and further back; correct axes (and side), or mirror"
            " the curves"
        )


def _fibula(limb: Limb, loops: Mapping[str, ClosedCurve]) -> Array | None:
    """Return the way from the tibia to the fibula, where the limb has both."""
    middle = {
        name: _middle(limb, region, loops)
        for region in limb.regions
        for name in ("tibia", "fibula")
        if region.tissue == "bone" and name in region.name
    }
    return middle["fibula"] - middle["tibia"] if len(middle) == 2 else None


def _middle(limb: Limb, region: Region, loops: Mapping[str, ClosedCurve]) -> Array:
    if limb.mesh is not None:
        return np.array(limb.mesh.body(region.id).centroid.coords[0])
    outer = loops[region.outer]
    return np.mean(outer.evaluate(outer.sample(1.0)), axis=0)


def _can_be_fibula(frame: Frame, place: Array) -> bool:
    first, last = FIBULA
    angle = float(frame.angle(place))
    return angle >= first or angle <= last


def _likely_axes(limb: Limb, fibula: Array | None) -> tuple[Direction, Direction]:
    """Return axes that agree with what is known of a limb, anterior up where that is possible."""
    upright: list[tuple[Direction, Direction]] = [
        ("lateral", "anterior"),
        ("medial", "anterior"),
        ("lateral", "posterior"),
        ("medial", "posterior"),
    ]
    for x, y in upright + [(y, x) for x, y in upright]:
        frame = Frame(x, y)
        seen = limb.side is None or frame.view(limb.side) == (limb.seen_from or "above")
        if seen and (fibula is None or _can_be_fibula(frame, fibula)):
            return x, y
    return upright[0]


def _apart(box: tuple[Array, Array], other: tuple[Array, Array]) -> bool:
    """Whether curves are `MIN_GAP` apart by their boxes, (least, most), already."""
    between = np.maximum(box[0] - other[1], other[0] - box[1])
    return bool(between.max() >= MIN_GAP)


def _check_nesting(limb: Limb, loops: Mapping[str, ClosedCurve]) -> None:
    """Raise an InputError unless curves are simple, disjoint and nested as the regions say."""
    for name, curve in loops.items():
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
    if limb.mesh is not None:
        return
    trees = {name: cKDTree(points) for name, points in samples.items()}
    boxes = {name: (points.min(axis=0), points.max(axis=0)) for name, points in samples.items()}
    for name, other in combinations(samples, 2):
        if _apart(boxes[name], boxes[other]):
            continue
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
