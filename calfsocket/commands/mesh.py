"""The command ``mesh``: a mesh without a solution."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from calfsocket.commands import OK, options
from calfsocket.parallel.first_rank import on_first_rank

if TYPE_CHECKING:
    from mpi4py import MPI

HELP = "write a mesh and a table of its quality"
DESCRIPTION = "Write a mesh with named regions and boundaries, and print a table of its quality."
EPILOG = ""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument("--socket", required=True, metavar="NAME", help="TC, TSB or HS")
    options.add_size(parser)
    parser.add_argument("--out", type=Path, required=True, metavar="FILE.msh")


def run(comm: "MPI.Intracomm", arguments: argparse.Namespace) -> int:
    """Write the mesh and print the table."""
    from calfsocket.meshes.limb import Limb
    from calfsocket.meshes.quality import format_table
    from calfsocket.meshes.section import write_section
    from calfsocket.meshes.sizing import mesh_size
    from calfsocket.meshes.socket import Socket

    def write() -> None:
        socket, size = Socket.reference(arguments.socket), mesh_size(arguments.size)
        print(format_table(write_section(arguments.out, Limb.reference(), socket, size)))

    on_first_rank(comm, write)
    return OK
