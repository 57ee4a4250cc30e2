"""A run of the limb followed step by step: Newton's iterations, energies, and the end state."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from calfsocket.materials.material_set import BaseSet
from calfsocket.mechanics.limb_problem import limb_problem
from calfsocket.mechanics.stepping import LoadStep, LoadStepper
from calfsocket.verification.energy import EnergyBalance, EnergyMeter
from calfsocket.verification.limb_runs import End, one_case
from calfsocket.verification.newton import (
    LAST_ITERATIONS,
    TOLERANCE,
    Iterations,
    Probe,
    Solve,
    probe_at,
    recording,
)
from calfsocket.verification.report import LOG, Curve, Figure, curves


@dataclass(frozen=True)
class LimbPath:
    """A case followed from load 0 to 1."""

    #: what was solved
    socket: str
    material_set: str
    largest: float  #: largest load step allowed
    as_the_study: bool  #: whether steps were extrapolated where the study does so, and only there
    steps: tuple[LoadStep, ...]  #: failed ones too
    solves: list[Solve]  #: Newton's iterates of each step
    energy: EnergyBalance  #: work of the shrink fit and where it went
    probe: Probe  #: Newton's method at the end, along the last step
    end: End  #: the equilibrium at full load

    @property
    def name(self) -> str:
        """Name of the case."""
        return f"{self.socket}_{self.material_set}"

    @property
    def extrapolated(self) -> bool:
        """Whether each step began from the secant through the last two states."""
        return self.as_the_study == (self.material_set == "combined")


def follow(
    socket: str, material_set: BaseSet, size: str, largest: float, as_the_study: bool = True
) -> LimbPath:
    """Solve a case with load steps of at most `largest`, on one rank.

    Raises
    ------
    ConvergenceError
        If the full load is not reached.
    """
    with recording() as solves:
        case, section, laws = one_case(socket, material_set, size)
        problem = limb_problem(section, laws, case.contact, case.support)
        steps = case.steps.model_copy(
            update={
                "first": min(largest, case.steps.first),
                "largest": largest,
                "extrapolate": as_the_study == bool(case.steps.extrapolate),
            }
        )
        meter = EnergyMeter(problem)
        states: list[np.ndarray] = []

        def record(step: LoadStep) -> None:
            meter.record(step)
            if step.newton.converged:
                states.append(stepper.newton.x.array.copy())

        stepper = LoadStepper(problem, steps, on_step=record)
        stepper.run()
    return LimbPath(
        socket=socket,
        material_set=material_set,
        largest=largest,
        as_the_study=as_the_study,
        steps=tuple(stepper.steps),
        solves=solves,
        energy=meter.balance(),
        probe=probe_at(problem, stepper.newton.x, states[-1] - states[-2]),
        end=End.of(stepper, case.limb),
    )


def largest_change(path: End, other: End) -> tuple[float, str]:
    """Largest relative change of a number of the summary from one end to another, and its name."""
    before, after = (end.summary["value"].abs().to_numpy() for end in (path, other))
    change = np.abs(after - before) / before
    row = path.summary.iloc[int(np.argmax(change))]
    return float(change.max()), f"{row.tissue} {row.quantity}"


def path_table(paths: Sequence[LimbPath], references: Mapping[str, LimbPath]) -> pd.DataFrame:
    """Sum paths up, each beside the reference of its case."""
    rows = []
    for path in paths:
        reference = references[path.name].end
        change, where = largest_change(reference, path.end)
        rows.append(
            {
                "case": path.name,
                "largest step": path.largest,
                "extrapolated": "yes" if path.extrapolated else "no",
                "steps": path.end.checks.steps,
                "Newton": path.end.checks.newton_iterations,
                "mean pressure, kPa": path.end.mean_pressure,
                "largest pressure, kPa": path.end.value("skin", "contact_pressure_max"),
                "points moved by, mm": path.end.moved_from(reference),
                "largest change, %": 100.0 * change,
                "of": where,
                "negative modes": path.end.checks.negative_modes,
            }
        )
    return pd.DataFrame(rows)


def energy_table(paths: Sequence[LimbPath]) -> pd.DataFrame:
    """Show where the work of the shrink fit went, as shares of it."""
    rows = []
    for path in paths:
        energy, work = path.energy, float(path.energy.work[-1])
        shares = {
            f"{name}, %": 100.0 * float(getattr(energy, name)[-1]) / work
            for name in ("limb", "socket", "friction", "lever", "penetration")
        }
        rows.append(
            {
                "case": path.name,
                "largest step": path.largest,
                "work, N mm per mm": work,
                **shares,
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
                "case": path.name,
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
    changed = (last.changes > 0) | last.cut
    ends = np.array([last.before.min(), last.before.max()])
    most = last.factor.max(initial=0.0)
    lines: list[Curve] = [
        (last.before[~changed], last.after[~changed], "o", "whole steps"),
        (last.before[changed], last.after[changed], "x", "contact changes, or cut"),
        (ends, most * ends**2, "k--", f"{most:.2g} |F|^2"),
        (ends, [TOLERANCE] * 2, "-C7", "tolerance"),
    ]
    return curves(
        "limb_newton",
        "The last two Newton iterations of every step of all paths.",
        ("|F| before the iteration, N/mm", "|F| after it, N/mm"),
        lines,
        ylim=(last.after.min() / 3.0, 3.0 * last.after.max()),
        **LOG,
    )


def energy_figure(paths: Sequence[LimbPath]) -> Figure:
    """Plot what the energy balance leaves over the load step."""
    lines: list[Curve] = []
    for k, name in enumerate(dict.fromkeys(path.name for path in paths)):
        followed = [path for path in paths if path.name == name and path.as_the_study]
        steps = [float(np.diff(path.energy.load).max()) for path in followed]
        left = [100.0 * abs(path.energy.full_error) for path in followed]
        style = "s--" if followed[0].material_set == "combined" else "o-"
        lines.append((steps, left, f"{style}C{k // 2}", name))
    ends = np.array([min(steps), max(steps)])
    return curves(
        "limb_energy",
        "Work of the shrink fit less all energies, with lever and penetration, by load step.",
        ("largest load step", "unaccounted, % of the work"),
        [*lines, (ends, ends**2, "k:", "slope 2")],
        **LOG,
    )
