"""The command ``limb``: a section of somebody's limb from a scan."""

from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from calfsocket.commands import command, first_rank, group, option
from calfsocket.io.errors import InputError

if TYPE_CHECKING:
    from calfsocket.imaging.limb import Imported


@command(
    option(
        "source", type=Path, nargs="+", metavar="SOURCE", help="file of a limb, or of its parts"
    ),
    option(
        "--level",
        default="0.5",
        metavar="LEVEL",
        help="share of the height, 0 distal to 1 proximal, or '80 mm', '80 mm from proximal'"
        " (default: %(default)s)",
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
        help="largest distance of the curves from the data (default: 0.2 mm)",
    ),
    option(
        "--skin-thickness", type=float, default=1.6, metavar="MM", help="default: %(default)s mm"
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
    ),
    description="""\
Make a limb from surfaces of its skin and bones: a section square to the tibia's axis, with smooth
curves within a tolerance of the data. Write it as JSON, for `limb = "..."` in a study file, with a
picture of the section over the source.

SOURCE is STL, PLY, OBJ, VTP or AOP, in mm: a file for each tissue (skin.stl, tibia.stl, ...), or
one with several closed shells, of which skin and bones are told by nesting and size. Level 0 is the
distal end. Side and directions follow from tibia and fibula where the source has both.
""",
    epilog="""\
examples:
  python3 -m calfsocket limb leg.stl --level 0.4 --out my-limb.json
  python3 -m calfsocket limb skin.ply tibia.ply fibula.ply --level '120 mm' --side left
""",
)
@first_rank
def limb(arguments: Namespace) -> None:
    """Make a limb from a scan of its surface and bones."""
    from calfsocket.imaging.anatomy import Said, find_anatomy
    from calfsocket.imaging.limb import imported, plane_of
    from calfsocket.imaging.plane import Level
    from calfsocket.imaging.source import ROLES, read_surface
    from calfsocket.plotting.source import draw_source

    out = arguments.out
    if out.suffix != ".json":
        raise InputError(f"--out {out}: limbs are JSON files; use a name that ends in .json")
    plane = plane_of(arguments.plane) if arguments.plane else None
    level = None if plane else Level.parse(arguments.level)
    said = {role: getattr(arguments, role) for role in ROLES if getattr(arguments, role)}
    source = read_surface(arguments.source, arguments.units, said)
    anatomy = find_anatomy(source, Said(arguments.side, arguments.proximal, arguments.anterior))
    made = imported(source, anatomy, level, plane, arguments.tolerance, arguments.skin_thickness)
    made.limb.write(out)
    draw_source(made.limb, made.section.data, out.with_suffix(".png"))
    print(summary(made))
    print(f"written to {out} and {out.with_suffix('.png')}")


def summary(made: "Imported") -> str:
    """Return a table of a limb's regions, and how it was found."""
    section, areas = made.section, made.limb.areas
    lines = [
        f"{made.limb.title} ({100 * section.height:.0f} % of the height from the distal end)",
        f"  {'region':18} {'tissue':8} {'mm2':>8}  {'origin':8}  deviation",
    ]
    for region in made.limb.regions:
        off = "" if region.deviation_mm is None else f"{region.deviation_mm:6.2f} mm"
        lines.append(
            f"  {region.name:18} {region.tissue:8} {areas[region.name]:8.1f}  "
            f"{region.origin or '':8}  {off}".rstrip()
        )
    assert made.limb.source is not None
    lines += [f"  {line}" for line in made.limb.source.found]
    lines += [f"  assumed: {line}" for line in made.limb.source.assumed]
    return "\n".join(lines)
