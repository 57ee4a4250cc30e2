"""The crest of the tibia in a skin: a ridge that runs down the front of the limb."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from scipy.ndimage import maximum_filter1d

from calfsocket.imaging.plane import Plane
from calfsocket.meshes.curves import Array

#: How much sharper than all other ridges one must be to be taken for the crest. The calf's is 1.5
#: times as sharp as the next; in a residual limb whose corners over the hamstrings are as sharp as
#: its crest the ratio is 1.06, and the sharpest is the wrong one.
SHARPER = 1.25
#: Anatomical angle, degrees, of the crest in the reference calf: a little medial of anterior.
CREST_ANGLE = 100.0
#: Degrees by which the ridge may wander from level to level, and within which there is no second.
_WANDER, _APART = 20, 60
#: Harmonics of an outline that count: bumps narrower than an eighth of it are noise.
_HARMONICS = 8
#: Points of an outline, and directions in which ridges are looked for.
_POINTS, _DIRECTIONS = 360, 72
#: Levels at which there must be an outline.
_FEWEST = 5


@dataclass(frozen=True)
class Crest:
    """The sharpest ridge of a skin.

    Attributes
    ----------
    direction : Array
        Unit vector from the axis to it.
    sharper : float
        How many times as sharp it is as the next ridge elsewhere.
    """

    direction: Array
    sharper: float


def crest(outlines: Sequence[shapely.Polygon], plane: Plane) -> Crest | None:
    """Find the ridge that is the sharpest over all levels.

    Sharpness is the mean over the levels of the outline's curvature times the radius of the circle
    of its area: 1 all around a circle.

    Parameters
    ----------
    outlines
        Of the skin at levels along the limb, in axes that are those of `plane`.
    plane
        Square to the limb's axis.
    """
    if len(outlines) < _FEWEST:
        return None
    step = 360 // _DIRECTIONS
    near = 2 * (_WANDER // step) + 1
    sharp = np.mean(
        [maximum_filter1d(_curvature(each), near, mode="wrap") for each in outlines], axis=0
    )
    angles = step * np.arange(_DIRECTIONS)
    top = np.flatnonzero(sharp > 0.99 * sharp.max())  # the ridge, and where it may wander
    middle = np.angle(np.exp(1j * np.deg2rad(angles[top])).sum())
    away = np.abs((angles - np.rad2deg(middle) + 180) % 360 - 180)
    other = sharp[away > _APART].max()
    direction = np.cos(middle) * plane.x + np.sin(middle) * plane.y
    return Crest(direction, float(sharp.max() / max(other, 1e-9)))


def _curvature(outline: shapely.Polygon) -> Array:
    """Return the curvature, for a circle of the same area 1, in directions from the centroid."""
    ring = shapely.LinearRing(outline.exterior.coords)
    if not ring.is_ccw:
        ring = ring.reverse()
    points = shapely.line_interpolate_point(ring, ring.length * np.arange(_POINTS) / _POINTS)
    x, y = shapely.get_coordinates(points).T
    centre = outline.centroid
    spectrum = np.fft.fft(x - centre.x + 1j * (y - centre.y))
    order = np.fft.fftfreq(_POINTS, 1 / _POINTS)
    spectrum[np.abs(order) > _HARMONICS] = 0
    place, first, second = (np.fft.ifft(spectrum * (1j * order) ** n) for n in range(3))
    bend = (first.conj() * second).imag / np.abs(first) ** 3 * np.sqrt(outline.area / np.pi)
    angle = np.angle(place)
    wanted = 2 * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
    return np.asarray(np.interp(wanted, angle, bend, period=2 * np.pi))
