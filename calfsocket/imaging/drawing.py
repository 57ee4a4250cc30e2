"""A section that was drawn: its outlines from CSV, DXF or SVG files."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path

import numpy as np
import shapely
from shapely.affinity import translate
from shapely.geometry.base import BaseGeometry

from calfsocket.imaging.anatomy import FIBULA_ANGLE, LEAST_SINE, Said, direction
from calfsocket.imaging.drawing_parts import Parts, read_parts
from calfsocket.imaging.label_table import CAVITY, Meaning
from calfsocket.imaging.outlines import Outline, SectionOutlines
from calfsocket.imaging.section import (
    RADII,
    SKIN_RADII,
    TOLERANCE,
    Section,
    around_all,
    blunt,
    check_tolerance,
    mean_thickness,
    parts,
    smooth_outline,
)
from calfsocket.imaging.shapes import largest, outside
from calfsocket.io.errors import InputError
from calfsocket.meshes import curves
from calfsocket.meshes.curves import Array, xy
from calfsocket.meshes.drawn import Drawn
from calfsocket.meshes.frame import Frame, View

#: Points of a skin or bone from which a spline through them is taken to be what was meant.
_MANY = 400
#: Muscles and bones are all there if, with the gaps between them closed, they fill this share of
#: their convex hull: 0.996 in the reference calf, at most 0.97 without one of its outer muscles.
_COMPLETE = 0.98
#: Files of a section that its title lists.
_LISTED = 5
#: +x and +y of a drawing, in space.
_XY = np.eye(2, 3)
#: Crural fascia around muscles of which no envelope was drawn, mm: as over the atlas's bellies.
_FASCIA = 0.74


def read_outlines(
    files: Mapping[str, Path | str] | Path | str,
    said: Said | None = None,
    seen_from: View = "above",
    tolerance: float = TOLERANCE,
) -> Section:
    """Read the outlines of a section.

    Parameters
    ----------
    files
        Files by name: "skin", "muscle" (the envelope of all muscles), "tibia", "fibula",
        "tibia_cavity", and single muscles, vessels and tendons as in a table of labels: "soleus",
        "muscle 3", "my_calf:muscle"; or one DXF or SVG drawing with a layer or an id for each.
    said
        Side and anterior direction, such as "+y" or "0.2,1,0", where tibia and fibula do not tell.
    seen_from
        From where the section was drawn.
    tolerance
        Largest distance of the curves from what was drawn, and largest overlap, mm.

    Raises
    ------
    InputError
        When a file or a name is not understood, or outlines overlap or do not lie in one another.
    """
    said = said or Said()
    return section_of(read_parts(files, said.side), said, seen_from, tolerance)


def section_of(
    read: Parts, said: Said, seen_from: View, tolerance: float, axes: Array = _XY
) -> Section:
    """Return the section of outlines that were read; `axes` are their +x and +y in space."""
    check_tolerance(tolerance)
    said = replace(said, side=said.side or read.side)
    remarks = list(read.remarks)
    drawn = _named(read, remarks)
    bodies = {name: _area(each.points) for name, (_, each) in drawn.items()}
    skin = bodies["skin"]
    for name, (_, each) in drawn.items():
        if name != "skin" and not skin.contains(bodies[name]):
            raise InputError(
                f"{each.path}: the outline of {name} is not inside the skin's; all outlines must"
                " have the same origin"
            )
    roles = _Roles.of({name: each for name, (each, _) in drawn.items()}, bodies, remarks)
    paths = {name: each.path for name, (_, each) in drawn.items()}
    _check_overlaps(roles, bodies, paths, tolerance)
    centre = np.array(shapely.Polygon(drawn["skin"][1].points).centroid.coords[0])
    about = {name: translate(bodies[name], *-centre) for name in ("skin", *roles.bones)}
    front, turn, found = front_of(_listed(list(read.files)), about, said, seen_from, axes)
    rotation = np.array([[front[1], -front[0]], [front[0], front[1]]])
    data = {name: (each.points - centre) @ rotation.T for name, (_, each) in drawn.items()}
    outlines = {
        name: _belly(each, data[name], tolerance) if name in roles.regions
        else _outline(each, data[name], tolerance, name, name in ("skin", roles.envelope))
        for name, (_, each) in drawn.items()
    }  # fmt: skip
    envelope = outlines[roles.envelope] if roles.envelope else _around(roles, data, remarks)
    frame = Frame("lateral" if turn > 0 else "medial", "anterior") if turn else Frame()
    return Section(
        outlines=SectionOutlines(
            skin=outlines["skin"],
            bones={name: outlines[name] for name in roles.bones},
            cavities={bone: outlines[name] for bone, name in roles.cavities.items()},
            muscle_envelope=envelope,
            skin_thickness=mean_thickness(skin, bodies[roles.fat]) if roles.fat else None,
            regions={name: (tissue, outlines[name]) for name, tissue in roles.regions.items()},
            frame=frame,
            side=said.side,
        ),
        data=data,
        plane=None,
        level=None,
        height=None,
        height_mm=None,
        tolerance=tolerance,
        remarks=(*found, *remarks),
        names=_listed(list(read.files)),
        files=read.files,
    )


def _listed(names: Sequence[str]) -> str:
    """Name some files, and how many more there are."""
    if len(names) <= _LISTED:
        return ", ".join(names)
    return f"{', '.join(names[: _LISTED - 1])} and {len(names) - _LISTED + 1} more files"


def _named(read: Parts, remarks: list[str]) -> dict[str, tuple[Meaning, Drawn]]:
    """Return curves under names of their own, and what they are; crumbs are left out."""
    found: dict[str, tuple[Meaning, Drawn]] = {}
    for region, drawn in read.curves.items():
        each = read.meanings[region]
        if not each.is_region:
            found[region] = each, drawn[0]
            continue
        areas = [_area(curve.points).area for curve in drawn]
        for name, number in parts(areas, region, remarks, read.curves):
            found[name] = each, drawn[number]
    return found


@dataclass(frozen=True)
class _Roles:
    """Which curve is what.

    Attributes
    ----------
    bones : sequence of str
    cavities : dict of str to str
        By bone.
    regions : dict of str to str
        Tissues of muscles, vessels and tendons.
    envelope, fat : str
        Around all muscles, and below the skin; empty where not drawn.
    """

    bones: Sequence[str]
    cavities: Mapping[str, str]
    regions: Mapping[str, str]
    envelope: str
    fat: str

    @classmethod
    def of(
        cls, drawn: Mapping[str, Meaning], bodies: Mapping[str, BaseGeometry], remarks: list[str]
    ) -> "_Roles":
        """Sort curves by what they are."""

        def around(names: Sequence[str]) -> str:
            """Return the outer one of curves around the same."""
            first, *others = sorted(names, key=lambda name: -bodies[name].area) or [""]
            remarks.extend(f"{name}: not used, for it lies in {first}" for name in others)
            return first

        layers = {name: each for name, each in drawn.items() if not each.is_region}
        bones = [name for name, each in layers.items() if each.tissue == "bone"]
        for name, each in layers.items():
            if each.tissue == "skin" and name != "skin":
                remarks.append(f"{name}: not used; the outline below the skin is that of the fat")
        return cls(
            bones=[name for name in bones if not name.endswith(CAVITY)],
            cavities={name.removesuffix(CAVITY): name for name in bones if name.endswith(CAVITY)},
            regions={name: each.tissue for name, each in drawn.items() if each.is_region},
            envelope=around(
                [name for name, each in layers.items() if each.tissue in ("muscle", "fascia")]
            ),
            fat=around([name for name, each in layers.items() if each.tissue == "fat"]),
        )

    @property
    def muscles(self) -> Sequence[str]:
        """Return the single muscles."""
        return [name for name, tissue in self.regions.items() if tissue == "muscle"]


def _check_overlaps(
    roles: _Roles,
    bodies: Mapping[str, BaseGeometry],
    paths: Mapping[str, Path],
    tolerance: float,
) -> None:
    """Raise an InputError where muscles, bones or vessels overlap by more than the tolerance.

    A vessel may be drawn over a muscle, which gives way.
    """

    def check(area: BaseGeometry, name: str, other: str, how: str) -> None:
        if area.buffer(-tolerance / 2).is_empty:
            return
        circle = shapely.maximum_inscribed_circle(largest(area))  # type: ignore[attr-defined]
        files = ", ".join(dict.fromkeys(str(paths[each]) for each in (name, other)))
        raise InputError(
            f"{files}: {how} by {2 * circle.length:.2g} mm near {xy(np.array(circle.coords[0]))},"
            f" more than the tolerance, {tolerance:g} mm; correct the outlines, or add --tolerance"
        )

    flesh = {*roles.bones, *roles.muscles}
    for name, other in combinations([*roles.regions, *roles.bones], 2):
        if {name, other} <= flesh or not {name, other} & set(roles.muscles):
            both = bodies[name].intersection(bodies[other])
            check(both, name, other, f"{name} and {other} overlap")
    for name in roles.muscles if roles.envelope else ():
        out = bodies[name].difference(bodies[roles.envelope])
        check(out, name, roles.envelope, f"{name} leaves {roles.envelope}, which is around it,")


def _around(roles: _Roles, data: Mapping[str, Array], remarks: list[str]) -> Outline | None:
    """Return the envelope of muscles and bones that leave no room for others; else nothing."""
    if not roles.muscles or not roles.bones:
        return None
    names = (*roles.bones, *roles.muscles)
    bodies = [_area(data[name]) for name in names]
    said: list[str] = []
    closed = around_all(bodies, said)
    if closed.area < _COMPLETE * shapely.union_all(bodies).convex_hull.area:
        return None
    remarks += [*said, "muscle: the envelope lies around the muscles that were drawn"]
    return blunt(outside(closed.buffer(_FASCIA)))


def _area(points: Array) -> BaseGeometry:
    return shapely.make_valid(shapely.Polygon(points))


def _belly(drawn: Drawn, points: Array, tolerance: float) -> Outline:
    """Return a muscle or vessel; spurs are cut off where no smooth curve follows them."""
    try:
        return _outline(drawn, points, tolerance, "", False)
    except InputError:
        return blunt(points)


def _outline(drawn: Drawn, points: Array, tolerance: float, name: str, wide: bool) -> Outline:
    """Return the spline through points that are smooth as they are, or one near them."""
    if len(points) <= _MANY and not drawn.corner():
        return Outline(curves.through(points))
    radii = SKIN_RADII if wide else RADII
    return smooth_outline(points, tolerance, f"{drawn.path}, {name}", radii)


def front_of(
    files: str,
    bodies: Mapping[str, BaseGeometry],
    said: Said,
    seen_from: View,
    axes: Array = _XY,
) -> tuple[Array, int, tuple[str, ...]]:
    """Return the anterior direction, which way anatomical angles turn, and how both were found.

    The second is 1 where they grow counter-clockwise, as in a right leg seen from above, -1 where
    they grow clockwise, and 0 where it is not known. `axes` are the drawing's +x and +y in space.
    """
    turn, found = 0, []
    if said.side:
        turn = 1 if (said.side == "right") == (seen_from == "above") else -1
        found.append(f"side: {said.side}, seen from {seen_from}, as said")
    towards = None
    if "tibia" in bodies and "fibula" in bodies:
        tibia, fibula = (np.array(bodies[name].centroid.coords[0]) for name in ("tibia", "fibula"))
        towards = (fibula - tibia) / np.linalg.norm(fibula - tibia)
        flesh = -tibia / max(float(np.linalg.norm(tibia)), 1e-9)
        sine = float(towards[0] * flesh[1] - towards[1] * flesh[0])
        if not turn:
            if abs(sine) < LEAST_SINE:
                raise InputError(
                    f"{files}: a left or a right limb? (tibia, fibula and flesh do not"
                    " tell) add --side left or --side right"
                )
            turn = 1 if sine < 0 else -1
            seen = ("right", "left") if turn > 0 else ("left", "right")
            found.append(
                f"side: {seen[0]} seen from above, or {seen[1]} seen from below, by tibia, fibula"
                " and the flesh behind them"
            )
    if said.anterior:
        front = axes @ direction(said.anterior, "anterior")
        if np.linalg.norm(front) < 0.3:
            raise InputError(f"anterior: '{said.anterior}' leaves the drawing; give +x, -y, ...")
        found.append("anterior: as said")
        return front / np.linalg.norm(front), turn, tuple(found)
    if towards is None or not turn:
        return np.array([0.0, 1.0]), 0, tuple(found)
    angle = np.deg2rad(90 - FIBULA_ANGLE) * turn
    c, s = np.cos(angle), np.sin(angle)
    front = np.array([c * towards[0] - s * towards[1], s * towards[0] + c * towards[1]])
    found.append("anterior: as in the reference calf, by the direction from tibia to fibula")
    return front, turn, tuple(found)
