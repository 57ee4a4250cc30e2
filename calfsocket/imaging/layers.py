"""Skin, fat and the fascia around the muscles: as thick as in the atlas where there is room."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from scipy.ndimage import gaussian_filter1d, minimum_filter1d

from calfsocket.imaging.landmarks import Ring
from calfsocket.imaging.shapes import band, curve_around, outside, polygon, rounded
from calfsocket.io.errors import InputError
from calfsocket.meshes.curves import Array, ClosedCurve

#: Fat is not thinner than this, mm, while skin and fascia are as thick as they should be; where
#: there is still less room, all three are thinned by the same factor.
LEAST_FAT = 0.6
#: The smallest factor: fat is then 0.15 mm thick, and curves must be 0.1 mm apart.
LEAST_SHARE = 0.25
#: Fascia between the envelope and a bone under the skin, mm: as over the atlas's tibia, where
#: the crural fascia is one with the periosteum.
OVER_BONE = 0.6
#: Half the width of notches between the muscles of a source and a bone beside them, mm, that belong
#: to the fascia.
NOTCH = 2.0
#: How far muscles of a source may leave the skin, mm: two voxels of a coarse segmentation.
VOXEL = 2.0
#: Over what length along the skin a thickness changes, mm.
_BLEND = 2.0
#: Smallest radii of the curves below skin and fat, mm, while corners are sharper above them.
SKIN_RADIUS, ENVELOPE_RADIUS = 1.2, 1.5
#: Distance of the points of the skin, mm.
_STEP = 0.4


@dataclass(frozen=True)
class Thinned:
    """A stretch of skin under which layers are thinner than in the atlas for want of room."""

    place: Array  #: where they are thinnest
    over: str  #: what lies below
    skin: float  #: mm
    fat: float  #: mm
    length: float  #: along the skin, mm


@dataclass(frozen=True)
class Fat:
    """What the atlas says of the fat under some places of the skin, arrays of the same shape.

    Attributes
    ----------
    thickness
        mm.
    bare
        1 where no muscle lies between fat and bone, so that the fat reaches down to the bone, to 0.
    fascia
        Thickness of the fascia on the bone there, mm.
    """

    thickness: Array
    bare: Array
    fascia: Array

    def over(self, room: Array) -> Array:
        """Return the thickness where below the skin there is so much room to the bone, mm."""
        reaching = np.maximum(room - self.fascia, self.thickness)
        return self.thickness + self.bare * (reaching - self.thickness)


@dataclass(frozen=True)
class Layers:
    """Curves below the skin.

    Attributes
    ----------
    thickness : float
        Of the skin where it is not thinned, mm.
    skin_inner, envelope : ClosedCurve
        Under the skin, and around the fascia of the muscles.
    thinned : tuple of Thinned
        Where skin and fascia are thinner than they should be.
    moved : float
        How far an envelope of the source was moved to have the bones in it and the skin around
        it, mm.
    """

    thickness: float
    skin_inner: ClosedCurve
    envelope: ClosedCurve
    thinned: tuple[Thinned, ...]
    moved: float = 0.0

    @cached_property
    def envelope_ring(self) -> Ring:
        """The envelope as a polygon."""
        return Ring.of(self.envelope)


def layers(
    skin: Ring,
    thickness: float,
    fat: Callable[[Array], Fat],
    bones: dict[str, Ring],
    muscles: dict[str, Ring],
    envelope: Ring | None,
    at: Callable[[Array], str],
) -> Layers:
    """Return the layers under the skin.

    Parameters
    ----------
    skin : Ring
        Its surface.
    thickness : float
        Of the skin, mm.
    fat : callable
        Arc length along the skin -> the fat that is expected there.
    bones, muscles : dict of str to Ring
        Below: all bones, and single muscles and deep vessels that the source has.
    envelope : Ring, optional
        Around the muscles where it is known; fat is then what lies between it and the skin.
    at : callable
        Words for a place.

    Raises
    ------
    InputError
        Where bone or muscles come so near to the skin's surface that no layers fit.
    """
    s = skin.even(int(skin.length / _STEP))
    points = skin.at(s)
    below = {name: ring.points for name, ring in (bones | muscles).items()}
    body, under, moved = polygon(skin), OVER_BONE, 0.0
    if envelope is not None:
        given = polygon(envelope)
        deep = _with_bones(_below_skin(given, body, thickness), bones)
        moved = 0.0 if deep is given else float(shapely.hausdorff_distance(given, deep))
        below, under = {"muscles": outside(deep)}, 0.0
    room = np.array([shapely.distance(shapely.points(points), shapely.LinearRing(each))
                     for each in below.values()])  # fmt: skip
    names, nearest = list(below), room.argmin(axis=0)
    least = room.min(axis=0)
    bare = np.zeros(len(s), dtype=bool)
    for each in below.values():
        bare |= shapely.contains_xy(shapely.Polygon(each), *points.T)
    share = np.minimum(least / (thickness + LEAST_FAT + under), 1.0)
    share[bare] = -1.0
    worst = int(np.argmin(share))
    if share[worst] < LEAST_SHARE:
        where = (
            "outside the skin" if bare[worst] else f"{least[worst]:.2f} mm below the skin's surface"
        )
        raise InputError(
            f"{names[nearest[worst]]}: lies {where} at {at(points[worst])}; skin, fat and fascia"
            f" need {LEAST_SHARE * (thickness + LEAST_FAT + under):.1f} mm; correct the outlines"
        )
    free = np.where(share < 1.0, share * LEAST_FAT, least - thickness - under)
    skin_width = _gently(share * thickness)
    fat_width = np.minimum(fat(s).over(least - thickness), _gently(free))
    inner = rounded(body.difference(band(points, skin_width)), SKIN_RADIUS)
    thinned = tuple(_stretches(skin, s, share, names, nearest, skin_width, fat_width))
    if envelope is None:
        deep = rounded(body.difference(band(points, skin_width + fat_width)), ENVELOPE_RADIUS)
    return Layers(thickness, curve_around(inner), curve_around(deep), thinned, moved)


def _below_skin(given: shapely.Polygon, body: shapely.Polygon, skin: float) -> shapely.Polygon:
    """Return muscles that leave room for the thinnest skin and fat, if not far from that."""
    room = body.buffer(-1.3 * LEAST_SHARE * (skin + LEAST_FAT))
    if room.contains(given) or not body.buffer(VOXEL).contains(given):
        return given
    return rounded(given.intersection(room), ENVELOPE_RADIUS)


def _with_bones(muscles: shapely.Polygon, bones: dict[str, Ring]) -> shapely.Polygon:
    """Return muscles and bones as one area, without narrow notches between them."""
    cover = [polygon(ring).buffer(OVER_BONE) for ring in bones.values()]
    if all(muscles.contains(each) for each in cover):
        return muscles
    area = shapely.union_all([muscles, *cover])
    closed = area.buffer(NOTCH).buffer(-NOTCH)
    return rounded(shapely.union_all([closed, area]), ENVELOPE_RADIUS)


def _gently(width: Array) -> Array:
    """Return widths that are nowhere larger and change over some millimetres."""
    reach = _BLEND / _STEP
    least = minimum_filter1d(width, 2 * int(3 * reach) + 1, mode="wrap")
    return np.minimum(gaussian_filter1d(least, reach, mode="wrap"), width)


def _stretches(
    skin: Ring,
    s: Array,
    share: Array,
    names: Sequence[str],
    nearest: Array,
    skin_width: Array,
    fat_width: Array,
) -> Sequence[Thinned]:
    """Return the places where layers are thinned, one for each connected stretch."""
    thin = share < 1.0
    if not thin.any():
        return []
    # Counted from where they are not thinned, so that no stretch is cut in two.
    first = 0 if thin.all() else int(np.flatnonzero(~thin)[0])
    order = np.roll(np.arange(len(s)), -first)
    label = np.cumsum(np.diff(thin[order].astype(int), prepend=0) == 1) * thin[order]
    found = []
    for number in range(1, int(label.max()) + 1):
        part = order[label == number]
        worst = int(part[np.argmin(share[part])])
        found.append(
            Thinned(
                skin.at(s[[worst]])[0], names[nearest[worst]], float(skin_width[worst]),
                float(fat_width[worst]), len(part) * _STEP,
            )
        )  # fmt: skip
    return found
