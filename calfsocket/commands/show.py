"""The command ``show``: a picture of what would be solved."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from calfsocket.commands import OK
from calfsocket.io.errors import InputError
from calfsocket.parallel.first_rank import on_first_rank

if TYPE_CHECKING:
    from mpi4py import MPI

HELP = "draw the limb and the sockets of a study file"
DESCRIPTION = """\
Draw the limb with its regions, the sockets of a study file on it, and the cases, as PNG.
"""
EPILOG = ""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument("file", type=Path, metavar="FILE", help="study file, or a run.json")
    parser.add_argument(
        "--out", type=Path, metavar="FILE.png", help="default: FILE's name with .png, here"
    )


def run(comm: "MPI.Intracomm", arguments: argparse.Namespace) -> int:
    """Draw it, and print where."""
    on_first_rank(comm, lambda: _draw(arguments.file, arguments.out))
    return OK


def _draw(file: Path, out: Path | None) -> None:
    from calfsocket.study.preview import draw
    from calfsocket.study.study import Study

    path = out or Path(file.with_suffix(".png").name)
    if path.suffix != ".png":
        raise InputError(f"--out {path}: pictures are PNG files; use a name that ends in .png")
    plan = Study.read(file).plan
    try:
        draw(plan, path)
    except OSError as error:
        raise InputError(f"--out {path}: {error.strerror}; name another file") from None
    print(path)
