"""The command: `python3 -m benchmarks [--only runs,ranks,start,growth] [--out FILE]`."""

import argparse
import os
import platform
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from benchmarks import growth, ranks, runs, start
from calfsocket.io.files import write_json
from calfsocket.io.versions import versions

SUBJECTS: dict[str, tuple[Callable[[str], dict[str, Any]], Callable[[dict[str, Any]], Table]]] = {
    "start": (start.measure, start.table),
    "runs": (runs.measure, runs.table),
    "ranks": (ranks.measure, ranks.table),
    "growth": (lambda _size: growth.measure(), growth.table),
}


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(prog="python3 -m benchmarks", description=__doc__)
    parser.add_argument("--only", default=",".join(SUBJECTS), help="default: %(default)s")
    parser.add_argument("--size", default="paper", help="of all but growth (default: %(default)s)")
    parser.add_argument(
        "--out", type=Path, default=Path("benchmarks.json"), help="default: %(default)s"
    )
    arguments = parser.parse_args()
    chosen = arguments.only.split(",")
    if unknown := set(chosen) - set(SUBJECTS):
        parser.error(f"--only: {', '.join(sorted(unknown))}; choose from {', '.join(SUBJECTS)}")
    console = Console(width=180)
    report: dict[str, Any] = {
        "date": time.strftime("%Y-%m-%d %H:%M"),
        "machine": {"processor": _processor(), "cores": os.cpu_count()},
        "versions": versions(),
    }
    for name in chosen:
        measure, table = SUBJECTS[name]
        report[name] = measure(arguments.size)
        report[name]["load_average"] = os.getloadavg()[0]
        console.print(table(report[name]))
        write_json(arguments.out, report)
    console.print(f"load average at the end {os.getloadavg()[0]:.1f}; written: {arguments.out}")


def _processor() -> str:
    """Return the processor's name where Linux reports it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor()


if __name__ == "__main__":
    main()
