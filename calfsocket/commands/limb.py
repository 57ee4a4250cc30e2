"""The command ``limb``: a section of somebody's limb from a scan."""

from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from calfsocket.commands import command, first_rank, group, option
from calfsocket.commands.options import MESH_DATA, mesh_geometry, mesh_sets
from calfsocket.io.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from calfsocket.imaging.anatomy import Anatomy, Said
    from calfsocket.imaging.limb import Filling, Imported
    from calfsocket.imaging.mesh.limb import MeshedLimb
    from calfsocket.imaging.section import Section
    from calfsocket.imaging.source import Source
    from calfsocket.meshes.limb import Limb


_NOT_OF_DRAWINGS = "does not belong to a drawing of the section; omit it"
_NOT_OF_MESHES = "does not belong to a mesh, which is solved as it is; omit it"
_FILLING = ("skin_thickness", "fat_thickness", "crest", "fibular_head", "septum")


@command(
    option(
        "source", type=Path, nargs="+", metavar="SOURCE", help="file of a limb, or of its parts"
    ),
    option(
        "--level",
        metavar="LEVEL",
        help="share of the height, 0 distal to 1 proximal, or '80 mm', '80 mm from proximal'"
        " (default: 0.5)",
    ),
    option(
        "--levels",
        metavar="FROM:TO:N",
        help="N levels from one share to another, e.g. 0.2:0.8:13; a file for each, and"
        " FILE.json lists them",
    ),
    option(
        "--plane",
        metavar="X,Y,Z,NX,NY,NZ",
        help="a point and a normal in the source's axes, instead of a level",
    ),
    option(
        "--out",
        type=Path,
        default=Path("limb.json"),
        metavar="FILE.json",
        help="default: %(default)s; the picture has its name with .png",
    ),
    option(
        "--tolerance",
        type=float,
        metavar="MM",
        help="largest distance of the curves from the data (default: 0.2 mm, or four times a"
        " surface's noise; of a label map half a voxel)",
    ),
    group(
        "what lies between skin and bones",
        option(
            "--tissues",
            default="atlas",
            choices=("atlas", "lumped"),
            help="the reference calf's regions carried into the section, or one soft tissue "
            "(default: %(default)s)",
        ),
        option("--skin-thickness", type=float, metavar="MM", help="default: the reference's, 1.6"),
        option(
            "--fat-thickness",
            type=float,
            metavar="MM",
            help="mean, for the atlas (default: the reference's, to scale)",
        ),
        option(
            "--crest",
            type=float,
            metavar="DEG",
            help="anatomical angle of the tibia's crest (90 is"
            " anterior), for a scan of the skin alone",
        ),
        option(
            "--fibular-head", type=float, metavar="DEG", help="that of the fibula (0 is lateral)"
        ),
        option(
            "--septum",
            type=float,
            metavar="MM",
            help="between muscles of the source that touch (default: the reference's, 0.76)",
        ),
    ),
    group(
        "what the source does not tell",
        option(
            "--units",
            default="mm",
            choices=("mm", "cm", "m", "inch"),
            help="of the files (default: %(default)s)",
        ),
        option("--side", choices=("left", "right"), help="of the body"),
        option(
            "--proximal", metavar="DIR", help="where the trunk is: +z, --proximal=-z or 0.1,0,1"
        ),
        option("--anterior", metavar="DIR", help="where the front is, in the same way"),
        *(
            option(f"--{role}", metavar="NAME", help=f"file or shell that is the {what}")
            for role, what in (
                ("skin", "skin"),
                ("muscle", "envelope of all muscles"),
                ("tibia", "tibia"),
                ("fibula", "fibula"),
            )
        ),
        option(
            "--labels",
            type=Path,
            metavar="FILE.csv",
            help="what the labels of a label map are: a line such as 3,tibia for each",
        ),
        option(
            "--seen-from",
            default="above",
            choices=("above", "below"),
            help="from where a section was drawn (default: %(default)s)",
        ),
        option("--voxel", metavar="X,Y,Z", help="size of a voxel of a stack of pictures, mm"),
    ),
    group(
        "a mesh of the section",
        mesh_sets(
            "what its sets are",
            "Set-2,gastrocnemius,muscle for each",
            "by their names",
        ),
        MESH_DATA,
        option(
            "--fixed",
            metavar="NAME",
            help="where the limb is fixed: a region, a set of nodes or edges, or holes (default:"
            " the hole in the tibia, or its surface)",
        ),
        mesh_geometry("limb"),
        option(
            "--outlines",
            action="store_true",
            help="use the outlines of its regions alone, as if they were drawn, and mesh them here",
        ),
    ),
    description="""\
Make a limb from surfaces of its skin and bones, from a label map, or from outlines: a section
square to the tibia's axis, with smooth curves within a tolerance of the data, and in it the regions
of the reference calf. Write it as JSON, for `limb = ...` in a study file, with a picture of the
section over the source.

SOURCE is STL, PLY, OBJ, VTP or AOP, in mm: a file for each tissue (skin.stl, tibia.stl, ...), or
one with several closed shells, of which skin and bones are told by nesting and size. Level 0 is the
distal end. Or it is a label map: NIfTI, NRRD, MetaImage, a TIFF of several pages, or a folder of
PNG or TIFF slices. Or it is the section itself: a CSV, DXF or SVG outline for each of skin.csv,
tibia.csv, soleus.csv, ..., or one drawing with a layer or an id for each. The names are those of
label maps: my_calf:muscle says the tissue. Side and directions follow from tibia and
fibula where the source has both. Or it is a mesh of the section, of triangles or quadrilaterals,
which is solved as it is: gmsh (.msh), Abaqus (.inp) or VTK (.vtu), with a set for each region.
""",
    epilog="""\
examples:
  python3 -m calfsocket limb leg.stl --level 0.4 --out my-limb.json
  python3 -m calfsocket limb skin.ply tibia.ply fibula.ply --level '120 mm' --side left
  python3 -m calfsocket limb segmentation.nii.gz --labels labels.csv --level 0.5
  python3 -m calfsocket limb leg.stl --levels 0.2:0.8:13 --out my-limb.json
  python3 -m calfsocket limb skin.csv tibia.csv fibula.csv soleus.csv 'my calf:muscle.csv'
  python3 -m calfsocket limb scan.aop --side left --anterior +y
  python3 -m calfsocket limb section.inp --sets sets.csv --units m --side right --anterior +y
""",
)
@first_rank
def limb(arguments: Namespace) -> None:
    """Make a limb from a scan of its surface and bones."""
    from calfsocket.imaging.limb import Filling, imported
    from calfsocket.imaging.mesh.reader import is_mesh
    from calfsocket.plotting.source import draw_source

    out = arguments.out
    if out.suffix != ".json":
        raise InputError(f"--out {out}: limbs are JSON files; use a name that ends in .json")
    if any(map(is_mesh, arguments.source)) and not arguments.outlines:
        made = _meshed(arguments)
        made.limb.write(out)
        draw_source(made.limb, made.outlines, out.with_suffix(".png"))
        print(summary_of_mesh(made.limb))
        print(f"written to {out} and {out.with_suffix('.png')}")
        return
    of_meshes = () if any(map(is_mesh, arguments.source)) else ("sets", "data", "outlines")
    for name in ("fixed", "geometry", *of_meshes):
        if getattr(arguments, name):
            what = "is none" if of_meshes else "is not solved as it is with --outlines"
            raise InputError(f"--{name}: belongs to a mesh, and {arguments.source[0]} {what}")
    filling = Filling(
        arguments.tissues,
        arguments.skin_thickness,
        arguments.fat_thickness,
        arguments.crest,
        arguments.fibular_head,
        arguments.septum,
    )

    def write(made: "Imported", path: Path) -> None:
        made.limb.write(path)
        draw_source(made.limb, made.section.data, path.with_suffix(".png"))
        print(summary(made))
        print(f"written to {path} and {path.with_suffix('.png')}")

    if arguments.levels:
        _write_levels(arguments, filling, write)
    else:
        write(imported(_section(arguments), filling), out)


def _write_levels(
    arguments: Namespace, filling: "Filling", write: "Callable[[Imported, Path], None]"
) -> None:
    """Write the sections of many levels, and the file that lists them."""
    from calfsocket.imaging.drawing_parts import is_drawing
    from calfsocket.imaging.levels import imported_levels, levels_of

    if arguments.level or arguments.plane:
        raise InputError("--levels: is given with --level or --plane; give one of them")
    levels = levels_of(arguments.levels)
    if any(map(is_drawing, arguments.source)):
        raise InputError(f"--levels: {_NOT_OF_DRAWINGS}")
    source, anatomy = _source(arguments)
    out = arguments.out
    found = imported_levels(
        source,
        anatomy,
        levels,
        arguments.tolerance,
        filling,
        out.stem,
        lambda made, file: write(made, out.with_name(file)),
    )
    for each in found.refused:
        print(f"left out: {each.reason}")
    found.write_index(out)
    print(f"{len(found)} levels are listed in {out}")


def _section(arguments: Namespace) -> "Section":
    """Return the section that is asked for."""
    from calfsocket.imaging.drawing_parts import is_drawing
    from calfsocket.imaging.limb import plane_of
    from calfsocket.imaging.mesh.reader import is_mesh
    from calfsocket.imaging.plane import Level
    from calfsocket.imaging.section import section

    if any(map(is_mesh, arguments.source)):
        return _outlines_of_mesh(arguments)
    if any(map(is_drawing, arguments.source)):
        return _drawn(arguments)
    plane = plane_of(arguments.plane) if arguments.plane else None
    if plane and arguments.level:
        raise InputError("--plane: is given with --level; give one of them")
    level = None if plane else Level.parse(arguments.level or 0.5)
    source, anatomy = _source(arguments)
    return section(source, anatomy, level, plane, arguments.tolerance)


def _source(arguments: Namespace) -> "tuple[Source, Anatomy]":
    """Read a scan or a label map, and find out how it lies."""
    from calfsocket.imaging.anatomy import find_anatomy
    from calfsocket.imaging.limb import read_source, voxel_of

    voxel = voxel_of(arguments.voxel) if arguments.voxel else None
    source = read_source(
        arguments.source,
        arguments.units,
        _roles(arguments),
        arguments.labels,
        voxel,
        arguments.side,
    )
    return source, find_anatomy(source, _said(arguments))


def _roles(arguments: Namespace) -> dict[str, str]:
    """Return which file or shell is said to be what."""
    from calfsocket.imaging.source import ROLES

    return {role: getattr(arguments, role) for role in ROLES if getattr(arguments, role)}


def _said(arguments: Namespace) -> "Said":
    """Return what is said of how the limb lies."""
    from calfsocket.imaging.anatomy import Said

    return Said(arguments.side, arguments.proximal, arguments.anterior)


def _drawn(arguments: Namespace) -> "Section":
    """Return the section that was drawn."""
    from calfsocket.imaging.drawing import read_outlines
    from calfsocket.imaging.drawing_parts import named_files
    from calfsocket.imaging.section import TOLERANCE

    for name, value in (
        ("--level", arguments.level),
        ("--plane", arguments.plane),
        ("--labels", arguments.labels),
        ("--voxel", arguments.voxel),
        ("--proximal", arguments.proximal),
        ("--units", arguments.units != "mm"),
    ):
        if value:
            raise InputError(f"{name}: {_NOT_OF_DRAWINGS}")
    tolerance = TOLERANCE if arguments.tolerance is None else arguments.tolerance
    parts = named_files(arguments.source, _roles(arguments))
    return read_outlines(parts, _said(arguments), arguments.seen_from, tolerance)


def _meshed(arguments: Namespace) -> "MeshedLimb":
    """Return the limb with a mesh of its own."""
    from calfsocket.imaging.mesh.limb import limb_of_mesh
    from calfsocket.imaging.mesh.plane_mesh import ON_CURVE

    _check_options_of_mesh(arguments, _FILLING)
    if arguments.tolerance is not None and arguments.geometry is None:
        raise InputError(f"--tolerance: {_NOT_OF_MESHES}, or add --geometry")
    return limb_of_mesh(
        arguments.source[0],
        arguments.sets,
        units=arguments.units,
        data=arguments.data,
        said=_said(arguments),
        seen_from=arguments.seen_from,
        fixed=arguments.fixed,
        geometry=arguments.geometry,
        tolerance=ON_CURVE if arguments.tolerance is None else arguments.tolerance,
    )


def _outlines_of_mesh(arguments: Namespace) -> "Section":
    """Return the section that a mesh is of."""
    from calfsocket.imaging.mesh.limb import section_of_mesh
    from calfsocket.imaging.section import TOLERANCE

    _check_options_of_mesh(arguments)
    return section_of_mesh(
        arguments.source[0],
        arguments.sets,
        units=arguments.units,
        data=arguments.data,
        said=_said(arguments),
        seen_from=arguments.seen_from,
        tolerance=TOLERANCE if arguments.tolerance is None else arguments.tolerance,
    )


def _check_options_of_mesh(arguments: Namespace, more: "Sequence[str]" = ()) -> None:
    """Refuse what belongs to other sources."""
    if len(arguments.source) > 1:
        raise InputError(f"{arguments.source[0]}: is a mesh or beside one; give a mesh alone")
    others = ("level", "levels", "plane", "labels", "voxel", "proximal", *_roles(arguments), *more)
    for name in others:
        if getattr(arguments, name) is not None:
            raise InputError(f"--{name.replace('_', '-')}: {_NOT_OF_MESHES}")


def summary_of_mesh(limb: "Limb") -> str:
    """Return a table of a mesh's regions, and what was found."""
    from calfsocket.meshes.quality import quality_table

    assert limb.mesh is not None and limb.source is not None
    table = quality_table(limb.mesh.triangles(limb.region_tags), limb.tissues, limb.areas)
    lines = [
        limb.title,
        f"  {'region':29} {'tissue':8} {'mm2':>8}  {'triangles':>9}  {'smallest angle':>14}",
    ]
    lines += [
        f"  {row.region:29} {row.tissue:8} {row.area_mm2:8.1f}  {row.triangles:9}  "
        f"{row.min_angle_deg:12.1f} deg"
        for row in table.itertuples()
    ]
    return "\n".join([*lines, *(f"  {line}" for line in limb.source.found)])


def summary(made: "Imported") -> str:
    """Return a table of a limb's regions, and how it was found."""
    section, areas, source = made.section, made.limb.areas, made.limb.source
    share = "" if section.height is None else f" ({100 * section.height:.0f} % of the height)"
    lines = [
        f"{made.limb.title}{share}",
        f"  {'region':29} {'tissue':8} {'mm2':>8}  {'origin':8}  deviation",
    ]
    for region in made.limb.regions:
        off = "" if region.deviation_mm is None else f"{region.deviation_mm:6.2f} mm"
        lines.append(
            f"  {region.name:29} {region.tissue:8} {areas[region.name]:8.1f}  "
            f"{region.origin or '':8}  {off}".rstrip()
        )
    if made.atlas:
        low, high = made.atlas.smallest_determinant, made.atlas.largest_determinant
        lines.append(f"  areas of the atlas change by factors of {low:.2f} to {high:.2f}")
        for layer, thick in made.atlas.thickness.items():
            lines.append(f"  {layer}: {thick.median:.2f} mm thick, {thick.smallest:.2f} at least")
    assert source is not None
    lines += [f"  {line}" for line in source.found]
    lines += [f"  assumed: {line}" for line in source.assumed]
    lines += [f"  note: {line}" for line in source.notes]
    return "\n".join(lines)
