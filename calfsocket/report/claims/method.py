"""Claims on loading, contact, analysis, and how outcomes are read."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calfsocket.postprocess.fields import TISSUES
from calfsocket.postprocess.quantities import UNITS
from calfsocket.report import names, published
from calfsocket.report.changes import relative_change
from calfsocket.report.claims.evidence import SOCKETS, SOFT_TISSUES, STRAINS, STRESSES, Evidence
from calfsocket.report.claims.registry import Finding, claim
from calfsocket.report.claims.tolerances import HALF_A_DIGIT, MOST, SAME
from calfsocket.report.results import MATERIAL_SETS, free_edges, of_case
from calfsocket.report.table import number

LOADS = ("load", "force", "weight", "moment", "gravity")
FRICTION = 0.4
NODES, CELLS = 5, 2


def _load_inputs(e: Evidence) -> list[str]:
    names = [*e.settings, *e.settings["contact"]]
    return [name for name in names if any(word in name for word in LOADS)]


@claim("C008")
def not_weight_bearing(e: Evidence) -> Finding:
    """Check for no load but the socket, at mid-calf."""
    loads = _load_inputs(e)
    return Finding(
        not loads and "mid-calf" in e.limb.title,
        f"mid-calf; no input of the study is a load ({', '.join(e.settings)})",
        "mid-calf, non-weight-bearing",
    )


@claim("C017")
def element(e: Evidence) -> Finding:
    """Check for quadratic displacement, linear pressure, plane strain.

    A displacement of two components at nodes and in a bubble of each cell, and three pressures a
    cell, add up to the unknowns of the run.
    """
    key = e.results.cases[0]
    fields = e.results.fields(*key)
    unknowns = 2 * (len(fields.points) + len(fields.cells)) + 3 * len(fields.cells)
    ours = e.results.run["cases"]["_".join(key)]["unknowns"]
    return Finding(
        ours == unknowns and fields.cells.shape[1] == 6,
        f"six-node triangles with a cubic bubble, linear pressure in each; {ours} unknowns",
        "CPE8H and CPE6H: quadratic, linear pressure, plane strain",
    )


@claim("C040")
def bare_socket(e: Evidence) -> Finding:
    """Check that the socket is one stiff material; no liner between it and the skin."""
    tissues = set(e.any_case().fields.region_tissues.values())
    others = tissues - set(SOFT_TISSUES) - {"bone", "socket"}
    law = e.laws["separate"]["socket"]
    return Finding(
        not others and law["law"] == "hencky",
        f"socket of one material, E = {law['e']:g} MPa; nothing between it and the skin",
        "stiff test socket, no liner",
    )


@claim("C041")
def gradual_overclosure(e: Evidence) -> Finding:
    """Check that the overclosure is the only load and is resolved over increments."""
    counts = []
    for key in e.results.cases:
        rows = of_case(e.results.steps, key)
        loads = rows.load[rows.converged]
        if not (loads.is_monotonic_increasing and loads.iloc[-1] == 1):
            return Finding(False, f"{'_'.join(key)} ends at load {loads.iloc[-1]:g}", "gradual", "")
        counts.append(len(loads))
    return Finding(
        min(counts) > 1 and not _load_inputs(e),
        f"gap closed in proportion, {min(counts)} to {max(counts)} increments",
        "gradually over increments",
    )


@claim("C043")
def surface_to_surface(e: Evidence) -> Finding:
    """Check that contact is integrated over the skin and sees the shape of both surfaces."""
    case = e.any_case()
    edges = free_edges(case.fields, case.fields.tissue == TISSUES.index("skin"))
    points = len(case.contact.arc_mm) / len(edges)
    return Finding(
        points >= 2,
        f"integrated over the skin's curved edges, {points:g} points each, projected on the "
        "socket's curved edges",
        "surface-to-surface",
    )


@claim("C044")
def friction(e: Evidence) -> Finding:
    """Check that the coefficient of friction is 0.4."""
    ours = e.settings["contact"]["friction"]
    return Finding(
        abs(ours - FRICTION) < SAME, f"{ours:g}", f"{FRICTION:g}", "by choice of this study"
    )


@claim("C047")
def analysis(e: Evidence) -> Finding:
    """Check for plane strain and an implicit solution."""
    steps = e.results.steps
    sigma33 = np.abs(e.any_case().fields.stress[..., 2]).max()
    return Finding(
        bool((steps.newton_iterations > 0).any() and sigma33 > 0),
        f"plane strain, implicit: {int(steps.newton_iterations.sum())} Newton iterations; "
        f"dolfinx {e.results.run['versions']['fenics-dolfinx']}",
        "plane strain, Abaqus/Standard",
    )


@claim("C048")
def six_runs(e: Evidence) -> Finding:
    """Check for three sockets times two sets."""
    e.need_all()
    n = len(e.results.cases)
    return Finding(n == len(SOCKETS) * len(MATERIAL_SETS), f"{n} runs", "6 runs")


@claim("C049")
def outcomes(e: Evidence) -> Finding:
    """Check for contact pressure, and Mises, shear, AMP and shear strain of each tissue."""
    summary = e.results.summary
    found = set(zip(summary.tissue, summary.outcome, strict=True))
    wanted = {(tissue, name) for tissue in SOFT_TISSUES for name in (*STRESSES, *STRAINS)}
    wanted.add(("skin", "contact_pressure_max"))
    return Finding(
        wanted <= found,
        f"{len(wanted & found)} of {len(wanted)} quantities, shear strain as engineering shear",
        "5 outcomes, per tissue",
    )


@claim("C050")
def extraction_rule(e: Evidence) -> Finding:
    """Check that every maximum is held by at least five nodes and two neighbouring elements."""
    held = total = 0
    for key in e.results.cases:
        case = e.results.case(*key)
        middles = case.fields.points[case.pairs.edge_node]
        tissue = case.fields.tissue[case.pairs.cells[:, 0]]
        for row in _maxima(e, key):
            distance = np.linalg.norm(middles - (row.x_mm, row.y_mm), axis=1)
            distance[tissue != TISSUES.index(row.tissue)] = np.inf
            pair = np.argmin(distance)
            nodal = case.outcomes.nodal[row.outcome].ravel()[case.pairs.corner[pair]]
            mean = case.outcomes.mean[row.outcome][case.pairs.cells[pair]]
            level = abs(row.value) * (1 - SAME)
            nodes = np.count_nonzero(_along(row, nodal) >= level)
            held += nodes >= NODES and bool((_along(row, mean) >= level).all())
            total += 1
    return Finding(
        held == total,
        f"{held} of {total} maxima are held by {NODES} nodes and {CELLS} neighbours",
        f"at least {NODES} nodes and {CELLS} neighbouring elements",
    )


def _maxima(e: Evidence, key: tuple[str, str]) -> Iterator[Any]:
    """Rows of the summary that come from the section's fields."""
    rows = of_case(e.results.summary, key)
    return rows[rows.outcome.isin(UNITS)].itertuples()


def _along(row: Any, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Turn values so that a maximum's own direction is positive."""
    if row.outcome == "amp_log_strain":
        return np.abs(values)
    return np.sign(row.value) * values


@claim("C100")
def spikes_left_out(e: Evidence) -> Finding:
    """Check that single nodal extremes do not count."""
    spikes = []
    for key in e.results.cases:
        case = e.results.case(*key)
        for row in _maxima(e, key):
            inside = case.fields.tissue == TISSUES.index(row.tissue)
            largest = np.abs(case.outcomes.nodal[row.outcome][inside]).max()
            spikes.append(largest / abs(row.value))
    return Finding(
        min(spikes) >= 1 - SAME,
        f"the largest nodal value is {number(np.median(spikes))} (median) to "
        f"{number(max(spikes))} times the maximum reported",
        "left out",
        "a maximum is larger than every node's value",
    )


@claim("C051")
def equation_3(e: Evidence) -> Finding:
    """Check that equation (3) on Tables 2 and 4 gives the rows "Max both" of Tables 3 and 5."""
    printed = published.changes()
    printed = printed[printed.site == "max_both"]
    at = published.maxima().set_index(["tissue", "outcome", "socket", "material_set"]).printed
    misses = []
    for row in printed.itertuples():
        cell = (row.tissue, row.outcome, row.socket)
        change = relative_change(*(at[(*cell, name)] for name in MATERIAL_SETS))
        if abs(change - row.printed) > HALF_A_DIGIT:
            misses.append(
                f"{row.tissue} {row.socket} {names.OUTCOMES[row.outcome]}, {change:.0f} %"
            )
    n = len(printed)
    return Finding(
        n - len(misses) >= MOST * n,
        f"{n - len(misses)} of {n} cells; not {'; '.join(misses)}",
        f"all {n} cells",
    )


@claim("C082")
def bold_range_limits(e: Evidence) -> Finding:
    """Check that bold marks the smallest and largest magnitudes of Tables 2 and 4."""
    right, limits = 0, 0
    for _, row in published.maxima().groupby(["tissue", "outcome"]):
        magnitude = row.printed.abs()
        for limit in (magnitude.idxmin(), magnitude.idxmax()):
            limits += 1
            right += row.bold[limit] == "1"
    return Finding(right >= MOST * limits, f"{right} of {limits} limits are bold", "all")
