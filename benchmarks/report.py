"""The report of the six runs on one rank and on two, and the picture of one run."""

import resource
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.table import Table

from benchmarks.measure import process

PROGRAM = (sys.executable, "-m", "calfsocket")


def measure(size: str) -> dict[str, Any]:
    """Solve the six runs, and time what is made of them."""
    with tempfile.TemporaryDirectory() as folder:
        out = str(Path(folder) / "results")
        process([*PROGRAM, "--size", size, "--out", out, "--no-pictures", "--no-report"])
        commands = {
            "help": [*PROGRAM, "--help"],
            "picture": [*PROGRAM, "picture", f"{out}/HS_separate"],
            "report": [*PROGRAM, "report", out],
            "report_on_two_ranks": ["mpirun", "-n", "2", *PROGRAM, "report", out],
        }
        return {"size": size, **{name: timed(command) for name, command in commands.items()}}


def timed(command: Sequence[str]) -> dict[str, float]:
    """Return wall time and processor time of a command, s."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = process(command)[0]
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    used = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
    return {"seconds": seconds, "processor_s": used}


def table(result: dict[str, Any]) -> Table:
    """Lay it out."""
    shown = Table(title=f"What is made of the six runs, size {result['size']}")
    for name in ("", "wall, s", "processor, s"):
        shown.add_column(name, justify="right" if name else "left")
    for name, times in result.items():
        if name != "size":
            row = [f"{times[key]:.2f}" for key in ("seconds", "processor_s")]
            shown.add_row(name.replace("_", " "), *row)
    return shown
