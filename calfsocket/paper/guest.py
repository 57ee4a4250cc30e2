"""What the paper adds to the report of a study that holds its cases."""

import logging
from typing import Any, get_args

import pandas as pd

from calfsocket.io.errors import InputError
from calfsocket.materials.laws import OgdenForm
from calfsocket.materials.material_set import BASE_SETS, MaterialSet
from calfsocket.materials.tissues import FASCIA_C10
from calfsocket.meshes.limb import Limb
from calfsocket.meshes.socket import reference_sockets
from calfsocket.paper import calibration, choices, scoreboard
from calfsocket.paper.calibration import NoCalibration
from calfsocket.paper.evidence import CASES, Evidence
from calfsocket.paper.figures import figures
from calfsocket.paper.published import PARTS, pressure
from calfsocket.paper.tables import FLIP, tables
from calfsocket.report import method
from calfsocket.report.findings import Findings
from calfsocket.report.write import Guest
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
    curves = {name: limb.curves[name] for *_, loops in regions for name in loops}
    return limb.axes, limb.layers, limb.fixed_boundary, regions, curves


def guest(findings: Findings) -> Guest | None:
    """Return what the paper adds; None where a study holds none of its cases."""
    keys = papers_cases(findings.results)
    if not keys:
        return None
    evidence = Evidence(findings.results.only(keys), findings.thresholds)
    board = scoreboard.scoreboard(evidence)
    shown = {table.name: table for table in choices.tables(findings)}
    shown |= {**tables(evidence), "scoreboard": scoreboard.table(board)}
    drawn: dict[str, Any] = figures(evidence)
    counted = scoreboard.counts(board)
    printed = pressure().set_index(["quantity", "socket"]).printed["contact_pressure_max"]
    of_paper = choices.are_the_papers(findings)
    values = {
        "settings": method.in_words(findings, {**method.FIRST, **CHOICES}),
        "whole": len(keys) == len(findings.results),
        "flip": FLIP,
        "papers_variants": of_paper,
        "rises": printed[evidence.changes.socket.unique()],
        "counted": counted,
        "tally": scoreboard.tally(counted),
        "parts": scoreboard.parts(board),
        "ratio": evidence.maxima.ratio.dropna(),
        "board": board,
        "board_by_part": _by_part(board),
        "marks": MARKS,
        "choices_title": "What the paper leaves open" if of_paper else "What the variants change",
        "missing": "",
        "calibrated": None,
    }
    warnings: tuple[str, ...] = ()
    try:
        found = evidence.calibration
    except NoCalibration as error:
        values["missing"] = f"Figure 3 {error}."
    except InputError as error:
        log.warning("the calibration is left out: %s", error)
        values["missing"] = f"The calibration, figure 3, is left out: {error}."
        warnings = (values["missing"],)
    else:
        values["calibrated"] = found.record.inputs
        drawn["calibration"] = found.figure
        shown["calibration"] = calibration.table(found, evidence.parameters.get("separate", {}))
    return Guest(PACKAGE, "paper.html", shown, drawn, NUMBERS, warnings, values)


def _by_part(board: pd.DataFrame) -> list[tuple[str, list[dict[str, Any]]]]:
    """Return the claims of each part of the paper."""
    parts = pd.Series([PARTS.get(name[0], name) for name in board.section], index=board.index)
    return [(name, rows.to_dict("records")) for name, rows in board.groupby(parts, sort=False)]
