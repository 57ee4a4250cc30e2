"""Which point of the atlas is which point of the section, and the smooth map that follows."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import shapely

from calfsocket.imaging.landmarks import Ring, in_order, slid, turned
from calfsocket.imaging.reference import Reference
from calfsocket.imaging.shapes import polygon
from calfsocket.imaging.smooth_map import SmoothMap, ThinPlate, best_affine, fitted
from calfsocket.meshes.curves import Array

#: Numbers of corresponding points on the skin and around the muscles, and on the bones.
OUTER_POINTS = 60
BONE_POINTS = {"tibia": 40, "fibula": 16}
#: Distance of corresponding points on a belly that the source has, mm, and how loosely they hold:
#: its own outline is used anyway, and its neighbours' may contradict it by the width of a septum.
BELLY_STEP, BELLY_SLACK = 6.0, 2e-3
#: How loosely the skin holds where it alone places the bones: these are no copy of its bumps.
SKIN_SLACK = 1e-2
#: Distance of the points at which folds are looked for, mm.
SAMPLE_STEP = 1.0
#: What lies on a curve is at most this far from the polygon that stands for it, mm.
_ON_EDGE = 0.05
#: Share of the atlas's soft tissue over a bone that is left where the skin alone places it.
LEAST_COVER = 0.5


@dataclass(frozen=True)
class Correspondence:
    """Points of the atlas, and where they lie on the curves of a section.

    Attributes
    ----------
    source : dict of str to Array
        Points of the atlas by curve, mm, in their order around.
    rings : dict of str to Ring
        The curves of the section.
    along : dict of str to Array
        Arc lengths on these, mm.
    turn : float
        By how much the section is turned against the atlas, rad.
    """

    source: dict[str, Array]
    rings: dict[str, Ring]
    along: dict[str, Array]
    turn: float

    @property
    def target(self) -> dict[str, Array]:
        """Where the points of the atlas lie in the section, mm."""
        return {name: ring.at(self.along[name]) for name, ring in self.rings.items()}

    def on_skin(self, s: Array, atlas: Ring) -> Array:
        """Return the arc lengths on the section's skin of those on the atlas's, mm."""
        return _carried(s, atlas.even(OUTER_POINTS), atlas, self.along["skin"], self.rings["skin"])

    def on_skin_of_atlas(self, s: Array, atlas: Ring) -> Array:
        """Return the arc lengths on the atlas's skin of those on the section's, mm."""
        return _carried(s, self.along["skin"], self.rings["skin"], atlas.even(OUTER_POINTS), atlas)


def around_bones(
    atlas: Reference, name: str, outer: Ring, bones: dict[str, Ring]
) -> Correspondence:
    """Find corresponding points of bones and of the ``skin``, or the muscles' ``envelope``.

    By how much the section is turned is the mean of what the direction from tibia to fibula and the
    shape of the tibia say. Points of the outer curve begin in the same directions from its centroid
    and slide from there.
    """
    own = {each: atlas.ring(each) for each in bones}
    turn = 0.0
    if "fibula" in own:
        before, after = (
            complex(*(each["fibula"].centroid - each["tibia"].centroid)) for each in (own, bones)
        )
        turn = float(np.angle(after / before))
    along, of_tibia = turned(own["tibia"], bones["tibia"], turn, BONE_POINTS["tibia"])
    turn = (turn + of_tibia) / 2 if "fibula" in own else of_tibia
    reference = _outer(atlas)[name]
    source = {name: reference.at(reference.even(OUTER_POINTS))}
    start = {name: outer.by_angle(source[name], reference.centroid, turn)}
    for bone, ring in own.items():
        source[bone] = ring.at(ring.even(BONE_POINTS[bone]))
        start[bone] = (
            along if bone == "tibia" else bones[bone].by_angle(source[bone], ring.centroid, turn)
        )
    rings = {name: outer, **bones}
    return Correspondence(source, rings, slid(source, rings, start), turn)


def with_layers(
    found: Correspondence, atlas: Reference, skin: Ring, envelope: Ring, bellies: dict[str, Ring]
) -> Correspondence:
    """Add points of the other outer curve, and of bellies that the source has.

    Points of skin and envelope face each other as they do in the atlas. Those of envelope, bones
    and bellies slide once more, without the skin: how thick the fat is says nothing of the muscles.
    """
    rings = {"skin": skin, "envelope": envelope, **found.rings}
    reference = _outer(atlas)
    source = {each: ring.at(ring.even(OUTER_POINTS)) for each, ring in reference.items()}
    (known,) = source.keys() & found.source.keys()
    (other,) = source.keys() - {known}
    there = _facing(reference[known], source[other], rings[known], found.along[known])
    along = {**found.along, other: in_order(rings[other], there)}
    source |= found.source
    for name, ring in bellies.items():
        own = atlas.ring(name)
        number = max(int(own.length / BELLY_STEP), 8)
        source[name], rings[name] = own.at(own.even(number)), ring
        along[name] = turned(own, ring, found.turn, number)[0]
    deep = [name for name in source if name != "skin"]
    along |= slid({name: source[name] for name in deep}, rings, along)
    if other == "skin":
        there = _facing(reference[known], source[other], rings[known], along[known])
        along[other] = in_order(skin, there)
    return Correspondence(source, rings, along, found.turn)


def _outer(atlas: Reference) -> dict[str, Ring]:
    return {"skin": atlas.skin_ring, "envelope": atlas.envelope}


def _facing(reference: Ring, points: Array, ring: Ring, along: Array) -> Array:
    """Return where the places of a reference curve to which points are nearest lie on a ring."""
    near = reference.nearest(points)
    return ring.at(_carried(near, reference.even(len(along)), reference, along, ring))


def _carried(s: Array, here: Array, ring: Ring, there: Array, other: Ring) -> Array:
    """Return the arc lengths on another ring that correspond to some on a ring.

    `here` and `there` are corresponding ones, in their order around.
    """
    first = int(np.argmin(np.mod(here, ring.length)))
    x = np.unwrap(np.roll(np.mod(here, ring.length), -first), period=ring.length)
    y = np.unwrap(np.roll(there, -first), period=other.length)
    x = np.concatenate([x[-1:] - ring.length, x, x[:1] + ring.length])
    y = np.concatenate([y[-1:] - other.length, y, y[:1] + other.length])
    return np.mod(np.interp(np.mod(s, ring.length), x, y), other.length)


def smooth_map(
    found: Correspondence, atlas: Reference, at: Callable[[Array], str]
) -> tuple[SmoothMap, Array]:
    """Return the map of all that lies within the envelope, and its determinants at points of it.

    These are `SAMPLE_STEP` apart all over the atlas's envelope, and on all curves in it. Skin and
    fat are layers of their own and not mapped: thick fat does not stretch the muscles.
    """
    deep = [name for name in found.source if name != "skin"]
    target = found.target
    slack = [
        np.full(len(target[name]), BELLY_SLACK if name in atlas.bellies else 0.0) for name in deep
    ]
    source = np.concatenate([found.source[name] for name in deep])
    ends = np.concatenate([target[name] for name in deep])
    return fitted(source, ends, _samples(atlas), np.concatenate(slack), at)


def _samples(atlas: Reference) -> Array:
    edge = polygon(atlas.envelope)
    low, high = atlas.envelope.points.min(axis=0), atlas.envelope.points.max(axis=0)
    axes = [np.arange(low[i], high[i], SAMPLE_STEP) for i in (0, 1)]
    grid = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    curves = [ring.at(ring.even(int(ring.length / SAMPLE_STEP))) for ring in atlas.rings.values()]
    points = np.concatenate([grid, *curves])
    inside = shapely.contains_xy(edge.buffer(_ON_EDGE), *points.T)
    return np.asarray(points[inside])


def bones_by_skin(atlas: Reference, skin: Ring, landmarks: dict[str, float]) -> dict[str, Ring]:
    """Place the atlas's bones by the skin's shape.

    Parameters
    ----------
    atlas : Reference
        The atlas.
    skin : Ring
        The section's skin.
    landmarks : dict of str to float
        Anatomical angles, degrees, of ``crest`` and ``fibular_head`` where they are known.

    Returns
    -------
    dict of str to Ring
        Moved, turned and scaled, not bent, unless they would then come too near to the skin.
    """
    own = atlas.skin_ring
    points = own.at(own.even(OUTER_POINTS))
    angle = np.rad2deg(np.arctan2(*(points - own.centroid).T[::-1]))
    turn = np.zeros(OUTER_POINTS)
    if landmarks:
        here = landmark_angles(atlas)
        known = sorted((here[name], _wrap(landmarks[name] - here[name])) for name in landmarks)
        turn = np.deg2rad(
            np.interp(angle, [x for x, _ in known], [y for _, y in known], period=360.0)
        )
    target = skin.at(skin.by_angle(points, own.centroid, turn))
    affine = best_affine(points, target)
    start = affine(points)
    bending = ThinPlate(start, target - start, np.full(len(points), SKIN_SLACK))
    carry = replace(affine, steps=(bending,))
    found = {}
    edge, new_edge = polygon(own).exterior, polygon(skin).exterior
    for name in atlas.bones:
        before = atlas.ring(name).points
        bent = carry(before)
        rigid = _similar(before, bent)
        cover = LEAST_COVER * edge.distance(polygon(atlas.ring(name)))
        body = shapely.Polygon(rigid)
        fits = polygon(skin).contains(body) and new_edge.distance(body) >= cover
        found[name] = Ring(rigid if fits else bent)
    return found


def landmark_angles(atlas: Reference) -> dict[str, float]:
    """Return the anatomical angles, degrees, of crest and fibula in the atlas."""
    tibia, fibula = atlas.ring("tibia"), atlas.ring("fibula")
    crest = tibia.points[tibia.points[:, 1].argmax()]
    places = {"crest": crest, "fibular_head": fibula.centroid}
    return {name: float(np.rad2deg(np.arctan2(y, x))) for name, (x, y) in places.items()}


def _wrap(angle: float) -> float:
    return (angle + 180.0) % 360.0 - 180.0


def _similar(before: Array, after: Array) -> Array:
    """Return points moved, turned and scaled so that they come nearest to others."""
    z, w = (points @ np.array([1.0, 1.0j]) for points in (before, after))
    z = z - z.mean()
    moved = np.vdot(z, w) / np.vdot(z, z) * z + w.mean()
    return np.column_stack([moved.real, moved.imag])
