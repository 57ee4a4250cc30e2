"""A run of the limb followed step by step: Newton's iterations, energies, and the end state."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import pandas as pd

from calfsocket.materials.material_set import BaseSet
from calfsocket.mechanics.limb_problem import limb_problem
from calfsocket.mechanics.stepping import LoadStep, LoadStepper
from calfsocket.simulation.result import Result
from calfsocket.verification.energy import EnergyMeter, energy_error, share, trapezoid_error
from calfsocket.verification.limb_runs import largest_distance, mean_pressure, one_case, value
from calfsocket.verification.newton import (
    TOLERANCE,
    Solve,
    largest_factor,
    last_contraction,
    last_iterations,
    probe_at,
    recording,
)
from calfsocket.verification.report import LOG, Curve, Draw, curves, order

STARTS: dict[bool | str, str] = {
    True: "extrapolation",
    False: "no extrapolation",
    "smooth": "extrapolation where the path is smooth",
}
"""What `LoadSteps.extrapolate` means, in words."""

IN_SHORT: dict[bool | str, str] = {True: "yes", False: "no", "smooth": "where smooth"}
"""The same, in a table."""


@dataclass(frozen=True)
class LimbPath:
    """A case followed from load 0 to 1."""

    largest: float  #: largest load step allowed
    as_the_study: bool  #: whether steps were extrapolated where the study does so, and only there
    extrapolated: Literal["smooth"] | bool  #: as of `LoadSteps.extrapolate`
    steps: tuple[LoadStep, ...]  #: failed ones too
    solves: list[Solve]  #: Newton's iterates of each step
    energy: pd.DataFrame  #: work of the shrink fit and where it went, by load step
    newton_order: float  #: of Newton's method at the end, along the last step
    end: Result  #: the equilibrium at full load

    @property
    def name(self) -> str:
        """Name of the case."""
        return self.end.record.name


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
        extrapolated = case.steps.extrapolate or False
        if not as_the_study:
            extrapolated = extrapolated is not True
        first = min(largest, case.steps.first)
        steps = case.steps.model_copy(
            update={"first": first, "largest": largest, "extrapolate": extrapolated}
        )
        meter = EnergyMeter(problem)
        states: list[np.ndarray] = []

        def record(step: LoadStep) -> None:
            meter.record(step)
            if step.newton.converged:
                states.append(stepper.newton.x.array.copy())

        stepper = LoadStepper(problem, steps, on_step=record)
        stepper.run()
    probe = probe_at(problem, stepper.newton.x, states[-1] - states[-2])
    return LimbPath(
        largest,
        as_the_study,
        extrapolated,
        steps=tuple(stepper.steps),
        solves=solves,
        energy=meter.balance,
        newton_order=order(probe.before, probe.after),
        end=case.result(stepper),
    )


def largest_change(end: Result, other: Result) -> tuple[float, str]:
    """Largest relative change of a number of the summary from one end to another, and its name."""
    rows = end.summary()
    before, after = rows["value"].abs(), other.summary()["value"].abs()
    change = (after - before).abs() / before
    row = rows.loc[change.idxmax()]
    return float(change.max()), f"{row.tissue} {row.quantity}"


def path_table(paths: Sequence[LimbPath], references: Mapping[str, LimbPath]) -> pd.DataFrame:
    """Sum paths up, each beside the reference of its case."""
    rows = []
    for path in paths:
        end, reference = path.end, references[path.name].end
        change, where = largest_change(reference, end)
        rows.append(
            {
                "case": path.name,
                "largest step": path.largest,
                "extrapolated": IN_SHORT[path.extrapolated],
                "steps": end.checks.steps,
                "Newton": end.checks.newton_iterations,
                "mean pressure, kPa": mean_pressure(end),
                "largest pressure, kPa": value(end, "skin", "contact_pressure_max"),
                "points moved by, mm": largest_distance(end, reference),
                "largest change, %": 100.0 * change,
                "of": where,
                "negative modes": end.checks.negative_modes,
            }
        )
    return pd.DataFrame(rows)


def energy_table(paths: Sequence[LimbPath]) -> pd.DataFrame:
    """Show where the work of the shrink fit went, as shares of it."""
    parts = ("limb", "socket", "friction", "lever", "penetration")
    return pd.DataFrame(
        {
            "case": path.name,
            "largest step": path.largest,
            "work, N mm per mm": path.energy.work.iloc[-1],
            **{f"{part}, %": 100.0 * share(path.energy, part) for part in parts},
            "work less limb, socket, friction, %": 100.0 * energy_error(path.energy),
            "less lever, penetration, too, %": 100.0 * trapezoid_error(path.energy),
        }
        for path in paths
    )


def newton_table(paths: Sequence[LimbPath]) -> pd.DataFrame:
    """Judge the last two iterations of every step of each path."""
    rows = []
    for path in paths:
        last = last_iterations(path.solves)
        kinks = last[(last.changes > 0) | last.cut]
        rows.append(
            {
                "case": path.name,
                "iterations": len(last),
                "contact changes": np.count_nonzero(last.changes),
                "cut": last.cut.sum(),
                "at loads": ", ".join(f"{path.steps[k].load:.3g}" for k in kinks.solve.unique()),
                "smooth": last.smooth.sum(),
                "largest C, mm/N": largest_factor(last),
                "last: worst |F| after / before": last_contraction(last),
                "order at the end": path.newton_order,
            }
        )
    return pd.DataFrame(rows)


def newton_figure(paths: Sequence[LimbPath]) -> Draw:
    """Plot |F| after over |F| before of the last two iterations of every step."""
    last = last_iterations([solve for path in paths for solve in path.solves])
    changed = (last.changes > 0) | last.cut
    smooth, kinks = last[~changed], last[changed]
    ends = np.array([last.before.min(), last.before.max()])
    most = largest_factor(last)
    lines: list[Curve] = [
        (smooth.before, smooth.after, "o", "whole steps"),
        (kinks.before, kinks.after, "x", "contact changes, or cut"),
        (ends, most * ends**2, "k--", f"{most:.2g} |F|^2"),
        (ends, [TOLERANCE] * 2, "-C7", "tolerance"),
    ]
    return curves(
        ("|F| before the iteration, N/mm", "|F| after it, N/mm"),
        lines,
        ylim=(last.after.min() / 3.0, 3.0 * last.after.max()),
        **LOG,
    )


def energy_figure(paths: Sequence[LimbPath]) -> Draw:
    """Plot what the energy balance leaves over the load step."""
    lines: list[Curve] = []
    for k, name in enumerate(dict.fromkeys(path.name for path in paths)):
        followed = [path for path in paths if path.name == name and path.as_the_study]
        steps = [float(np.diff(path.energy.load).max()) for path in followed]
        left = [100.0 * abs(trapezoid_error(path.energy)) for path in followed]
        style = "s--" if name.endswith("combined") else "o-"
        lines.append((steps, left, f"{style}C{k // 2}", name))
    ends = np.array([min(steps), max(steps)])
    lines.append((ends, ends**2, "k:", "slope 2"))
    return curves(("largest load step", "unaccounted, % of the work"), lines, **LOG)
