"""A limb from a source, in one step."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Self

import numpy as np

import calfsocket
from calfsocket.imaging.anatomy import Anatomy, Said, Side, find_anatomy
from calfsocket.imaging.lumped import SKIN_THICKNESS, lumped
from calfsocket.imaging.plane import Level
from calfsocket.imaging.section import Section, section
from calfsocket.imaging.source import Source, read_surface
from calfsocket.io.errors import InputError, error_context
from calfsocket.meshes import limb as meshes
from calfsocket.meshes.curves import Array
from calfsocket.meshes.limb import Provenance

Tissues = Literal["lumped"]


@dataclass(frozen=True)
class Imported:
    """A limb that was made from a source.

    Attributes
    ----------
    limb : Limb
    section : Section
        The section of the source that it was made from.
    """

    limb: "Limb"
    section: Section


class Limb(meshes.Limb):
    """A transverse section of a limb: the reference calf, from a file, or from a source.

    Attributes
    ----------
    title : str
        For reports.
    side : {"left", "right"}, optional
        Of the body.
    seen_from : {"above", "below"}, optional
        From where the section is seen.
    axes : mapping
        What ``"+x"`` and ``"+y"`` point to: lateral, anterior, medial or posterior.
    fixed_boundary, contact_boundary : str
        The curves where the limb is fixed, and of the skin.
    layers : Layers, optional
        Thickness of skin and fat where their curves are offsets.
    curves : mapping
        By name.
    regions : tuple of Region
        What is meshed.
    remarks : tuple of str
        Keys of the file that nothing is computed from.
    source : Provenance, optional
        What it was made from.
    """

    @classmethod
    def from_surface(
        cls,
        *paths: Path | str,
        level: float | str = 0.5,
        plane: tuple[Sequence[float], Sequence[float]] | None = None,
        units: str = "mm",
        tolerance: float | None = None,
        side: Side | None = None,
        proximal: str | None = None,
        anterior: str | None = None,
        skin: str | None = None,
        muscle: str | None = None,
        tibia: str | None = None,
        fibula: str | None = None,
        skin_thickness: float = SKIN_THICKNESS,
    ) -> Self:
        """Make a limb from surfaces of its skin and bones, of lumped tissues.

        Parameters
        ----------
        *paths
            STL, PLY, OBJ, VTP or AOP: a file for each tissue, or one with several closed shells.
        level
            Share of the height, from 0 at the distal end to 1 at the proximal end, or a distance
            such as ``"80 mm"`` or ``"80 mm from proximal"``; square to the tibia's axis.
        plane
            A point, mm, and a normal in the source's axes, instead of a level.
        units
            Of the files: mm, cm, m or inch.
        tolerance
            Largest distance of the curves from the data, mm (default 0.2).
        side
            "left" or "right", where tibia and fibula do not tell.
        proximal, anterior
            Directions in the source's axes, such as ``"+z"`` or ``"0.1,0,1"``, where its shape does
            not tell.
        skin, muscle, tibia, fibula
            Which file or shell is what, where size and nesting do not tell.
        skin_thickness
            mm.

        Raises
        ------
        InputError
            One line: file, level, place, and what to do.
        """
        roles = {"skin": skin, "muscle": muscle, "tibia": tibia, "fibula": fibula}
        source = read_surface(list(paths), units, {k: v for k, v in roles.items() if v})
        anatomy = find_anatomy(source, Said(side, proximal, anterior))
        at = None if plane else Level.parse(level)
        return cls._of(imported(source, anatomy, at, plane, tolerance, skin_thickness).limb)

    @classmethod
    def _of(cls, limb: meshes.Limb) -> Self:
        return cls.model_construct(**dict(limb))


def imported(
    source: Source,
    anatomy: Anatomy,
    level: Level | None,
    plane: tuple[Sequence[float], Sequence[float]] | None = None,
    tolerance: float | None = None,
    skin_thickness: float = SKIN_THICKNESS,
) -> Imported:
    """Make a limb of a source at a level, or in a plane."""
    at = (np.asarray(plane[0], float), np.asarray(plane[1], float)) if plane else None
    part = section(source, anatomy, level, at, tolerance)
    where = f"level {level}" if level else "the plane"
    with error_context(source.names, where):
        limb, assumed = lumped(part.outlines, skin_thickness, title=f"{source.names}, {where}")
    return Imported(Limb._of(_recorded(limb, source, part, where, assumed)), part)


def _recorded(
    limb: meshes.Limb, source: Source, part: Section, where: str, assumed: Sequence[str]
) -> meshes.Limb:
    plane = part.plane
    origin = Provenance(
        files=dict(source.files),
        level=where,
        height=round(part.height, 4),
        origin=_triple(plane.origin),
        normal=_triple(plane.normal),
        anterior=_triple(plane.y),
        tolerance_mm=part.tolerance,
        program=f"calfsocket {calfsocket.__version__}",
        found=tuple(part.remarks),
        assumed=tuple(assumed),
    )
    return limb.model_copy(update={"source": origin})


def _triple(vector: Array) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in np.round(vector, 5) + 0.0)
    return x, y, z


def plane_of(text: str) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Read a plane: six numbers, a point in mm and a normal, in the source's axes."""
    try:
        numbers = tuple(float(word) for word in text.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) != 6 or not np.isfinite(numbers).all() or not any(numbers[3:]):
        raise InputError(
            f"plane: is '{text}'; give a point and a normal: six numbers such as 0,0,80,0,0,1"
        )
    return numbers[:3], numbers[3:]
