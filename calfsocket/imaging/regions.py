"""The regions of a section below its skin, filled in from the atlas one after the other."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import combinations
from typing import Any

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from calfsocket.imaging import inlays
from calfsocket.imaging.aligned import AlignedSection
from calfsocket.imaging.correspondence import Correspondence
from calfsocket.imaging.inlays import CLEARANCE, IN_FAT
from calfsocket.imaging.landmarks import Ring
from calfsocket.imaging.layers import ENVELOPE_RADIUS, Layers
from calfsocket.imaging.outlines import Outline
from calfsocket.imaging.reference import Compartment, Reference
from calfsocket.imaging.shapes import band, curve_around, curve_of, largest, polygon, rounded
from calfsocket.imaging.smooth_map import SmoothMap, best_affine
from calfsocket.io.errors import InputError
from calfsocket.meshes.curves import Point
from calfsocket.meshes.limb import Limb, Origin, Region

#: Smallest radius, mm, of the corners of a belly (1.2 in the calf) and of a marrow cavity.
BELLY_RADIUS, CAVITY_RADIUS = 1.0, 1.0
#: Areas, mm^2, and widths, mm, below which a region is not meshed.
SMALLEST_AREA, SMALLEST_WIDTH = 1.0, 0.5
#: What lies between vessels that the source has, mm, at least.
BETWEEN_VESSELS = 0.3
#: Least crural fascia and sheath of bones over a belly, mm: in the atlas 0.74 and 0.54.
OVER_BELLY = 0.5
#: Cortex that a marrow cavity from the atlas leaves, mm.
LEAST_CORTEX = 1.2
#: The source has all muscles if the room in which another would fit is less than this share of the
#: envelope. Of one that it lacks as much as the second share must be free.
COMPLETE, LEAST_BELLY = 0.05, 0.3
#: Muscles of a source that have this share of the smaller one in common are a mistake.
OVERLAP = 0.2
#: What is lost of a belly between its neighbours is told from this share on.
LOST = 0.05


@dataclass(frozen=True)
class RegionOrigin:
    """Where a region's outer curve comes from, and how far the source's points are from it, mm."""

    origin: Origin
    deviation_mm: float = 0.0


@dataclass
class Regions:
    """Areas in the atlas's axes, and what they were made from.

    Attributes
    ----------
    atlas, section, bones, layers, smooth, found
        The reference limb, the section with its bones and layers, the map between both, and the
        points from which it was made.
    septum : float
        Between bellies that the source has, mm, where they touch.
    curves : dict
        Points of the curves in the section's axes, by name.
    origin : dict of str to RegionOrigin
        By region.
    warnings : list of str
        What was changed or left out.
    """

    atlas: Reference
    section: AlignedSection
    bones: Mapping[str, Ring]
    layers: Layers
    smooth: SmoothMap
    found: Correspondence
    septum: float
    curves: dict[str, tuple[Point, ...]] = field(default_factory=dict)
    origin: dict[str, RegionOrigin] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._bodies = {name: polygon(ring) for name, ring in self.bones.items()}
        self._envelope = polygon(self.layers.envelope_ring)
        self._inner = polygon(Ring.of(self.layers.skin_inner))
        self._extra: dict[str, tuple[str, bool]] = {}
        self._given = self._given_bodies()
        self._lost: dict[str, float] = {}
        self._fill()
        if self._lost:
            shares = ", ".join(f"{name} {share:.1%}" for name, share in self._lost.items())
            self.warnings.append(
                f"septa of {self.septum:.2g} mm and fascia were cut out of what the source has:"
                f" {shares}"
            )

    def _fill(self) -> None:
        outlines, atlas = self.section.outlines, self.atlas
        self._measured(atlas.skin, outlines.skin)
        self.curves[atlas.fat.outer] = self.section.points(self.layers.skin_inner)
        self.origin[atlas.fat.name] = RegionOrigin("atlas")
        self._fill_bones()
        in_fat = self._fill_veins()
        self._fill_envelope(in_fat)
        between = self._fill_inlays()
        self._fill_bellies(between, in_fat)

    # ----- what the source has

    def _given_bodies(self) -> dict[str, shapely.Polygon]:
        """Return the areas of further regions of the source, apart from each other and the rest."""
        given = {}
        for name, (tissue, _) in self.section.outlines.regions.items():
            body = given[name] = polygon(self.section.rings[name])
            deep = self._envelope.contains(body.centroid)
            known = {**self.atlas.bellies, **self.atlas.inlays, **self.atlas.veins}
            if name not in known:
                self._extra[name] = tissue, deep
        self._check_overlaps(given)
        found = {}
        for name, body in given.items():
            free: BaseGeometry = body
            if self._envelope.contains(body.centroid):
                free = free.intersection(self._envelope.buffer(-OVER_BELLY))
            else:
                free = free.intersection(self._inner.buffer(-IN_FAT))
            for bone in self._bodies.values():
                free = free.difference(bone.buffer(OVER_BELLY))
            for other, next_to in given.items():
                if other != name:
                    free = free.difference(_margin(body, self._tissue(name), next_to,
                                                   self._tissue(other), self.septum))  # fmt: skip
            found[name] = body if free.equals(body) else _without_holes(free)
        return found

    def _check_overlaps(self, given: Mapping[str, shapely.Polygon]) -> None:
        """Raise an InputError where muscles of the source lie in one another."""
        muscles = [each for each in given.items() if self._tissue(each[0]) == "muscle"]
        for (name, body), (other, another) in combinations(muscles, 2):
            both = body.intersection(another)
            if both.area > OVERLAP * min(body.area, another.area):
                place = self.section.at(np.array(both.centroid.coords[0]))
                raise InputError(
                    f"{name} and {other} overlap by {both.area:.3g} mm2 at {place}; correct the"
                    " outlines"
                )

    def _tissue(self, name: str) -> str:
        return self.section.outlines.regions[name][0]

    def _measured(self, region: Region, outline: Outline) -> None:
        """Take a curve of the source as it is."""
        curve = outline.curve
        points = curve.evaluate(curve.knots[:-1])
        self.curves[region.outer] = tuple((float(x), float(y)) for x, y in points)
        origin: Origin = "measured" if outline.origin == "measured" else "assumed"
        self.origin[region.name] = RegionOrigin(origin, outline.deviation_mm)

    def _fill_given(self, region: Region) -> shapely.Polygon | None:
        """Take a further region of the source, as it is or cut back, and return its area."""
        outline = self.section.outlines.regions[region.name][1]
        body, original = self._given[region.name], polygon(self.section.rings[region.name])
        if body is original or body.equals(original):
            self._measured(region, outline)
            return body
        self._lost[region.name] = 1 - body.area / original.area
        body = rounded(body, BELLY_RADIUS if region.tissue == "muscle" else SMALLEST_WIDTH)
        if not self._fill_area(region, body, RegionOrigin("measured")):
            return None
        away = outline.deviation_mm + float(original.hausdorff_distance(body))
        self.origin[region.name] = RegionOrigin("measured", away)
        return body

    def _fill_area(self, region: Region, body: shapely.Polygon, origin: RegionOrigin) -> bool:
        """Take an area as a region, if it can be meshed."""
        if body.area < SMALLEST_AREA or body.buffer(-SMALLEST_WIDTH / 2).is_empty:
            left = f"{body.area:.1f} mm^2 of it would remain" if body.area else "nothing remains"
            self.warnings.append(f"{region.name} is left out: {left} between its neighbours")
            return False
        smooth = curve_of if region.tissue == "vessel" else curve_around
        self.curves[region.outer] = self.section.points(smooth(body))
        self.origin[region.name] = origin
        return True

    # ----- bones

    def _fill_bones(self) -> None:
        outlines, atlas = self.section.outlines, self.atlas
        for name, region in atlas.bones.items():
            if name in outlines.bones:
                self._measured(region, outlines.bones[name])
            else:
                curve = curve_around(self._bodies[name])
                self.curves[region.outer] = self.section.points(curve)
                self.origin[name] = RegionOrigin("assumed")
            for hole in region.holes:
                self._fill_cavity(name, hole)
        for name in outlines.cavities:
            if name in atlas.bones and not atlas.bones[name].holes:
                self.warnings.append(f"the marrow cavity of the {name} is not used: it is solid")

    def _fill_cavity(self, bone: str, hole: str) -> None:
        if bone in self.section.outlines.cavities:
            curve = self.section.outlines.cavities[bone].curve
            points = curve.evaluate(curve.knots[:-1])
            self.curves[hole] = tuple((float(x), float(y)) for x, y in points)
            return
        affine = best_affine(self.found.source[bone], self.found.target[bone])
        moved = polygon(Ring(affine(self.atlas.rings[hole].points)))
        within = rounded(
            moved.intersection(self._bodies[bone].buffer(-LEAST_CORTEX)), CAVITY_RADIUS
        )
        if within.area < SMALLEST_AREA:
            raise InputError(
                f"{bone}: has no room for a marrow cavity, where the limb is fixed; correct the"
                " outline, or give the cavity"
            )
        self.curves[hole] = self.section.points(curve_around(within))

    # ----- vessels and tendons

    def _fill_veins(self) -> dict[str, shapely.Polygon]:
        """Place the vessels in the fat."""
        found: dict[str, shapely.Polygon] = {}
        measured = self.section.outlines.muscle_envelope is not None
        hard = [self._envelope] if measured else [
            body.buffer(OVER_BELLY + IN_FAT) for body in self._bodies.values()
        ]  # fmt: skip
        hard += [body.buffer(CLEARANCE) for body in self._given.values()]
        for name, region in self._regions(self.atlas.veins, "vein").items():
            if name in self._given:
                body = self._fill_given(region)
            else:
                wanted = inlays.below_skin(
                    self.atlas.ring(name), self.atlas, self.found, self.layers.thickness
                )
                body = inlays.in_fat(wanted, self._inner, shapely.union_all(hard))
                if body is None:
                    self.warnings.append(f"{name} is left out: the fat is too thin for it")
                    continue
                if body.area < 0.99 * wanted.area:
                    self.warnings.append(
                        f"{name} has {body.area:.1f} mm^2 instead of {wanted.area:.1f}: the fat is"
                        " thin"
                    )
                if not self._fill_area(region, body, RegionOrigin("atlas")):
                    body = None
            if body is not None:
                found[name] = body
        return found

    def _fill_envelope(self, veins: Mapping[str, shapely.Polygon]) -> None:
        """Take the muscles' envelope, which gives way to veins where the fat is thinner."""
        region, outline = self.atlas.fascia, self.section.outlines.muscle_envelope
        if outline is not None:
            self._measured(region, outline)
            away = outline.deviation_mm + self.layers.moved
            if self.layers.moved > 0:
                self.curves[region.outer] = self.section.points(self.layers.envelope)
                self.warnings.append(
                    f"the muscles' envelope was moved by up to {self.layers.moved:.1f} mm, to"
                    " have the bones in it and room for the skin"
                )
            self.origin[region.name] = RegionOrigin(self.origin[region.name].origin, away)
            return
        dents = shapely.union_all([vein.buffer(IN_FAT) for vein in veins.values()])
        if dents.intersects(self._envelope):
            dented = rounded(self._envelope.difference(dents), ENVELOPE_RADIUS)
            kept = [
                body.buffer(OVER_BELLY) for body in (*self._given.values(), *self._bodies.values())
            ]
            inside = shapely.union_all(kept).intersection(self._envelope)
            self._envelope = largest(dented.union(inside))
        self.curves[region.outer] = self.section.points(curve_around(self._envelope))
        self.origin[region.name] = RegionOrigin("atlas")

    def _fill_inlays(self) -> dict[str, shapely.Polygon]:
        """Place vessels and tendons between the bellies."""
        regions = self._regions(self.atlas.inlays, "inlay")
        found = {}
        for name in [name for name in regions if name in self._given]:
            body = self._fill_given(regions.pop(name))
            if body is not None:
                found[name] = body
        fixed = dict(self._given)
        wanted = {name: inlays.carried(self.atlas.ring(name), self.smooth) for name in regions}
        for name, body in inlays.apart(wanted, self._envelope, self._bodies, fixed).items():
            if body.area < 0.99 * wanted[name].area:
                self.warnings.append(
                    f"{name} has {body.area:.1f} mm^2 instead of {wanted[name].area:.1f}: there is"
                    " little room"
                )
            if self._fill_area(regions.pop(name), body, RegionOrigin("atlas")):
                found[name] = body
        if regions:
            self.warnings.append(
                f"left out, for there is no room between their neighbours: {', '.join(regions)}"
            )
        return found

    def _regions(self, own: Mapping[str, Region], kind: str) -> dict[str, Region]:
        """Return the regions of a kind, those of the source that the atlas lacks included."""
        first = max(region.id for region in self.atlas.limb.regions) + 1
        extra = {}
        for number, (name, (tissue, deep)) in enumerate(self._extra.items(), start=first):
            its_kind = "vein" if not deep else "belly" if tissue == "muscle" else "inlay"
            if its_kind == kind:
                extra[name] = Region.model_validate(
                    {"id": number, "name": name, "tissue": tissue, "outer": name}
                )
        return dict(own) | extra

    # ----- bellies

    def _fill_bellies(
        self, between: Mapping[str, shapely.Polygon], in_fat: Mapping[str, shapely.Polygon]
    ) -> None:
        """Shrink each compartment by the connective tissue around its belly."""
        regions = self._regions(self.atlas.bellies, "belly")
        taken = [body.buffer(CLEARANCE) for body in between.values()]
        taken += [body.buffer(OVER_BELLY) for body in self._bodies.values()]
        taken += [body.buffer(IN_FAT + OVER_BELLY) for body in in_fat.values()]
        for name in [name for name in regions if name in self._given]:
            body = self._fill_given(regions.pop(name))
            if body is not None:
                taken.append(body.buffer(self.septum))
        room = self._envelope.buffer(-OVER_BELLY).difference(shapely.union_all(taken))
        given = [name for name in self._given if self._tissue(name) == "muscle"]
        if given and room.buffer(-BELLY_RADIUS).area < COMPLETE * self._envelope.area:
            if regions:
                self.warnings.append(
                    "the muscles of the source fill the envelope: none of the atlas's is added"
                )
            return
        for name, region in regions.items():
            carried = self._belly(self.atlas.compartments[name])
            whole = carried.intersection(room)
            if given and whole.area < LEAST_BELLY * carried.area:
                self.warnings.append(
                    f"{name} is left out: {whole.area / carried.area:.0%} of it would remain"
                    " between the muscles of the source"
                )
                continue
            body = rounded(_without_holes(whole), BELLY_RADIUS)
            if self._fill_area(region, body, RegionOrigin("atlas")):
                lost = 1 - body.area / whole.area
                if lost > LOST:
                    self.warnings.append(
                        f"{name} is narrow in places: {lost:.0%} of it is left to the fascia"
                    )

    def _belly(self, compartment: Compartment) -> BaseGeometry:
        edge = self.smooth(compartment.edge)
        walls = dict(self.bones) | {self.atlas.fascia.name: self.layers.envelope_ring}
        on = np.array(compartment.on)
        for name, wall in walls.items():
            touching = on == name
            edge[touching] = wall.at(wall.nearest(edge[touching]))
        return polygon(Ring(edge)).difference(band(edge, compartment.width))

    # ----- all of it

    def limb(self, title: str) -> Limb:
        """Return the limb; its own checks apply."""
        atlas, outlines = self.atlas, self.section.outlines
        own = [*atlas.limb.regions]
        own += [region for kind in ("belly", "inlay", "vein")
                for region in self._regions({}, kind).values()]  # fmt: skip
        kept = [region for region in own if region.name in self.origin]
        extra = {
            name: region for region in (atlas.fat, atlas.fascia)
            for name in [each for each, (_, deep) in self._extra.items()
                         if deep == (region is atlas.fascia)]
        }  # fmt: skip
        regions: list[dict[str, Any]] = []
        for region in kept:
            holes = [hole for hole in region.holes if hole in self.curves]
            holes += [name for name, parent in extra.items()
                      if parent is region and name in self.curves]  # fmt: skip
            regions.append(
                {"id": region.id, "name": region.name, "tissue": region.tissue,
                 "outer": region.outer, "holes": holes, **vars(self.origin[region.name])}
            )  # fmt: skip
        frame = outlines.frame
        content: dict[str, Any] = {
            "title": title,
            "units": "mm, deg",
            "axes": {"+x": frame.x, "+y": frame.y},
            "fixed_boundary": atlas.limb.fixed_boundary,
            "contact_boundary": atlas.limb.contact_boundary,
            "curves": {
                name: {"type": "spline", "points": points} for name, points in self.curves.items()
            },
            "regions": regions,
        }
        if outlines.side:
            content |= {"side": outlines.side, "seen_from": frame.view(outlines.side)}
        return Limb(**content)


def _margin(
    body: shapely.Polygon, tissue: str, other: shapely.Polygon, its_tissue: str, septum: float
) -> BaseGeometry:
    """Return what a region of the source leaves free around another one that is too close.

    Of two muscles each leaves half of what lacks of a septum; a muscle leaves room for a vessel,
    and not the reverse.
    """
    muscles = (tissue == "muscle", its_tissue == "muscle")
    gap, wanted = body.distance(other), septum if any(muscles) else BETWEEN_VESSELS
    if gap >= wanted or muscles == (False, True):
        return shapely.Polygon()
    return other.buffer(wanted if muscles == (True, False) else (wanted + gap) / 2)


def _without_holes(area: BaseGeometry) -> shapely.Polygon:
    """Cut an area open from each hole to the nearest place outside, so that it has none."""
    main = largest(area)
    for hole in main.interiors:
        cut = shapely.shortest_line(main.exterior, hole).buffer(CLEARANCE)
        main = largest(main.difference(cut).difference(shapely.Polygon(hole)))
    return main
