"""A limb of lumped tissues: skin, fat where it is known, one soft tissue, bones."""

import re
from typing import Any

import numpy as np
import shapely
import shapely.affinity
from shapely.geometry.base import BaseGeometry

from calfsocket.imaging.outlines import Outline, SectionOutlines
from calfsocket.io.errors import InputError
from calfsocket.meshes import curves
from calfsocket.meshes.curves import Array, ClosedCurve, xy
from calfsocket.meshes.fairing import fair
from calfsocket.meshes.limb import Limb

#: Thickness of the skin, mm, and share of the tibia's area that is its marrow cavity: both those
#: of the reference calf.
SKIN_THICKNESS, _CAVITY_SHARE = 1.6, 0.37
#: Distance, mm, that layers keep from what lies beneath them, so that elements fit between. Where
#: there is less room the layer above thins out, the skin to this at least.
_GAP, _THINNEST_SKIN = 0.5, 0.4
#: Radius, mm, by which corners are rounded where outlines were joined.
_ROUND = 2.5
#: Wall, mm, that an assumed cavity leaves to its bone.
_WALL = 1.0
#: Distance of the points of polygons, mm, and how far a curve may leave them.
_STEP, _TOLERANCE = 0.5, 0.2


def lumped(
    outlines: SectionOutlines, skin_thickness: float = SKIN_THICKNESS, **given: Any
) -> tuple[Limb, tuple[str, ...]]:
    """Return the limb that a section's outlines make without an atlas, and what was assumed.

    Parameters
    ----------
    skin_thickness
        mm; thinner where the skin lies on bone.
    **given
        Further attributes of the limb, such as its title.

    Raises
    ------
    InputError
        When the section has no bone, which is where the limb is held.
    """
    if not 0.2 <= skin_thickness <= 10:
        raise InputError(f"skin thickness: is {skin_thickness:g} mm; it must be 0.2 to 10")
    if not outlines.bones:
        raise InputError(
            "no bone is known there, and a bone is where the limb is held; give the surface of the"
            " tibia too"
        )
    assumed = [f"skin: {skin_thickness:g} mm thick"]
    bones = {region_name(name): outline for name, outline in outlines.bones.items()}
    made = {"skin": outlines.skin.curve} | {name: bone.curve for name, bone in bones.items()}
    covered = shapely.union_all([_polygon(bone.curve).buffer(_GAP) for bone in bones.values()])
    envelope = outlines.muscle_envelope
    if envelope is not None:
        muscle = _over(_polygon(envelope.curve), covered, assumed, "muscle")
        made["muscle"] = _curve(muscle)
        covered = muscle.buffer(_GAP)
    else:
        assumed.append("fat: not known; all between skin and bones is one tissue, muscle")
    skin = _polygon(outlines.skin.curve)
    inner = _over(skin.buffer(-skin_thickness), covered, assumed, "skin")
    _check_room(skin, inner)
    made["skin_inner"] = _curve(inner)
    held = "tibia" if "tibia" in bones else max(bones, key=lambda name: bones[name].curve.area)
    cavity = outlines.cavities.get("tibia" if held == "tibia" else _original(outlines, held))
    made["cavity"] = cavity.curve if cavity else _assumed_cavity(bones[held].curve)
    if not cavity:
        assumed.append(
            f"{held}: its marrow cavity, {100 * _CAVITY_SHARE:.0f} % of its area as in the"
            " reference calf; the limb is held there"
        )
    frame, side = outlines.frame, outlines.side
    content: dict[str, Any] = {
        "units": "mm, deg",
        "side": side,
        "seen_from": frame.view(side) if frame.known and side else None,
        "axes": {"+x": frame.x, "+y": frame.y} if frame.known else {},
        "fixed_boundary": "cavity",
        "contact_boundary": "skin",
        "curves": {name: _spline(curve) for name, curve in made.items()},
        "regions": _regions(outlines.skin, envelope, bones, held),
    }
    limb = Limb(**content, **given)
    return limb, tuple(assumed)


def region_name(name: str) -> str:
    """Return a name that a region can have."""
    return re.sub(r"[^a-z0-9_]+", "_", name.lower()).strip("_") or "region"


def _original(outlines: SectionOutlines, region: str) -> str:
    return next(name for name in outlines.bones if region_name(name) == region)


def _regions(
    skin: Outline, envelope: Outline | None, bones: dict[str, Outline], held: str
) -> tuple[dict[str, Any], ...]:
    regions: list[dict[str, Any]] = [
        {"name": "skin", "tissue": "skin", "outer": "skin", "holes": ["skin_inner"],
         "origin": "assumed", "deviation_mm": skin.deviation_mm},
    ]  # fmt: skip
    soft: dict[str, Any] = {"name": "soft_tissue", "tissue": "muscle", "outer": "skin_inner"}
    if envelope:
        fat = {"name": "subcutaneous_fat", "tissue": "fat", "outer": "skin_inner"}
        regions.append(fat | {"holes": ["muscle"], "origin": "measured"})
        soft |= {"name": "muscle", "outer": "muscle", "deviation_mm": envelope.deviation_mm}
    regions.append(soft | {"holes": list(bones), "origin": "measured"})
    for name, bone in bones.items():
        holes = ["cavity"] if name == held else []
        regions.append(
            {"name": name, "tissue": "bone", "outer": name, "holes": holes,
             "origin": bone.origin, "deviation_mm": bone.deviation_mm}
        )  # fmt: skip
    return tuple({"id": number} | region for number, region in enumerate(regions, start=1))


def _over(
    layer: BaseGeometry, covered: BaseGeometry, assumed: list[str], name: str
) -> shapely.Polygon:
    """Return what lies beneath a layer, so that it encloses what must be covered."""
    if layer.contains(covered):
        return _largest(layer)
    assumed.append(f"{name}: moved outward by less than it is thick, where bone lies beneath it")
    joined = layer.union(covered)
    return _largest(joined.buffer(_ROUND).buffer(-2 * _ROUND).buffer(_ROUND).union(covered))


def _largest(body: BaseGeometry) -> shapely.Polygon:
    polygons = [part for part in shapely.get_parts(body) if isinstance(part, shapely.Polygon)]
    return max(polygons, key=lambda part: part.area)


def _check_room(skin: shapely.Polygon, inner: shapely.Polygon) -> None:
    """Raise an InputError where the skin would be too thin."""
    left = skin.exterior.distance(inner) if skin.contains(inner) else 0.0
    if left < _THINNEST_SKIN:
        places = shapely.get_coordinates(inner.exterior)
        distances = shapely.distance(shapely.points(places), skin.exterior)
        outside = ~shapely.contains_xy(skin, *places.T)
        worst = int(np.argmin(np.where(outside, -distances, distances)))
        raise InputError(
            f"the skin would be {left:.2f} mm thick on what lies beneath it at"
            f" {xy(places[worst])}; there must be room for {_THINNEST_SKIN:g} mm, and"
            f" {_GAP:g} mm beneath it: choose another level, or correct the surfaces"
        )


def _assumed_cavity(bone: ClosedCurve) -> ClosedCurve:
    """Return a cavity of the reference's share of a bone, of the same shape where that fits."""
    whole = _polygon(bone)
    centre = shapely.maximum_inscribed_circle(whole).coords[0]  # type: ignore[attr-defined]
    share = np.sqrt(_CAVITY_SHARE)
    scaled = shapely.affinity.scale(whole, share, share, origin=centre)
    if not whole.buffer(-_WALL).contains(scaled):
        depth = _WALL
        while whole.buffer(-depth).area > _CAVITY_SHARE * whole.area:
            depth += 0.1
        scaled = _largest(whole.buffer(-depth).buffer(-_ROUND).buffer(_ROUND))
    return _curve(scaled)


def _polygon(curve: ClosedCurve) -> shapely.Polygon:
    return shapely.Polygon(curve.evaluate(curve.sample(_STEP)))


def _curve(polygon: shapely.Polygon) -> ClosedCurve:
    """Return a smooth curve along a polygon."""
    even = polygon.exterior.simplify(0.01).segmentize(_STEP)
    points: Array = shapely.get_coordinates(even)[:-1]
    if not polygon.exterior.is_ccw:
        points = points[::-1]
    return curves.through(fair(points, _TOLERANCE, step=2 * _STEP)[0])


def _spline(curve: ClosedCurve) -> dict[str, Any]:
    """Return a curve as the file has it: the points between which its cubics lie."""
    points = np.round(curve.evaluate(curve.knots[:-1]), 4) + 0.0
    return {"type": "spline", "points": points.tolist()}
