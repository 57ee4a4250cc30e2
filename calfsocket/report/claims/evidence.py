"""What claims are checked against: the inputs of the study, its runs, and the paper's numbers."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import pandas as pd

from calfsocket.meshes.curves import ClosedCurve
from calfsocket.meshes.limb import Limb, limb_curves
from calfsocket.meshes.socket import AnySocket, Sockets
from calfsocket.report import comparison
from calfsocket.report.changes import relative_changes
from calfsocket.report.damage import Thresholds, damage
from calfsocket.report.names import SETS, SOCKETS
from calfsocket.report.results import MATERIAL_SETS, Results, SolvedCase

SOFT_TISSUES = ("skin", "fat", "muscle", "fascia", "vessel")
STRESSES = ("effective_stress", "shear_stress")
STRAINS = ("amp_log_strain", "shear_log_strain")


class NotChecked(Exception):
    """A claim cannot be checked; the text says what is missing."""


@dataclass(frozen=True)
class Evidence:
    """A study's inputs and results, and what is computed from them for more than one claim."""

    results: Results
    thresholds: Thresholds = field(default_factory=Thresholds)

    @property
    def settings(self) -> dict[str, Any]:
        """Settings of the study."""
        return self.results.run["inputs"]["settings"]

    @property
    def laws(self) -> dict[str, dict[str, dict[str, Any]]]:
        """Material set -> tissue -> law and parameters (MPa)."""
        return self.results.run["laws"]

    @cached_property
    def limb(self) -> Limb:
        """The limb as meshed."""
        return Limb.model_validate(self.results.run["limb"])

    @cached_property
    def sockets(self) -> dict[str, AnySocket]:
        """The paper's sockets as meshed, all of the file."""
        every = Sockets(sockets=self.results.run["sockets"]).sockets
        return {name: socket for name, socket in every.items() if name in SOCKETS}

    @cached_property
    def skin(self) -> ClosedCurve:
        """Undeformed outline of the limb."""
        return limb_curves(self.limb)[self.limb.contact_boundary]

    @cached_property
    def inner_faces(self) -> dict[str, ClosedCurve]:
        """Undeformed inner face of each socket."""
        return {name: socket.faces(self.skin)[0] for name, socket in self.sockets.items()}

    @cached_property
    def changes(self) -> pd.DataFrame:
        """`changes.relative_changes` of the study."""
        return relative_changes(self.results)

    @cached_property
    def maxima(self) -> pd.DataFrame:
        """`comparison.maxima` of the study."""
        return comparison.maxima(self.results)

    @cached_property
    def compared_changes(self) -> pd.DataFrame:
        """`comparison.changes` of the study."""
        return comparison.changes(self.results, self.changes)

    @cached_property
    def damage(self) -> pd.DataFrame:
        """`damage.damage` of the study."""
        return damage(self.results, self.thresholds)

    def any_case(self) -> SolvedCase:
        """Give the first case solved: for what is the same in all."""
        return self.results.case(*self.results.cases[0])

    def need(self, socket: str, material_set: str) -> None:
        """Refuse the check when a case is missing."""
        if (socket, material_set) not in self.results.cases:
            raise NotChecked(f"needs {socket} {SETS[material_set]}, which is not solved here")

    def need_all(self) -> None:
        """Refuse the check when one of the paper's six cases is missing."""
        for socket in SOCKETS:
            for name in MATERIAL_SETS:
                self.need(socket, name)

    def need_sets(self) -> tuple[str, ...]:
        """Return the sockets with both sets; refuse the check when there is none."""
        complete = tuple(filter(self.results.complete, self.results.sockets))
        if not complete:
            raise NotChecked("needs both material sets of a socket")
        return complete

    def value(self, socket: str, material_set: str, tissue: str, outcome: str) -> float:
        """Value of the summary; refuse the check when the case is missing."""
        self.need(socket, material_set)
        return self.results.value(socket, material_set, tissue, outcome)

    def row(self, socket: str, material_set: str, tissue: str, outcome: str) -> pd.Series:
        """Row of the summary; refuse the check when the case is missing."""
        self.need(socket, material_set)
        rows = self.results.summary
        return rows[
            (rows.socket == socket)
            & (rows.material_set == material_set)
            & (rows.tissue == tissue)
            & (rows.outcome == outcome)
        ].iloc[0]
