"""The anatomical directions of a limb in its source: proximal, anterior, and the side."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import pyvista

from calfsocket.imaging.crest import CREST_ANGLE, SHARPER, crest
from calfsocket.imaging.plane import Cut, Plane, cut
from calfsocket.imaging.source import Source
from calfsocket.io.errors import InputError
from calfsocket.meshes.curves import Array

Side = Literal["left", "right"]
#: Anatomical angle of the direction from the tibia to the fibula in the reference calf, degrees.
#: It defines anterior in limbs in which only bones say what is in front.
FIBULA_ANGLE = -37.8
#: The flesh lies behind the line from tibia to fibula: the sine of the angle from it to the
#: skin's centroid, seen from above, is -0.43 in the reference calf, a right leg. Smaller ones do
#: not tell the side.
LEAST_SINE = 0.12
#: By how much a tibia must be thicker at its proximal end: a share. Towards the knee it flares.
_FLARE = 1.3
#: The same of the whole limb: a tip, or an ankle without the foot, has less than half of the area.
_TAPER = 2.0
#: By how much longer than wide a surface must be for its axis to be told from its shape.
_LONGER = 1.15
#: Share of the length of a bone or limb whose centroids make its axis, and levels in it: knee and
#: end are left out.
_SHAFT, _LEVELS = (0.2, 0.8), 13
#: Parts of the names of landmarks that lie in front of the tibia, or on the fibula.
_IN_FRONT, _LATERAL = ("crest", "tuber", "patel"), ("fib",)
_AXES = re.compile(r"([+-])([xyz])")


@dataclass(frozen=True)
class Said:
    """What the user says of the limb.

    Attributes
    ----------
    side : {"left", "right"}, optional
        Of the body.
    proximal, anterior : str, optional
        Directions in the source's axes: "+z", "-y" or three numbers, "0.1,0,1".
    """

    side: Side | None = None
    proximal: str | None = None
    anterior: str | None = None


@dataclass(frozen=True)
class Anatomy:
    """Directions of a limb in its source.

    Attributes
    ----------
    axis : Array
        Unit vector along the tibia, or the limb, to the proximal end.
    centre : Array
        A point on the axis, mm.
    anterior : Array, optional
        Unit vector square to the axis.
    side : {"left", "right"}, optional
    low, high : float
        Heights along the axis between which the skin lies, mm.
    found : sequence of str
        How each was found.
    """

    axis: Array
    centre: Array
    anterior: Array | None
    side: Side | None
    low: float
    high: float
    found: Sequence[str]

    def plane(self, height: float) -> Plane:
        """Return the plane of a section, seen from above; +y is anterior where that is known."""
        return Plane.square_to(self.axis, self.centre + height * self.axis, self.anterior)


def direction(text: str, what: str) -> Array:
    """Return the unit vector of "+z" or "0.1,0,1"."""
    axis = _AXES.fullmatch(text.strip())
    if axis:
        return np.eye(3)["xyz".index(axis[2])] * (1 if axis[1] == "+" else -1)
    try:
        vector = np.array([float(word) for word in text.split(",")])
    except ValueError:
        vector = np.zeros(0)
    if vector.shape != (3,) or not np.isfinite(vector).all() or not vector.any():
        raise InputError(
            f"{what}: is '{text}'; give +x, -x, +y, ... or three numbers such as 0,0,1"
        )
    return vector / np.linalg.norm(vector)


def find_anatomy(source: Source, said: Said) -> Anatomy:
    """Find axis, proximal end, anterior direction and side of a limb.

    What the source's shape does not tell and nobody said is asked for.
    """
    found: list[str] = []
    tibia = source.bones.get("tibia")
    body = (tibia or source.skin).surface
    centre = np.asarray(source.skin.surface.points.mean(axis=0), dtype=float)
    rough = _rough_axis(source, said)
    axis = _centre_line(body, rough)
    found.append(f"axis: of the {'tibia' if tibia else 'limb'}")
    axis, how = _upward(source, said, axis)
    found.append(f"proximal: {how}")
    heights = (source.skin.surface.points - centre) @ axis
    anterior, side = _front(source, said, axis, centre, found)
    return Anatomy(
        axis, centre, anterior, side, float(heights.min()), float(heights.max()), tuple(found)
    )


def _rough_axis(source: Source, said: Said) -> Array:
    if said.proximal:
        return direction(said.proximal, "proximal")
    if source.superior is not None:
        return source.superior
    parts = (source.skin, source.bones.get("tibia"))
    for surface in (shell.surface for shell in parts if shell is not None):
        centres = surface.cell_centers().points
        weights = surface.compute_cell_sizes(length=False, volume=False)["Area"]
        values, vectors = np.linalg.eigh(np.cov(centres.T, aweights=weights))
        if values[2] > _LONGER**2 * values[1]:
            return np.asarray(vectors[:, 2])
    raise InputError(
        f"{source.names}: is about as long as wide, so that its axis cannot be told; say where the"
        " trunk is: --proximal +z, say"
    )


def _levels(surface: pyvista.PolyData, axis: Array, part: tuple[float, float]) -> list[Plane]:
    heights = surface.points @ axis
    low, high = heights.min(), heights.max()
    middle = surface.points.mean(axis=0)
    middle = middle - (middle @ axis) * axis
    return [
        Plane.square_to(axis, middle + (low + share * (high - low)) * axis)
        for share in np.linspace(*part, _LEVELS)
    ]


def _ends(surface: pyvista.PolyData, axis: Array) -> tuple[Plane, Plane]:
    """Return planes near both ends."""
    planes = _levels(surface, axis, (0.1, 0.9))
    return planes[0], planes[-1]


def _closed(surface: pyvista.PolyData, plane: Plane) -> Cut | None:
    found = cut(surface, plane)
    return found if found.bodies and not found.gap else None


def _centre_line(surface: pyvista.PolyData, axis: Array) -> Array:
    """Return the direction of the line through the centroids of a shaft's sections."""
    for _ in range(3):
        centres = []
        for plane in _levels(surface, axis, _SHAFT):
            section = _closed(surface, plane)
            if section:
                flat = section.centre
                centres.append(plane.origin + flat[0] * plane.x + flat[1] * plane.y)
        if len(centres) < 3:
            return axis
        line = np.linalg.svd(np.array(centres) - np.mean(centres, axis=0))[2][0]
        axis = line if line @ axis > 0 else -line
    return axis


def _upward(source: Source, said: Said, axis: Array) -> tuple[Array, str]:
    """Return the axis to the proximal end, and how that was told."""
    if said.proximal:
        return axis, "as said"
    if source.superior is not None:
        return axis, "by the axes of the file"
    cues: dict[str, float] = {}
    tibia = source.bones.get("tibia")
    if tibia is not None:
        areas = [
            [
                part.area
                for plane in _levels(tibia.surface, axis, ends)
                if (part := _closed(tibia.surface, plane))
            ]
            for ends in ((0.06, 0.25), (0.75, 0.94))
        ]
        if all(areas):
            flare = float(np.mean(areas[1]) / np.mean(areas[0]))
            if max(flare, 1 / flare) > _FLARE:
                cues["where the tibia flares"] = float(np.sign(flare - 1))
    rim = _rim(source.skin.surface, axis)
    if rim:
        cues["where the skin is open"] = rim
    thick = [_closed(source.skin.surface, end) for end in _ends(source.skin.surface, axis)]
    if all(thick):
        taper = thick[1].area / thick[0].area  # type: ignore[union-attr]
        if max(taper, 1 / taper) > _TAPER:
            cues["where the limb is thicker"] = float(np.sign(taper - 1))
    if len(set(cues.values())) != 1:
        what = (
            f"it would lie at different ends by {' and '.join(cues)}"
            if cues
            else "neither tibia, nor an open end, nor a tip of the limb tells"
        )
        x, y, z = np.round(axis, 2) + 0.0
        raise InputError(
            f"{source.names}: which end is proximal? ({what}) add --proximal={x:g},{y:g},{z:g} or"
            f" --proximal={-x + 0.0:g},{-y + 0.0:g},{-z + 0.0:g}"
        )
    return axis * next(iter(cues.values())), " and ".join(cues)


def _rim(skin: pyvista.PolyData, axis: Array) -> float:
    """Return 1 or -1 where a surface is open at one end only, along the axis; else 0."""
    edges = skin.extract_feature_edges(
        boundary_edges=True, feature_edges=False, manifold_edges=False, non_manifold_edges=False
    )
    if not edges.n_points:
        return 0.0
    heights = skin.points @ axis
    share = (edges.points @ axis - heights.min()) / np.ptp(heights)
    if share.min() > 0.5:
        return 1.0
    return -1.0 if share.max() < 0.5 else 0.0


def _front(
    source: Source, said: Said, axis: Array, centre: Array, found: list[str]
) -> tuple[Array | None, Side | None]:
    """Return the anterior direction and the side, as far as they are known."""
    towards, sine = _bones_seen(source, axis)
    side: Side | None = said.side or source.side  # type: ignore[assignment]
    if side:
        found.append(f"side: {side}, {'as said' if said.side else 'by the file'}")
    front = None
    if said.anterior:
        front = _square(direction(said.anterior, "anterior"), axis, "anterior")
        found.append("anterior: as said")
    elif source.anterior is not None:
        front = _square(source.anterior, axis, "anterior")
        found.append("anterior: by the axes of the file")
    if towards is None:
        if front is None:
            front = _by_landmarks(source, axis, centre, _IN_FRONT)
            if front is not None:
                found.append("anterior: by the landmarks in front of the tibia")
        outward = _by_landmarks(source, axis, centre, _LATERAL)
        if front is not None and outward is not None and not side:
            side = "right" if float(outward @ np.cross(front, axis)) > 0 else "left"
            found.append(f"side: {side}, by the landmark of the fibula, which is lateral")
        if front is None and side and not source.bones:
            front = _by_crest(source, axis, side, found)
        return front, side
    if front is not None and not side:
        # Seen from above with the front up, lateral is to the right of a right leg.
        side = "right" if float(towards @ np.cross(front, axis)) > 0 else "left"
        found.append(f"side: {side}, by the fibula, which is lateral")
    if not side:
        if abs(sine) < LEAST_SINE:
            raise InputError(
                f"{source.names}: a left or a right limb? (tibia, fibula and flesh do not tell)"
                " add --side left or --side right"
            )
        side = "right" if sine < 0 else "left"
        found.append(f"side: {side}, by tibia, fibula and the flesh behind them")
    elif abs(sine) > LEAST_SINE and (sine < 0) != (side == "right"):
        found.append(
            f"caution: tibia, fibula and flesh look like the other side than {side}; is the"
            " proximal end right, or the source mirrored?"
        )
    if front is None:
        turn = np.deg2rad(90 - FIBULA_ANGLE) * (1 if side == "right" else -1)
        front = np.cos(turn) * towards + np.sin(turn) * np.cross(axis, towards)
        found.append("anterior: as in the reference calf, by the direction from tibia to fibula")
    return front, side


def _by_landmarks(source: Source, axis: Array, centre: Array, words: Sequence[str]) -> Array | None:
    """Return the mean direction from the axis to landmarks with one of the words in their names."""
    away = [
        _square(place - centre, axis, name)
        for name, place in source.landmarks.items()
        if any(word in name for word in words)
    ]
    mean = np.sum(away, axis=0)
    return np.asarray(mean / np.linalg.norm(mean)) if np.any(mean) else None


def _by_crest(source: Source, axis: Array, side: Side, found: list[str]) -> Array | None:
    """Return the anterior direction by the crest of the tibia, if the skin shows it."""
    planes = _levels(source.skin.surface, axis, _SHAFT)
    cuts = [_closed(source.skin.surface, plane) for plane in planes]
    ridge = crest([each.bodies[0] for each in cuts if each], planes[0])
    if ridge is None or ridge.sharper < SHARPER:
        return None
    found.append(
        f"anterior: assumed, by the sharpest ridge of the skin, taken to be the tibia's crest:"
        f" {ridge.sharper:.2f} times as sharp as the next one ({SHARPER:g} is asked for)"
    )
    turn = np.deg2rad(90 - CREST_ANGLE) * (1 if side == "right" else -1)
    front = np.cos(turn) * ridge.direction + np.sin(turn) * np.cross(axis, ridge.direction)
    return np.asarray(front)


def _square(vector: Array, axis: Array, what: str) -> Array:
    flat = vector - (vector @ axis) * axis
    length = float(np.linalg.norm(flat))
    if length < 0.3:
        raise InputError(f"{what}: lies along the limb's axis; give a direction across it")
    return np.asarray(flat / length)


def _bones_seen(source: Source, axis: Array) -> tuple[Array | None, float]:
    """Return the mean direction from tibia to fibula, and on which side of it the flesh lies.

    The second is the sine of the angle to the direction from the tibia to the skin's centroid,
    counter-clockwise as seen from above.
    """
    tibia, fibula = source.bones.get("tibia"), source.bones.get("fibula")
    if tibia is None or fibula is None:
        return None, 0.0
    directions, sines = [], []
    for plane in _levels(fibula.surface, axis, (0.1, 0.9)):
        parts = [_closed(shell.surface, plane) for shell in (tibia, fibula, source.skin)]
        if all(parts):
            one, other, whole = (part.centre for part in parts if part)
            line = (other - one) / np.linalg.norm(other - one)
            flesh = (whole - one) / np.linalg.norm(whole - one)
            directions.append(line[0] * plane.x + line[1] * plane.y)
            sines.append(line[0] * flesh[1] - line[1] * flesh[0])
    if not directions:
        return None, 0.0
    mean = np.mean(directions, axis=0)
    return np.asarray(mean / np.linalg.norm(mean)), float(np.mean(sines))
