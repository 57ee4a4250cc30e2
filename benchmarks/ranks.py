"""Two ranks: six runs side by side, and one run on both."""

from typing import Any

from rich.table import Table

from benchmarks.measure import study

SIDE_BY_SIDE = 0.55
"""Largest share of the time on one rank that six runs on two ranks take."""
ONE = ("--sockets", "TSB", "--materials", "separate")


def measure(size: str) -> dict[str, Any]:
    """Time both, each on one rank and on two, one after the other."""
    result: dict[str, Any] = {"size": size}
    for name, options in (("six", ()), ("one", (*ONE, "--ranks-per-case", "max"))):
        for ranks in (1, 2):
            chosen = [str(ranks) if option == "max" else option for option in options]
            measured = study("--size", size, *chosen, ranks=ranks)
            result[f"{name}_on_{ranks}_s"] = measured.seconds
            if name == "one":
                (case,) = measured.run["cases"].values()
                result[f"one_on_{ranks}_solve_s"] = case["seconds"]["solve"]
    result["six_ratio"] = result["six_on_2_s"] / result["six_on_1_s"]
    result["one_ratio"] = result["one_on_2_s"] / result["one_on_1_s"]
    return result


def table(result: dict[str, Any]) -> Table:
    """Lay it out."""
    shown = Table(title=f"Two ranks, size {result['size']}")
    for name in ("", "1 rank, s", "2 ranks, s", "ratio", "bar"):
        shown.add_column(name, justify="right" if name else "left")
    for name, label, bar in (
        ("six", "six runs, side by side", SIDE_BY_SIDE),
        ("one", "one run, TSB separate", 1.0),
    ):
        times = [f"{result[f'{name}_on_{ranks}_s']:.1f}" for ranks in (1, 2)]
        shown.add_row(label, *times, f"{result[f'{name}_ratio']:.2f}", f"{bar:.2f}")
    return shown
