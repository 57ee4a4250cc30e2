"""Options that several commands have, and what they mean."""

import argparse
import contextlib
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from calfsocket.io.errors import InputError

if TYPE_CHECKING:
    from calfsocket.materials.material_set import BaseSet

Name = TypeVar("Name", bound=str)


class Options(Protocol):
    """A parser, or a group of its options."""

    def add_argument(self, *names: str, **settings: Any) -> Any:
        """Add an option."""


def add_size(options: Options, default: str = "paper") -> None:
    """Add the size of the mesh."""
    options.add_argument(
        "--size",
        default=default,
        help="mesh: coarse, medium, paper or a number of triangles (default: %(default)s)",
    )


def add_fascia_c10(options: Options) -> None:
    """Add the choice of fascia's first coefficient."""
    options.add_argument(
        "--fascia-c10",
        default="printed",
        choices=("printed", "tables"),
        help="fascia's C10 as the paper prints it, 4.91 MPa, or as its tables need it, 0.491 MPa "
        "(default: %(default)s)",
    )


def add_material(options: Options, remark: str = "") -> None:
    """Add the material files, with a remark on the tissues that may be named."""
    options.add_argument(
        "--material",
        action="append",
        default=[],
        metavar="TISSUE=FILE",
        help="material file, as `fit` writes it, that replaces Table 1's law of a tissue; "
        f"{remark}may be repeated",
    )


def add_friction(options: Options) -> None:
    """Add the coefficient of friction between skin and what presses on it."""
    options.add_argument(
        "--friction",
        type=friction_coefficient,
        default=0.4,
        metavar="MU",
        help="coefficient of friction (default: %(default)s)",
    )


def friction_coefficient(word: str) -> float:
    """Read a coefficient of friction."""
    with contextlib.suppress(ValueError):
        coefficient = float(word)
        if 0 <= coefficient < math.inf:
            return coefficient
    raise argparse.ArgumentTypeError(f"'{word}' is not a number of 0 or more")


def checked_size(word: str) -> str:
    """Return a mesh size that exists.

    Raises
    ------
    InputError
        If there is none of this name.
    """
    from calfsocket.meshes.sizing import mesh_size

    try:
        return mesh_size(word).name
    except InputError as error:
        raise InputError(f"--size: {error}") from None


def material_files(words: Sequence[str], sets: Iterable["BaseSet"]) -> dict[str, Path]:
    """Return the material files that replace laws of Table 1, by the name of the tissue.

    Parameters
    ----------
    words : sequence of str
        ``TISSUE=FILE.toml`` each; the tissue "combined" is muscle and fascia of that set.
    sets : iterable of str
        Material sets that are solved.

    Raises
    ------
    InputError
        If a word is none of these, or names a tissue that is in none of the sets, or was named
        before.
    """
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
    """Return the chosen names in the order of the allowed ones, whatever their case.

    Raises
    ------
    InputError
        For a name that is not allowed or is given twice, or if there is none.
    """
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
