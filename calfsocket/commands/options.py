"""Options that several commands have, and what they mean."""

import argparse
import contextlib
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from calfsocket.io.errors import InputError

if TYPE_CHECKING:
    from calfsocket.materials.law import Law
    from calfsocket.materials.material_set import BaseSet


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
        help="material file in the place of Table 1's law of a tissue, as `fit` writes it; "
        f"{remark}may be repeated",
    )


def add_friction(options: Options) -> None:
    """Add the coefficient of friction between skin and what presses on it."""
    options.add_argument(
        "--friction",
        type=friction_coefficient,
        default=0.4,
        metavar="MU",
        help="coefficient (default: %(default)s)",
    )


def friction_coefficient(word: str) -> float:
    """Read a coefficient of friction."""
    with contextlib.suppress(ValueError):
        coefficient = float(word)
        if 0 <= coefficient < math.inf:
            return coefficient
    raise argparse.ArgumentTypeError(f"{word}; give a number of 0 or more")


def model_settings(arguments: argparse.Namespace, sets: Sequence["BaseSet"]) -> dict[str, Any]:
    """Return what these options say, as the settings of a study and of a calibration have it.

    Raises
    ------
    InputError
        For an unknown mesh size, or a material file that cannot be used in these material sets.
    """
    from calfsocket.contact.nitsche import ContactParameters
    from calfsocket.meshes.sizing import mesh_size

    return {
        "size": mesh_size(arguments.size).name,
        "fascia_c10": arguments.fascia_c10,
        "materials": read_materials(arguments.material, sets),
        "contact": ContactParameters(fric_coeff=arguments.friction),
    }


def read_materials(words: Sequence[str], sets: Sequence["BaseSet"]) -> dict[str, "Law"]:
    """Read the material files that take the place of Table 1's laws.

    Parameters
    ----------
    words
        ``TISSUE=FILE.toml`` each, where the tissue "combined" is muscle and fascia of that set.
    sets
        Material sets that are solved.

    Raises
    ------
    InputError
        For a word of another kind, a tissue that is repeated or in none of the sets, or a bad file.
    """
    from calfsocket.materials.file import read_material
    from calfsocket.materials.material_set import MaterialSet

    used = dict.fromkeys(tissue for name in sets for tissue in MaterialSet.paper(name).laws)
    laws: dict[str, Law] = {}
    for word in words:
        tissue, equals, file = word.partition("=")
        if not (equals and file):
            raise InputError(f"--material {word}: write TISSUE=FILE.toml")
        if tissue not in used:
            raise InputError(
                f"--material {word}: no case has a tissue {tissue!r}; use one of {', '.join(used)}"
            )
        if tissue in laws:
            raise InputError(f"--material {word}: {tissue} is named twice; name it once")
        laws[tissue] = read_material(Path(file))
    return laws
