"""What a report says of stages of loading."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from calfsocket.postprocess.levels import NEARLY_ALL, statistics_of
from calfsocket.report.words import number
from calfsocket.simulation.result import Result
from calfsocket.simulation.results import Results


@dataclass(frozen=True)
class Stage:
    """A stage of a case, in words and numbers."""

    name: str
    limit: str  #: which force could not be borne; empty where all was
    pressure: str  #: mean and largest contact pressure at its end, kPa
    slipping: str  #: largest share of the contact that slips on its way, %
    dissipated: str  #: work of friction in it, N mm for each mm of limb
    skin_kPa: float  #: effective stress that 99.9 % of the skin stays below at its end
    largest_kPa: float  #: largest contact pressure at its end


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
            Case(" ".join(key), f"loading_{place}", stages_of(result))
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
        summary = state.summary().set_index(["tissue", "quantity"])["value"]
        part = curve[curve.stage == name]
        before = curve.dissipated_N_mm_per_mm.shift(fill_value=0.0)[part.index]
        work = (part.dissipated_N_mm_per_mm - before).sum()
        mean, most = (summary["skin", f"contact_pressure_{kind}"] for kind in ("mean", "max"))
        found.append(
            Stage(
                name,
                state.record.state.limit if state.record.state else "",
                f"{number(mean)} on average, {number(most)} at most",
                number(float(part.slipping_percent.max())),
                number(float(work)),
                statistics_of(state.quantities, "skin", "effective_stress")[NEARLY_ALL],
                float(most),
            )
        )
    return tuple(found)
