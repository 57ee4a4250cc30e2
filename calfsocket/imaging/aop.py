"""AOP: a limb's surface in cylindrical coordinates, as programs of prosthetics write it.

The lines of such a file are: AAOP1; comments; END COMMENTS; CYLINDRICAL; LEFT, RIGHT or NONE;
0; the number of radii of a level; their distance in degrees; the number of levels; the distance of
the levels in mm or, where that is 0, the place of each; then all radii, level after level, in mm.
"""

from pathlib import Path

import numpy as np

from calfsocket.io.errors import InputError
from calfsocket.meshes.curves import Array

#: Levels or radii of a file; more are no limb.
_MOST = 5000
_COORDINATES = "CYLINDRICAL"
_SIDES = ("LEFT", "RIGHT", "NONE", "BOTH")


def read_aop(path: Path) -> tuple[Array, np.ndarray]:
    """Return points and triangles of the surface, open at the first and last level."""
    levels, radii, angles = _read(path)
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


def _lines(path: Path) -> tuple[int, list[str]]:
    """Return the number of lines of the comments, and the lines after them."""
    lines = [line.strip() for line in path.read_text(encoding="latin-1").splitlines()]
    if not lines or not lines[0].upper().startswith("AAOP"):
        raise InputError(f"{path}: is no AOP file: its first line is not AAOP1")
    upper = [line.upper() for line in lines]
    if "END COMMENTS" not in upper:
        raise InputError(f"{path}: has no line END COMMENTS; export it again")
    start = upper.index("END COMMENTS") + 1
    return start, [*lines[start:], "", ""]


def _read(path: Path) -> tuple[Array, Array, Array]:
    """Return levels (n), radii (n, m) and angles (m) in radians."""
    start, lines = _lines(path)
    if lines[0].upper() != _COORDINATES:
        raise InputError(
            f"{path}, line {start + 1}: is '{lines[0]}'; only {_COORDINATES} is read; export it so"
        )
    if lines[1].upper() not in _SIDES:
        raise InputError(
            f"{path}, line {start + 2}: is '{lines[1]}'; it must be one of {', '.join(_SIDES)}"
        )
    numbers = []
    for place, line in enumerate(lines[2:], start=start + 3):
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

    if whole("landmarks", 0):
        raise InputError(f"{path}: has landmarks, which are not read; export it without them")
    number = whole("radii of a level", 8)
    step = following(1, "angles")[0]
    angles = (
        np.deg2rad(step * np.arange(number)) if step else np.deg2rad(following(number, "angles"))
    )
    if step and abs(step * number - 360) > 0.5:
        raise InputError(f"{path}: {number} radii {step:g} degrees apart do not go once around")
    count = whole("levels", 2)
    spacing = following(1, "distances of levels")[0]
    levels = spacing * np.arange(count) if spacing else following(count, "levels")
    radii = following(count * number, "radii").reshape(count, number)
    if not (np.all(np.diff(levels) > 0) and np.all(np.isfinite(radii)) and np.all(radii > 0)):
        raise InputError(f"{path}: levels must increase and radii be positive; export it again")
    left = len(list(values))
    if left:
        raise InputError(f"{path}: has {left} numbers more than its header says; export it again")
    return levels, radii, angles
