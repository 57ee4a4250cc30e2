"""The command ``socket``: a socket's outlines in the sections of a limb, from its own scan."""

from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from calfsocket.commands import command, first_rank, group, option
from calfsocket.commands.options import MESH_DATA, mesh_geometry, mesh_sets
from calfsocket.io.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from calfsocket.imaging.registration import Registration
    from calfsocket.imaging.socket_scan import SocketScan
    from calfsocket.meshes.limb import Limb
    from calfsocket.meshes.socket import Sections

#: mm.
_THICKEST = 100


@command(
    option("source", type=Path, metavar="SOURCE", help="scan of the socket"),
    option(
        "--limb",
        type=Path,
        required=True,
        metavar="FILE.json",
        help="the limb that it is for, of one level or of many, as the command limb makes it",
    ),
    option(
        "--out",
        type=Path,
        default=Path("socket.json"),
        metavar="FILE.json",
        help="default: %(default)s; the picture has its name with .png",
    ),
    option(
        "--tolerance",
        type=float,
        metavar="MM",
        help="largest distance of the curves from the scan (default: 0.2 mm)",
    ),
    option(
        "--wall-thickness",
        type=float,
        metavar="MM",
        help="of the wall (default: that of a scan with both faces; else 4.5 mm)",
    ),
    option(
        "--units",
        default="mm",
        choices=("mm", "cm", "m", "inch"),
        help="of the scan (default: %(default)s)",
    ),
    group(
        "where it lies",
        option(
            "--register",
            default="icp",
            choices=("icp", "none"),
            help="lay the inner face on the skin, or leave it where it is (default: %(default)s)",
        ),
        option(
            "--rotate",
            type=float,
            default=0.0,
            metavar="DEG",
            help="with none: turn about the limb's axis, counter-clockwise seen from above",
        ),
        option("--shift", metavar="X,Y,Z", help="with none: mm, in the limb's axes, after that"),
    ),
    group(
        "a mesh of the wall",
        mesh_sets("which set is the socket", "Set-7,socket", "the set of that name"),
        MESH_DATA,
        mesh_geometry("socket"),
    ),
    description="""\
Cut a socket from its own scan at the sections of a limb. Write its outlines as JSON, for
`sections = ...` of a socket in a study file, with a picture of them over the limb's sections.

SOURCE is STL, PLY, OBJ, VTP or AOP, in mm: the inner face, open at the brim, or a shell with inner
and outer face. It is laid on the skin of all sections so that the gap between them is as even as
possible: a socket is smaller than its limb, by how much is found. A scan in the limb's own axes
stays there.

Or SOURCE is a plane mesh of the wall, gmsh (.msh), Abaqus (.inp) or VTK (.vtu), in the axes of the
file that the limb was made of. It is solved as it is: `mesh = ...` of a socket in a study file.
""",
    epilog="""\
examples:
  python3 -m calfsocket socket scan.stl --limb my-limb.json --out my-socket.json
  python3 -m calfsocket socket design.aop --limb my-limb.json --register none
  python3 -m calfsocket socket section.inp --limb my-limb.json --sets sets.csv
""",
)
@first_rank
def socket(arguments: Namespace) -> None:
    """Cut a socket from its own scan at the sections of a limb."""
    from calfsocket.imaging.mesh.reader import is_mesh
    from calfsocket.imaging.section import TOLERANCE
    from calfsocket.imaging.socket_scan import cut_for, laid, read_socket_scan
    from calfsocket.meshes.levels import read_limb, sections
    from calfsocket.plotting.socket_scan import draw_sections

    out = arguments.out
    if out.suffix != ".json":
        raise InputError(f"--out {out}: is not JSON; use a name that ends in .json")
    if is_mesh(arguments.source):
        _write_meshed(arguments)
        return
    for name in ("sets", "data", "geometry"):
        if getattr(arguments, name):
            raise InputError(f"--{name}: belongs to a mesh, and {arguments.source} is none")
    shift = _shift(arguments.shift) if arguments.shift else (0.0, 0.0, 0.0)
    tolerance = TOLERANCE if arguments.tolerance is None else arguments.tolerance
    wall = arguments.wall_thickness
    if wall is not None and not 0 < wall <= _THICKEST:
        raise InputError(
            f"--wall-thickness: is {wall:g} mm; it must be more than 0, at most {_THICKEST:g}"
        )
    given = {} if wall is None else {"wall_thickness": wall}
    limbs = sections(read_limb(arguments.limb))
    scan = read_socket_scan(arguments.source, arguments.units)
    place = laid(scan, limbs, arguments.register, shift, arguments.rotate)
    made = cut_for(scan, limbs, place, arguments.register, tolerance, name=out.stem, **given)
    made.write(out)
    draw_sections(made, limbs, out.with_suffix(".png"))
    print(summary(scan, made, limbs, place))
    print(f"written to {out} and {out.with_suffix('.png')}")


def _write_meshed(arguments: Namespace) -> None:
    """Write a socket with a mesh of its own."""
    from calfsocket.imaging.mesh.socket import socket_of_mesh
    from calfsocket.meshes.limb import Limb
    from calfsocket.meshes.placement import askew
    from calfsocket.meshes.quality import smallest_angles
    from calfsocket.plotting.socket_scan import draw_sections

    for name in ("tolerance", "wall_thickness", "shift", "rotate"):
        if getattr(arguments, name):
            raise InputError(
                f"--{name.replace('_', '-')}: does not belong to a mesh, which is solved as it is"
                " and where it lies; omit it"
            )
    out = arguments.out
    worn_by = Limb.read(arguments.limb)
    made = socket_of_mesh(
        arguments.source,
        worn_by,
        arguments.sets,
        units=arguments.units,
        data=arguments.data,
        geometry=arguments.geometry,
        name=out.stem,
    )
    made.write(out)
    draw_sections(made, [worn_by], out.with_suffix(".png"))
    x, inner = made.mesh.coordinates, made.inner_face(worn_by).area
    assert made.source is not None
    print(
        "\n  ".join(
            [
                f"{made.source.file}: a wall of {made.wall_thickness:.1f} mm on average,"
                f" {len(x)} triangles, smallest angle {smallest_angles(x).min():.1f} deg",
                f"its inner face has {100 * (1 - inner / worn_by.skin.area):.2f} % less area than"
                " the skin",
                *made.source.notes,
                *(f"warning: {text}" for text in [askew(made, worn_by)] if text),
            ]
        )
    )
    print(f"written to {out} and {out.with_suffix('.png')}")


def _shift(text: str) -> tuple[float, ...]:
    """Read three numbers."""
    try:
        numbers = tuple(float(word) for word in text.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) != 3 or not all(abs(number) < 1e5 for number in numbers):
        raise InputError(f"--shift: is '{text}'; give three numbers in mm, such as 0,0,12.5")
    return numbers


def summary(
    scan: "SocketScan", made: "Sections", limbs: "Sequence[Limb]", place: "Registration"
) -> str:
    """Return a table of a socket's outlines, and how its scan lies on the limb."""
    faces = "inner and outer face" if scan.walled else "inner face"
    lines = [
        f"{scan.path.name}: {faces}",
        f"  {'level':12} {'mm2':>8}  {'less area':>9}  {'wall':>7}  deviation",
    ]
    for limb in limbs:
        for each in (each for each in made.sections if each.is_of(limb)):
            area = made.inner_face(limb).area
            less = 100 * (1 - area / limb.skin.area)
            lines.append(
                f"  {each.level or 'a plane':12} {area:8.1f}  {less:7.2f} %"
                f"  {made.thickness(limb):4.1f} mm  {each.deviation_mm:6.2f} mm"
            )
    lines += [f"  {line}" for line in place.words]
    assert made.source is not None
    lines += [f"  {note}" for note in made.source.notes]
    return "\n".join(lines)
