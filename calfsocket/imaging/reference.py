"""The reference limb taken apart: what lies in what, and how thick what lies between is."""

from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np
import shapely
from scipy.spatial import cKDTree
from shapely.geometry.base import BaseGeometry

from calfsocket.imaging.landmarks import Ring
from calfsocket.imaging.shapes import largest, outside, polygon
from calfsocket.meshes.curves import Array
from calfsocket.meshes.limb import Limb, Region, limb_curves

#: A belly's compartment ends this far from it, mm; over the medial face of the tibia is none.
REACH = 2.5
#: What is left around the place of a bone that has ended, and half a septum through it, mm.
SHEATH, HALF_SEPTUM = 1.0, 0.35
#: Distance of points on bellies from which compartments are found, and along compartments, mm.
_SITES, _EDGE = 0.15, 0.4


@dataclass(frozen=True)
class Compartment:
    """A belly with the connective tissue around it, up to the middle of its septa, or to a bone.

    Attributes
    ----------
    edge : Array
        Points on its boundary, mm, (n, 2).
    width : Array
        Their distances from the belly, mm, (n,): half a septum, a whole crural fascia.
    on : tuple of str
        The curve of the envelope or of a bone on which each lies, or "".
    """

    edge: Array
    width: Array
    on: tuple[str, ...]


@dataclass(frozen=True)
class Reference:
    """A limb of skin, fat, fascia, and bellies, bones and vessels in the fascia."""

    limb: Limb
    rings: dict[str, Ring]  #: by curve
    skin: Region
    fat: Region
    fascia: Region
    bones: dict[str, Region]
    bellies: dict[str, Region]
    inlays: dict[str, Region]  #: vessels and tendons between the bellies
    veins: dict[str, Region]  #: vessels in the fat
    absent: tuple[Ring, ...] = ()  #: bones that the section does not have

    @staticmethod
    @cache
    def calf() -> "Reference":
        """Return the calf of the package."""
        return Reference.of(Limb.reference())

    @staticmethod
    def of(limb: Limb) -> "Reference":
        """Take a limb apart."""
        by_outer = {region.outer: region for region in limb.regions}
        skin = by_outer[limb.contact_boundary]
        (fat,) = (by_outer[hole] for hole in skin.holes)
        inside = [by_outer[hole] for hole in fat.holes]
        (fascia,) = (region for region in inside if region.tissue == "fascia")
        deep = [by_outer[hole] for hole in fascia.holes]

        def named(regions: list[Region], *tissues: str) -> dict[str, Region]:
            return {each.name: each for each in regions if each.tissue in tissues}

        return Reference(
            limb, {name: Ring.of(curve) for name, curve in limb_curves(limb).items()},
            skin, fat, fascia,
            bones=named(deep, "bone"),
            bellies=named(deep, "muscle"),
            inlays=named(deep, "vessel", "fascia"),
            veins=named(inside, "vessel"),
        )  # fmt: skip

    def ring(self, region: str) -> Ring:
        """Return the outer boundary of a region."""
        every = {each.name: each for each in self.limb.regions}
        return self.rings[every[region].outer]

    @property
    def skin_ring(self) -> Ring:
        """Return the surface of the skin."""
        return self.rings[self.skin.outer]

    @property
    def envelope(self) -> Ring:
        """Return the outer boundary of the fascia around the muscles."""
        return self.rings[self.fascia.outer]

    @cached_property
    def skin_thickness(self) -> float:
        """Mean distance between the faces of the skin, mm."""
        inner = self.rings[self.fat.outer].points
        face = shapely.LinearRing(self.skin_ring.points)
        return float(np.mean(shapely.distance(shapely.points(inner), face)))

    @cached_property
    def fat_thickness(self) -> float:
        """Mean distance of the muscles' envelope from the inner face of the skin, mm."""
        return float(self.depth(self.skin_ring.even(360)).mean()) - self.skin_thickness

    def depth(self, s: Array) -> Array:
        """Return the distance of the muscles' envelope from places on the skin, mm."""
        envelope = shapely.LinearRing(self.envelope.points)
        return np.asarray(shapely.distance(shapely.points(self.skin_ring.at(s)), envelope))

    def depth_of_bone(self, s: Array) -> Array:
        """Return the distance of the nearest bone from places on the skin, mm."""
        points = shapely.points(self.skin_ring.at(s))
        rings = [shapely.LinearRing(self.ring(name).points) for name in self.bones]
        return np.min([np.asarray(shapely.distance(points, ring)) for ring in rings], axis=0)

    def without(self, bone: str) -> "Reference":
        """Return the same limb where a bone has ended: the bellies around it fill its place."""
        bones = {name: region for name, region in self.bones.items() if name != bone}
        return replace(self, bones=bones, absent=(*self.absent, self.ring(bone)))

    @cached_property
    def compartments(self) -> dict[str, Compartment]:
        """Divide what lies between envelope and bones among the bellies, each point to the nearest.

        Vessels and tendons between bellies belong to no compartment: there the septum is as wide
        as they need.
        """
        sites, owners = [], []
        for name in self.bellies:
            ring = self.ring(name)
            sites.append(ring.at(ring.even(int(ring.length / _SITES))))
            owners += [name] * len(sites[-1])
        points = np.concatenate(sites)
        walls = {name: self.ring(name) for name in self.bones} | {self.fascia.name: self.envelope}
        room: BaseGeometry = polygon(self.envelope)
        for name in self.bones:
            room = room.difference(polygon(self.ring(name)))
        filled = shapely.union_all([polygon(ring).buffer(SHEATH) for ring in self.absent])
        tiles = np.asarray(shapely.get_parts(shapely.voronoi_polygons(shapely.multipoints(points))))
        site, tile = shapely.STRtree(tiles).query(shapely.points(points), predicate="intersects")
        found = {}
        for name in self.bellies:
            mine = np.unique(tile[np.array(owners)[site] == name])
            near = polygon(self.ring(name)).buffer(REACH).union(filled)
            whole = largest(shapely.union_all(tiles[mine]).intersection(room).intersection(near))
            found[name] = _compartment(whole, self.ring(name), walls, filled)
        return found


def _compartment(
    whole: shapely.Polygon, belly: Ring, walls: dict[str, Ring], filled: BaseGeometry
) -> Compartment:
    ring = Ring(outside(whole))
    edge = ring.at(ring.even(int(ring.length / _EDGE)))
    on = np.full(len(edge), "", dtype=object)
    for name, wall in walls.items():
        on[cKDTree(wall.points).query(edge)[0] < _EDGE / 2] = name
    width = np.asarray(shapely.distance(shapely.points(edge), shapely.LinearRing(belly.points)))
    width[shapely.contains_xy(filled, *edge.T)] = HALF_SEPTUM
    return Compartment(edge, width, tuple(on))
