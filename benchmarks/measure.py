"""One run of the program as a process: wall time, time to the first iteration, memory."""

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

# PETSc's monitor of Newton's method. Forms are compiled by solving a small ring, whose first
# iteration comes before that of the study.
ITERATION, OCCURRENCE = "  1 SNES Function norm", 2

ONE = ("--sockets", "TSB", "--materials", "combined")
"""Options of one run."""


@dataclass(frozen=True)
class Measured:
    """A study that ran as a process."""

    seconds: float  #: wall time
    first_iteration: float | None  #: wall time to the first Newton iteration's end, s
    memory: float  #: largest resident memory of the process, MiB; of one rank, with mpirun
    run: dict[str, Any]  #: its run.json
    profile: pd.DataFrame  #: its profile.csv


def study(*options: str, ranks: int = 1, cache: Path | None = None) -> Measured:
    """Run a study without pictures or report, with a profile; on several ranks by mpirun."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "results"
        command = [
            *([] if ranks == 1 else ["mpirun", "-n", str(ranks)]),
            *(sys.executable, "-m", "calfsocket", "--out", str(out)),
            *("--no-pictures", "--no-report", "--profile", *options),
            "-calfsocket_snes_monitor",
        ]
        measured = process(command, cache)
        return Measured(
            *measured,
            run=json.loads((out / "run.json").read_text(encoding="utf-8")),
            profile=pd.read_csv(out / "profile.csv"),
        )


def process(command: Sequence[str], cache: Path | None = None) -> tuple[float, float | None, float]:
    """Run a command; return wall time, time to the first iteration (s) and memory (MiB).

    Raises
    ------
    RuntimeError
        When it fails, with what it said.
    """
    environment = os.environ | ({"XDG_CACHE_HOME": str(cache)} if cache else {})
    first = None
    with tempfile.TemporaryFile("w+") as errors:
        start = time.perf_counter()
        running = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=errors, text=True, env=environment
        )
        assert running.stdout is not None
        seen = 0
        for line in running.stdout:
            seen += line.startswith(ITERATION)
            if first is None and seen == OCCURRENCE:
                first = time.perf_counter() - start
        _, status, usage = os.wait4(running.pid, 0)
        seconds = time.perf_counter() - start
        running.returncode = os.waitstatus_to_exitcode(status)
        if running.returncode:
            errors.seek(0)
            raise RuntimeError(
                f"{' '.join(command)}: exit code {running.returncode}\n{errors.read()}"
            )
    return seconds, first, usage.ru_maxrss / 1024
