"""A section that was drawn: outlines of skin and bones from CSV, DXF or SVG files."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import ClassVar

import numpy as np
import shapely

from calfsocket.imaging.anatomy import FIBULA_ANGLE, LEAST_SINE, Said, direction
from calfsocket.imaging.outlines import Outline, SectionOutlines
from calfsocket.imaging.section import RADII, SKIN_RADII, TOLERANCE, Section, smooth_outline
from calfsocket.imaging.source import sha256
from calfsocket.io.errors import InputError
from calfsocket.meshes import curves
from calfsocket.meshes.curves import Array
from calfsocket.meshes.drawn import Drawn, OutlineFile
from calfsocket.meshes.frame import Frame, View
from calfsocket.meshes.outline import READERS

#: Roles of files, or of the layers of one drawing.
ROLES = ("skin", "muscle", "tibia", "fibula", "tibia_cavity")
#: Width and height, mm, that outlines other than the skin's may have.
_INNER = (2.0, 400.0)
#: Points of a skin or bone from which a spline through them is taken to be what was meant.
_MANY = 400


class _Inner(OutlineFile):
    """How an outline within the skin is read."""

    extent: ClassVar[tuple[float, float]] = _INNER


def is_drawing(path: Path) -> bool:
    """Return whether a file is read as an outline."""
    return path.suffix.lower() in READERS


def read_outlines(
    parts: Mapping[str, Path | str] | Path | str,
    said: Said | None = None,
    seen_from: View = "above",
    tolerance: float = TOLERANCE,
) -> Section:
    """Read the outlines of a section.

    Parameters
    ----------
    parts
        Files by role: "skin", "muscle" (the envelope of all muscles), "tibia", "fibula",
        "tibia_cavity"; or one DXF or SVG drawing with a layer for each.
    said
        Side and anterior direction, such as "+y" or "0.2,1,0", where tibia and fibula do not tell.
    seen_from
        From where the section was drawn.
    tolerance
        Largest distance of the curves from what was drawn, mm.

    Raises
    ------
    InputError
        When a file cannot be read, or its outlines do not lie in one another.
    """
    said = said or Said()
    files, drawn = _read(parts)
    skin = shapely.Polygon(drawn["skin"].points)
    for name, each in drawn.items():
        body = shapely.Polygon(each.points)
        if name != "skin" and not shapely.make_valid(skin).contains(shapely.make_valid(body)):
            raise InputError(
                f"{each.path}: the outline of {name} is not inside the skin's; all outlines must"
                " have the same origin"
            )
    centre = np.array(skin.centroid.coords[0])
    bodies = {name: shapely.Polygon(each.points - centre) for name, each in drawn.items()}
    front, turn, found = _front(files, bodies, said, seen_from)
    rotation = np.array([[front[1], -front[0]], [front[0], front[1]]])
    data = {name: (each.points - centre) @ rotation.T for name, each in drawn.items()}
    outlines = {name: _outline(drawn[name], data[name], tolerance, name) for name in drawn}
    frame = Frame("lateral" if turn > 0 else "medial", "anterior") if turn else Frame()
    cavity = outlines.get("tibia_cavity")
    return Section(
        outlines=SectionOutlines(
            skin=outlines["skin"],
            bones={name: outlines[name] for name in ("tibia", "fibula") if name in outlines},
            cavities={"tibia": cavity} if cavity else {},
            muscle_envelope=outlines.get("muscle"),
            frame=frame,
            side=said.side,
        ),
        data=data,
        plane=None,
        level=None,
        height=None,
        height_mm=None,
        tolerance=tolerance,
        remarks=found,
        names=", ".join(files),
        files=files,
    )


def roles_of(files: Sequence[Path], said: Mapping[str, str]) -> dict[str, Path] | Path:
    """Return which file is what: as said, or by its name; a single drawing as it is."""
    if len(files) == 1 and not said:
        return files[0]
    found = {}
    for role, name in said.items():
        fits = [path for path in files if name in (str(path), path.name, path.stem)]
        if not fits:
            raise InputError(f"--{role}: no file '{name}'; there are {', '.join(map(str, files))}")
        found[role] = fits[0]
    for path in [path for path in files if path not in found.values()]:
        roles = [role for role in ROLES if role in path.stem.lower() and role not in found]
        if not roles:
            raise InputError(
                f"{path}: what is it? say so by --skin, --muscle, --tibia or --fibula, or by its"
                " name, such as tibia.csv"
            )
        found[max(roles, key=len)] = path
    return found


def _read(parts: Mapping[str, Path | str] | Path | str) -> tuple[dict[str, str], dict[str, Drawn]]:
    """Return hashes of files, and outlines by role."""
    drawn: dict[str, Drawn] = {}
    if not isinstance(parts, Mapping):
        path = Path(parts)
        if path.suffix.lower() == ".csv":
            raise InputError(f"{path}: is one outline; give those of skin and bones, a file each")
        for role in ROLES:
            try:
                drawn[role] = _one(path, role, role)
            except InputError as error:
                if role == "skin" or "no layer" not in str(error):
                    raise
        return {path.name: sha256(path)}, drawn
    for role, file in parts.items():
        if role not in ROLES:
            raise InputError(f"{file}: is '{role}'; outlines are {', '.join(ROLES)}")
        drawn[role] = _one(Path(file), role, None)
    if "skin" not in drawn:
        raise InputError(f"{', '.join(map(str, parts.values()))}: which one is the skin?")
    return {each.path.name: sha256(each.path) for each in drawn.values()}, drawn


def _one(path: Path, role: str, layer: str | None) -> Drawn:
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise InputError(f"{path}: is no outline; export it as one of {', '.join(READERS)}")
    drawn = reader(path, (OutlineFile if role == "skin" else _Inner)(layer=layer))
    if not shapely.LinearRing(drawn.points).is_ccw:
        return Drawn(path, drawn.points[::-1], drawn.places[::-1], drawn.unit)
    return drawn


def _outline(drawn: Drawn, points: Array, tolerance: float, name: str) -> Outline:
    """Return the spline through points that are smooth as they are, or one near them."""
    if len(points) <= _MANY and not drawn.corner():
        return Outline(curves.through(points))
    radii = SKIN_RADII if name in ("skin", "muscle") else RADII
    return smooth_outline(points, tolerance, f"{drawn.path}, {name}", radii)


def _front(
    files: Mapping[str, str], bodies: Mapping[str, shapely.Polygon], said: Said, seen_from: View
) -> tuple[Array, int, tuple[str, ...]]:
    """Return the anterior direction, which way anatomical angles turn, and how both were found.

    The second is 1 where they grow counter-clockwise, as in a right leg seen from above, -1 where
    they grow clockwise, and 0 where it is not known.
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
                    f"{', '.join(files)}: a left or a right limb? (tibia, fibula and flesh do not"
                    " tell) add --side left or --side right"
                )
            turn = 1 if sine < 0 else -1
            seen = ("right", "left") if turn > 0 else ("left", "right")
            found.append(
                f"side: {seen[0]} seen from above, or {seen[1]} seen from below, by tibia, fibula"
                " and the flesh behind them"
            )
    if said.anterior:
        front = direction(said.anterior, "anterior")[:2]
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
