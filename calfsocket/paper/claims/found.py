"""Facts on results: maxima, what merging changes, contact pressure, damage, the calibration."""

from itertools import combinations, pairwise
from typing import Any

import numpy as np
import pandas as pd

from calfsocket.calibration.names import FITTED, IGNORED, SEPARATE, TABLE1
from calfsocket.paper.claims.rules import Fact
from calfsocket.paper.claims.tolerances import (
    DIFFERS_PCT,
    MOST,
    SEVERAL_HUNDRED_PCT,
    SITES_DIFFER_MM,
    about,
    about_change,
)
from calfsocket.paper.evidence import (
    SOCKETS,
    STRAINS,
    STRESSES,
    Evidence,
    NotChecked,
    run_name,
)
from calfsocket.postprocess.quantities import SUMMARY_TISSUES
from calfsocket.report.changes import magnitude_change, relative_change
from calfsocket.report.damage import DamageThresholds
from calfsocket.report.names import QUANTITIES, SETS, material_set, region
from calfsocket.report.words import number
from calfsocket.simulation.results import Key

OF = {"stress": STRESSES, "strain": STRAINS}
PEAK, MEAN = "contact_pressure_max", "contact_pressure_mean"
FASCIA_LIMIT = DamageThresholds().fascia_strain_pct


# --- maxima


def not_largest(e: Evidence, of: str) -> Fact:
    """Return the quantities whose largest value is not in the tissue that is named.

    Parts ``sockets set tissue quantities`` are separated by ";", names within by "+".
    """
    ours: dict[str, str] = {}
    wrong: dict[str, str] = {}
    for part in of.split("; "):
        sockets, name, tissue, quantities = part.split()
        for socket in sockets.split("+"):
            for quantity in quantities.split("+"):
                values = {t: abs(e.value(socket, name, t, quantity)) for t in SUMMARY_TISSUES}
                order = sorted(values, key=lambda t: -values[t])
                unit = "kPa" if quantity in STRESSES else "%"
                where = f"{socket} {QUANTITIES[quantity]}"
                largest = [f"{t} {number(values[t])}" for t in order[:2]]
                ours[where] = f"{', '.join(largest)} {unit}"
                if order[0] != tissue:
                    place = order.index(tissue) + 1
                    wrong[where] = f"{tissue} is number {place}, {number(values[tissue])} {unit}"
    return {
        "value": list(wrong),
        "ours": "; ".join(f"{where}: {text}" for where, text in ours.items()),
        "wrong": "; ".join(f"{where}: {text}" for where, text in wrong.items()),
    }


def cells_near(e: Evidence, of: str) -> Fact:
    """Return the share of the cells of Table 2 or 4 whose magnitude is about the paper's."""
    cells = e.maxima[e.maxima["quantity"].isin(OF[of])]
    near = sum(about(row.ours, row.paper) for row in cells.itertuples())
    far = cells.loc[np.abs(np.log(cells.ratio)).idxmax()]
    run = run_name((far.socket, far.material_set))
    return {
        "value": near / len(cells),
        "near": near,
        "n": len(cells),
        "median": cells.ratio.median(),
        "far": f"{far.tissue} {run} {QUANTITIES[far['quantity']]}",
        "ratio": far.ratio,
    }


def _changes(e: Evidence, of: str = "") -> pd.DataFrame:
    """Return changes of stresses, of strains, or of both."""
    e.need_sets()
    return e.changes[e.changes["quantity"].isin(OF.get(of, STRESSES + STRAINS))]


def _both(e: Evidence, of: str = "") -> pd.DataFrame:
    """Return changes of each set's own maximum."""
    rows = _changes(e, of)
    return rows[rows.site == "max_both"]


def maxima_that_differ(e: Evidence, of: str) -> Fact:
    """Return the share of maxima that differ in magnitude; 0 where a tissue has none."""
    rows = _both(e)
    differ = rows.magnitude_change_pct.abs() > DIFFERS_PCT
    same = [f"{r.tissue} {r.socket} {r.quantity}" for r in rows[~differ].itertuples()]
    every = (differ.groupby(rows.tissue).mean() > 0).all()
    share = differ.mean() if every else 0.0
    return {"value": share, "differ": differ.sum(), "n": len(rows), "same": same}


def _distance(a: Any, b: Any) -> float:
    return float(np.hypot(a.x_mm - b.x_mm, a.y_mm - b.y_mm))


def tissues_at_the_same_site(e: Evidence, of: str) -> Fact:
    """Return the tissues whose maxima are mostly at one site in both sets."""
    complete = e.need_sets()
    n = len(complete) * len(STRESSES + STRAINS)
    moved = {
        tissue: sum(
            _distance(*(e.row(socket, name, tissue, quantity) for name in SETS)) > SITES_DIFFER_MM
            for socket in complete
            for quantity in STRESSES + STRAINS
        )
        for tissue in SUMMARY_TISSUES
    }
    few = [tissue for tissue, count in moved.items() if count <= n / 2]
    return {"value": few, "moved": {tissue: f"{count} of {n}" for tissue, count in moved.items()}}


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
            places += _distance(a, b) > SITES_DIFFER_MM
    vary = sizes >= MOST * n and places > n / 2
    return {"value": vary, "n": n, "sizes": sizes, "places": places}


def shear_strain_of_muscle(e: Evidence, of: str) -> Fact:
    """Return the largest shear strain of muscle in a case, %; NaN where it is in another muscle."""
    socket, name, muscle = of.split()
    row = e.row(socket, name, "muscle", "shear_log_strain")
    here = row.region == muscle
    wrong = [] if here else [f"in another muscle than {region(muscle)}"]
    wrong += [] if about(row.value, 84) else ["not about 84 %"]
    parts = {"size": abs(row.value), "region": region(row.region), "wrong": wrong}
    return {"value": row.value if here else np.nan, **parts}


def vessel_pressure(e: Evidence, of: str) -> Fact:
    """Return, of the runs' largest pressures in the vessels, the one nearest to a value, kPa."""
    values = {run_name(key): e.value(*key, "vessel", "pressure") for key in e.results}
    nearest = min(values.values(), key=lambda value: abs(abs(value) - float(of)))
    return {"value": nearest, "runs": values}


# --- relative changes by equation (3)


def extreme_change(e: Evidence, of: str) -> Fact:
    """Return the largest rise or fall of a maximum, %; NaN where it is in another cell."""
    kind, way, sockets, tissue, quantity, printed = of.split()
    e.need()
    rows = _both(e, kind)
    signed, size = rows.relative_change_pct, rows.magnitude_change_pct
    at = [rows.loc[each.idxmax() if way == "rise" else each.idxmin()] for each in (signed, size)]
    value = at[0].relative_change_pct
    here = at[0].socket in sockets.split("+")
    here = here and (at[0].tissue, at[0]["quantity"]) == (tissue, quantity)
    wrong = [] if here else ["another cell is the extreme"]
    wrong += [] if about_change(value, float(printed)) else ["not about the printed number"]
    cells = [f"{QUANTITIES[row['quantity']]} in {row.tissue}, {row.socket}" for row in at]
    return {
        "value": value if here else np.nan,
        "signed": value,
        "cell": cells[0],
        "size": at[1].magnitude_change_pct,
        "cell_of_size": cells[1],
        "wrong": wrong,
    }


def changes_of_several_hundred(e: Evidence, of: str) -> Fact:
    """Return the number of maxima that change by several hundred percent."""
    rows = _both(e)
    signed, size = rows.relative_change_pct.abs(), rows.magnitude_change_pct.abs()
    far = [int((each >= SEVERAL_HUNDRED_PCT).sum()) for each in (signed, size)]
    return {"value": far[0], "by_size": far[1], "n": len(rows), "largest": signed.max()}


def share_of_several_hundred(e: Evidence, of: str) -> Fact:
    """Return the share of all cells that change by several hundred percent."""
    rows = _changes(e)
    far = rows.relative_change_pct.abs() >= SEVERAL_HUNDRED_PCT
    at_combined = int(far[rows.site == "max_combined"].sum())
    parts = {"share": 100 * far.mean(), "far": far.sum(), "at_combined": at_combined}
    return {"value": far.mean(), "n": len(rows), **parts}


def sites_spread_more(e: Evidence, of: str) -> Fact:
    """Return whether changes at sites spread wider than those of maxima, stresses and strains."""
    sites, both = {}, {}
    for kind in OF:
        rows = _changes(e, kind)
        change, at_both = rows.relative_change_pct, rows.site == "max_both"
        sites[kind], both[kind] = change[~at_both].dropna(), change[at_both].dropna()
    wider = tuple(np.ptp(sites[kind]) > np.ptp(both[kind]) for kind in OF)
    return {"value": wider, "sites": sites, "both": both}


def changes_near(e: Evidence, of: str) -> Fact:
    """Return the share of the cells of Table 3 or 5 whose change is about the paper's."""
    e.need_sets()
    cells = e.compared_changes
    cells = cells[cells["quantity"].isin(OF[of])].dropna(subset="ours")
    near = sum(about_change(row.ours, row.paper) for row in cells.itertuples())
    return {
        "value": near / len(cells),
        "near": near,
        "n": len(cells),
        "flips": int(cells.sign_flip.sum()),
        "distance": (cells.ours - cells.paper).abs().median(),
    }


def both_directions(e: Evidence, of: str) -> Fact:
    """Return the numbers of maxima that rise and that fall in magnitude."""
    size = _both(e).magnitude_change_pct
    return {"value": (int((size > 0).sum()), int((size < 0).sum()))}


def median_change(e: Evidence, of: str) -> Fact:
    """Return the median change of the maxima's magnitude, %."""
    return {"value": _both(e).magnitude_change_pct.abs().median()}


# --- contact pressure


def _rise(e: Evidence, socket: str, quantity: str = PEAK) -> float:
    return relative_change(*(e.value(socket, name, "skin", quantity) for name in SETS))


def pressure_rise(e: Evidence, of: str) -> Fact:
    """Return the rise of the largest contact pressure with Combined in some sockets, %."""
    rises = {socket: _rise(e, socket) for socket in of.split("+")}
    means = {socket: _rise(e, socket, MEAN) for socket in rises}
    falls = [socket for socket in rises if rises[socket] <= 0 < means[socket]]
    why = "rises by another share"
    if falls:
        c10 = e.parameters["separate"]["fascia"].get("c10")
        why = f"in {', '.join(falls)} the mean rises, the largest falls: in Separate a fascia of "
        why += (
            f"C10 {c10:g} MPa concentrates pressure in peaks" if c10 else "another law is stiffer"
        )
    return {"value": tuple(rises.values()), "rises": rises, "means": means, "why": why}


def ranking_of_rises(e: Evidence, of: str) -> Fact:
    """Return the sockets by the rise of the largest contact pressure."""
    rises = {socket: _rise(e, socket) for socket in SOCKETS}
    order = sorted(rises, key=lambda socket: -rises[socket])
    ranked = order[0]
    for before, after in pairwise(order):
        ranked += f" {'>' if rises[before] > rises[after] else '='} {after}"
    return {"value": ranked, "rises": rises}


def _alike(values: dict[Key, float]) -> Fact:
    """Return the pairs of runs of one set or of one socket whose values are alike."""
    if len(values) < 2:
        raise NotChecked("needs two runs to compare")
    alike = [
        f"{'_'.join(a)} and {'_'.join(b)}"
        for a, b in combinations(values, 2)
        if (a[0] == b[0]) != (a[1] == b[1])
        and abs(relative_change(values[a], values[b])) <= DIFFERS_PCT
    ]
    return {"value": alike, "runs": {run_name(key): value for key, value in values.items()}}


def alike_pressures(e: Evidence, of: str) -> Fact:
    """Return the pairs of runs of one set or of one socket with one mean contact pressure."""
    return _alike({key: e.value(*key, "skin", MEAN) for key in e.results})


def alike_forces(e: Evidence, of: str) -> Fact:
    """Return the pairs of runs of one set or of one socket with one pressing force."""
    return _alike({key: each.checks.pressing_force_N_per_mm for key, each in e.results.items()})


def distance_of_peaks(e: Evidence, of: str) -> Fact:
    """Return the smallest distance of two sockets' largest contact pressures in one set, mm."""
    distances = [
        _distance(a, b)
        for name in SETS
        for a, b in combinations([e.row(socket, name, "skin", PEAK) for socket in SOCKETS], 2)
    ]
    return {"value": min(distances), "distances": np.array(distances)}


# --- damage thresholds


def _fascia(e: Evidence, socket: str, name: str) -> dict[str, float]:
    """Return AMP and shear strain of fascia: the paper mixes the two."""
    return {
        QUANTITIES[quantity]: abs(e.value(socket, name, "fascia", quantity)) for quantity in STRAINS
    }


def _largest_in_fascia(e: Evidence, name: str) -> dict[str, float]:
    return {socket: max(_fascia(e, socket, name).values()) for socket in SOCKETS}


def _muscle(e: Evidence, name: str) -> dict[str, float]:
    return {socket: abs(e.value(socket, name, "muscle", "shear_log_strain")) for socket in SOCKETS}


def largest_shear_strain(e: Evidence, of: str) -> Fact:
    """Return the largest shear strain of a set, %."""
    values = {
        f"{socket} {tissue}": abs(e.value(socket, of, tissue, "shear_log_strain"))
        for socket in SOCKETS
        for tissue in SUMMARY_TISSUES
    }
    where = max(values, key=lambda name: values[name])
    return {"value": values[where], "where": where}


def muscle_above(e: Evidence, of: str) -> Fact:
    """Return the sockets in which muscle's shear strain is above a value, in one set."""
    name, limit = of.split()
    values = _muscle(e, name)
    above = [socket for socket, value in values.items() if value > float(limit)]
    return {"value": above, "strains": values}


def largest_fascia_strain(e: Evidence, of: str) -> Fact:
    """Return the largest strain of fascia, %; NaN where a socket stays below its threshold."""
    sockets, name = of.split()
    strains = {socket: _fascia(e, socket, name) for socket in sockets.split("+")}
    largest = [max(values.values()) for values in strains.values()]
    value = max(largest) if min(largest) > FASCIA_LIMIT else np.nan
    size = "smaller" if max(largest) < 29 else "larger"
    return {"value": value, "strains": strains, "size": size}


def fascia_strains(e: Evidence, of: str) -> Fact:
    """Return the strains of fascia in a case, %."""
    strains = _fascia(e, *of.split())
    return {"value": tuple(strains.values()), "strains": strains}


def fascia_strain_in_hs(e: Evidence, of: str) -> Fact:
    """Return the largest strain of the separate fascia, %; NaN above its threshold or not in HS."""
    strains = _largest_in_fascia(e, "separate")
    where = max(strains, key=lambda socket: strains[socket])
    value = strains[where]
    wrong = [] if value < FASCIA_LIMIT else [f"above {FASCIA_LIMIT:g} %"]
    wrong += [] if where == "HS" else [f"largest in {where}"]
    here = not wrong
    c10 = e.parameters["separate"]["fascia"].get("c10")
    if not about(value, 18) and c10:
        wrong.append(f"C10 is {c10:g} MPa; the paper's stresses and strains need about 0.5")
    return {"value": value if here else np.nan, "strains": strains, "wrong": wrong}


def tissues_at_risk_differ(e: Evidence, of: str) -> Fact:
    """Return whether other tissues pass their thresholds in one set than in the other."""
    limits = e.thresholds
    at_risk = {
        material_set(name): [
            *(f"muscle {s}" for s, v in _muscle(e, name).items() if v > limits.muscle_shear_pct),
            *(
                f"fascia {s}"
                for s, v in _largest_in_fascia(e, name).items()
                if v > limits.fascia_strain_pct
            ),
        ]
        for name in SETS
    }
    separate, combined = at_risk.values()
    none = "no strain passes a threshold in either set"
    why = "the same tissues pass in both sets" if separate or combined else none
    return {"value": separate != combined, "at_risk": at_risk, "why": why}


# --- the calibration


def matched_curve(e: Evidence, of: str) -> Fact:
    """Return the forces with Table 1's combined law over Separate's, at every displacement.

    A law fitted here is close to Separate by construction, so it cannot decide.
    """
    found = e.checked_calibration()
    table1, fitted = (found.force[name] / found.force[SEPARATE] for name in (TABLE1, FITTED))
    near = sum(about(value, 1.0) for value in table1)
    parts = {"table1": table1, "fitted": fitted, "fit": found.fit, "near": near, "n": len(table1)}
    return {"value": tuple(table1), **parts}


def force_without_fascia(e: Evidence, of: str) -> Fact:
    """Return the forces with muscle's law in the fascia over the others, at every displacement."""
    force = e.checked_calibration().force
    over = {name: force[IGNORED] / force[name] for name in (SEPARATE, TABLE1, FITTED)}
    return {"value": tuple(np.concatenate(list(over.values()))), **over}


def deviation_without_fascia(e: Evidence, of: str) -> Fact:
    """Return whether ignoring fascia is further from Separate than both combined laws are."""
    found = e.checked_calibration()
    off = {name: found.deviation_pct(name) for name in (IGNORED, TABLE1, FITTED)}
    closer = off[IGNORED] > off[FITTED]
    why = "Table 1's law is as far off in this model" if closer else "even the fitted law is as far"
    return {"value": off[IGNORED] > max(off[TABLE1], off[FITTED]), **off, "why": why}


def cannot_be_repeated(e: Evidence, of: str) -> Fact:
    """Return why a claim cannot be checked."""
    raise NotChecked(of)
