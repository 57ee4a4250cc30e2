"""Where the time of a case goes: its phases, and what PETSc, dolfinx and this program time."""

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from petsc4py import PETSc
from rich.table import Table

from calfsocket.io.fenics import timed

if TYPE_CHECKING:
    import pandas as pd

PROFILE_FILE = "profile.csv"

SOLVE = "solve"
# Events of PETSc's log, by what they are; those of one level do not overlap.
FACTORISATION, TRIANGULAR = "factorisation, numeric", "triangular solves"
SOLVE_EVENTS = {
    FACTORISATION: "MatLUFactorNum",
    "factorisation, symbolic": "MatLUFactorSym",
    TRIANGULAR: "MatSolve",
    "residual": "SNESFunctionEval",
    "tangent": "SNESJacobianEval",
}
INNER_EVENTS = {
    "tangent: tissues": "TissueTangent",
    "tangent: contact": "ContactTangent",
    "residual: tissues": "TissueResidual",
    "residual: contact": "ContactResidual",
}
# Timers of dolfinx, all of them in the phases "mesh" and "setup".
DOLFINX_TIMERS = (
    "Compute graph partition (SCOTCH)",
    "Compute entities of dim = 1",
    "Build dofmap data",
    "SparsityPattern::finalize",
)


class Phases:
    """Wall time of the phases of a case so far, in `seconds`."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._inside = 0.0  # wall time of phases inside the present one

    @contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        """Add the wall time of the body to a phase, without that of phases inside it."""
        start, outside = time.perf_counter(), self._inside
        self._inside = 0.0
        try:
            yield
        finally:
            elapsed = time.perf_counter() - start
            self.seconds[name] = self.seconds.get(name, 0.0) + elapsed - self._inside
            self._inside = outside + elapsed


class Profile:
    """Wall times of one case on this process.

    Events of PETSc's log count between `start` and `stop`, the timers of dolfinx from the start of
    the case.
    """

    def __init__(self) -> None:
        if not PETSc.Log.isActive():
            PETSc.Log.begin()
        self._timers = _timers()
        self._before = self._events = _events()

    def start(self) -> None:
        """Start counting events."""
        self._before = _events()

    def stop(self) -> None:
        """Stop counting events."""
        after = _events()
        self._events = {
            name: (after[name][0] - count, after[name][1] - seconds)
            for name, (count, seconds) in self._before.items()
        }

    def rows(self, phases: Mapping[str, float]) -> "pd.DataFrame":
        """Return what, calls and seconds: phases, events within the solution, timers of dolfinx."""
        import pandas as pd

        rows = [("phase", name, 1, seconds) for name, seconds in phases.items()]
        solve = phases.get(SOLVE, 0.0)
        known = sum(self._events[name][1] for name in SOLVE_EVENTS)
        rows += [(SOLVE, name, *self._events[name]) for name in SOLVE_EVENTS]
        rows.append((SOLVE, "rest", 1, solve - known))
        rows += [("within", name, *self._events[name]) for name in INNER_EVENTS]
        for name, (count, seconds) in _timers().items():
            before = self._timers[name]
            rows.append(("dolfinx", name, count - before[0], seconds - before[1]))
        return pd.DataFrame(rows, columns=["level", "what", "calls", "seconds"])


def solve_ratio(rows: "pd.DataFrame") -> float:
    """Wall time of the solution over that of its numeric factorisations and triangular solves."""
    seconds = rows.set_index(["level", "what"])["seconds"]
    algebra = seconds[SOLVE, FACTORISATION] + seconds[SOLVE, TRIANGULAR]
    return float(seconds["phase", SOLVE] / algebra)


def table(folder: Path) -> Table:
    """Lay out the profile of a study, a column a case, seconds and calls."""
    import pandas as pd

    rows = pd.read_csv(folder / PROFILE_FILE)
    cases = list(rows.groupby(["socket", "material_set"], sort=False))
    shown = Table(title="Wall time, s (calls)")
    shown.add_column("")
    for (socket, material_set), _ in cases:
        shown.add_column(f"{socket} {material_set}", justify="right")
    first = cases[0][1]
    for (level, what), _ in first.groupby(["level", "what"], sort=False):
        cells = []
        for _, case in cases:
            found = case[(case["level"] == level) & (case["what"] == what)].iloc[0]
            calls = "" if level == "phase" else f" ({found['calls']})"
            cells.append(f"{found['seconds']:.2f}{calls}")
        shown.add_row(what if level == "phase" else f"  {level}: {what}", *cells)
    ratios = [f"{solve_ratio(case):.2f}" for _, case in cases]
    shown.add_row("solve / (numeric factorisations + triangular solves)", *ratios)
    return shown


def _events() -> dict[str, tuple[int, float]]:
    found = {}
    for name, event in (SOLVE_EVENTS | INNER_EVENTS).items():
        info = PETSc.Log.Event(event).getPerfInfo()
        found[name] = int(info["count"]), float(info["time"])
    return found


def _timers() -> dict[str, tuple[int, float]]:
    return {name: timed(name) for name in DOLFINX_TIMERS}
