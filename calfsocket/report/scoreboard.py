"""The scoreboard: every checkable claim of the paper with a verdict, computed from a study.

A claim holds, does not hold, or cannot be checked with what was solved; never is a verdict written
by hand, and all tolerances are in `claims.tolerances`.
"""

import pandas as pd

from calfsocket.report import published
from calfsocket.report.claims.evidence import Evidence, NotChecked
from calfsocket.report.claims.registry import CHECKS
from calfsocket.report.damage import Thresholds
from calfsocket.report.results import Results
from calfsocket.report.table import Table

HOLDS, FAILS, UNCHECKED = "holds", "does not hold", "cannot be checked"
VERDICTS = (HOLDS, FAILS, UNCHECKED)
PLURAL = {HOLDS: "hold", FAILS: "do not hold", UNCHECKED: "cannot be checked"}
"""What claims of a verdict do."""


def scoreboard(results: Results, thresholds: Thresholds | None = None) -> pd.DataFrame:
    """Check every claim.

    Parameters
    ----------
    results : Results
        Of a study; only the paper's cases count; claims that need others of them
        cannot be checked, and a study of none has no row.
    thresholds : Thresholds, optional
        Damage thresholds, the paper's by default.

    Returns
    -------
    DataFrame
        One row a claim, in the order of the text: id, section, line, kind, claim, verdict, ours,
        paper (numbers in words), why (one line, where it does not hold or cannot be checked),
        own_tables (whether the paper's own tables agree with its text) and note (on that).
    """
    board = published.claims().copy()
    paper = results.of_paper
    if paper is None:
        board = board.iloc[:0]
    evidence = Evidence(paper or results, thresholds or Thresholds())
    found = [_check(identifier, evidence) for identifier in board.id]
    place = list(board.columns).index("own_tables")
    for offset, column in enumerate(("verdict", "ours", "paper", "why")):
        board.insert(place + offset, column, [row[offset] for row in found])
    return board


def counts(board: pd.DataFrame) -> dict[str, int]:
    """Give the number of claims of each verdict."""
    return {verdict: int((board.verdict == verdict).sum()) for verdict in VERDICTS}


def table(board: pd.DataFrame) -> Table:
    """Give the scoreboard as a table of the report."""
    contradicted = board.own_tables.str.startswith("NO")
    paper = board.paper.where(~contradicted, board.paper + " (its own tables disagree)")
    shown = board.assign(paper=paper).set_index("id")
    shown = shown[["claim", "verdict", "ours", "paper", "why"]]
    tally = ", ".join(f"{n} {PLURAL[verdict]}" for verdict, n in counts(board).items())
    return Table(
        "scoreboard",
        "Scoreboard",
        f"Of {len(board)} claims of the paper: {tally}. Computed from this study's inputs and "
        "results; what counts as agreement is the same for all claims of a kind.",
        board,
        shown,
    )


def _check(identifier: str, evidence: Evidence) -> tuple[str, str, str, str]:
    try:
        finding = CHECKS[identifier](evidence)
    except NotChecked as reason:
        return UNCHECKED, "", "", str(reason)
    verdict = HOLDS if finding.holds else FAILS
    why = "" if finding.holds else finding.why or "ours differs from the paper's"
    return verdict, finding.ours, finding.paper, why
