"""The scoreboard: every checkable claim of the paper with a verdict, computed from a study.

A claim holds, does not hold, or cannot be checked with what was solved; never is a verdict written
by hand. Claims on results are counted apart from those that only restate an input of the study, and
from those that compare the paper with itself: these hold by construction.
"""

import inspect
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import pandas as pd

from calfsocket.paper import published
from calfsocket.paper.claims import found, given
from calfsocket.paper.claims.rules import INPUT, PAPER, RESULT, fact, holds, in_words
from calfsocket.paper.evidence import Evidence, NotChecked
from calfsocket.report.table import Table
from calfsocket.report.words import listed

HOLDS, FAILS, UNCHECKED = "holds", "does not hold", "cannot be checked"
VERDICTS = (HOLDS, FAILS, UNCHECKED)
PLURAL = {HOLDS: "hold", FAILS: "do not hold", UNCHECKED: "cannot be checked"}
"""What claims of a verdict do."""

KINDS = {
    RESULT: "claims on results",
    INPUT: "claims that only restate an input",
    PAPER: "claims that the paper's own numbers decide",
}
"""What a claim may judge, in words."""

FACTS: dict[str, Callable[..., Any]] = {
    name: function
    for module in (given, found)
    for name, function in inspect.getmembers(module, inspect.isfunction)
    if function.__module__ == module.__name__ and not name.startswith("_")
}
"""What the expressions of facts are made of."""


def scoreboard(evidence: Evidence) -> pd.DataFrame:
    """Check every claim; those that need cases which are not solved cannot be checked.

    Returns
    -------
    DataFrame
        One row a claim, in the order of the text: id, section, line, kind, claim, judges ("result",
        "input" or "paper"), given (why it holds by construction), verdict, ours, paper (numbers in
        words), why (one line, where it does not hold or cannot be checked), paper_tables (whether
        the paper's tables agree with its text) and note (on that).
    """
    board = published.claims().join(published.checks()[["judges", "given"]], on="id")
    checked = pd.DataFrame([check(identifier, evidence) for identifier in board.id])
    board = pd.concat([board, checked], axis=1)
    last = ["paper_tables", "note"]
    return board[[*(name for name in board if name not in last), *last]]


def check(identifier: str, evidence: Evidence) -> dict[str, str]:
    """Return verdict, ours, paper and why of a claim."""
    about = published.checks().loc[identifier]
    known: dict[str, Any] = {"e": evidence}
    known |= {name: partial(function, evidence) for name, function in FACTS.items()}
    try:
        known |= fact(about.fact, known)
    except NotChecked as reason:
        return {"verdict": UNCHECKED, "ours": "", "paper": "", "why": str(reason)}
    found = {"ours": in_words(about.ours, known), "paper": about.paper}
    if holds(about.rule, known["value"], about.expected):
        return {"verdict": HOLDS, **found, "why": ""}
    why = in_words(about.why, known) or "ours differs from the paper's"
    return {"verdict": FAILS, **found, "why": why}


def counts(board: pd.DataFrame, judges: str = RESULT) -> dict[str, int]:
    """Return the number of claims of each verdict, of those that judge results, say."""
    verdicts = board.verdict[board.judges == judges]
    return {verdict: int((verdicts == verdict).sum()) for verdict in VERDICTS}


def tally(counted: Mapping[str, int]) -> str:
    """Return counts in words, without those that are 0."""
    return listed(f"{n} {PLURAL[verdict]}" for verdict, n in counted.items() if n)


def parts(board: pd.DataFrame) -> list[str]:
    """Return the counts of each kind of claims in words, those on results first."""
    counted = {what: counts(board, judges) for judges, what in KINDS.items()}
    return [f"{sum(each.values())} {what} ({tally(each)})" for what, each in counted.items()]


def table(board: pd.DataFrame) -> Table:
    """Return the scoreboard as a table of the report."""
    contradicted = board.paper_tables.str.startswith("NO")
    paper = board.paper.where(~contradicted, board.paper + " (its own tables disagree)")
    shown = board.assign(paper=paper).set_index("id")
    return Table("scoreboard", board, shown[["claim", "judges", "verdict", "ours", "paper", "why"]])
