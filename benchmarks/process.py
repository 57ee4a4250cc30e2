"""A command of calfsocket as a process: wall and processor time, memory, Newton iterations."""

import os
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

ITERATION = "SNES Function norm"
"""In each line of PETSc's monitor of Newton's method."""

MONITOR = ("-calfsocket_snes_monitor", "ascii")
BEGINNING = "mesh and set-up"
"""In the message with which a case begins: iterations before it are of the ring by which forms are
compiled."""


@dataclass
class Ended:
    """A process that has ended, or was ended after as many iterations as were asked for.

    Attributes
    ----------
    wall, processor : float
        Times, s; processor time is that of the process and of all that it started.
    memory : float
        Largest resident memory of one process, MB.
    iterations : list of (float, float)
        Wall time and processor time at each line of the monitor, s.
    """

    wall: float
    processor: float
    memory: float
    iterations: list[tuple[float, float]] = field(default_factory=list)


def run(
    words: Sequence[str],
    checkout: Path,
    ranks: int = 1,
    iterations: int | None = None,
    **environment: str,
) -> Ended:
    """Run `python3 -m calfsocket WORDS` of a checkout; stop it after some lines of the monitor.

    `environment` are variables besides those that there are.

    Raises
    ------
    RuntimeError
        When it fails, with what it said.
    """
    command = [sys.executable, "-m", "calfsocket", *words]
    if ranks > 1:
        command = ["mpirun", "-n", str(ranks), *command]
    variables = os.environ | {"PYTHONPATH": str(checkout), "OMP_NUM_THREADS": "1"} | environment
    variables.pop("PYTHONDONTWRITEBYTECODE", None)  # compiled once, as where a person works
    seen: list[tuple[float, float]] = []
    said: list[str] = []
    begun = False
    start = time.perf_counter()
    process = subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env=variables,
        cwd=checkout,  # where `python3 -m` looks first
    )
    assert process.stdout is not None
    for line in process.stdout:
        said.append(line)
        begun = begun or BEGINNING in line
        if begun and ITERATION in line:
            seen.append((time.perf_counter() - start, _processor_time(process.pid)))
        if iterations is not None and len(seen) == iterations:
            process.terminate()
            break
    process.stdout.close()
    _, status, usage = os.wait4(process.pid, 0)
    wall = time.perf_counter() - start
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode and len(seen) != iterations:
        raise RuntimeError(f"{' '.join(command)}: exit code {process.returncode}\n{''.join(said)}")
    return Ended(wall, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024, seen)


def _processor_time(pid: int) -> float:
    """Processor time of a living process so far, s."""
    words = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rsplit(")", 1)[1].split()
    return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")
