"""What a report says of stages of loading."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd

from calfsocket.postprocess.levels import NEARLY_ALL, levels_of
from calfsocket.postprocess.mesh_error import MESH_ERROR, error_of
from calfsocket.postprocess.quantities import CONTACT_UNITS, Maximum, summary_table
from calfsocket.report import names
from calfsocket.report.words import measured, measured_all
from calfsocket.simulation.result import Result
from calfsocket.simulation.results import Results

OF_SKIN = "skin", "effective_stress"
"""What the worst state is judged by."""


@dataclass(frozen=True)
class Stage:
    """A stage of a case, in words and numbers."""

    name: str
    limit: str  #: which force could not be borne; empty where all was
    pressure: str  #: mean and largest contact pressure at its end
    slipping: str  #: largest share of the contact that slips on its way, %
    dissipated: str  #: work of friction in it, N mm for each mm of limb
    skin_kPa: float  #: effective stress that 99.9 % of the skin stays below at its end
    largest_kPa: float  #: largest contact pressure at its end
    skin: str  #: the same with its mesh error
    largest: str  #: the same with its mesh error


@dataclass(frozen=True)
class Case:
    """A case with its stages; `figure` is the name of its curves."""

    name: str
    figure: str
    stages: tuple[Stage, ...]

    @property
    def donned(self) -> Stage:
        """The state before its loads."""
        return self.stages[0]

    @property
    def worst_of_skin(self) -> Stage:
        """The state with the largest effective stress of the skin."""
        return max(self.stages, key=lambda stage: stage.skin_kPa)

    @property
    def worst_of_pressure(self) -> Stage:
        """The state with the largest contact pressure."""
        return max(self.stages, key=lambda stage: stage.largest_kPa)

    @property
    def limits(self) -> tuple[Stage, ...]:
        """The stages whose forces could not be borne."""
        return tuple(stage for stage in self.stages if stage.limit)


@dataclass(frozen=True)
class Loads:
    """The stages of loading of a study."""

    results: Results

    @cached_property
    def cases(self) -> tuple[Case, ...]:
        """Cases with stages."""
        return tuple(
            Case(
                " ".join((key[0], names.material_set(key[1]))),
                f"loading_{place}",
                stages_of(result),
            )
            for place, (key, result) in enumerate(self.results.items())
            if result.states
        )

    @property
    def worst(self) -> Case | None:
        """The case whose skin has the largest effective stress, in any of its states."""
        if not self.cases:
            return None
        return max(self.cases, key=lambda case: case.worst_of_skin.skin_kPa)

    @property
    def limited(self) -> tuple[Case, ...]:
        """Cases with a force that could not be borne."""
        return tuple(case for case in self.cases if case.limits)


def stages_of(result: Result) -> tuple[Stage, ...]:
    """Return the donned state and the stages of a case."""
    states: Mapping[str, Result] = {"donned": result, **result.states}
    curve = result.curve
    assert curve is not None
    found = []
    for name, state in states.items():
        summary = state.with_mesh_error(lambda of: summary_table(_of_contact(of)))
        mean, largest = measured_all(summary.value, summary, MESH_ERROR)
        levels = state.levels_with_error(lambda of: levels_of(of.quantities, [OF_SKIN]))
        slipping, work = _on_way(result, name)
        (skin,) = measured_all(levels[NEARLY_ALL], levels, error_of(NEARLY_ALL))
        found.append(
            Stage(
                name,
                state.record.state.limit if state.record.state else "",
                f"{mean} kPa on average, {largest} kPa at most",
                slipping,
                work,
                float(levels[NEARLY_ALL].iloc[0]),
                float(summary.value.iloc[1]),
                skin,
                largest,
            )
        )
    return tuple(found)


def _of_contact(state: Result) -> Iterator[tuple[str, str, str, Maximum]]:
    """Return mean and largest contact pressure as rows of a summary."""
    for name in ("contact_pressure_mean", "contact_pressure_max"):
        yield "skin", name, CONTACT_UNITS[name], state.contact_levels[name]


def _on_way(result: Result, stage: str) -> Iterator[str]:
    """Return the largest slip, %, and the work of friction in a stage, with their mesh errors."""
    curves = [result.curve, result.second.curve if result.second else None]
    mine, second = (
        _slip_and_work(curve[curve.stage == stage], curve)
        if curve is not None and (curve.stage == stage).any()
        else (np.nan, np.nan)
        for curve in curves
    )
    return (
        measured(value, result.times_change * abs(value - other))
        for value, other in zip(mine, second, strict=True)
    )


def _slip_and_work(part: pd.DataFrame, curve: pd.DataFrame) -> tuple[float, float]:
    before = curve.dissipated_N_mm_per_mm.shift(fill_value=0.0)[part.index]
    work = (part.dissipated_N_mm_per_mm - before).sum()
    return float(part.slipping_percent.max()), float(work)
