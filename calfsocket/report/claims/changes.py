"""Claims on relative changes by equation (3): the extremes, the spread, Tables 3 and 5."""

import numpy as np
import pandas as pd

from calfsocket.report import names, published
from calfsocket.report.changes import magnitude_change
from calfsocket.report.claims.evidence import STRAINS, STRESSES, Evidence
from calfsocket.report.claims.registry import Finding, claim
from calfsocket.report.claims.tolerances import (
    LARGE_PCT,
    MOST,
    OFTEN,
    SEVERAL_HUNDRED_PCT,
    about_change,
)
from calfsocket.report.results import MATERIAL_SETS
from calfsocket.report.table import change, number


def _cells(e: Evidence, outcomes: tuple[str, ...] = STRESSES + STRAINS) -> pd.DataFrame:
    e.need_sets()
    return e.changes[e.changes.outcome.isin(outcomes)]


def _name(row: pd.Series) -> str:
    return f"{names.OUTCOMES[row.outcome]} in {row.tissue}, {row.socket}"


@claim(
    "C066", outcomes=STRESSES, rise=True, cells=[("TC", "muscle", "effective_stress")], paper=459
)
@claim("C067", outcomes=STRESSES, rise=False, cells=[("TC", "muscle", "shear_stress")], paper=-599)
@claim("C068", outcomes=STRAINS, rise=True, cells=[("HS", "fat", "shear_log_strain")], paper=202)
@claim(
    "C069",
    outcomes=STRAINS,
    rise=False,
    cells=[("TC", "vessel", "shear_log_strain"), ("HS", "vessel", "shear_log_strain")],
    paper=-253,
)
def extreme_change(
    e: Evidence,
    outcomes: tuple[str, ...],
    rise: bool,
    cells: list[tuple[str, str, str]],
    paper: float,
) -> Finding:
    """Check that one cell has the largest rise or fall of a maximum by equation (3)."""
    e.need_all()
    rows = _cells(e, outcomes)
    rows = rows[rows.site == "max_both"]
    signed, size = rows.relative_change_pct, rows.magnitude_change_pct
    extreme = rows.loc[signed.idxmax() if rise else signed.idxmin()]
    true = rows.loc[size.idxmax() if rise else size.idxmin()]
    here = (extreme.socket, extreme.tissue, extreme.outcome) in cells
    near = about_change(extreme.relative_change_pct, paper)
    why = [] if here else ["another cell is the extreme"]
    why += [] if near else ["not about the printed number"]
    return Finding(
        here and near,
        f"{change(extreme.relative_change_pct)} % ({_name(extreme)}); by magnitude "
        f"{change(true.magnitude_change_pct)} % ({_name(true)})",
        f"{change(paper)} % ({names.OUTCOMES[cells[0][2]]} in {cells[0][1]}, "
        f"{' and '.join(socket for socket, _, _ in cells)})",
        "; ".join(why),
    )


@claim("C006")
def several_hundred(e: Evidence) -> Finding:
    """Check that some relative changes reach several hundred percent."""
    rows = _cells(e)
    both = rows[rows.site == "max_both"]
    n = int((both.relative_change_pct.abs() >= SEVERAL_HUNDRED_PCT).sum())
    by_size = int((both.magnitude_change_pct.abs() >= SEVERAL_HUNDRED_PCT).sum())
    return Finding(
        n > 0,
        f"{n} of {len(both)} maxima change by {SEVERAL_HUNDRED_PCT:g} % or more, {by_size} in "
        "magnitude",
        "some (its tables: 12 of 60, 6 in magnitude)",
        f"the largest is {number(both.relative_change_pct.abs().max())} %",
    )


@claim("C085")
def often_several_hundred(e: Evidence) -> Finding:
    """Check that relative changes often reach several hundred percent."""
    rows = _cells(e)
    far = rows.relative_change_pct.abs() >= SEVERAL_HUNDRED_PCT
    printed = published.changes().printed.abs() >= SEVERAL_HUNDRED_PCT
    at_combined = int(far[rows.site == "max_combined"].sum())
    return Finding(
        far.mean() >= OFTEN,
        f"{far.sum()} of {len(rows)} cells, {at_combined} of them at the Combined maximum, where "
        "the reference is small",
        f"often ({printed.sum()} of {len(printed)} cells)",
        f"{100 * far.mean():.0f} % of the cells are fewer than {100 * OFTEN:g} %",
    )


@claim("C070")
def sites_spread_more(e: Evidence) -> Finding:
    """Check that changes at sites spread wider than changes of maxima."""
    ranges, wider = [], True
    for outcomes in (STRESSES, STRAINS):
        rows = _cells(e, outcomes)
        both = rows.relative_change_pct[rows.site == "max_both"]
        sites = rows.relative_change_pct[rows.site != "max_both"]
        wider = wider and np.ptp(sites.dropna()) > np.ptp(both.dropna())
        ranges.append(
            f"{'stress' if outcomes == STRESSES else 'strain'} {change(sites.min())} to "
            f"{change(sites.max())} % at sites, {change(both.min())} to {change(both.max())} % of "
            "maxima"
        )
    return Finding(bool(wider), "; ".join(ranges), "wider at sites")


@claim("C079", outcomes=STRESSES)
@claim("C081", outcomes=STRAINS)
def changes_table(e: Evidence, outcomes: tuple[str, ...]) -> Finding:
    """Check each relative change of Table 3 or 5."""
    e.need_sets()
    cells = e.compared_changes
    cells = cells[cells.outcome.isin(outcomes)].dropna(subset="ours")
    near = sum(about_change(row.ours, row.paper) for row in cells.itertuples())
    distance = (cells.ours - cells.paper).abs().median()
    flips = int(cells.sign_flip.sum())
    return Finding(
        near >= MOST * len(cells),
        f"{near} of {len(cells)} cells about alike; {flips} signs differ",
        f"{len(cells)} cells",
        f"median distance {number(distance)} points; at sites where one set is nearly unloaded a "
        "change follows every difference of geometry",
    )


@claim("C086")
def both_directions(e: Evidence) -> Finding:
    """Check that both increases and decreases appear."""
    rows = _cells(e)
    size = rows.magnitude_change_pct[rows.site == "max_both"]
    up, down = int((size > 0).sum()), int((size < 0).sum())
    return Finding(
        up > 0 and down > 0, f"{up} maxima rise in magnitude, {down} fall", "both", "all one way"
    )


@claim("C103")
def large_at_low_load(e: Evidence) -> Finding:
    """Check that differences are considerable although nothing but the socket loads the limb."""
    rows = _cells(e)
    median = rows.magnitude_change_pct[rows.site == "max_both"].abs().median()
    at = published.maxima().pivot(
        index=["tissue", "outcome", "socket"], columns="material_set", values="printed"
    )
    theirs = [
        abs(magnitude_change(separate, combined))
        for separate, combined in at[list(MATERIAL_SETS)].itertuples(index=False)
    ]
    return Finding(
        bool(median >= LARGE_PCT),
        f"half of the maxima change by {number(median)} % or more in magnitude",
        f"considerable (its tables: {number(float(np.median(theirs)))} %)",
        f"half of the maxima change by less than {LARGE_PCT:g} %",
    )
