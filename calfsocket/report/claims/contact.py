"""Claims on the pressure between skin and socket."""

from itertools import combinations, pairwise

import numpy as np

from calfsocket.postprocess.quantities import RUNNING_MEAN_MM
from calfsocket.report import names, published
from calfsocket.report.changes import relative_change
from calfsocket.report.claims.evidence import SOCKETS, Evidence, NotChecked
from calfsocket.report.claims.registry import Finding, claim
from calfsocket.report.claims.tolerances import DIFFERS_PCT, SITES_DIFFER_MM, about_change
from calfsocket.report.results import MATERIAL_SETS
from calfsocket.report.table import change, number

PEAK, MEAN = "contact_pressure_max", "contact_pressure_mean"


def _rise(e: Evidence, socket: str, outcome: str = PEAK) -> float:
    return relative_change(*(e.value(socket, name, "skin", outcome) for name in MATERIAL_SETS))


def _differ(what: str, unit: str, paper: str, values: dict[tuple[str, str], float]) -> Finding:
    """Find that values differ between any two runs of one set or of one socket."""
    if len(values) < 2:
        raise NotChecked("needs two runs to compare")
    alike = [
        f"{'_'.join(a)} and {'_'.join(b)}"
        for a, b in combinations(values, 2)
        if (a[0] == b[0]) != (a[1] == b[1])
        and abs(relative_change(values[a], values[b])) <= DIFFERS_PCT
    ]
    runs = ", ".join(f"{s} {names.SETS[m]} {number(v)}" for (s, m), v in values.items())
    return Finding(not alike, f"{what} {runs} {unit}", paper, f"alike: {', '.join(alike)}")


@claim("C005")
def pressure_differs(e: Evidence) -> Finding:
    """Check that contact pressure differs between sets and sockets."""
    means = {key: e.value(*key, "skin", MEAN) for key in e.results.cases}
    return _differ("mean", "kPa", "differs", means)


@claim("C105")
def force_differs(e: Evidence) -> Finding:
    """Check that contact forces differ between sets and sockets."""
    cases = e.results.run["cases"]
    forces = {key: cases["_".join(key)]["pressing_force_N_per_mm"] for key in e.results.cases}
    return _differ("pressing force", "N/mm", "differ (no force is printed)", forces)


@claim("C071")
def maximum_rises(e: Evidence) -> Finding:
    """Check that the largest contact pressure rises with Combined in all sockets."""
    rises = {socket: _rise(e, socket) for socket in SOCKETS}
    means = {socket: _rise(e, socket, MEAN) for socket in SOCKETS}
    return Finding(
        all(rise > 0 for rise in rises.values()),
        f"{_list(rises)} (means {_list(means)})",
        "rises in all three",
        _why(e, rises, means),
    )


def _why(e: Evidence, rises: dict[str, float], means: dict[str, float]) -> str:
    """Say how peaks and means part."""
    falls = [socket for socket in rises if rises[socket] <= 0 < means[socket]]
    if not falls:
        return "rises by another share"
    c10 = e.laws["separate"]["fascia"]["c10"]
    return (
        f"in {', '.join(falls)} the mean rises, the largest falls: in Separate a fascia of C10 "
        f"{c10:g} MPa gathers pressure in peaks"
    )


def _list(values: dict[str, float]) -> str:
    return ", ".join(f"{name} {change(value)} %" for name, value in values.items())


@claim("C072", socket="TC")
@claim("C073", socket="TSB")
@claim("C074", socket="HS")
def maximum_rises_by(e: Evidence, socket: str) -> Finding:
    """Check that the largest contact pressure rises by a printed percentage."""
    paper = published.pressure().set_index(["outcome", "socket"]).printed[(PEAK, socket)]
    ours, mean = _rise(e, socket), _rise(e, socket, MEAN)
    return Finding(
        about_change(ours, paper),
        f"{change(ours)} % (mean {change(mean)} %)",
        f"{change(paper)} %",
        _why(e, {socket: ours}, {socket: mean}),
    )


@claim("C075")
def ranking_of_rises(e: Evidence) -> Finding:
    """Check that the rise ranks TC > TSB > HS."""
    rises = {socket: _rise(e, socket) for socket in SOCKETS}
    order = sorted(rises, key=lambda socket: -rises[socket])
    return Finding(
        all(rises[a] > rises[b] for a, b in pairwise(SOCKETS)),
        _list(rises),
        "TC > TSB > HS",
        f"it ranks {' > '.join(order)}",
    )


@claim("C076")
def site_depends_on_socket(e: Evidence) -> Finding:
    """Check that the site of the largest contact pressure depends on the socket."""
    distances = []
    for name in MATERIAL_SETS:
        rows = [e.row(socket, name, "skin", PEAK) for socket in SOCKETS]
        distances += [np.hypot(a.x_mm - b.x_mm, a.y_mm - b.y_mm) for a, b in combinations(rows, 2)]
    return Finding(
        min(distances) > SITES_DIFFER_MM,
        f"sites of two sockets are {number(min(distances))} to {number(max(distances))} mm apart",
        "differs",
        "two sockets press hardest at the same place",
    )


@claim("C077")
def spikes_excluded(e: Evidence) -> Finding:
    """Check that spikes of contact pressure at single nodes do not count."""
    ratios, points = [], []
    for key in e.results.cases:
        line = e.results.case(*key).contact
        ratios.append(line.pressure_kPa.max() / e.value(*key, "skin", PEAK))
        points.append(RUNNING_MEAN_MM / line.weight_mm.max())
    return Finding(
        min(points) > 2 and min(ratios) >= 1,
        f"{RUNNING_MEAN_MM:g} mm running mean over at least {min(points):.0f} points; the highest "
        f"point has {number(max(ratios))} times the maximum reported",
        "single-node spikes excluded",
    )
