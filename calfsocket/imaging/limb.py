"""A limb from a source, in one step."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, Self

import numpy as np

import calfsocket
from calfsocket.imaging.anatomy import Said, Side, find_anatomy
from calfsocket.imaging.atlas import AtlasLimb, carried
from calfsocket.imaging.drawing import read_outlines
from calfsocket.imaging.labels import read_labels
from calfsocket.imaging.lumped import SKIN_THICKNESS, lumped
from calfsocket.imaging.mesh.limb import limb_of_mesh, section_of_mesh
from calfsocket.imaging.mesh.plane_mesh import ON_CURVE
from calfsocket.imaging.plane import Level
from calfsocket.imaging.section import TOLERANCE, Section, section
from calfsocket.imaging.source import Source, read_surface
from calfsocket.imaging.volume import is_volume
from calfsocket.io.errors import InputError, error_context
from calfsocket.meshes import limb as meshes
from calfsocket.meshes.curves import Array
from calfsocket.meshes.frame import View
from calfsocket.meshes.limb import Provenance

Tissues = Literal["atlas", "lumped"]
Plane = tuple[Sequence[float], Sequence[float]]


@dataclass(frozen=True)
class Filling:
    """What lies between the outlines of a section.

    Attributes
    ----------
    tissues : {"atlas", "lumped"}
        The regions of the reference calf carried into the section, or one soft tissue.
    skin_thickness, fat_thickness : float, optional
        mm; by default those of the reference calf. Fat is for the atlas alone, where no envelope
        of the muscles is known.
    crest, fibular_head : float, optional
        Anatomical angles of tibia and fibula, degrees, for the atlas and a scan of the skin alone.
    septum : float, optional
        Thickness, mm, of septa between muscles that touch in the source; by default the median of
        the reference calf's.
    """

    tissues: Tissues = "atlas"
    skin_thickness: float | None = None
    fat_thickness: float | None = None
    crest: float | None = None
    fibular_head: float | None = None
    septum: float | None = None


@dataclass(frozen=True)
class Imported:
    """A limb that was made from a source.

    Attributes
    ----------
    limb : Limb
    section : Section
        The section of the source that it was made from.
    atlas : AtlasLimb, optional
        What was measured of the atlas's map and layers.
    """

    limb: "Limb"
    section: Section
    atlas: AtlasLimb | None = None


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
    mesh : GivenMesh, optional
        A mesh that was made elsewhere and is solved as it is.
    """

    @classmethod
    def from_surface(
        cls,
        *paths: Path | str,
        level: float | str = 0.5,
        plane: Plane | None = None,
        units: str = "mm",
        tolerance: float | None = None,
        side: Side | None = None,
        proximal: str | None = None,
        anterior: str | None = None,
        skin: str | None = None,
        muscle: str | None = None,
        tibia: str | None = None,
        fibula: str | None = None,
        **filling: Any,
    ) -> Self:
        """Make a limb from surfaces of its skin and bones.

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
        **filling
            ``tissues`` ("atlas" or "lumped"), ``skin_thickness``, ``fat_thickness``, mm, and
            ``crest``, ``fibular_head``, degrees, ``septum``, mm: see
            `calfsocket.imaging.limb.Filling`.

        Raises
        ------
        InputError
            One line: file, level, place, and what to do.
        """
        roles = {"skin": skin, "muscle": muscle, "tibia": tibia, "fibula": fibula}
        source = read_surface(list(paths), units, {k: v for k, v in roles.items() if v})
        said = Said(side, proximal, anterior)
        return cls._of(imported(_cut(source, said, level, plane, tolerance), filling).limb)

    @classmethod
    def from_labels(
        cls,
        path: Path | str,
        labels: Path | str,
        *,
        level: float | str = 0.5,
        plane: Plane | None = None,
        voxel: tuple[float, float, float] | None = None,
        tolerance: float | None = None,
        side: Side | None = None,
        proximal: str | None = None,
        anterior: str | None = None,
        **filling: Any,
    ) -> Self:
        """Make a limb from a label map.

        Parameters
        ----------
        path
            NIfTI, NRRD, MetaImage, a TIFF with several pages, or a folder of PNG or TIFF slices, in
            any orientation.
        labels
            CSV that says what the labels are: ``label,region`` a line, such as ``3,tibia``, and the
            tissue behind it where the region's name does not say it.
        voxel
            Size of a voxel in mm, for pictures.
        tolerance
            Largest distance of the curves from the data, mm (default: half a voxel).
        level, plane, side, proximal, anterior, **filling
            As of `from_surface`.

        Raises
        ------
        InputError
            One line: file, level, place, and what to do.
        """
        source = read_labels(path, labels, voxel, side)
        said = Said(side, proximal, anterior)
        return cls._of(imported(_cut(source, said, level, plane, tolerance), filling).limb)

    @classmethod
    def from_outlines(
        cls,
        parts: Mapping[str, Path | str] | Path | str,
        *,
        tolerance: float = TOLERANCE,
        side: Side | None = None,
        seen_from: View = "above",
        anterior: str | None = None,
        **filling: Any,
    ) -> Self:
        """Make a limb from outlines of its skin, bones and muscles.

        Parameters
        ----------
        parts
            CSV, DXF or SVG files by name: "skin", "muscle" (the envelope of all muscles), "tibia",
            "fibula", "tibia_cavity", and single muscles, vessels and tendons as in a table of
            labels: "soleus", "muscle 3", "my_calf:muscle"; or one DXF or SVG drawing with a layer
            or an id for each.
        tolerance
            Largest distance of the curves from rough outlines, and largest overlap, mm.
        side, seen_from
            Of the body, and from where the section was drawn.
        anterior
            Direction in the drawing, such as ``"+y"``, where tibia and fibula do not tell.
        **filling
            As of `from_surface`.

        Raises
        ------
        InputError
            One line: file, place, and what to do.
        """
        part = read_outlines(parts, Said(side, None, anterior), seen_from, tolerance)
        return cls._of(imported(part, filling).limb)

    @classmethod
    def from_mesh(
        cls,
        path: Path | str,
        sets: Mapping[str, Any] | Path | str | None = None,
        *,
        units: str = "mm",
        data: str | None = None,
        side: Side | None = None,
        seen_from: View = "above",
        anterior: str | None = None,
        fixed: str | None = None,
        geometry: meshes.Limb | Path | str | None = None,
        tolerance: float | None = None,
        outlines: bool = False,
        **filling: Any,
    ) -> Self:
        """Make a limb of a plane mesh, which is solved as it is, or of its outlines alone.

        Parameters
        ----------
        path
            gmsh (.msh), Abaqus (.inp) or VTK (.vtu, .vtk): triangles of first or second order, or
            quadrilaterals, which are split.
        sets
            What its sets are: ``{"SKIN": "skin", "Set-2": "gastrocnemius:muscle"}``, with
            ``"ignore"`` for what is left out, or a table of them (CSV ``set,region,tissue``, or
            TOML). By default their names tell it. Of a VTK file the sets are the numbers in `data`.
        units
            Of the file: mm, cm, m or inch.
        data
            Array of whole numbers of the cells that says the region, where there are several.
        side, seen_from
            Of the body, and from which side of its plane the mesh is seen.
        anterior
            Direction in the file's axes, such as ``"+y"``, where tibia and fibula do not tell.
        fixed
            Where the limb is fixed: a region (its hole, or else its surface), a set of nodes or
            edges, or "holes", all of them. By default the hole in a bone, the tibia's first; the
            only hole; or the surface of the tibia, or of the largest bone.
        geometry
            A limb, its file, or the file of an outline, in the axes of the mesh: straight sides
            between nodes of its curves are laid onto them.
        tolerance
            Largest distance of those nodes from the curves, mm (default 0.02); of smooth curves
            from the outlines (default 0.2).
        outlines
            Whether the outlines of the regions alone are used, as those of `from_outlines` are, so
            that the limb is meshed here.
        **filling
            With outlines: as of `from_surface`.

        Raises
        ------
        InputError
            One line: file, place, and what to do.
        """
        said = Said(side, None, anterior)
        if not outlines:
            for name in filling:
                raise InputError(f"{name}: belongs to outlines, not to a mesh that is solved as it"
                                 " is; add outlines = True")  # fmt: skip
            within = ON_CURVE if tolerance is None else tolerance
            made = limb_of_mesh(
                path, sets, units=units, data=data, said=said, seen_from=seen_from, fixed=fixed,
                geometry=geometry, tolerance=within,
            )  # fmt: skip
            return cls._of(made.limb)
        for name, value in (("fixed", fixed), ("geometry", geometry)):
            if value is not None:
                raise InputError(f"{name}: belongs to a mesh that is solved as it is; leave it out")
        part = section_of_mesh(
            path, sets, units=units, data=data, said=said, seen_from=seen_from,
            tolerance=TOLERANCE if tolerance is None else tolerance,
        )  # fmt: skip
        return cls._of(imported(part, filling).limb)

    @classmethod
    def _of(cls, limb: meshes.Limb) -> Self:
        return cls.model_construct(**dict(limb))


def _cut(
    source: Source,
    said: Said,
    level: float | str,
    plane: Plane | None,
    tolerance: float | None,
) -> Section:
    where = None if plane else Level.parse(level)
    return section(source, find_anatomy(source, said), where, plane, tolerance)


def read_source(
    paths: Sequence[Path],
    units: str = "mm",
    said: Mapping[str, str] | None = None,
    labels: Path | None = None,
    voxel: tuple[float, float, float] | None = None,
    side: Side | None = None,
) -> Source:
    """Read surfaces, or a label map.

    The parameters are those of `read_surface` and `read_labels`.
    """
    maps = [path for path in paths if is_volume(path)]
    if not maps:
        for option, value in (("--labels", labels), ("--voxel", voxel)):
            if value:
                raise InputError(f"{option}: belongs to a label map, and {paths[0]} is none")
        return read_surface(paths, units, said)
    if len(paths) > 1:
        raise InputError(f"{maps[0]}: is a label map; give it alone")
    for option in [f"--{role}" for role in said or {}] + ["--units"] * (units != "mm"):
        raise InputError(f"{option}: belongs to surfaces, and {maps[0]} is a label map")
    return read_labels(maps[0], labels, voxel, side)


def imported(part: Section, filling: Filling | Mapping[str, Any] = Filling()) -> Imported:
    """Make a limb of a section."""
    if not isinstance(filling, Filling):
        try:
            filling = Filling(**filling)
        except TypeError as error:
            raise InputError(f"limb: {str(error).split(') ')[-1]}") from None
    title = part.title
    with error_context(title):
        if filling.tissues == "lumped":
            return Imported(Limb._of(_lumped(part, filling, title)), part)
        if filling.tissues != "atlas":
            raise InputError(f"tissues: is '{filling.tissues}'; it must be atlas or lumped")
        if not part.outlines.frame.known:
            if part.outlines.side:
                raise InputError(
                    "where the front is, is not known, and the atlas must lie so (no ridge of the"
                    " skin is sharp enough to be the tibia's crest): add --anterior, or bones from"
                    " which it follows"
                )
            raise InputError(
                "which side of the body it is, is not known, and the atlas must lie so: add --side,"
                " and --anterior where the skin does not show the tibia's crest, or bones from"
                " which they follow"
            )
        made = carried(
            part.outlines,
            title=title,
            skin_thickness=filling.skin_thickness,
            fat_thickness=filling.fat_thickness,
            crest=filling.crest,
            fibular_head=filling.fibular_head,
            septum=filling.septum,
        )
    regions = tuple(_with_origin(region, made) for region in made.limb.regions)
    limb = made.limb.model_copy(update={"regions": regions})
    notes = (*made.thinned, *made.warnings)
    return Imported(Limb._of(_recorded(limb, part, made.assumed, notes)), part, made)


def _with_origin(region: meshes.Region, made: AtlasLimb) -> meshes.Region:
    """Record where a region comes from, and how far it is from the data if they have it."""
    found = made.origin[region.name]
    off = round(found.deviation_mm, 4) if found.origin == "measured" else None
    return region.model_copy(update={"origin": found.origin, "deviation_mm": off})


def _lumped(part: Section, filling: Filling, title: str) -> meshes.Limb:
    for name in ("fat_thickness", "crest", "fibular_head", "septum"):
        if getattr(filling, name) is not None:
            raise InputError(f"{name}: belongs to the atlas, not to lumped tissues; leave it out")
    thick = SKIN_THICKNESS if filling.skin_thickness is None else filling.skin_thickness
    limb, assumed = lumped(part.outlines, thick, title=title)
    return _recorded(limb, part, assumed, ())


def _recorded(
    limb: meshes.Limb, part: Section, assumed: Sequence[str], notes: Sequence[str]
) -> meshes.Limb:
    plane = part.plane
    origin = Provenance(
        files=dict(part.files),
        level=part.where or None,
        height=None if part.height is None else round(part.height, 4),
        height_mm=None if part.height_mm is None else round(part.height_mm, 3),
        origin=_triple(plane.origin) if plane else None,
        normal=_triple(plane.normal) if plane else None,
        anterior=_triple(plane.y) if plane else None,
        tolerance_mm=part.tolerance,
        program=f"calfsocket {calfsocket.__version__}",
        found=tuple(part.remarks),
        assumed=tuple(assumed),
        notes=tuple(notes),
    )
    return limb.model_copy(update={"source": origin})


def _triple(vector: Array) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in np.round(vector, 5) + 0.0)
    return x, y, z


def voxel_of(text: str) -> tuple[float, float, float]:
    """Read the size of a voxel, three numbers, mm."""
    try:
        x, y, z = (float(word) for word in text.split(","))
    except ValueError:
        x = y = z = 0.0
    if not all(0.01 <= size <= 50 for size in (x, y, z)):
        raise InputError(
            f"voxel: is '{text}'; give three sizes of 0.01 to 50 mm, such as 0.5,0.5,2"
        )
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
