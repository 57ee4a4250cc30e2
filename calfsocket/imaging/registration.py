r"""A socket's inner face laid on a limb's skin by the rigid motion that makes their gap even.

A socket is smaller than its limb by design, by a mean of 1 or 2 mm and by more where it presses.
The gap d is therefore an unknown of its own, beside the six of the motion:

.. math:: \min_{\omega, u, d} \sum_i w_i \left(r_i - d\right)^2,
    \quad r_i = n_i \cdot (p_i - q_i)

with points p of the skin, the nearest points q of the face, its normals n outward, and Tukey's
weights w, which leave out what the socket's bumps and the scan's holes move away from the rest.
Points whose nearest one is on the rim of the face lie beyond it and do not count.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, Self

import numpy as np
import pyvista
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation
from scipy.stats import f as f_distribution
from vtkmodules.vtkFiltersCore import vtkWindowedSincPolyDataFilter

from calfsocket.io.errors import InputError
from calfsocket.meshes.curves import Array

Register = Literal["icp", "none"]
#: Distance of the points of a face, mm: the tangent planes there leave it by 0.02 mm.
_SPACING = 3.0
#: Rounds and pass band of Taubin's smoothing, which takes a scanner's noise from the normals.
_ROUNDS, _PASS_BAND = 40, 0.05
#: Width, mm, of what a prosthetist presses in or relieves: closer deviations are not independent.
_PATCH = 30.0
#: Between skin and face, mm, and its standard deviation: sockets enclose 3 to 6 % less than limbs.
#: It matters where the shape tells little: the gap in a cone depends on how deep the limb sits.
_EXPECTED_GAP, _GAP_SPREAD = 1.0, 1.0
#: A gap beyond this, mm, is another limb's or in other units.
_WIDEST_GAP = 10.0
#: Turns about the axis, and distances along it, mm, from which it is looked for.
_TURNS, _STEP_ALONG = 24, 20.0
#: So many of the starts, those with the least deviation, are followed to their end.
_FOLLOWED = 8
#: Points of the skin that starts are compared by.
_FEW = 120
#: Steps of the method, and the motion, mm, below which it has arrived: nearest points come and go.
_MOST_STEPS, _ARRIVED = 50, 2e-3
#: Tukey's constant, and the least deviation, mm, that it is scaled by.
_TUKEY, _LEAST_SCALE = 4.685, 0.05
#: Share of the skin's points, those with the least deviation, by which motions are compared.
_COMPARED = 0.8
#: Share of the skin's points that the face must have beside it.
_LEAST_COVERED = 0.6
#: Largest angle, degrees, between the axes of socket and limb.
_MOST_TILT = 30.0
#: A scan stays in its axes where its deviation is up to so many times the best, and its cover no
#: less by more than this. Bumps of 4 mm move the best fit, to half the deviation of the true place;
#: 2 mm to the side make it four times as large.
_STAYS, _LESS_COVERED = 2.0, 0.05
#: Points from which seven unknowns are determined.
_FEWEST = 20
#: Variance of what nothing is known of.
_UNKNOWN = 1e12
#: Largest deviation from an even gap, mm, root mean square of that share: the bumps of sockets.
MOST_DEVIATION = 3.0
#: Largest standard uncertainties: of the gap, mm, and of the turn, degrees.
MOST_GAP_ERROR, MOST_TURN_ERROR = 0.6, 10.0
#: Rotations closer than this, degrees, are one.
_SAME = 20.0
#: Level at which one motion counts as better than another.
_SIGNIFICANCE = 0.95


@dataclass(frozen=True)
class Motion:
    """A rigid motion from a scan's axes to the limb's.

    Attributes
    ----------
    rotation : Array
        Matrix, (3, 3).
    shift : Array
        mm; added after the rotation.
    """

    rotation: Array
    shift: Array

    @classmethod
    def none(cls) -> Self:
        """Return the motion that leaves everything where it is."""
        return cls(np.eye(3), np.zeros(3))

    @classmethod
    def about(cls, axis: Array, degrees: float, centre: Array, shift: Array) -> Self:
        """Return a turn about an axis through a point, and a shift after it."""
        turn = Rotation.from_rotvec(np.deg2rad(degrees) * axis).as_matrix()
        return cls(turn, centre - turn @ centre + shift)

    def __call__(self, points: Array) -> Array:
        """Return points in the limb's axes."""
        return np.asarray(points @ self.rotation.T + self.shift)

    def back(self, points: Array) -> Array:
        """Return points in the scan's axes."""
        return np.asarray((points - self.shift) @ self.rotation)

    def then(self, turn: Array, shift: Array, centre: Array) -> "Motion":
        """Return this motion followed by a small turn, a vector, about a centre, and a shift."""
        more = Rotation.from_rotvec(turn).as_matrix()
        return Motion(more @ self.rotation, more @ (self.shift - centre) + centre + shift)

    def angle_from(self, other: "Motion") -> float:
        """Return the angle of the rotation from another motion to this one, degrees."""
        between = Rotation.from_matrix(self.rotation @ other.rotation.T)
        return float(np.rad2deg(between.magnitude()))


@dataclass(frozen=True)
class Skin:
    """Points of a limb's skin.

    Attributes
    ----------
    points : Array
        mm, (n, 3), in the limb's axes.
    axis : Array
        To the proximal end.
    length : float
        Of all outlines together, mm.
    """

    points: Array
    axis: Array
    length: float

    @property
    def centre(self) -> Array:
        """Mean of the points."""
        return np.asarray(self.points.mean(axis=0))

    def some(self, number: int) -> "Skin":
        """Return so many of the points, evenly."""
        kept = np.unique(np.linspace(0, len(self.points) - 1, number).astype(int))
        return Skin(self.points[kept], self.axis, self.length)


def _smooth(surface: pyvista.PolyData) -> pyvista.PolyData:
    """Return a surface without its noise; its rim stays where it is."""
    sinc = vtkWindowedSincPolyDataFilter()
    sinc.SetInputData(surface)
    sinc.SetNumberOfIterations(_ROUNDS)
    sinc.SetPassBand(_PASS_BAND)
    sinc.BoundarySmoothingOff()
    if hasattr(sinc, "SetWindowFunctionToHamming"):
        sinc.SetWindowFunctionToHamming()  # the only one until VTK 9.3; later ones smooth less
    sinc.Update()
    return pyvista.PolyData(sinc.GetOutput())


class Face:
    """The inner face of a socket as points with normals outward, in the scan's axes."""

    def __init__(self, surface: pyvista.PolyData) -> None:
        dense = _smooth(surface).subdivide_adaptive(max_edge_len=_SPACING, max_n_passes=6)
        dense = dense.clean().compute_normals(
            cell_normals=False, consistent_normals=False, split_vertices=False
        )
        self.points = np.asarray(dense.points, dtype=float)
        self.normals = np.asarray(dense.point_data["Normals"], dtype=float)
        self._tree = cKDTree(self.points)
        edges = dense.extract_feature_edges(
            feature_edges=False, non_manifold_edges=False, manifold_edges=False
        )
        self._rim = np.zeros(len(self.points), dtype=bool)
        if edges.n_points:
            self._rim = cKDTree(edges.points).query(self.points)[0] < _SPACING

    @cached_property
    def axis(self) -> Array:
        """The direction, of either sign, to which the normals are most nearly square."""
        return np.asarray(np.linalg.eigh(self.normals.T @ self.normals)[1][:, 0])

    @property
    def centre(self) -> Array:
        """Mean of the points."""
        return np.asarray(self.points.mean(axis=0))

    def along(self) -> tuple[float, float]:
        """Return from where to where it extends along its axis about its centre, mm."""
        heights = (self.points - self.centre) @ self.axis
        return float(heights.min()), float(heights.max())

    def nearest(self, points: Array) -> tuple[Array, Array, Array]:
        """Return how far points lie outside, the normals there, and whether the face is there."""
        _, index = self._tree.query(points)
        normals = self.normals[index]
        outside = np.sum(normals * (points - self.points[index]), axis=1)
        return outside, normals, ~self._rim[index]


@dataclass(frozen=True)
class Registration:
    """How a face lies on a skin.

    Attributes
    ----------
    motion : Motion
    gap : float
        Mean distance of the skin outside the face, mm.
    gap_error : float
        Its standard uncertainty.
    turn_error, along_error : float
        Those of the turn about the axis, degrees, and of the place along it, mm.
    deviation : float
        Root mean square of the distances from that gap, mm, of the share of points with the least.
    rms, largest : float
        Root mean square, and largest, of all of them.
    covered : float
        Share of the skin that the face has beside it.
    kept : bool
        Whether the scan stayed in its own axes.
    """

    motion: Motion
    gap: float
    gap_error: float
    turn_error: float
    along_error: float
    deviation: float
    rms: float
    largest: float
    covered: float
    kept: bool = False

    @property
    def words(self) -> Iterator[str]:
        """What a person should know of it, a line each."""
        angle = self.motion.angle_from(Motion.none())
        x, y, z = np.round(self.motion.shift, 2) + 0.0
        if angle or np.any(self.motion.shift):
            yield f"turned by {angle:.2f} degrees and shifted by ({x:g}, {y:g}, {z:g}) mm"
        else:
            yield "stays in the axes of the limb's source"
        yield (
            f"the skin lies {self.gap:.2f} mm outside the inner face, off by {self.rms:.2f} mm"
            f" (root mean square) and {self.largest:.2f} mm (largest), on"
            f" {100 * self.covered:.0f} % of it"
        )
        yield (
            f"known to +-{self.gap_error:.2f} mm; along the limb to +-{self.along_error:.1f} mm,"
            f" about it to +-{self.turn_error:.1f} degrees"
        )


def registered(face: Face, skin: Skin) -> Registration:
    """Lay a face on a skin; one that lies on it already to its deviations stays where it is.

    Raises
    ------
    InputError
        When the best motion is not credible, or another one is as good.
    """
    stayed = fixed(face, skin, Motion.none())
    found = [_followed(face, skin, start) for start in _starts(face, skin)]
    if stayed.covered >= _LEAST_COVERED:
        found.append(_followed(face, skin, Motion.none()))
    upright = np.cos(np.deg2rad(_MOST_TILT))
    credible = [
        each
        for each in found
        if each.covered >= _LEAST_COVERED
        and abs(each.motion.rotation @ face.axis @ skin.axis) > upright
    ]
    if not credible:
        raise InputError(
            "does not lie along the limb with its inner face beside"
            f" {100 * _LEAST_COVERED:.0f} % of the skin, wherever it is laid; check that they"
            " belong together, or give a limb whose levels the socket covers"
        )
    ratio = _significant(skin)
    least = max(min(each.deviation for each in credible), _LEAST_SCALE)
    good = [each for each in credible if each.deviation <= ratio * least]
    # Along a straight limb all places are as good: that where most of it is covered.
    best = max(good, key=lambda each: (round(each.covered, 2), -each.deviation))
    stays = stayed.deviation <= _STAYS * least and stayed.covered > best.covered - _LESS_COVERED
    stays = stays and best.motion.angle_from(stayed.motion) < _SAME
    turned = any(other.motion.angle_from(best.motion) > _SAME for other in good)
    # Before the fit is judged: that of a round socket depends on where it happens to lie.
    if not stays and (turned or best.turn_error > MOST_TURN_ERROR):
        raise InputError(_TURNED)
    _check_fit(best)
    if stays:
        return stayed
    _check_depth(best)
    return best


_STATE = "bring it into the limb's axes and add --register none, with --rotate if need be"
_TURNED = (
    "fits the skin as well when it is turned, so that which way round it belongs does not show;"
    f" {_STATE}"
)


def _check_depth(best: Registration) -> None:
    """Raise an InputError where the depth does not follow from the shape."""
    if best.gap_error > MOST_GAP_ERROR:
        raise InputError(
            "does not show how deep the limb sits in it: the gap to the skin is known to"
            f" +-{best.gap_error:.1f} mm; {_STATE}"
        )


def _check_fit(best: Registration) -> None:
    """Raise an InputError where a face is not that of a socket for this limb."""
    if best.deviation > MOST_DEVIATION or abs(best.gap) > _WIDEST_GAP:
        raise InputError(
            f"does not fit the limb: laid on the skin it leaves a gap of {best.gap:.1f} mm, from"
            f" which it is {best.deviation:.1f} mm off (root mean square; up to {_WIDEST_GAP:g} and"
            f" {MOST_DEVIATION:g} mm are a socket's); check that limb and socket belong together,"
            " and the units"
        )


def _significant(skin: Skin) -> float:
    """Return from which ratio of deviations on the larger one is worse than the other."""
    free = max(skin.length / _PATCH - 7, 2.0)
    return float(np.sqrt(1 + 6 / free * f_distribution.ppf(_SIGNIFICANCE, 6, free)))


def fixed(face: Face, skin: Skin, motion: Motion) -> Registration:
    """Return how a face lies where it was put."""
    return _measured(face, skin, motion, kept=True)


def _starts(face: Face, skin: Skin) -> Iterator[Motion]:
    """Yield the most promising places: turned about the axis, moved along it, either end up."""
    few = skin.some(_FEW)
    low, high = face.along()
    heights = (skin.points - skin.centre) @ skin.axis
    reach = max(high - heights.min(), heights.max() - low)
    candidates: list[tuple[float, int, Motion]] = []
    for up in (face.axis, -face.axis):
        upright = _turning(up, skin.axis)
        for turn in np.arange(_TURNS) * 360 / _TURNS:
            rotation = Rotation.from_rotvec(np.deg2rad(turn) * skin.axis).as_matrix() @ upright
            for along in np.arange(-reach, reach + _STEP_ALONG, _STEP_ALONG):
                shift = skin.centre + along * skin.axis - rotation @ face.centre
                motion = Motion(rotation, shift)
                outside, _, there = face.nearest(motion.back(few.points))
                if there.mean() < _LEAST_COVERED:
                    continue
                gap = np.median(outside[there])
                off = np.median(np.abs(outside[there] - gap))
                candidates.append(
                    (float(np.hypot(off, gap / _WIDEST_GAP)), len(candidates), motion)
                )
    candidates.sort()
    chosen: list[Motion] = []
    for _, _, motion in candidates:
        # One for each turn, so that others are not crowded out.
        if all(motion.angle_from(other) > _SAME for other in chosen):
            chosen.append(motion)
            yield motion
        if len(chosen) == _FOLLOWED:
            return


def _turning(one: Array, other: Array) -> Array:
    """Return the smallest rotation from a unit vector to another."""
    axis = np.cross(one, other)
    length, cosine = float(np.linalg.norm(axis)), float(one @ other)
    if length < 1e-9:
        if cosine > 0:
            return np.eye(3)
        axis, length = np.cross(one, np.eye(3)[np.argmin(np.abs(one))]), 0.0
        axis /= np.linalg.norm(axis)
        return Rotation.from_rotvec(np.pi * axis).as_matrix()
    return Rotation.from_rotvec(np.arctan2(length, cosine) * axis / length).as_matrix()


def _followed(face: Face, skin: Skin, motion: Motion) -> Registration:
    """Return the place that the method reaches from a start."""
    reach = np.linalg.norm(skin.points - skin.centre, axis=1).max()
    for _ in range(_MOST_STEPS):
        step = _linearised(face, skin, motion)[0]
        size = np.abs(step[:3]).max() * reach + np.abs(step[3:6]).max()
        if size > 10.0:  # nearest points change: not further than they are good for
            step = step * 10.0 / size
        motion = motion.then(step[:3], step[3:6], skin.centre)
        if size < _ARRIVED:
            break
    return _measured(face, skin, motion)


def _linearised(face: Face, skin: Skin, motion: Motion) -> tuple[Array, Array]:
    """Return the step (turn, shift, gap), and its covariance."""
    outside, normals, there = face.nearest(motion.back(skin.points))
    if there.sum() < _FEWEST:
        return np.zeros(7), np.eye(7) * _UNKNOWN
    outside, normals = outside[there], normals[there] @ motion.rotation.T
    arms = skin.points[there] - skin.centre
    gap = np.median(outside)
    scale = max(1.4826 * float(np.median(np.abs(outside - gap))), _LEAST_SCALE)
    weight = np.clip(1 - ((outside - gap) / (_TUKEY * scale)) ** 2, 0, None) ** 2
    # r = n.(p - q); the face moved by omega x (p - c) + u takes that from it.
    matrix = np.column_stack([np.cross(arms, normals), normals, np.ones(len(outside))])
    share = min(1.0, skin.length / _PATCH / len(skin.points))  # of independent points
    independent = weight * share / scale**2
    left = matrix.T @ (independent[:, None] * matrix)
    right = matrix.T @ (independent * outside)
    left[6, 6] += 1 / _GAP_SPREAD**2
    right[6] += _EXPECTED_GAP / _GAP_SPREAD**2
    # So little that it matters only where nothing is known: a turn of a full circle, 1 m.
    damping = np.diag([1 / (2 * np.pi) ** 2] * 3 + [1e-6] * 3 + [0.0])
    covariance = np.linalg.inv(left + damping)
    return covariance @ right, covariance


def _measured(face: Face, skin: Skin, motion: Motion, kept: bool = False) -> Registration:
    outside, _, there = face.nearest(motion.back(skin.points))
    covered = float(there.mean())
    if not there.any():
        nothing = float("inf")
        return Registration(
            motion, nothing, nothing, nothing, nothing, nothing, nothing, nothing, 0.0, kept
        )
    covariance = _linearised(face, skin, motion)[1]
    gap = float(np.median(outside[there]))
    for _ in range(20):
        off = np.abs(outside[there] - gap)
        compared = off <= np.quantile(off, _COMPARED)
        gap = float(outside[there][compared].mean())
    axis = skin.axis
    return Registration(
        motion=motion,
        gap=gap,
        gap_error=float(np.sqrt(covariance[6, 6])),
        turn_error=float(np.rad2deg(np.sqrt(axis @ covariance[:3, :3] @ axis))),
        along_error=float(np.sqrt(axis @ covariance[3:6, 3:6] @ axis)),
        deviation=float(np.sqrt(np.mean((outside[there][compared] - gap) ** 2))),
        rms=float(np.sqrt(np.mean((outside[there] - gap) ** 2))),
        largest=float(off.max()),
        covered=covered,
        kept=kept,
    )
