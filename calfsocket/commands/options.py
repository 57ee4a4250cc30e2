"""Options that several commands have, and what they mean."""

import argparse
import contextlib
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from calfsocket.commands import Option, option
from calfsocket.io.errors import InputError, error_context

if TYPE_CHECKING:
    from calfsocket.materials.material_set import BaseSet

Name = TypeVar("Name", bound=str)


def size(default: str, refined: bool = False) -> Option:
    """Return the size of the mesh, which a solution may refine."""
    return option(
        "--size",
        default=default,
        help="mesh: coarse, medium, paper"
        + (", adaptive (refined where a first solution has its errors) " if refined else " ")
        + "or a number of triangles (default: %(default)s)",
    )


def material(remark: str = "") -> Option:
    """Return the material files, with a remark on the tissues that may be named."""
    return option(
        "--material",
        action="append",
        default=[],
        metavar="TISSUE=FILE",
        help="material file, as `fit` writes it, that replaces Table 1's law of a tissue; "
        f"{remark}may be repeated",
    )


def friction_coefficient(word: str) -> float:
    """Read a coefficient of friction."""
    with contextlib.suppress(ValueError):
        coefficient = float(word)
        if 0 <= coefficient < math.inf:
            return coefficient
    raise argparse.ArgumentTypeError(f"'{word}' is not a number of 0 or more")


FASCIA_C10 = option(
    "--fascia-c10",
    default="printed",
    choices=("printed", "tables"),
    help="fascia's C10 as the paper prints it, 4.91 MPa, or as its tables need it, 0.491 MPa "
    "(default: %(default)s)",
)
FRICTION = option(
    "--friction",
    type=friction_coefficient,
    default=0.4,
    metavar="MU",
    help="coefficient of friction (default: %(default)s)",
)
MESH_DATA = option("--data", metavar="NAME", help="array of a VTK file that numbers the regions")


def mesh_sets(what: str, example: str, default: str) -> Option:
    """Return the table of a mesh's sets."""
    return option(
        "--sets",
        type=Path,
        metavar="FILE",
        help=f"{what}: a line such as {example} (CSV), or TOML (default: {default})",
    )


def mesh_geometry(body: str) -> Option:
    """Return the body or outline that a mesh was made from."""
    return option(
        "--geometry",
        type=Path,
        metavar="FILE",
        help=f"{body} or outline that it was meshed from: straight sides are laid onto its curves",
    )


def checked_size(word: str) -> str:
    """Return the name of a mesh size, which must exist."""
    from calfsocket.meshes.sizing import any_size

    with error_context("--size"):
        return any_size(word).name


def material_files(words: Sequence[str], sets: Iterable["BaseSet"]) -> dict[str, Path]:
    """Return the material files, ``TISSUE=FILE.toml`` each, by a tissue of the sets solved."""
    from calfsocket.materials.material_set import MaterialSet

    used = dict.fromkeys(name for each in sets for name in MaterialSet.paper(each).laws)
    files: dict[str, Path] = {}
    for word in words:
        tissue, equals, file = word.partition("=")
        if not (equals and file):
            raise InputError(f"--material: is '{word}'; it must be TISSUE=FILE.toml")
        if tissue not in used:
            raise InputError(
                f"--material {word}: no case has a tissue '{tissue}'; use one of {', '.join(used)}"
            )
        if tissue in files:
            raise InputError(f"--material {word}: '{tissue}' is given twice; give it once")
        files[tissue] = Path(file)
    return files


def select(names: Sequence[str], allowed: Sequence[Name], option: str) -> list[Name]:
    """Return the chosen names, which may differ in case, in the order of the allowed ones."""
    by_lower = {name.lower(): name for name in allowed}
    chosen: list[Name] = []
    for name in names:
        key = name.strip().lower()
        if key not in by_lower:
            raise InputError(f"{option}: unknown name '{name}'; use {', '.join(allowed)}")
        if by_lower[key] in chosen:
            raise InputError(f"{option}: '{name}' is listed twice; list it once")
        chosen.append(by_lower[key])
    return [name for name in allowed if name in chosen]
