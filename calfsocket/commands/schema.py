"""The command ``schema``: what a study file may hold, for editors."""

import argparse
from typing import TYPE_CHECKING

from calfsocket.commands import OK

if TYPE_CHECKING:
    from mpi4py import MPI

HELP = "print the JSON schema of study files, for editors"
DESCRIPTION = """\
Print the JSON schema of study files. Editors that know TOML complete and check a file by it when
its first line is `#:schema study.schema.json`.
"""
EPILOG = """\
example:
  python3 -m calfsocket schema > study.schema.json
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options, of which there are none."""


def run(comm: "MPI.Intracomm", arguments: argparse.Namespace) -> int:
    """Print it."""
    from calfsocket.study.document import schema_text

    if comm.rank == 0:
        print(schema_text(), end="")
    return OK
