"""Corresponding points of two sections: on the skin, around the muscles, on the bones."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from calfsocket.imaging.smooth_map import bending_energy
from calfsocket.meshes.curves import Array, ClosedCurve

#: Distance of the points that stand for a curve, mm.
STEP = 0.2
#: Rounds in which points slide; the map's energy falls by less than 1 % in later ones.
ROUNDS = 12
#: Weight of even spacing against the bending energy. Without it points crowd where the map bends.
EVENNESS = 5e-4
#: Smallest share of the even spacing that two neighbours keep.
CLOSEST = 0.3
#: Largest angle, degrees, by which a bone is taken to be turned against the atlas.
MOST_TURNED = 60.0


@dataclass(frozen=True)
class Ring:
    """A closed polygon of many points that stands for a curve, counter-clockwise, mm, (n, 2)."""

    points: Array

    @classmethod
    def of(cls, curve: ClosedCurve) -> "Ring":
        """Return the polygon of a curve."""
        return cls(curve.evaluate(curve.sample(STEP)))

    @cached_property
    def along(self) -> Array:
        """Arc length at the points and where the polygon closes, mm, (n + 1,)."""
        closed = np.concatenate([self.points, self.points[:1]])
        return np.append(0.0, np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1)))

    @property
    def length(self) -> float:
        """Once around, mm."""
        return float(self.along[-1])

    @cached_property
    def tree(self) -> cKDTree:
        """Of the points."""
        return cKDTree(self.points)

    @cached_property
    def centroid(self) -> Array:
        """Of the area."""
        x, y = self.points.T
        cross = x * np.roll(y, -1) - y * np.roll(x, -1)
        pairs = self.points + np.roll(self.points, -1, axis=0)
        return np.asarray((pairs * cross[:, None]).sum(axis=0) / (3 * cross.sum()))

    def at(self, s: Array) -> Array:
        """Return the points at arc lengths, mm."""
        closed = np.concatenate([self.points, self.points[:1]])
        s = np.mod(s, self.length)
        return np.column_stack([np.interp(s, self.along, closed[:, i]) for i in (0, 1)])

    def tangent(self, s: Array) -> Array:
        """Return unit tangents at arc lengths."""
        chord = self.at(s + 2 * STEP) - self.at(s - 2 * STEP)
        return chord / np.linalg.norm(chord, axis=1, keepdims=True)

    def nearest(self, x: Array) -> Array:
        """Return the arc lengths of the points nearest to others, mm."""
        return np.asarray(self.along[:-1][self.tree.query(x)[1]])

    def even(self, number: int) -> Array:
        """Return so many arc lengths, evenly spaced, mm."""
        return self.length * np.arange(number) / number

    def by_angle(self, points: Array, center: Array, turn: float | Array) -> Array:
        """Return arc lengths where the ring lies in the directions of points from their centre.

        The directions are turned by `turn`, rad, first and count from this ring's centroid.
        """
        away = points - center
        wanted = np.arctan2(away[:, 1], away[:, 0]) + turn
        own = self.points - self.centroid
        own_angle = np.unwrap(np.arctan2(own[:, 1], own[:, 0]))
        own_angle = np.maximum.accumulate(own_angle)
        offset = np.mod(wanted - own_angle[0], 2 * np.pi)
        angles = np.append(own_angle - own_angle[0], 2 * np.pi)
        return np.interp(offset, angles, self.along)


def turned(source: Ring, target: Ring, about: float = 0.0, number: int = 48) -> tuple[Array, float]:
    """Return arc lengths on the target that correspond to even ones, and by how much it is turned.

    Of all starting points on the target, the one with which rotation and scaling of the source come
    nearest to it; `about`, rad, is the turn that is expected to `MOST_TURNED`.
    """
    first = source.at(source.even(number)) - source.centroid
    best = np.inf, 0.0, 0.0
    z = first[:, 0] + 1j * first[:, 1]
    for start in target.even(4 * number):
        second = target.at(target.even(number) + start) - target.centroid
        w = second[:, 0] + 1j * second[:, 1]
        factor = np.vdot(z, w) / np.vdot(z, z)
        turn = float(np.angle(factor * np.exp(-1j * about)))
        misfit = float(np.sum(np.abs(w - factor * z) ** 2))
        if abs(turn) < np.deg2rad(MOST_TURNED) and misfit < best[0]:
            best = misfit, float(start), about + turn
    return target.even(number) + best[1], best[2]


def in_order(ring: Ring, near: Array) -> Array:
    """Return arc lengths on a ring near to points, spread so that neighbours keep their order."""
    spacing = ring.length / len(near)
    wanted = ring.nearest(near)
    gaps = np.maximum(_gaps(wanted, ring.length), 2 * CLOSEST * spacing)
    gaps *= ring.length / gaps.sum()
    along = np.append(0.0, np.cumsum(gaps[:-1]))
    off = np.angle(np.exp(2j * np.pi * (wanted - along) / ring.length).sum())
    return along + off * ring.length / (2 * np.pi)


def slid(
    source: Mapping[str, Array], rings: Mapping[str, Ring], start: Mapping[str, Array]
) -> dict[str, Array]:
    """Slide points along curves until the thin plate from the source bends as little as possible.

    Semilandmarks [1]_: where a point of the skin comes is decided by the bones and the other
    points, not by an angle about some centre. Neighbours keep their order.

    Parameters
    ----------
    source : mapping of str to Array
        Points on the curves of the atlas, evenly spaced, in their order around, mm.
    rings, start : mapping
        The same curves of the section, and the arc lengths there to begin with, mm.

    Returns
    -------
    dict of str to Array
        Arc lengths, mm.

    References
    ----------
    .. [1] F. L. Bookstein, Medical Image Analysis 1 (1997) 225-243,
       doi:10.1016/S1361-8415(97)85012-8.
    """
    names = list(source)
    energy = bending_energy(np.concatenate([source[name] for name in names]))
    s = {name: np.asarray(start[name], dtype=float) for name in names}
    spacing = {name: rings[name].length / len(source[name]) for name in names}
    for _ in range(ROUNDS):
        place = np.concatenate([rings[name].at(s[name]) for name in names])
        tangent = np.concatenate([rings[name].tangent(s[name]) for name in names])
        matrix = energy * (tangent @ tangent.T)
        right = -np.sum(tangent * (energy @ place), axis=1)
        weight = EVENNESS * np.trace(matrix) / len(matrix)
        first = 0
        for name in names:
            n = len(s[name])
            part = slice(first, first + n)
            difference = np.roll(np.eye(n), 1, axis=1) - np.eye(n)
            uneven = _gaps(s[name], rings[name].length) - spacing[name]
            matrix[part, part] += weight * difference.T @ difference
            right[part] -= weight * difference.T @ uneven
            first += n
        move = np.linalg.lstsq(matrix, right, rcond=1e-10)[0]
        first = 0
        for name in names:
            n = len(s[name])
            s[name] = _in_order(s[name], move[first : first + n], rings[name].length, spacing[name])
            first += n
    return s


def _gaps(s: Array, length: float) -> Array:
    return np.mod(np.roll(s, -1) - s + length / 2, length) - length / 2


def _in_order(s: Array, move: Array, length: float, spacing: float) -> Array:
    """Return arc lengths moved as far as neighbours stay in order."""
    for fraction in 0.5 ** np.arange(8):
        moved = s + fraction * move
        if np.all(_gaps(moved, length) > CLOSEST * spacing):
            return moved
    return s
