"""What the paper leaves open: which of its claims change their verdict with a variant."""

from collections.abc import Mapping

import pandas as pd

from calfsocket.paper.evidence import CASES, Evidence
from calfsocket.paper.scoreboard import FAILS, HOLDS, UNCHECKED, counts, scoreboard
from calfsocket.report.findings import Findings
from calfsocket.report.table import Table
from calfsocket.report.variants import BASE, variants
from calfsocket.report.words import TIMES

MARKS = {HOLDS: "\N{CHECK MARK}", FAILS: TIMES, UNCHECKED: "?"}


def claims(boards: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Verdict on each claim under each variant; `same` says whether all agree."""
    board = boards[BASE][["id", "kind", "judges", "claim"]]
    verdicts = pd.DataFrame({name: each.verdict for name, each in boards.items()})
    return board.join(verdicts).assign(same=verdicts.nunique(axis=1) == 1)


def tables(findings: Findings) -> list[Table]:
    """Return the tables of verdicts by variant; none for a study without variants."""
    of = variants(findings.study)
    boards = {
        name: scoreboard(Evidence(results.only(CASES), findings.thresholds))
        for name, results in of.items()
    }
    return [_counts(boards), _claims(claims(boards))] if boards else []


def are_the_papers(findings: Findings) -> bool:
    """Whether a study has just the variants of what the paper leaves open."""
    found = variants(findings.study)
    if not found:
        return False
    from calfsocket.study.study import variants as paper_variants

    return {*found} == {BASE, *paper_variants()}


def _counts(boards: Mapping[str, pd.DataFrame]) -> Table:
    data = pd.DataFrame([{"variant": name, **counts(board)} for name, board in boards.items()])
    return Table("verdicts_by_variant", data, data.set_index("variant").map(str))


def _claims(data: pd.DataFrame) -> Table:
    verdicts = [*data.columns.drop(["id", "kind", "judges", "claim", "same"])]
    shown = data[~data.same].set_index("id")[["claim", *verdicts]]
    return Table("claims_by_variant", data, shown.replace(dict.fromkeys(verdicts, MARKS)))
