"""Cost against size: time and memory of one run, from coarse to far beyond the paper's mesh."""

from typing import Any

import numpy as np
import pandas as pd
from rich.table import Table

from benchmarks.measure import ONE, study
from calfsocket.simulation.profile import FACTORISATION, SOLVE, TRIANGULAR

SIZES = ("7000", "15000", "31900", "65000", "130000", "200000")
FITTED = (
    "iteration_s",
    "factorisation_s",
    "triangular_solve_s",
    "other_s",
    "mesh_s",
    "memory_MiB",
)


def measure(sizes: tuple[str, ...] = SIZES) -> dict[str, Any]:
    """Solve one run at each size; fit a power of the number of triangles to each cost."""
    rows = []
    for size in sizes:
        measured = study("--size", size, *ONE)
        (case,) = measured.run["cases"].values()
        checks, phases = case["checks"], case["seconds"]
        seconds = measured.profile.set_index(["level", "what"])["seconds"]
        n = checks["newton_iterations"]
        factorisation, solves = (seconds[SOLVE, what] / n for what in (FACTORISATION, TRIANGULAR))
        rows.append(
            {
                "triangles": checks["cells"],
                "unknowns": checks["unknowns"],
                "iterations": n,
                "failed_steps": checks["failed_steps"],
                "mesh_s": phases["mesh"],
                "iteration_s": phases["solve"] / n,
                "factorisation_s": factorisation,
                "triangular_solve_s": solves,
                "other_s": phases["solve"] / n - factorisation - solves,
                "seconds": measured.seconds,
                "memory_MiB": measured.memory,
            }
        )
    logarithms = np.log(pd.DataFrame(rows)[["triangles", *FITTED]])
    slopes, _ = np.polyfit(logarithms["triangles"], logarithms[[*FITTED]], 1)
    return {"runs": rows, "exponents": dict(zip(FITTED, slopes.tolist(), strict=True))}


def table(result: dict[str, Any]) -> Table:
    """Lay it out, the exponents below."""
    shown = Table(title="Growth: TSB combined, one rank")
    names = list(result["runs"][0])
    for name in names:
        shown.add_column(name.replace("_", " "), justify="right")
    for row in result["runs"]:
        shown.add_row(
            *(f"{row[name]:.3g}" if name.endswith("_s") else f"{row[name]:.0f}" for name in names)
        )
    shown.add_section()
    exponents = result["exponents"]
    shown.add_row(*(f"N^{exponents[name]:.2f}" if name in exponents else "" for name in names))
    return shown
