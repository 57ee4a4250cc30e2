"""The design of a study's uncertain inputs, read again: what was drawn, and how each case ended."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calfsocket.io.errors import InputError
from calfsocket.mechanics.loading import DONNED
from calfsocket.simulation.record import KEY, CaseRecord
from calfsocket.uncertainty.failures import pattern
from calfsocket.uncertainty.inputs import Array, Joint, Uncertainty

DESIGN_FILE = "design.csv"
EVALUATED = ("uncertainty.csv", "sobol.csv", "contact_pressure_band.csv")
"""Files of what is evaluated of it: all numbers, what each input explains, contact pressure."""

PURPOSE, FIT, CHECK = "purpose", "fit", "check"
"""Column that says what a case was drawn for, and its values."""

Key = tuple[str, str]
"""Socket and material set."""

Mask = NDArray[np.bool_]


def heading(name: str, unit: str) -> str:
    """Return the heading of an input's column."""
    return f"{name} [{unit}]" if unit else name


@dataclass(frozen=True, eq=False)
class Group:
    """Cases of a design that share socket and material set.

    Attributes
    ----------
    base : tuple of str
        These two, and the key of the case with the file's own values.
    joint : Joint
        Of the inputs that reach them.
    values : array
        Of these inputs, a row a case.
    records : tuple of CaseRecord
        Of the cases.
    own : CaseRecord, optional
        Of the case with the file's own values.
    state : str
        That which is looked at: the donned socket, or the end of a stage of loading.
    """

    base: Key
    joint: Joint
    values: Array
    records: tuple[CaseRecord, ...]
    own: CaseRecord | None = None
    state: str = DONNED

    def at(self, state: str) -> "Group":
        """Return the same cases in another state."""
        return replace(self, state=state)

    @property
    def states(self) -> tuple[str, ...]:
        """The donned socket and the ends of all stages of loading."""
        ends = (record.states for record in self.records if record.solved)
        return (DONNED, *dict.fromkeys(name for names in ends for name in names))

    @property
    def solved(self) -> Mask:
        """Whether each case reached its full load, and in the state looked at bore the stage's."""
        return np.array(
            [record.solved and self.state not in record.limited for record in self.records],
            dtype=bool,
        )

    @property
    def failed(self) -> Mask:
        """Whether each case did not; one that was not begun, or not ended, has not failed."""
        ended = [record.status == "failed" or record.solved for record in self.records]
        return np.array(ended, dtype=bool) & ~self.solved

    @property
    def failures(self) -> str:
        """Whether cases failed by chance, in words; empty where none failed."""
        ended = self.solved | self.failed
        failed = self.failed[ended]
        if not failed.any():
            return ""
        names = self.joint.names
        found = pattern(names, self.values[ended], failed)
        if found.inputs:
            where = ", ".join(f"{size} {name}" for name, size in found.inputs.items())
            return f"not random: more often with {where}"
        return "random as far as they tell" if found.tells else "too few to tell whether random"


@dataclass(frozen=True, eq=False)
class Design:
    """A study's uncertain inputs, and the cases that were drawn, by socket and material set.

    Attributes
    ----------
    inputs : Uncertainty
    groups : tuple of Group
        Cases of the design.
    checks : mapping
        Base of a group -> the cases that check it; empty where the study has none.
    """

    inputs: Uncertainty
    groups: tuple[Group, ...]
    checks: Mapping[Key, Group]


def read_design(folder: Path, content: Mapping[str, Any], records: Iterable[CaseRecord]) -> Design:
    """Read the design of a study.

    Raises
    ------
    InputError
        When design.csv is missing or is not that of the study.
    """
    import pandas as pd

    path = folder / DESIGN_FILE
    inputs = Uncertainty.model_validate(content)
    names = [heading(name, of.unit) for name, of in inputs.inputs.items()]
    again = "run the study again with --resume"
    try:
        table = pd.read_csv(path, dtype=dict.fromkeys(KEY, str)).set_index("case")
        if PURPOSE not in table:  # of a version that did not know cases that check
            table[PURPOSE] = FIT
        table = table[[PURPOSE, *names]]
    except (OSError, ValueError, KeyError) as error:
        raise InputError(f"{path}: cannot be read ({error}); {again}") from None
    records = list(records)
    own = {record.key: record for record in records if not record.changes}
    drawn: dict[str, dict[Key, list[CaseRecord]]] = {FIT: {}, CHECK: {}}
    for record in records:
        if record.name in table.index:
            of_base = drawn[CHECK if table[PURPOSE][record.name] == CHECK else FIT]
            of_base.setdefault(record.base, []).append(record)

    def group(base: Key, cases: list[CaseRecord]) -> Group:
        rows = table.loc[[record.name for record in cases], names]
        kept = rows.notna().all().to_numpy()
        pairs = [
            (of, rows[name])
            for (name, of, keep) in zip(names, inputs.inputs.values(), kept, strict=True)
            if keep
        ]
        values = np.column_stack(
            [column.map(of.value) if of.discrete else column.astype(float) for of, column in pairs]
        )
        return Group(base, inputs.joint.only(kept), values, tuple(cases), own.get(base))

    groups = tuple(group(base, cases) for base, cases in drawn[FIT].items())
    checks = {base: group(base, cases) for base, cases in drawn[CHECK].items()}
    return Design(inputs, groups, checks)
