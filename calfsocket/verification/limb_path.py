"""A run of the limb followed step by step: Newton's iterations, energies, and the end state."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from mpi4py import MPI
from numpy.typing import NDArray

from calfsocket.io.errors import SolveError
from calfsocket.mechanics.stepping import LoadStep
from calfsocket.meshes.limb import Limb
from calfsocket.meshes.socket import Socket
from calfsocket.postprocess.extract import contact_line, section_fields
from calfsocket.postprocess.quantities import summary_rows
from calfsocket.simulation.case import Case, Run, Settings, region_tissues, step_control
from calfsocket.verification.energy import EnergyBalance, EnergyMeter
from calfsocket.verification.newton import (
    LAST_ITERATIONS,
    TOLERANCE,
    Iterations,
    Probe,
    Solve,
    probe_at,
    recording,
)
from calfsocket.verification.report import Figure


@dataclass(frozen=True)
class LimbPath:
    """A run from load 0 to 1.

    Attributes
    ----------
    case : Case
        What was solved.
    largest : float
        Largest load step allowed.
    extrapolate : bool
        Whether each step began from the secant through the last two states.
    steps : tuple of LoadStep
        Failed ones too.
    solves : list of Solve
        Newton's iterates of each step.
    energy : EnergyBalance
        Work of the shrink fit and where it went.
    probe : Probe
        Newton's method at the end state, along the last step.
    summary : DataFrame
        Rows of summary.csv.
    displacement : (n, 2)
        Of the mesh nodes at the end, mm.
    negative_modes : int
        Of the end state.
    """

    case: Case
    largest: float
    extrapolate: bool
    steps: tuple[LoadStep, ...]
    solves: list[Solve]
    energy: EnergyBalance
    probe: Probe
    summary: pd.DataFrame
    displacement: NDArray[np.float64]
    negative_modes: int

    @property
    def mean_pressure(self) -> float:
        """Mean contact pressure at the end, kPa."""
        return self.value("skin", "contact_pressure_mean")

    def as_the_study(self, largest: float) -> bool:
        """Whether it has these steps, and the study's extrapolation."""
        return self.largest == largest and self.extrapolate == (
            self.case.material_set == "combined"
        )

    def value(self, tissue: str, quantity: str) -> float:
        """Value of a quantity at the end."""
        table = self.summary
        rows = table[(table.tissue == tissue) & (table["quantity"] == quantity)]
        return float(rows["value"].iloc[0])


def follow(
    case: Case, settings: Settings, largest: float, extrapolate: bool | None = None
) -> LimbPath:
    """Solve a case with load steps of at most `largest` (one rank).

    Parameters
    ----------
    case, settings
        What to solve.
    largest : float
        Largest load step; the first one is no larger.
    extrapolate : bool, optional
        Whether to extrapolate; as the study does unless given.

    Raises
    ------
    SolveError
        If the run does not reach the full load.
    """
    limb = Limb.reference()
    socket = Socket.reference(case.socket)
    with recording() as solves:
        run = Run(MPI.COMM_SELF, case, settings, limb, socket, on_step=lambda s: record(s))
        stepper, model = run.stepper, run.model
        control = step_control(case, settings)
        changes = {"first": min(largest, control.first), "largest": largest}
        if extrapolate is not None:
            changes["extrapolate"] = extrapolate
        stepper.control = control = control.model_copy(update=changes)
        meter = EnergyMeter(model)
        states = [stepper.newton.x.array.copy()]

        def record(step: LoadStep) -> None:
            meter.record(step)
            if step.newton.converged:
                states.append(stepper.newton.x.array.copy())

        run.solve()
    if run.failure:
        raise SolveError(f"{case.name}: {run.failure}")
    fields = section_fields(model, region_tissues(limb))
    line = contact_line(model)
    assert fields is not None and line is not None  # one rank
    return LimbPath(
        case=case,
        largest=largest,
        extrapolate=control.extrapolate,
        steps=tuple(stepper.steps),
        solves=solves,
        energy=meter.balance(),
        probe=probe_at(model, stepper.newton.x, states[-1] - states[-2]),
        summary=summary_rows(fields, line, case.socket, case.material_set),
        displacement=fields.displacement,
        negative_modes=stepper.newton.negative_modes(),
    )


def largest_change(path: LimbPath, other: LimbPath) -> tuple[float, str]:
    """Largest relative change of a number of the summary from one path to another, and its name."""
    before, after = path.summary["value"].to_numpy(), other.summary["value"].to_numpy()
    change = np.abs(np.abs(after) - np.abs(before)) / np.abs(before)
    row = path.summary.iloc[int(np.argmax(change))]
    return float(change.max()), f"{row.tissue} {row.quantity}"


def path_table(paths: Sequence[LimbPath], references: Mapping[str, LimbPath]) -> pd.DataFrame:
    """Sum paths up, each beside the reference of its case."""
    rows = []
    for path in paths:
        reference = references[path.case.name]
        change, where = largest_change(reference, path)
        moved = np.linalg.norm(path.displacement - reference.displacement, axis=1).max()
        rows.append(
            {
                "case": path.case.name,
                "largest step": path.largest,
                "predictor": "secant" if path.extrapolate else "none",
                "steps": len(path.energy.load) - 1,
                "Newton": sum(step.newton.iterations for step in path.steps),
                "mean pressure, kPa": path.mean_pressure,
                "largest pressure, kPa": path.value("skin", "contact_pressure_max"),
                "points moved by, mm": float(moved),
                "largest change, %": 100.0 * change,
                "of": where,
                "negative modes": path.negative_modes,
            }
        )
    return pd.DataFrame(rows)


def energy_table(paths: Sequence[LimbPath]) -> pd.DataFrame:
    """Show where the work of the shrink fit went, as shares of it."""
    rows = []
    for path in paths:
        energy = path.energy
        shares = {
            "limb": energy.limb,
            "socket": energy.socket,
            "friction": energy.friction,
            "lever": energy.lever,
            "penetration": energy.penetration,
        }
        rows.append(
            {
                "case": path.case.name,
                "largest step": path.largest,
                "work, N mm per mm": float(energy.work[-1]),
                **{
                    f"{name}, %": float(100.0 * share[-1] / energy.work[-1])
                    for name, share in shares.items()
                },
                "work less limb, socket, friction, %": 100.0 * energy.error,
                "less lever, penetration, too, %": 100.0 * energy.full_error,
            }
        )
    return pd.DataFrame(rows)


def newton_table(paths: Sequence[LimbPath]) -> pd.DataFrame:
    """Judge the last two iterations of every step of each path."""
    rows = []
    for path in paths:
        last = Iterations.of(path.solves)
        changing = [
            f"{step.load:.3g}"
            for step, solve in zip(path.steps, path.solves, strict=True)
            if solve.converged
            and (solve.changes()[-LAST_ITERATIONS:].any() or solve.cuts()[-LAST_ITERATIONS:].any())
        ]
        rows.append(
            {
                "case": path.case.name,
                "iterations": len(last.before),
                "contact changes": int(np.count_nonzero(last.changes)),
                "cut": int(np.count_nonzero(last.cut)),
                "at loads": ", ".join(changing),
                "smooth": int(np.count_nonzero(last.smooth)),
                "largest C, mm/N": float(last.factor.max(initial=0.0)),
                "last: worst |F| after / before": last.last_contraction,
                "order at the end": path.probe.order,
            }
        )
    return pd.DataFrame(rows)


def newton_figure(paths: Sequence[LimbPath]) -> Figure:
    """Plot |F| after over |F| before of the last two iterations of every step."""
    last = Iterations.of([solve for path in paths for solve in path.solves])

    def draw(axes: Axes) -> None:
        changed = (last.changes > 0) | last.cut
        axes.loglog(last.before[~changed], last.after[~changed], "o", ms=4, label="whole steps")
        axes.loglog(
            last.before[changed], last.after[changed], "x", ms=5, label="contact changes, or cut"
        )
        before = np.array([last.before.min(), last.before.max()])
        most = last.factor.max(initial=0.0)
        axes.loglog(before, most * before**2, "k--", lw=1, label=f"{most:.2g} |F|^2")
        axes.axhline(TOLERANCE, color="0.6", lw=1, label="tolerance")
        axes.set(
            xlabel="|F| before the iteration, N/mm",
            ylabel="|F| after it, N/mm",
            ylim=(last.after.min() / 3.0, 3.0 * last.after.max()),
        )
        axes.legend()

    return Figure("limb_newton", draw, "The last two Newton iterations of every step of all paths.")


def energy_figure(paths: Sequence[LimbPath]) -> Figure:
    """Plot what the energy balance leaves over the load step."""

    def draw(axes: Axes) -> None:
        cases = dict.fromkeys(path.case.name for path in paths)
        for k, name in enumerate(cases):
            own = [p for p in paths if p.case.name == name and p.as_the_study(p.largest)]
            steps = [float(np.diff(p.energy.load).max()) for p in own]
            left = [100.0 * abs(p.energy.full_error) for p in own]
            style = "o-" if own[0].case.material_set == "separate" else "s--"
            axes.loglog(steps, left, style, color=f"C{k // 2}", label=name)
        ends = np.array([min(steps), max(steps)])
        axes.loglog(ends, ends**2, "k:", lw=1, label="slope 2")
        axes.set(xlabel="largest load step", ylabel="unaccounted, % of the work")
        axes.legend(fontsize="small")

    return Figure(
        "limb_energy",
        draw,
        "Work of the shrink fit less all energies, with lever and penetration, by load step.",
    )
