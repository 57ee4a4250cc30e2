"""How long it takes until something happens."""

import sys
import tempfile
from functools import partial
from pathlib import Path
from typing import Any

from rich.table import Table

from benchmarks.measure import ONE, process, study

BARS = {"help_s": 0.5, "first_iteration_cold_s": 25.0, "first_iteration_cached_s": 8.0}
REPEATS = 3


def measure(size: str) -> dict[str, Any]:
    """Time the help, and the first Newton iteration with an empty cache and with a full one."""
    helped = [process([sys.executable, "-m", "calfsocket", "--help"])[0] for _ in range(REPEATS)]
    with tempfile.TemporaryDirectory() as folder:
        run = partial(study, "--size", size, cache=Path(folder))
        cold, cached = (run(*ONE) for _ in range(2))
        forms = len(list(Path(folder).rglob("*.so")))
        run(*ONE, "--friction", "0.3", "--fascia-c10", "tables")
        run("--sockets", "HS")
        again = len(list(Path(folder).rglob("*.so"))) - forms
    return {
        "size": size,
        "help_s": min(helped),
        "first_iteration_cold_s": cold.first_iteration,
        "first_iteration_cached_s": cached.first_iteration,
        "compiled": forms,
        "compiled_again": again,
    }


def table(result: dict[str, Any]) -> Table:
    """Lay it out."""
    shown = Table(title=f"Start, size {result['size']}")
    for name in ("", "s", "bar"):
        shown.add_column(name, justify="right" if name else "left")
    for name, bar in BARS.items():
        shown.add_row(name.removesuffix("_s").replace("_", " "), f"{result[name]:.2f}", f"{bar:g}")
    shown.add_row(
        "compiled once / again for other runs and parameters",
        f"{result['compiled']} / {result['compiled_again']}",
        "0 again",
    )
    return shown
