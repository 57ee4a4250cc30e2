"""A section of a source: its outlines as smooth curves in the anatomical frame."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, count

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from calfsocket.imaging.anatomy import Anatomy
from calfsocket.imaging.layers import NOTCH
from calfsocket.imaging.outlines import Outline, SectionOutlines
from calfsocket.imaging.plane import Cut, Level, Plane, cut
from calfsocket.imaging.shapes import curve_around, largest, rounded
from calfsocket.imaging.source import Source
from calfsocket.imaging.surface import Shell
from calfsocket.io.errors import InputError, error_context
from calfsocket.meshes import curves
from calfsocket.meshes.curves import Array, xy
from calfsocket.meshes.fairing import FEWEST, fair_each, noise_of
from calfsocket.meshes.frame import Frame

#: Largest distance, mm, of the curves from a surface, unless said otherwise or it is noisy:
#: then so many times its noise, which one vertex in 16 000 exceeds, and no more than the last, mm.
#: Within less a curve would have to follow the noise.
TOLERANCE, _NOISES, _NOISIEST = 0.2, 4.0, 0.5
#: Root mean square of the distances of a curve from the steps of voxels that it went through, in
#: voxels: 0.16 to 0.25 for the outlines of the reference calf.
_STEPS = 0.18
#: Smallest radius of curvature, mm, that is tried for a curve, one after the other until it stays
#: within the tolerance. A skin bends less than a bone: 15 mm in the reference calf, whose bones
#: bend by 2 mm; what bends more is noise. A socket's wall of 4.5 mm needs 5 mm.
SKIN_RADII, RADII = (20.0, 10.0, 5.0, 2.0, 1.0), (2.0, 1.0)
#: A curve that leaves the data so many times further than the next one, which bends more, has
#: missed some of the shape: for noise alone the factor is 1.1 to 1.6.
_SHAPE = 2.0
#: Distance of the knots, mm.
_KNOTS = 1.0
#: A second part of a bone or of the skin with more than this share of the area of the first is no
#: debris.
_SECOND_PART = 0.05
#: A hole in a bone with more than this share of its area is its marrow cavity.
_CAVITY = 0.1
#: A bone with a smaller area than this, mm^2, ends there: elements of it would be a handful.
_TIP = 20.0
#: Parts of muscles and vessels with a smaller area than this, mm^2, are left out.
_CRUMB = 1.0
#: Distance of the points, mm, by which outlines with few vertices are followed.
_STEP = 0.5


@dataclass(frozen=True)
class Section:
    """A section of a source.

    Attributes
    ----------
    outlines : SectionOutlines
        What it consists of.
    data : mapping of str to Array
        The outlines as the source has them, mm, in the section's axes, by name.
    names : str
        Of the source's files.
    files : mapping of str to str
        Their names and hashes.
    plane : Plane, optional
        Where it lies; its origin is that of the outlines. None where the section was drawn.
    level : Level, optional
        Along the limb; None where a plane was given.
    height, height_mm : float, optional
        Share of the source's height from its distal end, and the same in mm.
    tolerance : float
        Largest distance of the curves from the data, mm.
    remarks : sequence of str
        How it was found, and what was left out.
    """

    outlines: SectionOutlines
    data: Mapping[str, Array]
    names: str
    files: Mapping[str, str]
    plane: Plane | None
    level: Level | None
    height: float | None
    height_mm: float | None
    tolerance: float
    remarks: Sequence[str]

    @property
    def where(self) -> str:
        """Say where in the source it lies; empty where it was drawn."""
        if self.level:
            return f"level {self.level}"
        return "a plane" if self.plane else ""

    @property
    def title(self) -> str:
        """Name it for reports."""
        return f"{self.names}, {self.where}" if self.where else self.names


def section(
    source: Source,
    anatomy: Anatomy,
    level: Level | None,
    plane: tuple[Sequence[float], Sequence[float]] | None = None,
    tolerance: float | None = None,
) -> Section:
    """Cut a source.

    Parameters
    ----------
    level
        Where along the limb, square to its axis.
    plane
        A point of the plane, mm in the source's axes, and its normal, instead of a level.
    tolerance
        Largest distance of the curves from the data, mm; default: `TOLERANCE`, more where the
        surface is noisier than that; of a label map half a voxel.

    Raises
    ------
    InputError
        When the outline of a part is open there, in several parts, or not where it must be.
    """
    where, height, height_mm = _place(source, anatomy, level, plane)
    voxel = source.resolution(np.stack([where.x, where.y]))
    # Labels are noisy in places by a voxel: what half a voxel does not allow is reported.
    most = voxel if tolerance is None else None
    tolerance_by_noise = tolerance is None
    if tolerance is None:
        tolerance = voxel / 2 or TOLERANCE
    check_tolerance(tolerance)
    at = f"{source.names}, level {level}" if level else f"{source.names}, the plane"
    skin = _body(_cut(source.skin, where, at, "skin"), at, "skin")
    if skin is None:
        raise InputError(f"{at}: does not meet the skin; choose a level inside the limb")
    bodies: dict[str, shapely.Polygon] = {}
    bones: list[str] = []
    cavities: dict[str, shapely.Polygon] = {}
    remarks: list[str] = []
    for name, shell in source.bones.items():
        body = _body(_cut(shell, where, at, name), at, name)
        if body is None:
            continue
        if body.area < _TIP:
            remarks.append(f"{name}: its tip of {body.area:.0f} mm2 is left out")
            continue
        bones.append(name)
        bodies[name] = shapely.Polygon(body.exterior)
        holes = sorted((shapely.Polygon(hole) for hole in body.interiors), key=lambda h: -h.area)
        if name in source.cavities:
            inner = _body(_cut(source.cavities[name], where, at, f"cavity of {name}"), at, name)
            holes = [shapely.Polygon(inner.exterior)] if inner else []
        if holes and holes[0].area > _CAVITY * bodies[name].area:
            cavities[name] = holes[0]
    _check_bones(source, anatomy, at, bones)
    regions: dict[str, tuple[str, shapely.Polygon]] = {}
    for name, (tissue, shell) in source.regions.items():
        found = _cut(shell, where, at, name).bodies
        for part, number in parts([body.area for body in found], name, remarks):
            regions[part] = (tissue, shapely.Polygon(found[number].exterior))
    muscle = None
    if source.muscle is not None:
        muscle = _envelope(_cut(source.muscle, where, at, "muscle"), voxel, at, remarks)
    whole = shapely.Polygon(skin.exterior)
    for name, body in bodies.items():
        if not whole.contains(body):
            out = np.array(body.difference(whole).centroid.coords[0])
            raise InputError(
                f"{at}: {name} leaves the skin by {body.hausdorff_distance(body & whole):.2g} mm"
                f" near {xy(out - _centroid(whole))}; correct the surfaces, or choose another level"
            )
    centre = _centroid(whole)
    data: dict[str, Array] = {}

    def outline(name: str, body: shapely.Polygon, within: float) -> Outline:
        points = counter_clockwise(body) - centre
        data[name] = points
        radii = SKIN_RADII if name in ("skin", "muscle") else RADII
        where = f"{at}, {name}"
        if voxel:
            found, why = smooth_outline(points, within, where, radii, _STEPS * voxel, most), ""
        else:
            noise = noise_of(distinct(points), _KNOTS) if tolerance_by_noise else 0.0
            within = max(within, min(_NOISES * noise, _NOISIEST))
            found = of_surface(points, within, where, radii, strict=not tolerance_by_noise)
            why = f" (noise of {noise:.2f} mm)"
        if found.deviation_mm > tolerance:
            remarks.append(f"{name}: leaves the data by {found.deviation_mm:.2f} mm{why}")
        return found

    def belly(name: str, body: shapely.Polygon) -> Outline:
        """Of a muscle or vessel; spurs are cut off where no smooth curve follows them."""
        try:
            return outline(name, body, tolerance)
        except InputError:
            return blunt(data[name])

    front = "anterior" if anatomy.anterior is not None else None
    lateral = {"right": "lateral", "left": "medial", None: None}[anatomy.side]
    outlines = SectionOutlines(
        skin=outline("skin", whole, tolerance),
        bones={name: outline(name, bodies[name], tolerance) for name in bones},
        cavities={
            name: outline(f"cavity of {name}", body, _MOST_TOLERANCE)
            for name, body in cavities.items()
        },
        muscle_envelope=outline("muscle", muscle, tolerance) if muscle else None,
        skin_thickness=_skin_thickness(source, whole, where, at),
        regions={name: (tissue, belly(name, body)) for name, (tissue, body) in regions.items()},
        frame=Frame(lateral, front) if front and lateral else Frame(),  # type: ignore[arg-type]
        side=anatomy.side,
    )
    shifted = Plane(where.origin + centre[0] * where.x + centre[1] * where.y, where.x, where.y)
    return Section(
        outlines=outlines,
        data=data,
        names=source.names,
        files=source.files,
        plane=shifted,
        level=level,
        height=height,
        height_mm=height_mm,
        tolerance=tolerance,
        remarks=(*source.remarks, *anatomy.found, *remarks),
    )


#: mm. A curve further away from the data than this shows another limb.
_MOST_TOLERANCE = 5.0


def check_tolerance(tolerance: float) -> None:
    """Raise an InputError unless curves can be kept within a tolerance, mm."""
    if not 0 < tolerance <= _MOST_TOLERANCE:
        raise InputError(
            f"tolerance: is {tolerance:g} mm; it must be more than 0, at most {_MOST_TOLERANCE:g}"
        )


def _place(
    source: Source,
    anatomy: Anatomy,
    level: Level | None,
    plane: tuple[Sequence[float], Sequence[float]] | None,
) -> tuple[Plane, float, float]:
    """Return the plane of a section, its share of the height, and its height in mm."""
    low, high = anatomy.low, anatomy.high
    if plane is None:
        assert level is not None
        with error_context(source.names):
            height = level.height(low, high)
        return anatomy.plane(height), (height - low) / (high - low), height - low
    origin, normal = (np.asarray(each, dtype=float) for each in plane)
    normal = normal / np.linalg.norm(normal)
    if abs(normal @ anatomy.axis) < _STEEPEST:
        raise InputError(
            f"{source.names}, plane: lies along the limb, not across it; its normal is"
            f" {np.degrees(np.arccos(abs(normal @ anatomy.axis))):.0f} degrees from the axis"
        )
    normal = normal * np.sign(normal @ anatomy.axis)
    height = float((origin - anatomy.centre) @ anatomy.axis - low)
    return Plane.square_to(normal, origin, anatomy.anterior), height / (high - low), height


#: Cosine of the largest angle between the normal of a section and the limb's axis: 45 degrees.
_STEEPEST = 0.7


def _cut(shell: Shell, plane: Plane, at: str, name: str) -> Cut:
    found = cut(shell.surface, plane)
    if found.gap:
        assert found.place is not None
        raise InputError(
            f"{at}: the outline of {name} is open by {found.gap:.3g} mm near"
            f" {xyz(plane, found.place)} (a hole or the rim of the surface); choose a level where"
            " it is closed, or close it"
        )
    return found


def xyz(plane: Plane, flat: Array) -> str:
    """Return a place of a plane in the source's axes for messages."""
    x, y, z = np.round(plane.origin + flat[0] * plane.x + flat[1] * plane.y, 1) + 0.0
    return f"({x:g}, {y:g}, {z:g}) mm"


def _body(found: Cut, at: str, name: str) -> shapely.Polygon | None:
    """Return the one body that a part must be; None where it is not met."""
    if not found.bodies:
        return None
    first, *others = found.bodies
    second = [other for other in others if other.area > _SECOND_PART * first.area]
    if second:
        areas = ", ".join(f"{each.area:.0f}" for each in (first, *second))
        raise InputError(
            f"{at}: {name} is in {len(second) + 1} parts there ({areas} mm2); choose a level where"
            " it is in one"
        )
    return first


def parts(
    areas: Sequence[float], name: str, remarks: list[str], taken: Collection[str] = ()
) -> Iterator[tuple[str, int]]:
    """Yield names for the parts of a muscle or vessel, and their indices, the largest first.

    Parameters
    ----------
    areas
        Of the parts, mm^2; crumbs are left out, which is added to the remarks.
    taken
        Names that other regions have.
    """
    crumbs = [area for area in areas if area < _CRUMB]
    if crumbs:
        what = "1 part of" if len(crumbs) == 1 else f"{len(crumbs)} parts of together"
        remarks.append(f"{name}: {what} {sum(crumbs):.2g} mm2 left out")
    numbered = (f"{name}_{number}" for number in count(2))
    names = chain([name], (each for each in numbered if each not in taken))
    for index in np.argsort(-np.array(areas), kind="stable"):
        if areas[index] >= _CRUMB:
            yield next(names), int(index)


def _envelope(found: Cut, voxel: float, at: str, remarks: list[str]) -> shapely.Polygon | None:
    """Return what lies around all muscles.

    Of a label map it is around all deep labels; gaps between them are of the fascia.
    """
    if not voxel or not found.bodies:
        return _body(found, at, "muscle")
    return around_all([shapely.Polygon(body.exterior) for body in found.bodies], remarks, voxel)


def around_all(
    bodies: Sequence[BaseGeometry], remarks: list[str], steps: float = 0.0
) -> shapely.Polygon:
    """Return what lies around muscles and bones, their narrow gaps closed.

    Notches no deeper than `steps`, mm, are those of voxels and stay: filled, they would move an
    envelope outward by 0.03 mm at voxels of 0.35 to 1 mm.
    """
    filled = shapely.union_all(bodies)
    closed = largest(filled.buffer(NOTCH).buffer(-NOTCH))
    gaps = shapely.get_parts(closed.difference(filled))
    corners, of = shapely.get_coordinates(gaps, return_index=True)
    depth = np.zeros(len(gaps))
    np.maximum.at(depth, of, shapely.distance(shapely.points(corners), closed.exterior))
    gaps = gaps[depth > steps]
    added = float(shapely.area(gaps).sum())
    if added > _CRUMB:
        remarks.append(f"muscle: gaps of {added:.0f} mm2 between muscles closed")
    return shapely.Polygon(largest(shapely.union_all([filled, *gaps])).exterior)


def _skin_thickness(source: Source, whole: shapely.Polygon, where: Plane, at: str) -> float | None:
    """Return the mean thickness of a skin that is a layer of the source, mm."""
    if source.skin_inner is None:
        return None
    found = _cut(source.skin_inner, where, at, "skin's inner face")
    if not found.bodies:
        return None
    inner = shapely.union_all([shapely.Polygon(body.exterior) for body in found.bodies])
    return mean_thickness(whole, inner)


def mean_thickness(whole: BaseGeometry, inner: BaseGeometry) -> float:
    """Return the mean thickness of a skin, mm, of its two faces."""
    return float(whole.difference(inner).area / shapely.convex_hull(whole).length)


def _check_bones(source: Source, anatomy: Anatomy, at: str, bones: Sequence[str]) -> None:
    """Raise an InputError where the source has a tibia but the level misses it."""
    tibia = source.bones.get("tibia")
    if tibia is None or "tibia" in bones:
        return
    heights = (tibia.surface.points - anatomy.centre) @ anatomy.axis
    size = anatomy.high - anatomy.low
    low, high = ((value - anatomy.low) / size for value in (heights.min(), heights.max()))
    met = f", which meets {' and '.join(bones)}" if bones else ""
    raise InputError(
        f"{at}: lies beyond the tibia{met}; the tibia is between {low:.2f} and {high:.2f} of the"
        " height"
    )


def _centroid(body: shapely.Polygon) -> Array:
    return np.array(body.centroid.coords[0])


def counter_clockwise(body: shapely.Polygon) -> Array:
    """Return the corners of a body's outer boundary, each once."""
    points: Array = shapely.get_coordinates(body.exterior)[:-1]
    if not body.exterior.is_ccw:
        points = points[::-1]
    # Where VTK begins depends on how the surface lies: begin at the one that is furthest right.
    return np.roll(points, -int(np.argmax(points[:, 0])), axis=0)


def distinct(points: Array) -> Array:
    """Return the points of a surface's outline that were measured, one for each vertex.

    All triangles at a vertex near the plane are cut near it. Such points have the same error, and
    cross-validation would take it for shape: points closer than half a knot become one. The outline
    comes back as it is where too few would be left.
    """
    sides = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)
    rolled = np.roll(points, -int(np.argmax(sides)) - 1, axis=0)
    along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(rolled, axis=0), axis=1)))
    starts = [0]
    for number, place in enumerate(along):
        if place - along[starts[-1]] >= _KNOTS / 2:
            starts.append(number)
    if len(starts) < FEWEST:
        return points
    return np.asarray(np.add.reduceat(rolled, starts) / np.diff([*starts, len(points)])[:, None])


def of_surface(
    points: Array, tolerance: float, at: str, radii: Sequence[float], strict: bool
) -> Outline:
    """Return the smooth curve near the outline of a surface, and its distance from all of that.

    Of the points that are not distinct, some may be further away than the tolerance, unless it is
    `strict`.
    """
    found = smooth_outline(distinct(points), tolerance, at, radii)
    line = shapely.LinearRing(found.curve.evaluate(found.curve.sample(0.05)))
    away = float(np.max(shapely.distance(shapely.points(points), line)))
    if strict and away > tolerance:
        return smooth_outline(points, tolerance, at, radii)
    return replace(found, deviation_mm=max(found.deviation_mm, away))


def blunt(points: Array) -> Outline:
    """Return a curve around a muscle or vessel whose spurs are cut off."""
    body = shapely.make_valid(shapely.Polygon(points))
    cut_off = rounded(body, min(RADII[-1], 0.3 * np.sqrt(body.area / np.pi)))
    away = float(shapely.hausdorff_distance(cut_off, body))
    return Outline(curve_around(cut_off), deviation_mm=away)


def smooth_outline(
    points: Array,
    tolerance: float,
    at: str,
    radii: Sequence[float] = RADII,
    noise: float = 0.0,
    most: float | None = None,
) -> Outline:
    """Return the smooth curve within a tolerance, mm, of a closed polygon.

    Parameters
    ----------
    at
        What it is, for errors.
    radii
        Smallest radii of curvature, mm, in the order in which they are tried.
    noise
        Root mean square of its steps, mm, where they come from voxels.
    most
        What is allowed, mm, where no smooth curve stays within the tolerance.
    """
    ring = shapely.LinearRing(points)
    if len(points) < FEWEST:  # of a coarse surface: its sides are what is known
        step = min(max(_STEP, ring.length / 400), ring.length / (2 * FEWEST))
        points = shapely.get_coordinates(ring.segmentize(step))[:-1]
    trials = fair_each(points, tolerance, noise, radii, _KNOTS)
    smooth, deviation, place = next(trials)
    for closer in trials:
        if deviation <= min(tolerance, _SHAPE * closer[1]):
            break
        smooth, deviation, place = closer
    if deviation > tolerance and most and most > tolerance:
        return smooth_outline(points, most, at, radii, noise)
    if deviation > tolerance:
        enough = np.ceil(20 * deviation) / 20
        raise InputError(
            f"{at}: a smooth curve leaves the outline by {deviation:.2f} mm at {xy(place)}, more"
            f" than the tolerance, {tolerance:g} mm; add --tolerance {enough:g},"
            " or smooth the surface"
        )
    return Outline(curves.through(smooth), deviation_mm=deviation)
