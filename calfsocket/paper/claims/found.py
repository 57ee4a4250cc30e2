"""Facts on results: maxima, what merging changes, contact pressure, damage, the calibration."""

from collections.abc import Mapping
from itertools import combinations, pairwise
from typing import Any

import numpy as np
import pandas as pd

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


def both(e: Evidence, of: str = "") -> pd.DataFrame:
    """Return changes of each set's own maximum."""
    rows = _changes(e, of)
    return rows[rows.site == "max_both"]


def maxima_that_differ(e: Evidence) -> Fact:
    """Return the share of maxima that differ in magnitude; 0 where a tissue has none."""
    rows = both(e)
    differ = rows.magnitude_change_pct.abs() > DIFFERS_PCT
    same = [f"{r.tissue} {r.socket} {r.quantity}" for r in rows[~differ].itertuples()]
    every = (differ.groupby(rows.tissue).mean() > 0).all()
    share = differ.mean() if every else 0.0
    return {"value": share, "differ": differ.sum(), "n": len(rows), "same": same}


def _distance(a: Any, b: Any) -> float:
    return float(np.hypot(a.x_mm - b.x_mm, a.y_mm - b.y_mm))


def tissues_at_the_same_site(e: Evidence) -> Fact:
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


def maxima_vary(e: Evidence) -> Fact:
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


def vessel_pressures(e: Evidence) -> dict[str, float]:
    """Return the largest pressure in the vessels of each run, kPa."""
    return {run_name(key): e.value(*key, "vessel", "pressure") for key in e.results}


def nearest(e: Evidence, values: Mapping[str, float], to: float) -> float:
    """Return the value whose magnitude is nearest to another."""
    return min(values.values(), key=lambda value: abs(abs(value) - to))


# --- relative changes by equation (3)


def extreme_change(e: Evidence, of: str) -> Fact:
    """Return the largest rise or fall of a maximum, %; NaN where it is in another cell."""
    kind, way, sockets, tissue, quantity, printed = of.split()
    e.need()
    rows = both(e, kind)
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


def sites_spread_more(e: Evidence) -> Fact:
    """Return whether changes at sites spread wider than those of maxima, stresses and strains."""
    sites, both = {}, {}
    for kind in OF:
        rows = _changes(e, kind)
        change, at_both = rows.relative_change_pct, rows.site == "max_both"
        sites[kind], both[kind] = change[~at_both].dropna(), change[at_both].dropna()
    wider = all(np.ptp(sites[kind]) > np.ptp(both[kind]) for kind in OF)
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


def several(e: Evidence, site: str = "") -> "pd.Series[bool]":
    """Return whether changes, those at a site say, are of several hundred percent."""
    rows = _changes(e)
    return rows.relative_change_pct[rows.site.str.startswith(site)].abs() >= SEVERAL_HUNDRED_PCT


# --- contact pressure


def rises(e: Evidence, *sockets: str, quantity: str = PEAK) -> dict[str, float]:
    """Return the rise of a contact pressure, the largest by default, with Combined, %."""
    return {
        socket: relative_change(*(e.value(socket, name, "skin", quantity) for name in SETS))
        for socket in sockets
    }


def why_of_rises(e: Evidence, found: Mapping[str, float]) -> str:
    """Return why the largest contact pressure does not rise as in the paper."""
    means = rises(e, *found, quantity=MEAN)
    falls = [socket for socket in found if found[socket] <= 0 < means[socket]]
    if not falls:
        return "rises by another share"
    c10 = e.parameters["separate"]["fascia"].get("c10")
    stiff = f"C10 {c10:g} MPa concentrates pressure in peaks" if c10 else "another law is stiffer"
    where = ", ".join(falls)
    return f"in {where} the mean rises, the largest falls: in Separate a fascia of {stiff}"


def ranking(e: Evidence, values: Mapping[str, float]) -> str:
    """Return names by their values, the largest first."""
    order = sorted(values, key=lambda name: -values[name])
    ranked = order[0]
    for before, after in pairwise(order):
        ranked += f" {'>' if values[before] > values[after] else '='} {after}"
    return ranked


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


def alike_pressures(e: Evidence) -> Fact:
    """Return the pairs of runs of one set or of one socket with one mean contact pressure."""
    return _alike({key: e.value(*key, "skin", MEAN) for key in e.results})


def alike_forces(e: Evidence) -> Fact:
    """Return the pairs of runs of one set or of one socket with one pressing force."""
    return _alike({key: each.checks.pressing_force_N_per_mm for key, each in e.results.items()})


def distance_of_peaks(e: Evidence) -> Fact:
    """Return the smallest distance of two sockets' largest contact pressures in one set, mm."""
    distances = [
        _distance(a, b)
        for name in SETS
        for a, b in combinations([e.row(socket, name, "skin", PEAK) for socket in SOCKETS], 2)
    ]
    return {"value": min(distances), "distances": np.array(distances)}


# --- damage thresholds


def fascia(e: Evidence, socket: str, name: str) -> dict[str, float]:
    """Return AMP and shear strain of fascia, %: the paper mixes the two."""
    return {
        QUANTITIES[quantity]: abs(e.value(socket, name, "fascia", quantity)) for quantity in STRAINS
    }


def _largest_in_fascia(e: Evidence, name: str) -> dict[str, float]:
    """Return the larger of the two in every socket, in one set, %."""
    return {socket: max(fascia(e, socket, name).values()) for socket in SOCKETS}


def muscle(e: Evidence, name: str) -> dict[str, float]:
    """Return the shear strain of muscle in every socket, in one set, %."""
    return {socket: abs(e.value(socket, name, "muscle", "shear_log_strain")) for socket in SOCKETS}


def above(e: Evidence, values: Mapping[str, float], limit: float) -> list[str]:
    """Return the names of the values above a limit."""
    return [name for name, value in values.items() if value > limit]


def shear_strains(e: Evidence, name: str) -> "pd.Series[float]":
    """Return the shear strain of every socket and tissue in a set, %."""
    return pd.Series(
        {
            f"{socket} {tissue}": abs(e.value(socket, name, tissue, "shear_log_strain"))
            for socket in SOCKETS
            for tissue in SUMMARY_TISSUES
        }
    )


def largest_fascia_strain(e: Evidence, name: str, *sockets: str) -> Fact:
    """Return the largest strain of fascia, %; NaN where a socket stays below its threshold."""
    strains = {socket: fascia(e, socket, name) for socket in sockets}
    largest = [max(values.values()) for values in strains.values()]
    value = max(largest) if min(largest) > FASCIA_LIMIT else np.nan
    size = "smaller" if max(largest) < 29 else "larger"
    return {"value": value, "strains": strains, "size": size}


def fascia_strain_in_hs(e: Evidence) -> Fact:
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


def at_risk(e: Evidence) -> dict[str, list[str]]:
    """Return the tissues and sockets in which a threshold is passed, in each set."""
    limits = e.thresholds
    return {
        material_set(name): [
            *(f"muscle {each}" for each in above(e, muscle(e, name), limits.muscle_shear_pct)),
            *(
                f"fascia {each}"
                for each in above(e, _largest_in_fascia(e, name), limits.fascia_strain_pct)
            ),
        ]
        for name in SETS
    }


# --- what cannot be repeated


def not_checked(e: Evidence, why: str) -> Fact:
    """Refuse a check."""
    raise NotChecked(why)
