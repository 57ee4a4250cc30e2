"""Stress-stretch data from a CSV file, checked.

    # Strips of crural fascia, mediolateral
    stretch, engineering_stress [kPa]
    1.00, 0.0
    1.02, 310.5

Columns, in any order: the deformation (`DEFORMATIONS`); the stress (`STRESSES`) with its unit; if
known, the standard deviation of each stress, ``stress_sd``; if wanted, the ``mode``, the same in
every row. Others are not used, which is reported. How headers and numbers may be written is said in
`fit.columns`. One file is one test; of loading and unloading one branch is taken.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeVar, get_args

import numpy as np

from calfsocket.fit import branches
from calfsocket.fit.branches import Branch
from calfsocket.fit.columns import Columns
from calfsocket.io.errors import InputError
from calfsocket.io.units import STRESS
from calfsocket.materials.modes import MODES, Array, Mode, sheared_stretch
from calfsocket.materials.stability import SCANNED

Choice = TypeVar("Choice", bound=str)
Measure = Literal["engineering", "cauchy"]
MEASURES: tuple[Measure, ...] = get_args(Measure)

DEFORMATIONS: dict[str, tuple[str, ...]] = {
    "stretch": ("stretch_ratio", "extension_ratio", "lambda", "λ"),
    "strain": (
        "engineering_strain",
        "eng_strain",
        "nominal_strain",
        "tensile_strain",
        "axial_strain",
    ),
    "true_strain": ("log_strain", "logarithmic_strain"),
    "shear_strain": ("amount_of_shear", "shear", "gamma", "\u03b3"),
    "shear_angle": ("angle_of_shear",),
}
"""Columns of the deformation, and other names for them. Strain is the engineering strain, stretch
minus 1; shear strain the amount of shear, the tangent of the angle."""

STRESSES: dict[str, tuple[str, ...]] = {
    "engineering_stress": ("eng_stress", "nominal_stress", "first_piola_kirchhoff_stress"),
    "cauchy_stress": ("true_stress",),
    "shear_stress": (),
    "stress": ("tensile_stress", "axial_stress", "sigma", "\u03c3"),
}
"""Columns of the stress, and other names for them."""

_SHEAR = ("shear_strain", "shear_angle", "shear_stress")
"""Columns that only a test of simple shear has."""

_MEASURED: dict[str, Measure] = {
    "engineering_stress": "engineering",
    "cauchy_stress": "cauchy",
}
_OTHERS: dict[str, tuple[str, ...]] = {"stress_sd": ("sd", "standard_deviation"), "mode": ()}
_NAMES = {name: (name, *ways) for name, ways in (DEFORMATIONS | STRESSES | _OTHERS).items()}

_TO_STRETCH: dict[str, Callable[[Array], Array]] = {
    "stretch": lambda stretch: stretch,
    "strain": lambda strain: 1 + strain,
    "true_strain": np.exp,
    "shear_strain": sheared_stretch,
    "shear_angle": lambda angle: sheared_stretch(np.tan(angle)),
}
_MODES: dict[str, Mode] = {
    **{mode: mode for mode in MODES},
    "tension": "uniaxial",
    "compression": "uniaxial",
    "biaxial": "equibiaxial",
    "simple shear": "shear",
    "pure shear": "planar",
}


@dataclass(frozen=True)
class Test:
    """One test, or one branch of it: engineering stress over stretch."""

    __test__ = False  # not one of pytest's

    path: Path
    title: str  #: first comment of the file, or its name
    sha256: str  #: of the file
    mode: Mode
    measure: Measure  #: stress as measured
    stretch: Array  #: along the load, 1 unloaded; of shear the larger principal one, (n,)
    stress: Array  #: engineering stress, MPa, (n,)
    sd: Array | None  #: its standard deviation, MPa, where known, (n,)
    branch: str = ""  #: which one of the file, where it has several
    unused: tuple[str, ...] = ()  #: columns of the file that are not used


def read_test(
    path: Path,
    mode: Mode | None = None,
    measure: Measure | None = None,
    branch: Branch | None = None,
    cycle: int | Literal["last"] | None = None,
) -> Test:
    """Read a test.

    Where neither the file nor `mode` and `measure` say so, it is uniaxial, and a column ``stress``
    holds the engineering stress. A file with loading and unloading needs a `branch`, one with
    several cycles also a `cycle`, counted from 1.

    Raises
    ------
    InputError
        When the file cannot be used; the message names file, line or column, and what is allowed.
    """
    table = Columns(Path(path), _NAMES, (DEFORMATIONS, STRESSES))
    named = next(name for name in STRESSES if name in table)
    measure = _agree(path, "the column's name", _MEASURED.get(named), "--stress", measure)
    mode = _agree(path, *_mode(table), "--mode", mode) or "uniaxial"
    stretch = _stretch(table, mode)
    stress = _in_mpa(table, named)
    sd = _in_mpa(table, "stress_sd") if "stress_sd" in table else None
    if sd is not None:
        table.refuse(sd <= 0, "stress_sd is 0 or less; give it above 0, or remove the column")
    # Load over reference area: the current one is 1/stretch of it where the volume is kept.
    area = 1.0 / stretch if measure == "cauchy" and mode != "shear" else np.ones_like(stretch)
    rows, words = _branch(table, stretch, branch, cycle)
    stretch, stress, area = stretch[rows], (stress * area)[rows], area[rows]
    if np.sum(stress * (stretch - 1)) <= 0:
        raise table.wrong(
            "stress and strain have opposite signs; "
            "tension must be positive and compression negative"
        )
    return Test(
        path=table.path,
        title=table.title,
        sha256=table.sha256,
        mode=mode,
        measure=measure or "engineering",
        stretch=stretch,
        stress=stress,
        sd=None if sd is None else sd[rows] * area,
        branch=words,
        unused=table.unused,
    )


def _mode(table: Columns) -> tuple[str, Mode | None]:
    """Return where the file says what kind of test it is, and the kind if it does."""
    shear = next((name for name in _SHEAR if name in table), None)
    if "mode" not in table:
        return f"the column {shear}", "shear" if shear else None
    cells = [cell.replace("_", " ").casefold() for cell in table.text("mode")]
    table.refuse(
        [cell not in _MODES for cell in cells], f"mode is unknown; use one of {', '.join(MODES)}"
    )
    found = [_MODES[cell] for cell in cells]
    table.refuse(
        [mode != found[0] for mode in found],
        f"mode changes from {found[0]}; put each test in a separate file, "
        "and give all files to `fit`",
    )
    if shear and found[0] != "shear":
        raise table.wrong(f"the column mode says {found[0]}, but the file has a column {shear}")
    return "the column mode", found[0]


def _stretch(table: Columns, mode: Mode) -> Array:
    """Return the principal stretches along the load."""
    name = next(name for name in DEFORMATIONS if name in table)
    measured = "shear_strain" if mode == "shear" and name == "strain" else name
    if (mode == "shear") != measured.startswith("shear"):
        raise table.wrong(
            f"the deformation of a {mode} test cannot be a {name}; give the column "
            f"{'shear_strain or shear_angle' if mode == 'shear' else 'stretch or strain'}"
        )

    def factor(unit: str) -> float:
        known = {"": 1.0, "-": 1.0, "mm/mm": 1.0, "m/m": 1.0}
        if name == "shear_angle":
            known = {"deg": np.pi / 180, "°": np.pi / 180, "rad": 1.0}
        elif name != "stretch":
            known |= {"%": 0.01, "percent": 0.01}
        if unit not in known:
            allowed = [each for each in known if each]
            example = f"`{name} [{allowed[0]}]`"
            raise ValueError(
                f"unit {unit!r} is unknown; use one of {', '.join(allowed)}, e.g. {example}"
            )
        return known[unit]

    with np.errstate(over="ignore"):
        stretch = _TO_STRETCH[measured](table.numbers(name, factor))
    low, high = SCANNED
    table.refuse(
        ~((stretch >= low) & (stretch <= high)),
        f"the stretch is outside {low} to {high}; 1 is unloaded, shortening is below 1"
        + ("; strain in per cent needs the header `strain [%]`" if name == "strain" else ""),
    )
    return stretch


def _in_mpa(table: Columns, name: str) -> Array:
    """Return a column of stresses; machines write units with any capitals."""

    def factor(unit: str) -> float:
        if not STRESS.has(unit) and not unit.startswith("m"):  # m may be milli or mega
            same = [each for each in STRESS.allowed if each.casefold() == unit.casefold()]
            unit = next(iter(same), unit)
        try:
            return float(STRESS.factor(unit))
        except ValueError as error:
            raise ValueError(f"{error}, e.g. `{name} [kPa]`") from None

    return table.numbers(name, factor)


def _branch(
    table: Columns, stretch: Array, branch: Branch | None, cycle: int | Literal["last"] | None
) -> tuple[Array, str]:
    """Return the rows of the branch that is asked for, and its name if there are others."""
    found = branches.pieces(stretch)
    # Where a test does not turn, the order of its rows says nothing.
    if (
        len(found) == 1
        and branch in (None, "loading", found[0].branch)
        and cycle in (None, 1, "last")
    ):
        return found[0].rows, ""
    turns = [table.lines[row] for row in branches.turning_points(stretch)]
    cycles = sorted({piece.cycle for piece in found if branch in (None, piece.branch)})
    if not turns:
        raise table.wrong(
            f"the stretch does not turn, so that there is one curve, of {found[0].branch}; "
            "omit --branch and --cycle"
        )
    several = f"; the file has {len(cycles)} cycles: choose one with --cycle 1 to {len(cycles)}"
    if branch is None:
        raise table.wrong(
            f"the stretch turns back{f' {len(turns)} times, first' if turns[1:] else ''} at line "
            f"{turns[0]}, and loading and unloading are two curves: choose one with --branch "
            f"loading or unloading{several if cycles[1:] else ''}; if it is one curve, sort the "
            "rows by stretch"
        )
    if not cycles:
        raise table.wrong(f"has no {branch}; omit --branch to see where the stretch turns")
    if cycle is None and len(cycles) > 1:
        raise table.wrong(f"{several.removeprefix('; the file ')}, or the last with --cycle last")
    chosen = cycles[-1] if cycle in (None, "last") else cycle
    if chosen not in cycles:
        raise table.wrong(f"no {branch} in cycle {chosen}; use --cycle 1 to {cycles[-1]}")
    rows = [piece.rows for piece in found if (piece.branch, piece.cycle) == (branch, chosen)]
    return np.concatenate(rows), f"{branch}, cycle {chosen} of {cycles[-1]}"


def _agree(
    path: Path, place: str, read: Choice | None, option: str, asked: Choice | None
) -> Choice | None:
    """Return what the file says, else what the option says; they must not contradict each other."""
    if read and asked and read != asked:
        raise InputError(
            f"{path}: {place} says {read}, but {option} says {asked}; make them the same"
        )
    return read or asked
