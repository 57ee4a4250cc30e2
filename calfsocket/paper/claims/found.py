"""Facts on results: maxima, what merging changes, contact pressure, damage, the calibration."""

from collections.abc import Mapping
from itertools import combinations, pairwise
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from calfsocket.paper.calibration import FITTED, IGNORED, SEPARATE, TABLE1
from calfsocket.paper.claims.rules import Fact, fact
from calfsocket.paper.claims.tolerances import (
    ABOUT,
    DIFFERS_PCT,
    MOST,
    SEVERAL_HUNDRED_PCT,
    SITES_DIFFER_MM,
    about,
    about_change,
)
from calfsocket.paper.evidence import (
    SOCKETS,
    SOFT_TISSUES,
    STRAINS,
    STRESSES,
    Evidence,
    NotChecked,
)
from calfsocket.report.changes import SETS, magnitude_change, relative_change
from calfsocket.report.damage import DamageThresholds
from calfsocket.report.names import QUANTITIES, material_set, region
from calfsocket.report.table import change, number
from calfsocket.simulation.results import Key

OF = {"stress": STRESSES, "strain": STRAINS}
PEAK, MEAN = "contact_pressure_max", "contact_pressure_mean"
FASCIA_LIMIT = DamageThresholds().fascia_strain_pct


def _listed(values: Mapping[str, float], text: Any = number, unit: str = "") -> str:
    return ", ".join(f"{name} {text(value)}{unit}" for name, value in values.items())


# --- maxima


@fact
def not_largest(e: Evidence, of: str) -> Fact:
    """Return quantities whose largest value is not in the tissue that is named.

    Parts ``sockets set tissue quantities`` are separated by ";", names within by "+".
    """
    ours, wrong = [], []
    for part in of.split("; "):
        sockets, name, tissue, quantities = part.split()
        for socket in sockets.split("+"):
            for quantity in quantities.split("+"):
                values = {t: abs(e.value(socket, name, t, quantity)) for t in SOFT_TISSUES}
                order = pd.Series(values).sort_values(ascending=False, kind="stable")
                unit = "kPa" if quantity in STRESSES else "%"
                where = f"{socket} {QUANTITIES[quantity]}"
                first, second = order.index[:2]
                ours.append(
                    f"{where}: {first} {number(order[first])}, {second} {number(order[second])} "
                    f"{unit}"
                )
                if first != tissue:
                    place = list(order.index).index(tissue) + 1
                    wrong.append(
                        f"{where}: {tissue} is number {place}, {number(order[tissue])} {unit}"
                    )
    return Fact(wrong, "; ".join(ours), "; ".join(wrong))


@fact
def cells_near(e: Evidence, of: str) -> Fact:
    """Return share of the cells of Table 2 or 4 whose magnitude is about the paper's."""
    cells = e.maxima[e.maxima["quantity"].isin(OF[of])]
    near = sum(about(row.ours, row.paper) for row in cells.itertuples())
    far = cells.loc[np.abs(np.log(cells.ratio)).idxmax()]
    return Fact(
        near / len(cells),
        f"{near} of {len(cells)} cells within a factor {ABOUT:g}; median ratio "
        f"{number(cells.ratio.median())}",
        f"the limb and two of the sockets are our own; farthest: {far.tissue} {far.socket} "
        f"{material_set(far.material_set)} {QUANTITIES[far['quantity']]}, {number(far.ratio)} "
        "times",
    )


def _changes(e: Evidence, of: str = "") -> pd.DataFrame:
    """Return changes of stresses, of strains, or of both."""
    e.need_sets()
    return e.changes[e.changes["quantity"].isin(OF.get(of, STRESSES + STRAINS))]


def _both(e: Evidence, of: str = "") -> pd.DataFrame:
    """Return changes of each set's own maximum."""
    rows = _changes(e, of)
    return rows[rows.site == "max_both"]


@fact
def maxima_that_differ(e: Evidence, of: str) -> Fact:
    """Return share of maxima whose magnitude differs between the sets; 0 if a tissue has none."""
    rows = _both(e)
    differ = rows.magnitude_change_pct.abs() > DIFFERS_PCT
    same = [f"{r.tissue} {r.socket} {r.quantity}" for r in rows[~differ].itertuples()]
    every = (differ.groupby(rows.tissue).mean() > 0).all()
    return Fact(
        differ.mean() if every else 0.0,
        f"{differ.sum()} of {len(rows)} maxima differ by more than {DIFFERS_PCT:g} %",
        f"alike: {', '.join(same)}",
    )


def _apart(a: Any, b: Any) -> bool:
    return bool(np.hypot(a.x_mm - b.x_mm, a.y_mm - b.y_mm) > SITES_DIFFER_MM)


@fact
def tissues_at_the_same_site(e: Evidence, of: str) -> Fact:
    """Return tissues whose maxima are mostly at one site in both sets."""
    complete = e.need_sets()
    moved = {
        tissue: sum(
            _apart(*(e.row(socket, name, tissue, quantity) for name in SETS))
            for socket in complete
            for quantity in STRESSES + STRAINS
        )
        for tissue in SOFT_TISSUES
    }
    n = len(complete) * len(STRESSES + STRAINS)
    few = [tissue for tissue, count in moved.items() if count <= n / 2]
    counts = _listed(moved, str, f" of {n}")
    return Fact(
        few,
        f"moved by more than {SITES_DIFFER_MM:g} mm: {counts}",
        f"mostly at the same site: {', '.join(few)}",
    )


@fact
def maxima_vary(e: Evidence, of: str) -> Fact:
    """Return whether maxima vary in size and place with set and socket."""
    e.need()
    rows = e.results.summary
    sizes = places = n = 0
    for _, group in rows[rows["quantity"].isin(STRESSES + STRAINS)].groupby(["tissue", "quantity"]):
        for a, b in combinations(group.itertuples(), 2):
            if (a.socket == b.socket) == (a.material_set == b.material_set):
                continue  # the same case, or one that differs in both
            n += 1
            sizes += abs(magnitude_change(a.value, b.value)) > DIFFERS_PCT
            places += _apart(a, b)
    return Fact(
        sizes >= MOST * n and places > n / 2,
        f"of {n} pairs of runs that differ in set or socket {sizes} differ in size, {places} in "
        "place",
    )


@fact
def shear_strain_of_muscle(e: Evidence, of: str) -> Fact:
    """Return largest shear strain of muscle in a case, %; NaN where it lies in another muscle."""
    socket, name, muscle = of.split()
    row = e.row(socket, name, "muscle", "shear_log_strain")
    here = row.region == muscle
    wrong = [] if here else [f"in another muscle than {region(muscle)}"]
    wrong += [] if about(row.value, 84) else [f"not within a factor {ABOUT:g}"]
    text = f"{number(abs(row.value))} % in {region(row.region)}"
    return Fact(row.value if here else np.nan, text, "; ".join(wrong))


@fact
def vessel_pressure(e: Evidence, of: str) -> Fact:
    """Return of the runs' largest pressures in the vessels, the one nearest to a value, kPa."""
    values = {key: e.value(*key, "vessel", "pressure") for key in e.results}
    nearest = min(values.values(), key=lambda value: abs(abs(value) - float(of)))
    return Fact(nearest, f"{_runs(values)} kPa", f"no run comes within a factor {ABOUT:g}")


def _runs(values: dict[Key, float]) -> str:
    return _listed({f"{socket} {material_set(name)}": v for (socket, name), v in values.items()})


# --- relative changes by equation (3)


@fact
def extreme_change(e: Evidence, of: str) -> Fact:
    """Return the largest rise or fall of a maximum, %; NaN where it is in another cell."""
    kind, way, sockets, tissue, quantity, printed = of.split()
    e.need()
    rows = _both(e, kind)
    signed, size = rows.relative_change_pct, rows.magnitude_change_pct
    rise = way == "rise"
    extreme = rows.loc[signed.idxmax() if rise else signed.idxmin()]
    true = rows.loc[size.idxmax() if rise else size.idxmin()]
    cell = (extreme.tissue, extreme["quantity"])
    here = extreme.socket in sockets.split("+") and cell == (tissue, quantity)
    value = extreme.relative_change_pct
    why = [] if here else ["another cell is the extreme"]
    why += [] if about_change(value, float(printed)) else ["not about the printed number"]

    def name(row: pd.Series) -> str:
        return f"{QUANTITIES[row['quantity']]} in {row.tissue}, {row.socket}"

    return Fact(
        value if here else np.nan,
        f"{change(value)} % ({name(extreme)}); by magnitude {change(true.magnitude_change_pct)} % "
        f"({name(true)})",
        "; ".join(why),
    )


@fact
def changes_of_several_hundred(e: Evidence, of: str) -> Fact:
    """Return number of maxima that change by several hundred percent."""
    rows = _both(e)
    far, by_size = (
        int((values.abs() >= SEVERAL_HUNDRED_PCT).sum())
        for values in (rows.relative_change_pct, rows.magnitude_change_pct)
    )
    return Fact(
        far,
        f"{far} of {len(rows)} maxima change by {SEVERAL_HUNDRED_PCT:g} % or more, {by_size} in "
        "magnitude",
        f"the largest is {number(rows.relative_change_pct.abs().max())} %",
    )


@fact
def share_of_several_hundred(e: Evidence, of: str) -> Fact:
    """Return share of all cells that change by several hundred percent."""
    rows = _changes(e)
    far = rows.relative_change_pct.abs() >= SEVERAL_HUNDRED_PCT
    at_combined = int(far[rows.site == "max_combined"].sum())
    return Fact(
        far.mean(),
        f"{far.sum()} of {len(rows)} cells, {at_combined} of them at the Combined maximum, where "
        "the reference is small",
        f"{100 * far.mean():.0f} % of the cells",
    )


@fact
def sites_spread_more(e: Evidence, of: str) -> Fact:
    """Return whether changes at sites spread wider than those of maxima, stresses and strains."""
    ranges, wider = [], []
    for kind in OF:
        rows = _changes(e, kind)
        both = rows.relative_change_pct[rows.site == "max_both"]
        sites = rows.relative_change_pct[rows.site != "max_both"]
        wider.append(np.ptp(sites.dropna()) > np.ptp(both.dropna()))
        ranges.append(
            f"{kind} {change(sites.min())} to {change(sites.max())} % at sites, "
            f"{change(both.min())} to {change(both.max())} % of maxima"
        )
    return Fact(tuple(wider), "; ".join(ranges))


@fact
def changes_near(e: Evidence, of: str) -> Fact:
    """Return share of the cells of Table 3 or 5 whose change is about the paper's."""
    e.need_sets()
    cells = e.compared_changes
    cells = cells[cells["quantity"].isin(OF[of])].dropna(subset="ours")
    near = sum(about_change(row.ours, row.paper) for row in cells.itertuples())
    distance = (cells.ours - cells.paper).abs().median()
    return Fact(
        near / len(cells),
        f"{near} of {len(cells)} cells about alike; {int(cells.sign_flip.sum())} signs differ",
        f"median distance {number(distance)} points; at sites where one set is nearly unloaded a "
        "change follows every difference of geometry",
    )


@fact
def both_directions(e: Evidence, of: str) -> Fact:
    """Return numbers of maxima that rise and that fall in magnitude."""
    size = _both(e).magnitude_change_pct
    up, down = int((size > 0).sum()), int((size < 0).sum())
    return Fact((up, down), f"{up} maxima rise in magnitude, {down} fall")


@fact
def median_change(e: Evidence, of: str) -> Fact:
    """Return median change of the maxima's magnitude, %."""
    median = _both(e).magnitude_change_pct.abs().median()
    return Fact(median, f"half of the maxima change by {number(median)} % or more in magnitude")


# --- contact pressure


def _rise(e: Evidence, socket: str, quantity: str = PEAK) -> float:
    return relative_change(*(e.value(socket, name, "skin", quantity) for name in SETS))


@fact
def pressure_rise(e: Evidence, of: str) -> Fact:
    """Return rise of the largest contact pressure with Combined in some sockets, %."""
    rises = {socket: _rise(e, socket) for socket in of.split("+")}
    means = {socket: _rise(e, socket, MEAN) for socket in rises}
    falls = [socket for socket in rises if rises[socket] <= 0 < means[socket]]
    why = "rises by another share"
    if falls:
        why = f"in {', '.join(falls)} the mean rises, the largest falls"
        if c10 := e.laws.get("separate", {}).get("fascia", {}).get("c10"):
            why += f": in Separate a fascia of C10 {c10:g} MPa gathers pressure in peaks"
    text = f"{_listed(rises, change, ' %')} (means {_listed(means, change, ' %')})"
    return Fact(tuple(rises.values()), text, why)


@fact
def ranking_of_rises(e: Evidence, of: str) -> Fact:
    """Return sockets by the rise of the largest contact pressure."""
    rises = {socket: _rise(e, socket) for socket in SOCKETS}
    order = sorted(rises, key=lambda socket: -rises[socket])
    ranked = order[0]
    for before, after in pairwise(order):
        ranked += f" {'>' if rises[before] > rises[after] else '='} {after}"
    return Fact(ranked, _listed(rises, change, " %"), f"it ranks {ranked}")


def _alike(what: str, unit: str, values: dict[Key, float]) -> Fact:
    """Return the pairs of runs of one set or of one socket whose values are alike."""
    if len(values) < 2:
        raise NotChecked("needs two runs to compare")
    alike = [
        f"{'_'.join(a)} and {'_'.join(b)}"
        for a, b in combinations(values, 2)
        if (a[0] == b[0]) != (a[1] == b[1])
        and abs(relative_change(values[a], values[b])) <= DIFFERS_PCT
    ]
    return Fact(alike, f"{what} {_runs(values)} {unit}", f"alike: {', '.join(alike)}")


@fact
def alike_pressures(e: Evidence, of: str) -> Fact:
    """Return pairs of runs of one set or of one socket with one mean contact pressure."""
    return _alike("mean", "kPa", {key: e.value(*key, "skin", MEAN) for key in e.results})


@fact
def alike_forces(e: Evidence, of: str) -> Fact:
    """Return pairs of runs of one set or of one socket with one pressing force."""
    forces = {key: result.checks.pressing_force_N_per_mm for key, result in e.results.items()}
    return _alike("pressing force", "N/mm", forces)


@fact
def distance_of_peaks(e: Evidence, of: str) -> Fact:
    """Return smallest distance of two sockets' largest contact pressures in one set, mm."""
    distances = []
    for name in SETS:
        rows = [e.row(socket, name, "skin", PEAK) for socket in SOCKETS]
        distances += [np.hypot(a.x_mm - b.x_mm, a.y_mm - b.y_mm) for a, b in combinations(rows, 2)]
    low, high = min(distances), max(distances)
    return Fact(low, f"sites of two sockets are {number(low)} to {number(high)} mm apart")


# --- damage thresholds


def _fascia(e: Evidence, socket: str, name: str) -> dict[str, float]:
    """AMP and shear of fascia: the paper mixes the two."""
    return {
        QUANTITIES[quantity]: abs(e.value(socket, name, "fascia", quantity)) for quantity in STRAINS
    }


def _muscle(e: Evidence, name: str) -> dict[str, float]:
    return {socket: abs(e.value(socket, name, "muscle", "shear_log_strain")) for socket in SOCKETS}


@fact
def largest_shear_strain(e: Evidence, of: str) -> Fact:
    """Return largest shear strain of a set, %."""
    values = {
        f"{socket} {tissue}": abs(e.value(socket, of, tissue, "shear_log_strain"))
        for socket in SOCKETS
        for tissue in SOFT_TISSUES
    }
    where = max(values, key=lambda name: values[name])
    return Fact(values[where], f"largest {number(values[where])} % ({where})")


@fact
def muscle_above(e: Evidence, of: str) -> Fact:
    """Return sockets in which muscle's shear strain is above a value, in one set."""
    name, limit = of.split()
    values = _muscle(e, name)
    above = ", ".join(socket for socket, value in values.items() if value > float(limit))
    return Fact(above, f"{_listed(values)} %", f"above {limit} %: {above or 'none'}")


@fact
def largest_fascia_strain(e: Evidence, of: str) -> Fact:
    """Return largest strain of fascia in some sockets, %; NaN where one is below its threshold."""
    sockets, name = of.split()
    ours = {socket: _fascia(e, socket, name) for socket in sockets.split("+")}
    largest = [max(values.values()) for values in ours.values()]
    text = "; ".join(f"{socket}: {_listed(values)} %" for socket, values in ours.items())
    why = "smaller strains of fascia" if max(largest) < 29 else "larger strains of fascia"
    return Fact(max(largest) if min(largest) > FASCIA_LIMIT else np.nan, text, why)


@fact
def fascia_strains(e: Evidence, of: str) -> Fact:
    """Return strains of fascia in a case, %."""
    values = _fascia(e, *of.split())
    return Fact(tuple(values.values()), f"{_listed(values)} %")


@fact
def fascia_strain_in_hs(e: Evidence, of: str) -> Fact:
    """Return largest strain of the separate fascia, %; NaN above its threshold, or not in HS."""
    ours = {socket: max(_fascia(e, socket, "separate").values()) for socket in SOCKETS}
    where = max(ours, key=lambda socket: ours[socket])
    below, near = ours[where] < FASCIA_LIMIT, about(ours[where], 18)
    why = [] if below else [f"above {FASCIA_LIMIT:g} %"]
    why += [] if where == "HS" else [f"largest in {where}"]
    c10 = e.laws.get("separate", {}).get("fascia", {}).get("c10")
    if not near and c10:
        why.append(f"C10 is {c10:g} MPa; the paper's stresses and strains need about 0.5")
    value = ours[where] if below and where == "HS" else np.nan
    return Fact(value, f"{_listed(ours)} %", "; ".join(why))


@fact
def tissues_at_risk_differ(e: Evidence, of: str) -> Fact:
    """Return whether other tissues pass their thresholds in one set than in the other."""
    at_risk: dict[str, list[str]] = {}
    for name in SETS:
        muscle = _muscle(e, name)
        fascia = {socket: max(_fascia(e, socket, name).values()) for socket in SOCKETS}
        at_risk[name] = [
            *(f"muscle {s}" for s, v in muscle.items() if v > e.thresholds.muscle_shear_pct),
            *(f"fascia {s}" for s, v in fascia.items() if v > e.thresholds.fascia_strain_pct),
        ]
    why = "the same tissues pass in both sets"
    if not any(at_risk.values()):
        why = "no strain passes a threshold in either set"
    text = "; ".join(
        f"{material_set(name)}: {', '.join(found) or 'none'}" for name, found in at_risk.items()
    )
    return Fact(at_risk["separate"] != at_risk["combined"], text, why)


# --- the calibration


def _range(values: NDArray[np.float64]) -> str:
    return f"{number(values.min())} to {number(values.max())}"


@fact
def matched_curve(e: Evidence, of: str) -> Fact:
    """Return forces with Table 1's combined law over Separate's, at every displacement.

    A law fitted here is close to Separate by construction, so it cannot decide.
    """
    found = e.checked_calibration()
    ratio = {name: found.force[name] / found.force[SEPARATE] for name in (TABLE1, FITTED)}
    near = sum(about(value, 1.0) for value in ratio[TABLE1])
    return Fact(
        tuple(ratio[TABLE1]),
        f"force with Table 1's combined law {_range(ratio[TABLE1])} times Separate's; with one "
        f"fitted here (mu {number(found.fit.mu_kPa)} kPa, alpha {number(found.fit.alpha)}) "
        f"{_range(ratio[FITTED])}",
        f"about equal at {near} of {len(ratio[TABLE1])} displacements: the parameters depend on "
        "the model's dimensions and stroke, which the paper does not give",
    )


@fact
def force_without_fascia(e: Evidence, of: str) -> Fact:
    """Return forces with muscle's law in the fascia over the others, at every displacement."""
    force = e.checked_calibration().force
    ratio = {name: force[IGNORED] / force[name] for name in (SEPARATE, TABLE1, FITTED)}
    return Fact(
        tuple(np.concatenate(list(ratio.values()))),
        f"force without fascia {_range(ratio[SEPARATE])} times Separate's, {_range(ratio[TABLE1])} "
        f"times Combined's with Table 1's law, {_range(ratio[FITTED])} with the fitted one",
    )


@fact
def deviation_without_fascia(e: Evidence, of: str) -> Fact:
    """Return deviation from Separate with fascia ignored over those with the combined laws."""
    found = e.checked_calibration()
    off = {name: found.deviation_pct(name) for name in (IGNORED, TABLE1, FITTED)}
    why = "even the fitted law is as far off"
    if off[IGNORED] > off[FITTED]:
        why = "Table 1's law is as far off in this model"
    return Fact(
        off[IGNORED] > max(off[TABLE1], off[FITTED]),
        f"root mean square, share of the largest force: fascia ignored {number(off[IGNORED])} %, "
        f"Combined {number(off[TABLE1])} % (Table 1), {number(off[FITTED])} % (fitted)",
        why,
    )


@fact
def cannot_be_repeated(e: Evidence, of: str) -> Fact:
    """Say why a claim cannot be checked."""
    raise NotChecked(of)
