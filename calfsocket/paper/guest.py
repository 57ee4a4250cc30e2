"""What the paper adds to the report of a study that holds its cases."""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, get_args

import pandas as pd

from calfsocket.io.errors import InputError
from calfsocket.materials.laws import OgdenForm
from calfsocket.materials.material_set import BASE_SETS, MaterialSet
from calfsocket.materials.tissues import FASCIA_C10
from calfsocket.meshes.limb import Limb
from calfsocket.meshes.socket import reference_sockets
from calfsocket.paper import calibration, choices, scoreboard
from calfsocket.paper.calibration import Calibration, NoCalibration
from calfsocket.paper.comparison import quantile
from calfsocket.paper.evidence import CASES, Evidence
from calfsocket.paper.figures import figures
from calfsocket.paper.published import PARTS, pressure
from calfsocket.paper.tables import FLIP, tables
from calfsocket.report import method
from calfsocket.report.findings import Findings
from calfsocket.report.table import Table
from calfsocket.report.words import measured
from calfsocket.report.write import Draw, Guest
from calfsocket.simulation.results import Key, Results

log = logging.getLogger(__name__)

PACKAGE = "calfsocket.paper.templates"
NUMBERS = {
    "regions": "1",
    "overlays": "2",
    "calibration": "3",
    "effective_stress": "4",
    "changes_of_maxima": "5",
    "changes_of_magnitude": "5b",
    "stress_at_sites": "6",
    "shear_strain": "7",
    "strain_at_sites": "8",
    "contact_pressure": "9",
}
"""Of the paper's figures; 5b is ours."""

CHOICES = {"fascia_c10": "fascia's C10", "ogden_form": "Ogden form"}
"""Settings that the paper leaves open, and their words."""

MARKS = {scoreboard.HOLDS: "✓", scoreboard.FAILS: "✗", scoreboard.UNCHECKED: "?"}


def papers_cases(results: Results) -> list[Key]:
    """Return the cases of the paper's limb, sockets and material sets, by its names.

    The choices that the paper leaves open are free. Single results that were saved without a study
    do not say what they were made of, so that they are none of the paper's.
    """
    run = results.run
    if run is None or run.limb is None or _shape(run.limb) != _shape(Limb.reference()):
        return []
    if "layers" in run.settings:  # are not as thick as in the paper's limb
        return []
    reference = reference_sockets()
    own = [
        MaterialSet.paper(name, c10, form).tissue_laws()
        for name in BASE_SETS
        for c10 in FASCIA_C10
        for form in get_args(OgdenForm)
    ]
    return [
        (socket, name)
        for socket, name in results
        if (socket, name) in CASES
        and run.sockets.get(socket) == reference[socket]
        and run.laws.get(name) in own
    ]


def _shape(limb: Limb) -> tuple[Any, ...]:
    """Return what a limb is, without what its file says beside."""
    regions = [(region.name, region.tissue, region.loops) for region in limb.regions]
    # A limb with a mesh of its own has no curves of its regions.
    curves = {name: limb.curves.get(name) for *_, loops in regions for name in loops}
    return limb.axes, limb.layers, limb.fixed_boundary, regions, curves


def guest(findings: Findings) -> "PaperGuest | None":
    """Return what the paper adds; None where a study holds none of its cases."""
    keys = papers_cases(findings.results)
    return PaperGuest(findings, keys) if keys else None


@dataclass(frozen=True, eq=False)
class PaperGuest(Guest):
    """The paper's figures, tables and claims beside those of its cases that a study holds."""

    findings: Findings
    keys: Sequence[Key]
    package, template, numbers = PACKAGE, "paper.html", NUMBERS

    @cached_property
    def evidence(self) -> Evidence:
        """What its claims are checked against."""
        results = self.findings.results.only(self.keys)
        return Evidence(results, self.findings.thresholds, report=self.findings)

    @property
    def figures(self) -> Mapping[str, Draw]:
        """Those of changes."""
        return figures(self.evidence)

    @property
    def made(self) -> Mapping[str, tuple[Path, Path]]:
        """That of the calibration, where there is one."""
        found = self._calibration
        return {"calibration": found.figure} if isinstance(found, Calibration) else {}

    @cached_property
    def tables(self) -> Mapping[str, Table]:
        """The paper's tables, the scoreboard, and what variants change of it."""
        made = [*choices.tables(self.findings), *tables(self.evidence).values()]
        made.append(scoreboard.table(self._board))
        if isinstance(self._calibration, Calibration):
            laws = self.evidence.parameters.get("separate", {})
            made.append(calibration.table(self._calibration, laws))
        return {table.name: table for table in made}

    @property
    def warnings(self) -> tuple[str, ...]:
        """That the calibration cannot be read."""
        absent = isinstance(self._calibration, Calibration | NoCalibration)
        return () if absent else (self._missing,)

    @cached_property
    def values(self) -> Mapping[str, Any]:
        """What the sentences on the paper are about."""
        evidence, board, found = self.evidence, self._board, self._calibration
        counted = scoreboard.counts(board)
        printed = pressure().set_index(["quantity", "socket"]).printed["contact_pressure_max"]
        of_paper = choices.are_the_papers(self.findings)
        return {
            "settings": method.in_words(self.findings, {**method.FIRST, **CHOICES}),
            "whole": len(self.keys) == len(self.findings.results),
            "flip": FLIP,
            "papers_variants": of_paper,
            "rises": printed[evidence.changes.socket.unique()],
            "counted": counted,
            "tally": scoreboard.tally(counted),
            "parts": scoreboard.parts(board),
            "ratios": _quartiles(evidence.maxima),
            "board": board,
            "board_by_part": _by_part(board),
            "marks": MARKS,
            "choices_title": "What the paper leaves open"
            if of_paper
            else "What the variants change",
            "missing": self._missing,
            "calibrated": found.record.inputs if isinstance(found, Calibration) else None,
        }

    @cached_property
    def _board(self) -> pd.DataFrame:
        return scoreboard.scoreboard(self.evidence)

    @cached_property
    def _calibration(self) -> Calibration | InputError:
        """The calibration, or why there is none."""
        try:
            return self.evidence.calibration
        except NoCalibration as error:
            return error
        except InputError as error:
            log.warning("the calibration is left out: %s", error)
            return error

    @property
    def _missing(self) -> str:
        """Why there is no calibration, in words; empty where there is one."""
        match self._calibration:
            case NoCalibration() as why:
                return f"Figure 3 {why}."
            case InputError() as why:
                return f"The calibration, figure 3, is left out: {why}."
        return ""


def _quartiles(maxima: pd.DataFrame) -> list[str]:
    """Return the quartiles of ratios to the paper's numbers in words; none where there are none."""
    cells = maxima.dropna(subset="ratio")
    return [measured(*quantile(cells, share)) for share in (0.25, 0.5, 0.75) if len(cells)]


def _by_part(board: pd.DataFrame) -> list[tuple[str, list[dict[str, Any]]]]:
    """Return the claims of each part of the paper."""
    parts = pd.Series([PARTS.get(name[0], name) for name in board.section], index=board.index)
    return [(name, rows.to_dict("records")) for name, rows in board.groupby(parts, sort=False)]
