"""Facts on what a study is given: tissues, laws, geometry, mesh, contact, how maxima are read."""

from collections.abc import Iterator

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from calfsocket.meshes.curves import ClosedCurve
from calfsocket.paper import comparison, published
from calfsocket.paper.claims.rules import Fact, fact
from calfsocket.paper.claims.tolerances import HALF_A_DIGIT, SAME
from calfsocket.paper.evidence import (
    SOCKETS,
    SOFT_TISSUES,
    STRAINS,
    STRESSES,
    Evidence,
    NotChecked,
)
from calfsocket.postprocess.contact_line import RUNNING_MEAN_MM
from calfsocket.postprocess.fields import TISSUES, SectionFields
from calfsocket.postprocess.quantities import SUMMARY_TISSUES, UNITS, Maximum, Quantities
from calfsocket.postprocess.thresholds import gauss_areas, tissue_area
from calfsocket.report.changes import SETS, relative_change
from calfsocket.report.names import QUANTITIES, material_set
from calfsocket.report.table import number

LIMB_TISSUES = ("skin", "fat", "fascia", "muscle", "bone", "vessel")
POISSON_RATIO = 0.495
LOADS = ("load", "force", "weight", "moment", "gravity")
NOT_MODELLED = ("nerve", "lymph")
NODES, CELLS = 5, 2


# --- tissues and laws


@fact
def materials_and_sockets(e: Evidence, of: str) -> Fact:
    """Return materials of the limb in each set, and sockets."""
    counts = [
        len({repr(e.laws[name][tissue]) for tissue in LIMB_TISSUES})
        for name in ("separate", "combined")
    ]
    n = len(e.sockets)
    text = f"{counts[0]} materials Separate, {counts[1]} Combined; {n} sockets"
    return Fact(f"{counts[0]} {counts[1]} {n}", text)


@fact
def nonlinear_with_friction(e: Evidence, of: str) -> Fact:
    """Return whether laws are nonlinear and there is friction."""
    laws = {law["law"] for law in e.laws["separate"].values()}
    friction = e.settings["friction"]
    return Fact(
        {"ogden", "yeoh"} <= laws and friction > 0,
        f"{', '.join(sorted(laws))} at large strain; friction {friction:g}",
        "this study has no friction" if friction == 0 else "",
    )


@fact
def laws_that_differ(e: Evidence, of: str) -> Fact:
    """Return tissues whose law differs between the sets, and the laws of muscle and fascia."""
    separate, combined = e.laws["separate"], e.laws["combined"]
    differ = ", ".join(sorted(name for name in separate if separate[name] != combined[name]))
    shared = "one" if combined["muscle"] == combined["fascia"] else "two"
    text = f"{differ}; {shared} in Combined"
    return Fact(text, f"laws that differ: {text}")


@fact
def law_of_each_tissue(e: Evidence, of: str) -> Fact:
    """Return kind of law of every tissue, and number of Ogden terms."""
    laws = {tissue: e.laws["separate"][tissue] for tissue in LIMB_TISSUES}
    terms = {len(law["mu"]) for law in laws.values() if law["law"] == "ogden"}
    text = ", ".join(f"{tissue} {law['law']}" for tissue, law in laws.items())
    return Fact(f"{text}; terms {terms}", f"{text}; hencky is linear in logarithmic strain")


@fact
def parameters(e: Evidence, of: str) -> Fact:
    """Return relative deviation of a material's parameters from Table 1."""
    rows = comparison.materials(e.laws)
    rows = rows[rows.material == of]
    off = ((rows.ours - rows.paper) / rows.paper).abs()
    words = [f"{r.symbol} {r.ours:.4g} {r.unit}".rstrip() for r in rows.itertuples()]
    why = [
        f"{r.symbol} is {r.ours:.4g} {r.unit} by choice of this study"
        for r in rows[~(off <= SAME)].itertuples()
    ]
    return Fact(tuple(off), ", ".join(words), "; ".join(why))


@fact
def d1_of_poisson_ratio(e: Evidence, of: str) -> Fact:
    """Return relative deviation of D1 = 3 (1 - 2 nu) / (mu1 (1 + nu)) from those of the laws."""
    laws = [e.laws["separate"][tissue] for tissue in ("skin", "fat", "muscle")]
    laws.append(e.laws["combined"]["muscle"])
    factor = 3 * (1 - 2 * POISSON_RATIO) / (1 + POISSON_RATIO)
    off = max(abs(factor / law["mu"][0] / law["d1"] - 1) for law in laws)
    return Fact(off, f"recomputed D1 differ by at most {100 * off:.2f} %")


@fact
def ogden_prefactor(e: Evidence, of: str) -> Fact:
    """Return Ogden's form, which the paper's own stresses and strains decide on.

    At constant volume and 45 degrees to the principal axes S12 = (2 mu/alpha) sinh(alpha LE12/2)
    in Abaqus's form, alpha/2 times as much in that of equation (1). Tables 2 and 4 of the paper
    give pairs of S12 and LE12 for skin and muscle.
    """
    at = published.maximum()
    abaqus, printed = [], []
    for tissue, name in (("skin", "separate"), ("skin", "combined"), ("muscle", "separate")):
        law = e.laws[name][tissue]
        mu, alpha = 1e3 * law["mu"][0], law["alpha"][0]
        for socket in SOCKETS:
            shear = abs(at[(tissue, "shear_log_strain", socket, name)]) / 100
            stress = abs(at[(tissue, "shear_stress", socket, name)])
            ratio = stress / (2 * mu / alpha * np.sinh(alpha * shear / 2))
            abaqus.append(ratio)
            printed.append(ratio / (alpha / 2))
    form = e.laws["separate"]["skin"]["form"]
    fits = abs(np.log(np.median(printed))) < abs(np.log(np.median(abaqus)))
    return Fact(
        form if fits else "refuted by the paper's tables",
        f"form solved: {form}; the paper's own stresses are {np.median(abaqus):.2f} of those of "
        f"2 mu/alpha^2 and {np.median(printed):.2f} of those of mu/alpha (medians)",
    )


@fact
def fascia_is_incompressible(e: Evidence, of: str) -> Fact:
    """Return whether the separate fascia has no D."""
    law = e.laws["separate"]["fascia"]
    return Fact(law["law"] == "yeoh" and not law.get("d1"), "incompressible")


@fact
def fascia_is_modelled(e: Evidence, of: str) -> Fact:
    """Return whether fascia is in both sets, in none with muscle's own material."""
    fascia = [region for region in e.limb.regions if region.tissue == "fascia"]
    area = sum(region.area for region in fascia)
    muscle = e.laws["separate"]["muscle"]
    ignored = any(laws["fascia"] == muscle for laws in e.laws.values())
    text = f"{len(fascia)} regions, {number(area)} mm², in both sets"
    return Fact(bool(fascia) and not ignored, text)


# --- section, sockets, mesh


@fact
def illustration(e: Evidence, of: str) -> Fact:
    """Return whether the section follows the illustration, by its title."""
    title = e.limb.title
    return Fact("just above mid-calf" in title and "not traced" not in title, title)


@fact
def segmented_tissues(e: Evidence, of: str) -> Fact:
    """Return tissues with separate muscles; no nerves, no lymphatics."""
    regions = e.limb.regions
    tissues = sorted({region.tissue for region in regions})
    muscles = sum(region.tissue == "muscle" for region in regions)
    ignored = not any(word in region.name for region in regions for word in NOT_MODELLED)
    return Fact(
        tissues == sorted(LIMB_TISSUES) and muscles > 1 and ignored,
        f"{', '.join(tissues)}; {muscles} separate muscles; no nerve, no lymphatic vessel",
    )


@fact
def regions_and_tissues(e: Evidence, of: str) -> Fact:
    """Return number of regions, of tissues, and of soft ones."""
    tissues = {region.tissue for region in e.limb.regions}
    text = f"{len(e.limb.regions)} regions, {len(tissues)} tissues, {len(tissues - {'bone'})} soft"
    return Fact(text, text)


@fact
def sockets(e: Evidence, of: str) -> Fact:
    """Return the sockets, of different shapes."""
    shapes = {repr(socket) for socket in e.sockets.values()}
    text = ", ".join(e.sockets)
    same = "" if len(shapes) == len(SOCKETS) else ", not all different"
    return Fact(text + same, f"{text}; outlines of our own")


@fact
def area_lost(e: Evidence, of: str) -> Fact:
    """Return share of the limb's area that a socket takes, or that each of them does."""
    if of:
        return Fact(e.area_lost[of], f"{100 * e.area_lost[of]:.3f} %")
    words = ", ".join(f"{name} {100 * value:.2f} %" for name, value in e.area_lost.items())
    return Fact(tuple(e.area_lost.values()), f"area lost: {words}")


@fact
def wall(e: Evidence, of: str) -> Fact:
    """Return thickness of the sockets' walls, mm; the one that differs most from the mean."""
    walls = [socket.wall_thickness for socket in e.sockets.values()]
    worst = max(walls, key=lambda wall: abs(wall - sum(walls) / len(walls)))
    return Fact(worst, ", ".join(f"{wall:g} mm" for wall in dict.fromkeys(walls)))


@fact
def bare_socket(e: Evidence, of: str) -> Fact:
    """Return whether the socket is one stiff material, without a liner between it and the skin."""
    tissues = set(e.any_case().fields.region_tissues.values())
    law = e.laws["separate"]["socket"]
    return Fact(
        not tissues - {*SOFT_TISSUES, "bone", "socket"} and law["law"] == "hencky",
        f"socket of one material, E = {law['e']:g} MPa; nothing between it and the skin",
    )


def radial_overlap(skin: ClosedCurve, inner: ClosedCurve) -> NDArray[np.float64]:
    """Skin radius less that of the socket's inner face at all polar angles, mm, (720,)."""
    angle = np.radians(np.arange(0, 360, 0.5))

    def radius(curve: ClosedCurve) -> NDArray[np.float64]:
        points = curve.evaluate(curve.sample(0.1))
        at = np.arctan2(points[:, 1], points[:, 0])
        order = np.argsort(at)
        return np.interp(angle, at[order], np.linalg.norm(points[order], axis=1), period=2 * np.pi)

    return radius(skin) - radius(inner)


@fact
def overlaps(e: Evidence, of: str) -> Fact:
    """Return deepest overlap of limb and socket before contact, mm."""
    depth = {name: radial_overlap(e.skin, face) for name, face in e.inner_faces.items()}
    words = [f"{name} {d.min():.2f} to {d.max():.2f} mm" for name, d in depth.items()]
    return Fact(tuple(d.max() for d in depth.values()), ", ".join(words))


def _in_limb(fields: SectionFields) -> NDArray[np.bool_]:
    return fields.tissue != TISSUES.index("socket")


@fact
def elements(e: Evidence, of: str) -> Fact:
    """Return fewest and most elements of the limb, or of a socket."""
    inside = [_in_limb(result.fields) for result in e.results.values()]
    counts = [int((cells if of == "limb" else ~cells).sum()) for cells in inside]
    low, high = min(counts), max(counts)
    return Fact(
        (low, high),
        f"{low}" if low == high else f"{low} to {high}",
        f"the mesh size is '{e.settings['size']}'",
    )


@fact
def unknowns(e: Evidence, of: str) -> Fact:
    """Return whether the unknowns are those of quadratic displacement and linear pressure.

    A displacement of two components at nodes and in a bubble of each cell, and three pressures a
    cell, add up to the unknowns of the run.
    """
    result = e.any_case()
    cells = len(result.fields.cells)
    expected = 2 * (len(result.fields.points) + cells) + 3 * cells
    return Fact(
        result.checks.unknowns == expected and result.fields.cells.shape[1] == 6,
        "six-node triangles with a cubic bubble, linear pressure in each; "
        f"{result.checks.unknowns} unknowns",
    )


@fact
def largest_area(e: Evidence, of: str) -> Fact:
    """Return the tissue with the largest area."""
    fields = e.any_case().fields
    area = {tissue: tissue_area(fields, tissue) for tissue in LIMB_TISSUES}
    order = sorted(area, key=lambda tissue: -area[tissue])
    return Fact(order[0], ", ".join(f"{tissue} {number(area[tissue])} mm²" for tissue in order))


@fact
def shared_nodes(e: Evidence, of: str) -> Fact:
    """Return whether the limb is one connected mesh, without two nodes in one place."""
    fields = e.any_case().fields
    cells = fields.cells[_in_limb(fields)]
    nodes, local = np.unique(cells, return_inverse=True)
    local = local.reshape(cells.shape)
    links = coo_array(
        (np.ones(5 * len(cells)), (np.repeat(local[:, 0], 5), local[:, 1:].ravel())),
        shape=(len(nodes), len(nodes)),
    )
    pieces, _ = connected_components(links, directed=False)
    places = len(np.unique(fields.points[nodes].round(9), axis=0))
    return Fact(
        pieces == 1 and places == len(nodes),
        f"{len(nodes)} nodes in {places} places, {pieces} connected piece",
    )


@fact
def refined_at_thin_fascia(e: Evidence, of: str) -> Fact:
    """Return element size in fascia at the bones over that in muscle."""
    fields = e.any_case().fields
    size = np.sqrt(gauss_areas(fields).sum(axis=1) * 4 / np.sqrt(3))  # side of an equal triangle
    bone = fields.cells[fields.tissue == TISSUES.index("bone")]
    at_bone = np.isin(fields.cells, bone).any(axis=1)
    thin = at_bone & (fields.tissue == TISSUES.index("fascia"))
    if not thin.any():
        raise NotChecked("no element of fascia lies at a bone")
    fine = float(np.median(size[thin]))
    coarse = float(np.median(size[fields.tissue == TISSUES.index("muscle")]))
    return Fact(
        fine / coarse,
        f"median side {number(fine)} mm in fascia at the bones, {number(coarse)} mm in muscle",
    )


@fact
def other_meshes(e: Evidence, of: str) -> Fact:
    """Return runs whose mesh of the limb is not that of the first."""
    if len(e.results) < 2:
        raise NotChecked("needs two runs to compare")
    meshes = []
    for result in e.results.values():
        fields = result.fields
        nodes, local = np.unique(fields.cells[_in_limb(fields)], return_inverse=True)
        meshes.append((fields.points[nodes], local.ravel()))
    differ = ", ".join(
        "_".join(key)
        for key, mesh in zip(e.results, meshes, strict=True)
        if not all(np.array_equal(a, b) for a, b in zip(meshes[0], mesh, strict=True))
    )
    text = f"not the same in {differ}" if differ else f"one limb mesh in {len(meshes)} runs"
    return Fact(differ, text, f"differs from {'_'.join(next(iter(e.results)))}: {differ}")


# --- loading, contact, analysis


def _load_inputs(e: Evidence) -> list[str]:
    return [name for name in e.settings if any(word in name for word in LOADS)]


@fact
def not_weight_bearing(e: Evidence, of: str) -> Fact:
    """Return whether there is no load but the socket, at mid-calf."""
    text = f"mid-calf; no input of the study is a load ({', '.join(e.settings)})"
    return Fact(not _load_inputs(e) and "mid-calf" in e.limb.title, text)


@fact
def gradual_overclosure(e: Evidence, of: str) -> Fact:
    """Return whether the overclosure is the only load and is resolved over increments."""
    counts = []
    for key, result in e.results.items():
        loads = result.steps.load[result.steps.converged]
        if not (loads.is_monotonic_increasing and loads.iloc[-1] == 1):
            return Fact(False, f"{'_'.join(key)} ends at load {loads.iloc[-1]:g}")
        counts.append(len(loads))
    return Fact(
        min(counts) > 1 and not _load_inputs(e),
        f"gap closed in proportion, {min(counts)} to {max(counts)} increments",
    )


@fact
def contact_points(e: Evidence, of: str) -> Fact:
    """Return points of contact on an edge of the skin."""
    result = e.any_case()
    edges = free_edges(result.fields, result.fields.tissue == TISSUES.index("skin"))
    points = len(result.line.arc_mm) / len(edges)
    return Fact(
        points,
        f"integrated over the skin's curved edges, {points:g} points each, projected on the "
        "socket's curved edges",
    )


@fact
def friction(e: Evidence, of: str) -> Fact:
    """Return coefficient of friction."""
    return Fact(e.settings["friction"], f"{e.settings['friction']:g}")


@fact
def supports(e: Evidence, of: str) -> Fact:
    """Return whether the tibia's inner boundary is fixed and the fibula free."""
    fields = e.any_case().fields
    ids = {name: region for region, name in fields.region_names.items()}
    moved = np.linalg.norm(fields.displacement, axis=1)
    tibia = moved[free_edges(fields, fields.region == ids["tibia"])].max()
    fibula = moved[fields.cells[fields.region == ids["fibula"]]].mean()
    text = f"tibia's inner boundary moves {tibia:g} mm, the fibula {number(fibula)} mm"
    return Fact(tibia == 0 and fibula > 0, text)


def free_edges(fields: SectionFields, chosen: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return ends and middle of the edges of the chosen cells that no other cell has, (n, 3)."""
    cells = fields.cells[chosen]
    corners = cells[:, :3]
    edges = np.stack([corners, np.roll(corners, -1, axis=1), cells[:, 3:]], axis=2).reshape(-1, 3)
    uses = np.bincount(fields.cells[:, 3:].ravel(), minlength=len(fields.points))
    return edges[uses[edges[:, 2]] == 1]


@fact
def implicit_plane_strain(e: Evidence, of: str) -> Fact:
    """Return whether the solution is implicit, with a stress across the plane."""
    iterations = int(e.results.steps.newton_iterations.sum())
    sigma33 = np.abs(e.any_case().fields.stress[..., 2]).max()
    version = e.run.versions.get("fenics-dolfinx", "")
    text = f"plane strain, implicit: {iterations} Newton iterations; dolfinx {version}"
    return Fact(iterations > 0 and sigma33 > 0, text)


@fact
def runs(e: Evidence, of: str) -> Fact:
    """Return number of runs."""
    e.need()
    return Fact(len(e.results), f"{len(e.results)} runs")


# --- how maxima are read


@fact
def missing_quantities(e: Evidence, of: str) -> Fact:
    """Return what is missing of contact pressure, and of four quantities of each tissue."""
    summary = e.results.summary
    found = set(zip(summary.tissue, summary["quantity"], strict=True))
    wanted = {(tissue, name) for tissue in SOFT_TISSUES for name in (*STRESSES, *STRAINS)}
    wanted.add(("skin", "contact_pressure_max"))
    text = f"{len(wanted & found)} of {len(wanted)} quantities, shear strain as engineering shear"
    return Fact(wanted - found, text)


def _levels(e: Evidence) -> Iterator[tuple[Quantities, str, str, Maximum]]:
    """Quantities, tissue, quantity and maximum of every maximum of the section's fields."""
    for result in e.results.values():
        quantities = result.quantities
        for tissue in SUMMARY_TISSUES:
            for name in UNITS:
                if TISSUES.index(tissue) in result.fields.tissue and (
                    name != "pressure" or tissue == "vessel"
                ):
                    yield quantities, tissue, name, quantities.maximum(tissue, name)


@fact
def maxima_not_held(e: Evidence, of: str) -> Fact:
    """Return number of maxima that fewer than five nodes or two neighbouring elements hold."""
    held = total = 0
    for quantities, tissue, name, level in _levels(e):
        fields, pairs = quantities.fields, quantities.pairs
        middles = fields.points[pairs.edge_node]
        distance = np.linalg.norm(middles - (level.x_mm, level.y_mm), axis=1)
        distance[fields.tissue[pairs.cells[:, 0]] != TISSUES.index(tissue)] = np.inf
        pair = np.argmin(distance)

        def along(values: NDArray[np.float64], name: str = name, level: Maximum = level):  # type: ignore[no-untyped-def]
            return np.abs(values) if name == "amp_log_strain" else np.sign(level.value) * values

        least = abs(level.value) * (1 - SAME)
        nodal = quantities.nodal[name].ravel()[pairs.corner[pair]]
        mean = quantities.mean[name][pairs.cells[pair]]
        nodes = np.count_nonzero(along(nodal) >= least)
        held += nodes >= NODES and bool((along(mean) >= least).all())
        total += 1
    text = f"{held} of {total} maxima are held by {NODES} nodes and {CELLS} neighbours"
    return Fact(total - held, text)


@fact
def nodal_extremes(e: Evidence, of: str) -> Fact:
    """Return largest nodal values over the maxima reported."""
    spikes = []
    for quantities, tissue, name, level in _levels(e):
        inside = quantities.fields.tissue == TISSUES.index(tissue)
        spikes.append(np.abs(quantities.nodal[name][inside]).max() / abs(level.value))
    return Fact(
        min(spikes),
        f"the largest nodal value is {number(np.median(spikes))} (median) to "
        f"{number(max(spikes))} times the maximum reported",
    )


@fact
def contact_spikes(e: Evidence, of: str) -> Fact:
    """Return whether spikes of contact pressure at single points do not count."""
    lines = [result.line for result in e.results.values()]
    ratios = [line.pressure_kPa.max() / line.running_mean_kPa.max() for line in lines]
    points = min(RUNNING_MEAN_MM / line.weight_mm.max() for line in lines)
    return Fact(
        points > 2 and min(ratios) >= 1,
        f"{RUNNING_MEAN_MM:g} mm running mean over at least {points:.0f} points; the highest "
        f"point has {number(max(ratios))} times the maximum reported",
    )


# --- thresholds that are asked for


@fact
def muscle_threshold(e: Evidence, of: str) -> Fact:
    """Return shear strain beyond which muscle counts to the damage risk volume, %."""
    rows = e.findings.damage
    rows = rows[rows.tissue == "muscle"]
    limit = e.thresholds.muscle_shear_pct
    return Fact(limit, f"muscle with |LE12| > {limit:g} %: {_areas(rows)}")


def _areas(rows: pd.DataFrame) -> str:
    return ", ".join(
        f"{row.socket} {material_set(row.material_set)} {number(row.area_mm2)} mm²"
        for row in rows.itertuples()
    )


@fact
def fascia_threshold(e: Evidence, of: str) -> Fact:
    """Return strain beyond which fascia counts as damaged, %."""
    rows = e.findings.damage
    level = rows[rows["quantity"] == "tensile_log_strain"].level_pct.max()
    limit = e.thresholds.fascia_strain_pct
    return Fact(limit, f"{limit:g} %; largest tensile strain of fascia {number(level)} %")


@fact
def flat_plate(e: Evidence, of: str) -> Fact:
    """Return share of the calibration's plate that is flat between its rounded edges."""
    given = e.checked_calibration().inputs
    flat = given.plate.width - 2 * given.plate.edge_radius
    return Fact(
        flat / given.plate.width,
        f"plate of {number(given.plate.width)} mm, flat over {number(flat)} mm, pressed "
        f"{number(given.stroke_mm)} mm into the {given.specimen}",
    )


# --- the paper against itself


@fact
def millimetres_of_mercury(e: Evidence, of: str) -> Fact:
    """Return 14.7 kPa in mmHg."""
    return Fact(14.7 / 0.133322, f"{14.7 / 0.133322:.1f} mmHg")


@fact
def equation_3(e: Evidence, of: str) -> Fact:
    """Return share of the rows "Max both" that equation (3) gives from Tables 2 and 4."""
    both = published.changes()
    both = both[both.site == "max_both"]
    misses = []
    for row in both.itertuples():
        cell = (row.tissue, row.quantity, row.socket)
        change = relative_change(*(published.maximum()[(*cell, name)] for name in SETS))
        if abs(change - row.printed) > HALF_A_DIGIT:
            quantity = QUANTITIES[row.quantity]
            misses.append(f"{row.tissue} {row.socket} {quantity}, {change:.0f} %")
    n = len(both)
    text = f"{n - len(misses)} of {n} cells; not {'; '.join(misses)}"
    return Fact((n - len(misses)) / n, text)


@fact
def bold_limits(e: Evidence, of: str) -> Fact:
    """Return share of the smallest and largest magnitudes of Tables 2 and 4 that are bold."""
    right = []
    for _, row in published.maxima().groupby(["tissue", "quantity"]):
        magnitude = row.printed.abs()
        right += [row.bold[limit] == "1" for limit in (magnitude.idxmin(), magnitude.idxmax())]
    return Fact(sum(right) / len(right), f"{sum(right)} of {len(right)} limits are bold")
