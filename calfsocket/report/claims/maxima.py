"""Claims on the largest stresses and strains: which tissue, how large, where."""

from itertools import combinations

import numpy as np
import pandas as pd

from calfsocket.report import names
from calfsocket.report.changes import magnitude_change
from calfsocket.report.claims.evidence import SOCKETS, SOFT_TISSUES, STRAINS, STRESSES, Evidence
from calfsocket.report.claims.registry import Finding, claim
from calfsocket.report.claims.tolerances import ABOUT, DIFFERS_PCT, MOST, SITES_DIFFER_MM, about
from calfsocket.report.results import MATERIAL_SETS
from calfsocket.report.table import number

KPA_PER_MMHG = 0.133322


def ranking(e: Evidence, socket: str, material_set: str, outcome: str) -> pd.Series:
    """Magnitudes by tissue, the largest first."""
    values = {t: abs(e.value(socket, material_set, t, outcome)) for t in SOFT_TISSUES}
    return pd.Series(values).sort_values(ascending=False, kind="stable")


def _is_largest(
    e: Evidence, cases: list[tuple[str, str]], tissue: str, outcomes: tuple[str, ...]
) -> Finding:
    """Whether a tissue has the largest of every outcome in every case."""
    ours, wrong = [], []
    for socket, material_set in cases:
        for outcome in outcomes:
            order = ranking(e, socket, material_set, outcome)
            unit = "kPa" if outcome in STRESSES else "%"
            first, second = order.index[:2]
            where = f"{socket} {names.OUTCOMES[outcome]}"
            ours.append(
                f"{where}: {first} {number(order[first])}, {second} {number(order[second])} {unit}"
            )
            if first != tissue:
                place = order.index.get_loc(tissue) + 1
                wrong.append(f"{where}: {tissue} is number {place}, {number(order[tissue])} {unit}")
    return Finding(not wrong, "; ".join(ours), f"largest in {tissue}", "; ".join(wrong))


@claim("C053", socket="TC", material_set="separate", tissue="fascia")
@claim("C054", socket="TC", material_set="combined", tissue="skin")
@claim("C055", socket="TSB", material_set="separate", tissue="fascia")
@claim("C056", socket="TSB", material_set="combined", tissue="skin")
@claim("C057", socket="HS", material_set="separate", tissue="fascia")
@claim("C058", socket="HS", material_set="combined", tissue="skin")
@claim("C059", socket="TC", material_set="separate", tissue="muscle", outcomes=STRAINS)
@claim("C060", socket="TSB", material_set="separate", tissue="muscle", outcomes=STRAINS)
@claim("C061", socket="HS", material_set="separate", tissue="muscle", outcomes=STRAINS)
@claim("C062", socket="TC", material_set="combined", tissue="fat", outcomes=STRAINS)
@claim("C063", socket="HS", material_set="combined", tissue="fat", outcomes=STRAINS)
@claim("C064", socket="TSB", material_set="combined", tissue="muscle", outcomes=STRAINS[:1])
@claim("C065", socket="TSB", material_set="combined", tissue="vessel", outcomes=STRAINS[1:])
def largest_in_tissue(
    e: Evidence,
    socket: str,
    material_set: str,
    tissue: str,
    outcomes: tuple[str, ...] = STRESSES[:1],
) -> Finding:
    """Check that one tissue has the largest stress, or the largest strains, of a run."""
    return _is_largest(e, [(socket, material_set)], tissue, outcomes)


@claim("C087", material_set="separate", tissue="fascia")
@claim("C088", material_set="combined", tissue="skin")
def largest_stresses(e: Evidence, material_set: str, tissue: str) -> Finding:
    """Check that one tissue has the largest stresses of a set in all sockets."""
    return _is_largest(e, [(socket, material_set) for socket in SOCKETS], tissue, STRESSES)


@claim("C089")
def largest_strains_combined(e: Evidence) -> Finding:
    """Check that in Combined it is fat for TC and HS, muscle and vessels for TSB."""
    parts = [
        largest_in_tissue(e, "TC", "combined", "fat", STRAINS),
        largest_in_tissue(e, "HS", "combined", "fat", STRAINS),
        largest_in_tissue(e, "TSB", "combined", "muscle", STRAINS[:1]),
        largest_in_tissue(e, "TSB", "combined", "vessel", STRAINS[1:]),
    ]
    return Finding(
        all(part.holds for part in parts),
        "; ".join(part.ours for part in parts),
        "fat (TC, HS), muscle and vessels (TSB)",
        "; ".join(part.why for part in parts if part.why),
    )


@claim("C078", outcomes=STRESSES)
@claim("C080", outcomes=STRAINS)
def maxima_table(e: Evidence, outcomes: tuple[str, ...]) -> Finding:
    """Check each cell of Table 2 or 4, in magnitude."""
    cells = e.maxima[e.maxima.outcome.isin(outcomes)]
    near = sum(about(row.ours, row.paper) for row in cells.itertuples())
    far = cells.loc[np.abs(np.log(cells.ratio)).idxmax()]
    return Finding(
        near >= MOST * len(cells),
        f"{near} of {len(cells)} cells within a factor {ABOUT:g}; median ratio "
        f"{number(cells.ratio.median())}",
        f"{len(cells)} cells",
        f"the limb and two of the sockets are our own; farthest: {far.tissue} {far.socket} "
        f"{names.SETS[far.material_set]} {names.OUTCOMES[far.outcome]}, {number(far.ratio)} times",
    )


def _both(e: Evidence) -> pd.DataFrame:
    """Each set's own maxima of stresses and strains."""
    e.need_sets()
    rows = e.changes[e.changes.site == "max_both"]
    return rows[rows.outcome.isin(STRESSES + STRAINS)]


@claim("C003")
@claim("C052")
def magnitudes_differ(e: Evidence) -> Finding:
    """Check that maxima of every tissue differ between the sets."""
    rows = _both(e)
    differ = rows.magnitude_change_pct.abs() > DIFFERS_PCT
    same = rows[~differ]
    by_tissue = differ.groupby(rows.tissue).mean()
    return Finding(
        bool((by_tissue > 0).all() and differ.mean() >= MOST),
        f"{differ.sum()} of {len(rows)} maxima differ by more than {DIFFERS_PCT:g} %",
        "all five tissues",
        f"alike: {', '.join(f'{r.tissue} {r.socket} {r.outcome}' for r in same.itertuples())}",
    )


def _sites(e: Evidence) -> pd.DataFrame:
    """Sites of all maxima of stresses and strains."""
    rows = e.results.summary
    return rows[rows.outcome.isin(STRESSES + STRAINS)]


def _apart(a: pd.Series, b: pd.Series) -> bool:
    return bool(np.hypot(a.x_mm - b.x_mm, a.y_mm - b.y_mm) > SITES_DIFFER_MM)


@claim("C004")
def sites_differ(e: Evidence) -> Finding:
    """Check that the site of the maximum of each tissue type differs between the sets."""
    complete = e.need_sets()
    moved: dict[str, list[bool]] = {tissue: [] for tissue in SOFT_TISSUES}
    for tissue in SOFT_TISSUES:
        for socket in complete:
            for outcome in STRESSES + STRAINS:
                separate, combined = (
                    e.row(socket, name, tissue, outcome) for name in MATERIAL_SETS
                )
                moved[tissue].append(_apart(separate, combined))
    n = len(complete) * len(STRESSES + STRAINS)
    few = [tissue for tissue, list_ in moved.items() if sum(list_) <= n / 2]
    return Finding(
        not few,
        f"moved by more than {SITES_DIFFER_MM:g} mm: "
        + ", ".join(f"{tissue} {sum(list_)} of {n}" for tissue, list_ in moved.items()),
        "each tissue (its tables: skin 2 of 12)",
        f"mostly at the same site: {', '.join(few)}",
    )


@claim("C084")
def maxima_vary(e: Evidence) -> Finding:
    """Check that maxima vary in size and place with set and socket."""
    e.need_all()
    sizes = places = n = 0
    for _, rows in _sites(e).groupby(["tissue", "outcome"]):
        for a, b in combinations(rows.itertuples(), 2):
            if (a.socket == b.socket) == (a.material_set == b.material_set):
                continue  # the same case, or one that differs in both
            n += 1
            sizes += abs(magnitude_change(a.value, b.value)) > DIFFERS_PCT
            places += _apart(a, b)
    return Finding(
        sizes >= MOST * n and places > n / 2,
        f"of {n} pairs of runs that differ in set or socket {sizes} differ in size, {places} in "
        "place",
        "vary in size and place",
    )


@claim("C092")
def largest_shear_strain(e: Evidence) -> Finding:
    """Check that the largest shear strain is 84 %, in the lateral gastrocnemius, HS Separate."""
    row = e.row("HS", "separate", "muscle", "shear_log_strain")
    region = "gastrocnemius_lateral_head"
    here, size = row.region == region, about(row.value, 84)
    wrong = [] if here else [f"in another muscle than {names.region(region)}"]
    wrong += [] if size else [f"not within a factor {ABOUT:g}"]
    return Finding(
        bool(here and size),
        f"{number(abs(row.value))} % in {names.region(row.region)}",
        "84 % in gastrocnemius lateral head",
        "; ".join(wrong),
    )


@claim("C030")
def vessel_pressure(e: Evidence) -> Finding:
    """Check that the largest pressure in the vessels is 14.7 kPa."""
    values = {key: e.value(*key, "vessel", "pressure") for key in e.results.cases}
    near = [key for key, value in values.items() if about(value, 14.7)]
    return Finding(
        bool(near),
        ", ".join(f"{s} {names.SETS[m]} {number(v)}" for (s, m), v in values.items()) + " kPa",
        "14.7 kPa in a run that is not named",
        f"no run comes within a factor {ABOUT:g}",
    )


@claim("C031")
def millimetres_of_mercury(e: Evidence) -> Finding:
    """Check that 14.7 kPa is 110 mmHg."""
    ours = 14.7 / KPA_PER_MMHG
    return Finding(round(ours) == 110, f"{ours:.1f} mmHg", "110 mmHg")
