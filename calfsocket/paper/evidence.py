"""What claims are checked against: the inputs of the study, its runs, and the paper's numbers."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import pandas as pd

from calfsocket.io.errors import InputError
from calfsocket.meshes.curves import ClosedCurve
from calfsocket.meshes.limb import Limb
from calfsocket.meshes.socket import AnySocket, reference_sockets
from calfsocket.paper import comparison
from calfsocket.paper.calibration import Calibration, read_calibration
from calfsocket.report import inputs
from calfsocket.report.changes import complete_sockets
from calfsocket.report.findings import Findings
from calfsocket.report.names import SETS, material_set
from calfsocket.simulation.record import StudyRecord
from calfsocket.simulation.result import Result

SOCKETS = ("TC", "TSB", "HS")
CASES = tuple((socket, name) for socket in SOCKETS for name in SETS)
"""The paper's six cases."""

STRESSES = ("effective_stress", "shear_stress")
STRAINS = ("amp_log_strain", "shear_log_strain")


def run_name(key: tuple[str, str]) -> str:
    """Return the name of a run as people read it."""
    return f"{key[0]} {material_set(key[1])}"


class NotChecked(Exception):
    """A claim cannot be checked; the text says what is missing."""


class _OfSets(dict[str, Any]):
    """Something of each material set; a claim on a set that a study lacks cannot be checked."""

    def __missing__(self, name: str) -> Any:
        raise NotChecked(f"needs the {material_set(name)} set, which is not in this study")


@dataclass(frozen=True, eq=False)
class Evidence(Findings):
    """Findings of the paper's cases alone, and what is computed for more than one claim."""

    report: Findings | None = None
    """Those of a report whose results these are among: what it has computed is taken from it."""

    @cached_property
    def changes(self) -> pd.DataFrame:
        """Relative changes from the Separate to the Combined set."""
        if self.report is None:
            return super().changes
        rows = self.report.changes
        mine = rows.socket.isin(complete_sockets(self.results))
        return rows[mine & rows.tissue.isin(self.soft_tissues)].reset_index(drop=True)

    @cached_property
    def damage(self) -> pd.DataFrame:
        """Strains against the damage thresholds."""
        if self.report is None:
            return super().damage
        rows = self.report.damage
        mine = [key in self.results for key in zip(rows.socket, rows.material_set, strict=True)]
        return rows[mine].reset_index(drop=True)

    @cached_property
    def settings(self) -> dict[str, Any]:
        """Settings of the study, by their last name."""
        return inputs.settings(self.results)

    @cached_property
    def parameters(self) -> comparison.Laws:
        """Material set -> tissue -> kind of law and parameters, MPa."""
        return _OfSets(
            (name, {tissue: law.model_dump(mode="json") for tissue, law in laws.items()})
            for name, laws in inputs.laws(self.results).items()
        )

    @property
    def run(self) -> StudyRecord:
        """Inputs and versions of the study."""
        assert self.results.run is not None
        return self.results.run

    @property
    def limb(self) -> Limb:
        """The paper's limb."""
        assert self.run.limb is not None  # one of many levels is none of the paper's
        return self.run.limb

    @cached_property
    def sockets(self) -> dict[str, AnySocket]:
        """The paper's sockets as meshed."""
        every = reference_sockets() | self.run.sockets
        return {name: every[name] for name in SOCKETS}

    @cached_property
    def skin(self) -> ClosedCurve:
        """Undeformed outline of the limb."""
        return self.limb.skin

    @cached_property
    def inner_faces(self) -> dict[str, ClosedCurve]:
        """Undeformed inner face of each socket."""
        return {name: socket.faces(self.limb)[0] for name, socket in self.sockets.items()}

    @cached_property
    def area_lost(self) -> dict[str, float]:
        """By how much each socket encloses less area than the limb, %."""
        area = self.skin.area
        return {name: 100 * (1 - face.area / area) for name, face in self.inner_faces.items()}

    @cached_property
    def materials(self) -> pd.DataFrame:
        """`comparison.materials` of the study."""
        return comparison.materials(self.parameters)

    @cached_property
    def maxima(self) -> pd.DataFrame:
        """`comparison.maxima` of the study."""
        return comparison.maxima(self)

    @cached_property
    def compared_changes(self) -> pd.DataFrame:
        """`comparison.changes` of the study."""
        return comparison.changes(self)

    @cached_property
    def calibration(self) -> Calibration:
        """The calibration in the study's folder (see `read_calibration`)."""
        return read_calibration(self.results.folder)

    def checked_calibration(self) -> Calibration:
        """Return the calibration; refuse the check without one."""
        try:
            return self.calibration
        except InputError as reason:
            raise NotChecked(str(reason)) from None

    def any_case(self) -> Result:
        """Return the first case solved: for what is the same in all."""
        return next(iter(self.results.values()))

    def need(self, keys: Iterable[tuple[str, str]] = CASES) -> None:
        """Refuse the check when one of some cases is missing."""
        for socket, name in keys:
            if (socket, name) not in self.results:
                raise NotChecked(f"needs {run_name((socket, name))}, which is not solved here")

    def need_sets(self) -> tuple[str, ...]:
        """Return the sockets with both sets; refuse the check when there is none."""
        complete = complete_sockets(self.results)
        if not complete:
            raise NotChecked("needs both material sets of a socket")
        return complete

    def value(self, socket: str, material_set: str, tissue: str, quantity: str) -> float:
        """Value of the summary; refuse the check when the case is missing."""
        self.need([(socket, material_set)])
        return self.results.value(socket, material_set, tissue, quantity)

    def row(self, socket: str, material_set: str, tissue: str, quantity: str) -> Any:
        """Row of the summary; refuse the check when the case is missing."""
        self.need([(socket, material_set)])
        return self._rows[socket, material_set, tissue, quantity]

    @cached_property
    def _rows(self) -> dict[tuple[str, ...], Any]:
        rows = self.results.summary.itertuples()
        return {(row.socket, row.material_set, row.tissue, row.quantity): row for row in rows}
