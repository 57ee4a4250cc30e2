"""The command ``calibrate``: one law for muscle and fascia from an indentation test."""

from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from calfsocket.commands import Comm, command, group, option, options
from calfsocket.io.errors import InputError
from calfsocket.parallel.first_rank import on_first_rank

if TYPE_CHECKING:
    from calfsocket.materials.laws import Ogden


@command(
    group(
        "what to press",
        option(
            "--specimen",
            default="compound",
            choices=("compound", "limb"),
            help="default: %(default)s",
        ),
        option(
            "--compound",
            type=Path,
            metavar="FILE",
            help="dimensions, in the format of meshes/compound.json",
        ),
        option("--stroke", type=float, metavar="MM", help="default: the specimen's own"),
        options.size("coarse"),
        options.FASCIA_C10,
        options.material(),
        options.FRICTION,
    ),
    group(
        "how to fit",
        option(
            "--points",
            type=int,
            default=8,
            metavar="N",
            help="points on each curve (default: %(default)s)",
        ),
        option(
            "--start",
            action="append",
            default=[],
            metavar="KPA,ALPHA",
            help="start of the search; may be repeated (default: 5,5 and 30,25)",
        ),
        option("--free-d", action="store_true", help="also fit D1 instead of taking nu = 0.495"),
        option(
            "--out",
            type=Path,
            default=Path("results/calibration"),
            metavar="DIR",
            help="default: %(default)s, where the report of results/ looks for it",
        ),
    ),
    description="""\
Find the combined material of muscle and fascia: press a specimen with a flat plate, and fit
Ogden's mu and alpha to the force-displacement curve of the separate materials.
""",
    epilog="""\
examples:
  python3 -m calfsocket calibrate                   a compound of layers and compartments
  python3 -m calfsocket calibrate --specimen limb   the limb's own section, which takes longer
  python3 -m calfsocket --material combined=results/calibration/combined.toml

results: curves.csv, calibration.json, combined.toml, figure3.png, figure3.pdf
""",
)
def calibrate(comm: Comm, arguments: Namespace) -> None:
    """Fit the combined material of muscle and fascia."""
    from rich.console import Console

    from calfsocket.calibration import report
    from calfsocket.calibration.run import STARTS, Settings, calibrate
    from calfsocket.contact.parameters import Contact
    from calfsocket.materials.file import read_material
    from calfsocket.meshes.compound import load_compound
    from calfsocket.meshes.limb import Limb
    from calfsocket.simulation.precompile import precompile

    settings = Settings(
        compound=load_compound(arguments.compound),
        limb=Limb.reference(),
        specimen=arguments.specimen,
        stroke=arguments.stroke,
        points=arguments.points,
        starts=tuple(_start(word) for word in arguments.start) or STARTS,
        free_d=arguments.free_d,
        size=options.checked_size(arguments.size),
        fascia_c10=arguments.fascia_c10,
        materials={
            tissue: read_material(path)
            for tissue, path in options.material_files(arguments.material, ["separate"]).items()
        },
        contact=Contact(friction=arguments.friction),
    )
    on_first_rank(comm, lambda: _make_folder(arguments.out))
    precompile(comm)
    console = Console(stderr=True, quiet=comm.rank > 0)
    calibration = calibrate(comm, settings, on_line=lambda text: console.print(text, style="dim"))
    if comm.rank == 0:
        from calfsocket.paper import figure3

        report.write(calibration, settings, arguments.out)
        figure3.draw(calibration, arguments.out)
        report.show(calibration, Console())


def _start(word: str) -> "Ogden":
    """Read a start of a fit, mu in kPa and alpha."""
    from calfsocket.calibration.fit import LARGEST_ALPHA, SMALLEST_ALPHA, ogden

    try:
        mu, alpha = (float(part) for part in word.split(","))
    except ValueError:
        raise InputError(f"--start: is {word!r}; give mu in kPa and alpha, e.g. 5,5") from None
    if not (0 < mu < float("inf") and SMALLEST_ALPHA <= alpha <= LARGEST_ALPHA):
        raise InputError(
            f"--start: is {word!r}; give mu > 0 and alpha from {SMALLEST_ALPHA:g} to "
            f"{LARGEST_ALPHA:g}"
        )
    return ogden(1e-3 * mu, alpha)


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--out {folder}: {error.strerror}; name another folder") from None
