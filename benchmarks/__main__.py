"""The command: `python3 -m benchmarks [--quick] [--only start,mesh,...]`."""

import argparse
import json
import os
import platform
import time
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from benchmarks.calibration import unit
from benchmarks.measures import QUICK, SUBJECTS, THOROUGH, USUAL, Subject
from calfsocket.io.files import write_json
from calfsocket.io.versions import versions

HERE = Path(__file__).resolve().parent
BASELINE = HERE / "baseline.json"
PAGE = HERE.parent / "docs" / "performance.md"
BEGIN, END = "<!-- made by python3 -m benchmarks --page -->\n", "<!-- end -->\n"


def main() -> None:
    """Measure, compare, print and write."""
    parser = argparse.ArgumentParser(prog="python3 -m benchmarks", description=__doc__)
    parser.add_argument("--only", default=",".join(SUBJECTS), help="default: %(default)s")
    parser.add_argument(
        "--quick",
        dest="problems",
        action="store_const",
        const=QUICK,
        default=USUAL,
        help="smaller problems: a minute",
    )
    parser.add_argument(
        "--thorough",
        dest="problems",
        action="store_const",
        const=THOROUGH,
        help="up to a million triangles, 100 cases on two ranks: hours, 20 GB",
    )
    parser.add_argument("--out", type=Path, default=Path("benchmarks.json"))
    parser.add_argument("--of", type=Path, default=HERE.parent, help="another checkout")
    parser.add_argument("--store", action="store_true", help="make this the baseline")
    parser.add_argument(
        "--page", action="store_true", help="write the table of docs/performance.md"
    )
    arguments = parser.parse_args()
    chosen = arguments.only.split(",")
    if unknown := set(chosen) - set(SUBJECTS):
        parser.error(f"--only: {', '.join(sorted(unknown))}; choose from {', '.join(SUBJECTS)}")
    console, subject = Console(width=140), Subject(arguments.of.resolve(), arguments.problems)
    numbers: dict[str, float] = {}
    report: dict[str, Any] = {
        "date": time.strftime("%Y-%m-%d %H:%M"),
        "machine": {"processor": _processor(), "cores": os.cpu_count()},
        "versions": versions(),
        "numbers": numbers,
    }
    for name in chosen:
        report["unit_s"] = min(unit(), report.get("unit_s", float("inf")))
        numbers |= {key: round(value, 4) for key, value in SUBJECTS[name](subject).items()}
        write_json(arguments.out, report)
    baseline = _read(BASELINE)
    if arguments.store:
        kept = {
            **baseline,
            **report,
            "numbers": {**baseline.get("numbers", {}), **in_units(report)},
        }
        write_json(BASELINE, kept)
        return
    rows = compared(report, baseline)
    console.print(_table(rows))
    if arguments.page:
        _write_page(rows, report)


def in_units(report: dict[str, Any]) -> dict[str, float]:
    """Return the numbers with times in units of the calibration."""
    unit_s = report["unit_s"]
    return {
        name: round(value / unit_s, 4) if name.endswith("_s") else value
        for name, value in report["numbers"].items()
    }


def compared(
    report: dict[str, Any], baseline: dict[str, Any]
) -> list[tuple[str, float, float | None, float | None]]:
    """Return each number, that of the baseline on this machine, and the ratio of the two."""
    rows = []
    for name, value in report["numbers"].items():
        before = baseline.get("numbers", {}).get(name)
        if before is not None and name.endswith("_s"):
            before *= report["unit_s"]
        rows.append((name, value, before, value / before if before else None))
    return rows


def _cells(row: tuple[str, float, float | None, float | None]) -> list[str]:
    name, *values = row
    words = name.removesuffix("_s").replace("_wall", ", wall").replace("_MB", ", MB")
    words += ", s" if name.endswith("_s") else ""
    return [words.replace("_", " "), *("" if v is None else f"{v:.3g}" for v in values)]


HEAD = ("", "now", "baseline", "ratio")


def _table(rows: list[tuple[str, float, float | None, float | None]]) -> Table:
    shown = Table(title="Processor time unless it says wall; the baseline is commit 89dcf25")
    for name in HEAD:
        shown.add_column(name, justify="right" if name else "left")
    for row in rows:
        shown.add_row(*_cells(row))
    return shown


def _write_page(
    rows: list[tuple[str, float, float | None, float | None]], report: dict[str, Any]
) -> None:
    """Put the table into docs/performance.md, between its two marks."""
    text = PAGE.read_text(encoding="utf-8")
    before, rest = text.split(BEGIN)
    after = rest.split(END)[1]
    lines = [" | ".join(["", *HEAD, ""]).strip(), "|---|---:|---:|---:|"]
    lines += ["| " + " | ".join(_cells(row)) + " |" for row in rows]
    where = f"{report['machine']['processor']}, {report['machine']['cores']} cores"
    table = "\n".join([f"Measured on {where}.", "", *lines, ""])
    PAGE.write_text(before + BEGIN + "\n" + table + "\n" + END + after, encoding="utf-8")


def _read(path: Path) -> dict[str, Any]:
    return dict(json.loads(path.read_text(encoding="utf-8"))) if path.exists() else {}


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
