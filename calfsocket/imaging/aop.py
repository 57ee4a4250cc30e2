"""AOP: a limb's surface in cylindrical coordinates, as programs of prosthetics write it.

The lines of such a file are: AAOP1; comments; END COMMENTS; CYLINDRICAL; LEFT, RIGHT or NONE;
the number of landmarks, and a name and three numbers for each; the number of radii of a level;
their distance in degrees or, where that is 0, the angle of each; the number of levels; the distance
of the levels in mm or, where that is 0, the place of each, up or down; then all radii, level after
level, in mm.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import permutations
from pathlib import Path

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from calfsocket.io.errors import InputError
from calfsocket.meshes.curves import Array

#: Levels or radii of a file; more are no limb.
_MOST = 5000
_COORDINATES = "CYLINDRICAL"
_SIDES = ("LEFT", "RIGHT", "NONE", "BOTH")
#: How far a landmark may be from the surface, as a share of its radius; programs write its radius,
#: angle and level in different orders, and only one of them lies on the surface.
_ON_SURFACE = 0.1


@dataclass(frozen=True)
class _Cylinder:
    """What a file has: levels (n), radii (n, m), angles (m) in rad, and landmarks as written."""

    levels: Array
    radii: Array
    angles: Array
    landmarks: Mapping[str, tuple[float, ...]] = field(default_factory=dict)

    def radius(self, level: float, angle: float) -> float:
        """Return the radius of the surface at a place; none outside of it."""
        turns = np.mod(self.angles, 2 * np.pi)
        order = np.argsort(turns)
        x = np.concatenate(
            [turns[order[-1:]] - 2 * np.pi, turns[order], turns[order[:1]] + 2 * np.pi]
        )
        r = self.radii[:, np.concatenate([order[-1:], order, order[:1]])]
        at = RegularGridInterpolator((self.levels, x), r, bounds_error=False)
        return float(at((level, np.mod(angle, 2 * np.pi)))[()])


def read_aop(path: Path) -> tuple[Array, np.ndarray]:
    """Return points and triangles of the surface, open at the first and last level."""
    read = _read(path)
    levels, radii, angles = read.levels, read.radii, read.angles
    number = len(angles)
    points = np.stack(
        [
            radii * np.cos(angles),
            radii * np.sin(angles),
            np.broadcast_to(levels[:, None], radii.shape),
        ],
        axis=-1,
    ).reshape(-1, 3)
    row = np.arange(number)
    right = (row + 1) % number
    quads = np.stack([row, right, right + number, row + number], axis=-1)
    cells = (quads + number * np.arange(len(levels) - 1)[:, None, None]).reshape(-1, 4)
    return points, np.concatenate([cells[:, :3], cells[:, [0, 2, 3]]])


def side_of(path: Path) -> str | None:
    """Return the side that the file states, "left" or "right"."""
    word = _lines(path)[1][1].upper()
    return word.lower() if word in _SIDES[:2] else None


def landmarks_of(path: Path) -> dict[str, Array]:
    """Return the landmarks of a file, by name in small letters, mm.

    Their three numbers are taken in the order in which they lie nearest to the surface; those that
    are a tenth of the radius away from it are left out.
    """
    read = _read(path)
    best, found = _ON_SURFACE, {}
    for r, a, z in permutations(range(3)):
        away, points = {}, {}
        for name, values in read.landmarks.items():
            angle = np.deg2rad(values[a])
            off = abs(values[r] / read.radius(values[z], angle) - 1)
            away[name] = off if np.isfinite(off) else np.inf
            x, y = values[r] * np.cos(angle), values[r] * np.sin(angle)
            points[name] = np.array([x, y, values[z]])
        middle = float(np.median(list(away.values()))) if away else np.inf
        if middle < best:
            best = middle
            found = {name: points[name] for name in points if away[name] < _ON_SURFACE}
    return found


def _lines(path: Path) -> tuple[int, list[str]]:
    """Return the number of lines of the comments, and the lines after them."""
    lines = [line.strip() for line in path.read_text(encoding="latin-1").splitlines()]
    if not lines or not lines[0].upper().startswith("AAOP"):
        raise InputError(f"{path}: is no AOP file: its first line is not AAOP1")
    upper = [line.upper() for line in lines]
    if "END COMMENTS" not in upper:
        raise InputError(f"{path}: has no line END COMMENTS; export it again")
    start = upper.index("END COMMENTS") + 1
    while start < len(lines) and not lines[start]:
        start += 1
    return start, [*lines[start:], "", ""]


def _landmarks(path: Path, lines: list[str]) -> tuple[dict[str, tuple[float, ...]], int]:
    """Return the landmarks behind their number, and the number of lines of both.

    A landmark is a name and three numbers, in one line or in several.
    """
    first = (lines[0].split() or [""])[0]
    if not first.isdigit() or int(first) == 0 or int(first) > _MOST:
        return {}, 0
    found: dict[str, tuple[float, ...]] = {}
    used = 1
    while len(found) < int(first):
        words: list[str] = []
        values: list[float] = []
        while len(values) < 3:
            if used >= len(lines):
                raise InputError(
                    f"{path}: ends after {len(found)} of {first} landmarks; the file is not"
                    " complete"
                )
            for word in re.split(r"[\s,;\"]+", lines[used].strip()):
                if re.fullmatch(r"[-+]?[\d.]+([eE][-+]?\d+)?", word):
                    values.append(float(word))
                elif word:
                    words.append(word.lower())
            used += 1
        found[" ".join(words) or f"landmark {len(found) + 1}"] = tuple(values[:3])
    return found, used


def _read(path: Path) -> _Cylinder:
    """Read a file."""
    start, lines = _lines(path)
    if lines[0].upper() != _COORDINATES:
        raise InputError(
            f"{path}, line {start + 1}: is '{lines[0]}'; only {_COORDINATES} is read; export it so"
        )
    if lines[1].upper() not in _SIDES:
        raise InputError(
            f"{path}, line {start + 2}: is '{lines[1]}'; it must be one of {', '.join(_SIDES)}"
        )
    landmarks, used = _landmarks(path, lines[2:])
    numbers = []
    for place, line in enumerate(lines[2 + used :], start=start + used + 3):
        for word in line.split():
            try:
                numbers.append(float(word))
            except ValueError:
                raise InputError(
                    f"{path}, line {place}: '{word}' is no number; export it again"
                ) from None
    values = iter(numbers)

    def following(count: int, what: str) -> Array:
        found = np.array([value for _, value in zip(range(count), values, strict=False)])
        if len(found) < count:
            raise InputError(
                f"{path}: ends after {len(found)} of {count} {what}; the file is not complete"
            )
        return found

    def whole(what: str, least: int) -> int:
        value = following(1, what)[0]
        if not (value.is_integer() and least <= value <= _MOST):
            raise InputError(f"{path}: has {value:g} {what}; it must be {least} to {_MOST}")
        return int(value)

    if not landmarks:
        whole("landmarks", 0)
    number = whole("radii of a level", 8)
    step = following(1, "angles")[0]
    angles = (
        np.deg2rad(step * np.arange(number)) if step else np.deg2rad(following(number, "angles"))
    )
    if step and abs(abs(step) * number - 360) > 0.5:
        raise InputError(f"{path}: {number} radii {step:g} degrees apart do not go once around")
    count = whole("levels", 2)
    spacing = following(1, "distances of levels")[0]
    levels: Array = spacing * np.arange(count) if spacing else following(count, "levels")
    radii: Array = following(count * number, "radii").reshape(count, number)
    if np.all(np.diff(levels) < 0):  # listed from the top
        levels, radii = np.flip(levels), np.flipud(radii)
    if not (np.all(np.diff(levels) > 0) and np.all(np.isfinite(radii)) and np.all(radii > 0)):
        raise InputError(f"{path}: levels must be in order and radii positive; export it again")
    left = len(list(values))
    if left:
        raise InputError(f"{path}: has {left} numbers more than its header says; export it again")
    return _Cylinder(levels, radii, angles, landmarks)
