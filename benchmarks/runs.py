"""The six runs, one after the other on one rank: phases, iterations, and what is not algebra."""

from typing import Any

from rich.table import Table

from benchmarks.measure import study
from calfsocket.simulation.profile import FACTORISATION, SOLVE, TRIANGULAR, solve_ratio

RATIO = 1.4
"""Largest ratio of the solution's wall time to its factorisations and triangular solves."""

ITERATIONS = {
    ("TC", "separate"): 45,
    ("TC", "combined"): 30,
    ("TSB", "separate"): 30,
    ("TSB", "combined"): 30,
    ("HS", "separate"): 60,
    ("HS", "combined"): 30,
}
"""Most Newton iterations of each run at size "paper"."""


def measure(size: str) -> dict[str, Any]:
    """Solve the six runs; return a row a run."""
    measured = study("--size", size)
    rows = []
    for (socket, material_set), profile in measured.profile.groupby(
        ["socket", "material_set"], sort=False
    ):
        case = measured.run["cases"][f"{socket}_{material_set}"]
        seconds = profile.set_index(["level", "what"])["seconds"]
        checks = case["checks"]
        iterations = checks["newton_iterations"]
        solve = {what: float(seconds[SOLVE, what]) for what in seconds[SOLVE].index}
        rows.append(
            {
                "socket": socket,
                "material_set": material_set,
                "iterations": iterations,
                "most_iterations": ITERATIONS[socket, material_set],
                "failed_steps": checks["failed_steps"],
                "negative_modes": checks["negative_modes"],
                "phases_s": {k: round(v, 4) for k, v in case["seconds"].items()},
                "solve_s": solve,
                "per_iteration_s": {what: value / iterations for what, value in solve.items()},
                "ratio": solve_ratio(profile),
                "ratio_of_all_phases": sum(case["seconds"].values())
                / (solve[FACTORISATION] + solve[TRIANGULAR]),
            }
        )
    return {"size": size, "seconds": measured.seconds, "memory_MiB": measured.memory, "runs": rows}


def table(result: dict[str, Any]) -> Table:
    """Lay the runs out, times in seconds an iteration."""
    shown = Table(
        title=f"Six runs, size {result['size']}, one rank: {result['seconds']:.0f} s, "
        f"{result['memory_MiB']:.0f} MiB"
    )
    first = result["runs"][0]
    for name in ("run", "iterations (bar)", "failed", "modes", "solve s", "all s"):
        shown.add_column(name, justify="left" if name == "run" else "right")
    for what in first["per_iteration_s"]:
        shown.add_column(f"{what} ms/it", justify="right")
    shown.add_column(f"ratio (bar {RATIO})", justify="right")
    for row in result["runs"]:
        shown.add_row(
            f"{row['socket']} {row['material_set']}",
            f"{row['iterations']} ({row['most_iterations']})",
            str(row["failed_steps"]),
            str(row["negative_modes"]),
            f"{row['phases_s'][SOLVE]:.1f}",
            f"{sum(row['phases_s'].values()):.1f}",
            *(f"{1000 * value:.0f}" for value in row["per_iteration_s"].values()),
            f"{row['ratio']:.2f}",
        )
    return shown
