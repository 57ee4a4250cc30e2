"""What the paper adds to the report of a study that holds its cases."""

import logging

import pandas as pd

from calfsocket.io.errors import InputError
from calfsocket.paper import calibration, choices, scoreboard
from calfsocket.paper.calibration import NoCalibration
from calfsocket.paper.evidence import CASES, Evidence
from calfsocket.paper.figures import figures
from calfsocket.paper.published import PARTS, pressure
from calfsocket.paper.tables import tables
from calfsocket.report.answer import MERGING, TRUST
from calfsocket.report.chapters import Chapter, Content, Guest, Line, Note
from calfsocket.report.findings import Findings
from calfsocket.report.table import change, listed, number
from calfsocket.report.templates import render

log = logging.getLogger(__name__)

NUMBERS = {
    "regions": "1",
    "overlays": "2",
    "effective_stress": "4",
    "shear_strain": "7",
    "contact_pressure": "9",
}
CAPTIONS = {
    "effective_stress": "The scale is that of the paper's figure 4.",
    "shear_strain": "The limits are those of the paper's figure 7.",
}
MARKS = {scoreboard.HOLDS: "✓", scoreboard.FAILS: "✗", scoreboard.UNCHECKED: "?"}


def guest(findings: Findings) -> Guest | None:
    """Return what the paper adds; None where a study holds none of its cases.

    Single results that were saved without a study do not say what they were made of, so that they
    are none of them.
    """
    keys = [key for key in findings.results if key in CASES]
    if not keys or findings.study.run is None:
        return None
    evidence = Evidence(findings.results.only(keys), findings.thresholds)
    board = scoreboard.scoreboard(evidence)
    drawn, warnings = _calibration(evidence)
    known: dict[str, Content] = {**tables(evidence), **figures(evidence)}

    def content(*names: str) -> tuple[Content, ...]:
        return tuple(known[name] for name in names if name in known)

    chapters = (
        Chapter(
            "model",
            intro="In the Separate set every tissue has its own law; in the Combined set muscle "
            "and fascia share one.",
            content=(*content("table1"), *drawn),
        ),
        Chapter("stress", content=content("table2")),
        Chapter("strain", content=content("table4")),
        Chapter(
            "merging",
            "What merging fascia and muscle changes",
            "The Combined set against the Separate set, at each set's own maximum and at each "
            "other's sites.",
            content("5", "5b", "6", "table3", "8", "table5"),
            after="strain",
        ),
        Chapter("contact", content=content("pressure")),
        Chapter("agreement-with-paper", "Agreement with the paper", content=content("agreement")),
        Chapter(
            "choices",
            "What the paper leaves open",
            "None of these choices is made because it looks like the paper.",
            tuple(choices.tables(findings)),
        ),
        Chapter("scoreboard", "Scoreboard", content=(_scoreboard(board),)),
    )
    return Guest(
        title="What a prosthetic socket does inside a calf",
        chapters=chapters,
        lines=tuple(_lines(evidence, board)),
        warnings=tuple(warnings),
        note="The limb is a generic section, built from anatomical relations, and the sockets were "
        "shaped by hand: the order of the sockets is partly built in.",
        numbers=NUMBERS,
        captions=CAPTIONS,
        tables=(scoreboard.table(board),),
        replaces=("laws", "maxima") if len(keys) == len(findings.results) else (),
    )


def _calibration(evidence: Evidence) -> tuple[list[Content], list[str]]:
    """Return figure 3 and its table, or why they are missing; and a warning where it matters."""
    try:
        found = evidence.calibration
    except NoCalibration as error:
        return [Note(f"Figure 3 {error}.")], []
    except InputError as error:
        log.warning("the calibration is left out: %s", error)
        missing = f"The calibration, figure 3, is left out: {error}."
        return [Note(missing)], [missing]
    return [found.figure, calibration.table(found, evidence.laws["separate"])], []


def _scoreboard(board: pd.DataFrame) -> Content:
    parts = [PARTS.get(section[0], section) for section in board.section]
    return render(
        "scoreboard.html",
        "calfsocket.paper.templates",
        results=scoreboard.counts(board),
        apart=scoreboard.parts(board)[1:],
        marks=MARKS,
        parts=[
            (name, group.to_dict("records"))
            for name, group in board.groupby(pd.Series(parts, index=board.index), sort=False)
        ],
    )


def _lines(evidence: Evidence, board: pd.DataFrame) -> list[Line]:
    """Return what the paper says of the same, and how far results agree with it."""
    lines = []
    printed = pressure().set_index(["quantity", "socket"]).printed["contact_pressure_max"]
    if len(evidence.changes):
        rises = [change(printed[socket]) for socket in evidence.changes.socket.unique()]
        lines.append(Line(MERGING, f"The paper, the largest: by {listed(rises)} %."))
    counted = scoreboard.counts(board)
    text = f"Of the paper's {sum(counted.values())} claims on results {scoreboard.tally(counted)}"
    apart = len(board) - sum(counted.values())
    text += f"; {apart} more, on inputs and on its own numbers, are counted apart."
    ratio = evidence.maxima.ratio
    if ratio.notna().any():
        low, middle, high = (number(ratio.quantile(share)) for share in (0.25, 0.5, 0.75))
        text += (
            f" Stresses and strains are {middle} times the paper's in the median, "
            f"half of them {low} to {high} times."
        )
    return [*lines, Line(TRUST, text)]
