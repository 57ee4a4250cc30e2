"""PETSc's options: our defaults, and a place for the user's own."""

from collections.abc import Iterator
from contextlib import contextmanager

from petsc4py import PETSc

OPTIONS_PREFIX = "calfsocket_"

DEFAULT_OPTIONS: dict[str, str | int | float] = {
    "snes_type": "newtonls",
    "snes_linesearch_type": "bt",
    "snes_max_it": 20,
    "snes_atol": 1e-9,
    "snes_rtol": 0.0,
    "snes_stol": 0.0,
    "snes_divergence_tolerance": -1.0,
    "ksp_type": "preonly",
    "pc_type": "lu",
    "pc_factor_mat_solver_type": "mumps",
    # Room for delayed pivots, in percent.
    "mat_mumps_icntl_14": 60,
    # No scaling: unknowns are of like size already, and it takes a fifth of a factorisation.
    "mat_mumps_icntl_8": 0,
}
"""The residual's tolerance is in N/mm; any of them can be set as -calfsocket_NAME VALUE."""


def given() -> dict[str, str]:
    """Return the user's options; one that stands alone, such as a monitor, has no text."""
    return {name: value or "" for name, value in PETSc.Options().getAll().items()}


@contextmanager
def defaults(**changed: str) -> Iterator[None]:
    """Put our defaults, or these, into PETSc's options where the user has set nothing."""
    options = PETSc.Options(OPTIONS_PREFIX)
    values = DEFAULT_OPTIONS | changed
    added = [name for name in values if not options.hasName(name)]
    for name in added:
        options[name] = values[name]
    try:
        yield
    finally:
        for name in added:
            del options[name]
