"""Which point of the atlas is which point of the section, and the smooth map that follows."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import shapely

from calfsocket.imaging.landmarks import Ring, in_order, slid, turned
from calfsocket.imaging.reference import Reference
from calfsocket.imaging.shapes import polygon
from calfsocket.imaging.smooth_map import SmoothMap, ThinPlate, fitted
from calfsocket.meshes.curves import Array

#: Numbers of corresponding points on the skin, around the muscles, and on the bones.
SKIN_POINTS, ENVELOPE_POINTS = 60, 60
BONE_POINTS = {"tibia": 40, "fibula": 16}
#: Distance of corresponding points on a belly that the source has, mm, and how loosely they hold:
#: its own outline is used anyway, and its neighbours' may contradict it by the width of a septum.
BELLY_STEP, BELLY_SLACK = 6.0, 2e-3
#: How loosely the skin holds where it alone places the bones: these are no copy of its bumps.
SKIN_SLACK = 1e-2
#: Distance of the points at which folds are looked for, mm.
SAMPLE_STEP = 1.0
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

    def on_skin_of_atlas(self, s: Array, atlas: Ring) -> Array:
        """Return the arc lengths on the atlas's skin of those on the section's, mm."""
        own = self.along["skin"]
        length = self.rings["skin"].length
        first = int(np.argmin(np.mod(own, length)))
        own = np.unwrap(np.roll(np.mod(own, length), -first), period=length)
        there = np.roll(atlas.even(SKIN_POINTS), -first)
        there = np.unwrap(there, period=atlas.length)
        own = np.concatenate([own[-1:] - length, own, own[:1] + length])
        there = np.concatenate([there[-1:] - atlas.length, there, there[:1] + atlas.length])
        return np.mod(np.interp(np.mod(s, length), own, there), atlas.length)


def skin_and_bones(atlas: Reference, skin: Ring, bones: dict[str, Ring]) -> Correspondence:
    """Find corresponding points of skin and bones.

    By how much the section is turned is the mean of what the direction from tibia to fibula and the
    shape of the tibia say. Points of the skin begin in the same directions from its centroid and
    slide from there.
    """
    own = {name: atlas.ring(name) for name in bones}
    tibia, fibula = own["tibia"], own.get("fibula")
    turn = 0.0
    if fibula:
        before, after = (
            complex(*(each["fibula"].centroid - each["tibia"].centroid)) for each in (own, bones)
        )
        turn = float(np.angle(after / before))
    along, of_tibia = turned(tibia, bones["tibia"], turn, BONE_POINTS["tibia"])
    turn = (turn + of_tibia) / 2 if fibula else of_tibia
    source = {"skin": atlas.skin_ring.at(atlas.skin_ring.even(SKIN_POINTS))}
    start = {"skin": skin.by_angle(source["skin"], atlas.skin_ring.centroid, turn)}
    for name, ring in own.items():
        source[name] = ring.at(ring.even(BONE_POINTS[name]))
        start[name] = (
            along if name == "tibia" else bones[name].by_angle(source[name], ring.centroid, turn)
        )
    rings = {"skin": skin, **bones}
    return Correspondence(source, rings, slid(source, rings, start), turn)


def with_envelope(
    before: Correspondence, atlas: Reference, envelope: Ring, bellies: dict[str, Ring]
) -> Correspondence:
    """Add points around the muscles, and on bellies that the source has, and let all slide again.

    Points around the muscles begin below the points of the skin to which they are nearest.
    """
    source, rings, start = dict(before.source), dict(before.rings), dict(before.along)
    points = atlas.envelope.at(atlas.envelope.even(ENVELOPE_POINTS))
    here = atlas.skin_ring.nearest(points)
    there = np.interp(
        here,
        *_increasing(atlas.skin_ring.even(SKIN_POINTS), start["skin"], atlas.skin_ring.length,
                     rings["skin"].length),
    )  # fmt: skip
    source["envelope"], rings["envelope"] = points, envelope
    start["envelope"] = in_order(envelope, rings["skin"].at(there))
    for name, ring in bellies.items():
        own = atlas.ring(name)
        number = max(int(own.length / BELLY_STEP), 8)
        source[name], rings[name] = own.at(own.even(number)), ring
        start[name] = turned(own, ring, before.turn, number)[0]
    return Correspondence(source, rings, slid(source, rings, start), before.turn)


def affine(found: Correspondence, name: str) -> SmoothMap:
    """Return the affine map that takes the points on one curve nearest to theirs."""
    source = np.column_stack([found.source[name], np.ones(len(found.source[name]))])
    solution = np.linalg.lstsq(source, found.target[name], rcond=None)[0]
    return SmoothMap(solution[:2].T, solution[2])


def _increasing(s: Array, t: Array, length: float, other: float) -> tuple[Array, Array]:
    """Return corresponding arc lengths around two rings as a function that grows."""
    t = np.unwrap(t, period=other)
    return np.append(s, length), np.append(t, t[0] + other)


def smooth_map(
    found: Correspondence, atlas: Reference, at: Callable[[Array], str]
) -> tuple[SmoothMap, Array]:
    """Return the map, and its determinants at points of the atlas.

    These are `SAMPLE_STEP` apart all over the section, and on all curves.
    """
    loose = {name: BELLY_SLACK for name in found.source if name in atlas.bellies}
    target = found.target
    slack = np.concatenate(
        [np.full(len(points), loose.get(name, 0.0)) for name, points in found.source.items()]
    )
    source = np.concatenate(list(found.source.values()))
    ends = np.concatenate([target[name] for name in found.source])
    return fitted(source, ends, _samples(atlas), slack, at)


def _samples(atlas: Reference) -> Array:
    low, high = atlas.skin_ring.points.min(axis=0), atlas.skin_ring.points.max(axis=0)
    axes = [np.arange(low[i], high[i], SAMPLE_STEP) for i in (0, 1)]
    grid = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    inside = grid[shapely.contains_xy(polygon(atlas.skin_ring), *grid.T)]
    rings = [ring.at(ring.even(int(ring.length / SAMPLE_STEP))) for ring in atlas.rings.values()]
    return np.concatenate([inside, *rings])


def bones_by_skin(
    atlas: Reference, skin: Ring, landmarks: dict[str, float]
) -> dict[str, Ring]:
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
    points = own.at(own.even(SKIN_POINTS))
    angle = np.rad2deg(np.arctan2(*(points - own.centroid).T[::-1]))
    turn = np.zeros(SKIN_POINTS)
    if landmarks:
        here = landmark_angles(atlas)
        known = sorted((here[name], _wrap(landmarks[name] - here[name])) for name in landmarks)
        turn = np.deg2rad(np.interp(angle, *np.array(known).T, period=360.0))
    target = skin.at(skin.by_angle(points, own.centroid, turn))
    base = np.column_stack([points, np.ones(len(points))])
    linear = np.linalg.lstsq(base, target, rcond=None)[0]
    bending = ThinPlate(base @ linear, target - base @ linear, np.full(len(points), SKIN_SLACK))

    def carry(x: Array) -> Array:
        moved = np.column_stack([x, np.ones(len(x))]) @ linear
        return moved + bending.at(moved)[0]

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
