"""Facts on what a study is given: tissues, laws, geometry, mesh, contact, how maxima are read."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from calfsocket.meshes.curves import ClosedCurve
from calfsocket.paper import published
from calfsocket.paper.claims.rules import Fact
from calfsocket.paper.claims.tolerances import HALF_A_DIGIT, SAME
from calfsocket.paper.evidence import (
    SOCKETS,
    STRAINS,
    STRESSES,
    Evidence,
    NotChecked,
    run_name,
)
from calfsocket.postprocess.contact_line import RUNNING_MEAN_MM
from calfsocket.postprocess.fields import TISSUES, SectionFields
from calfsocket.postprocess.quantities import SUMMARY_TISSUES, Maximum, Quantities, reported
from calfsocket.postprocess.thresholds import tissue_area
from calfsocket.report.changes import relative_change
from calfsocket.report.names import QUANTITIES, SETS

LIMB_TISSUES = ("skin", "fat", "fascia", "muscle", "bone", "vessel")
POISSON_RATIO = 0.495
LOADS = ("load", "force", "weight", "moment", "gravity")
NOT_MODELLED = ("nerve", "lymph")
NODES = 5


# --- tissues and laws


def materials(e: Evidence, name: str) -> int:
    """Return the number of materials of the limb in a set."""
    return len({repr(e.parameters[name][tissue]) for tissue in LIMB_TISSUES})


def kinds(e: Evidence) -> list[str]:
    """Return the kinds of laws of the Separate set."""
    return sorted({law["law"] for law in e.parameters["separate"].values()})


def laws_that_differ(e: Evidence) -> Fact:
    """Return tissues whose law differs between the sets, and the laws of muscle and fascia."""
    separate, combined = e.parameters["separate"], e.parameters["combined"]
    differ = ", ".join(sorted(name for name in separate if separate[name] != combined[name]))
    shared = "one" if combined["muscle"] == combined["fascia"] else "two"
    return {"value": f"{differ}; {shared} in Combined"}


def law_of_each_tissue(e: Evidence) -> Fact:
    """Return the kind of law of every tissue, and the numbers of Ogden terms."""
    laws = {tissue: e.parameters["separate"][tissue] for tissue in LIMB_TISSUES}
    terms = {len(law["mu"]) for law in laws.values() if law["law"] == "ogden"}
    kinds = ", ".join(f"{tissue} {law['law']}" for tissue, law in laws.items())
    return {"value": f"{kinds}; terms {terms}", "kinds": kinds}


def parameters(e: Evidence, of: str) -> Fact:
    """Return the relative deviations of a material's parameters from Table 1."""
    rows = e.materials[e.materials.material == of]
    if rows.empty:
        raise NotChecked("needs another material set, which is not in this study")
    off = ((rows.ours - rows.paper) / rows.paper).abs()
    ours = [f"{r.symbol} {r.ours:.4g} {r.unit}".rstrip() for r in rows.itertuples()]
    chosen = [f"{r.symbol} is {r.ours:.4g} {r.unit}" for r in rows[~(off <= SAME)].itertuples()]
    return {"value": tuple(off), "ours": ours, "chosen": chosen}


def d1_of_poisson_ratio(e: Evidence) -> Fact:
    """Return the deviation of D1 = 3 (1 - 2 nu) / (mu1 (1 + nu)) from those of the laws."""
    laws = [e.parameters["separate"][tissue] for tissue in ("skin", "fat", "muscle")]
    laws.append(e.parameters["combined"]["muscle"])
    factor = 3 * (1 - 2 * POISSON_RATIO) / (1 + POISSON_RATIO)
    off = max(abs(factor / law["mu"][0] / law["d1"] - 1) for law in laws)
    return {"value": off, "off": 100 * off}


def ogden_prefactor(e: Evidence) -> Fact:
    """Return Ogden's form, on which the paper's own stresses and strains decide.

    At constant volume and 45 degrees to the principal axes S12 = (2 mu/alpha) sinh(alpha LE12/2)
    in Abaqus's form, alpha/2 times as much in that of equation (1). Tables 2 and 4 of the paper
    give pairs of S12 and LE12 for skin and muscle.
    """
    at = published.maximum()
    abaqus, printed = [], []
    for tissue, name in (("skin", "separate"), ("skin", "combined"), ("muscle", "separate")):
        law = e.parameters[name][tissue]
        mu, alpha = 1e3 * law["mu"][0], law["alpha"][0]
        for socket in SOCKETS:
            shear = abs(at[(tissue, "shear_log_strain", socket, name)]) / 100
            stress = abs(at[(tissue, "shear_stress", socket, name)])
            ratio = stress / (2 * mu / alpha * np.sinh(alpha * shear / 2))
            abaqus.append(ratio)
            printed.append(ratio / (alpha / 2))
    form = e.parameters["separate"]["skin"]["form"]
    medians = {"abaqus": np.median(abaqus), "printed": np.median(printed)}
    fits = abs(np.log(medians["printed"])) < abs(np.log(medians["abaqus"]))
    return {"value": form if fits else "refuted by the paper's tables", "form": form, **medians}


def fascia_is_modelled(e: Evidence) -> Fact:
    """Return whether fascia is in both sets, in none with muscle's own material."""
    limb = e.limb
    areas = [limb.areas[name] for name, tissue in limb.tissues.items() if tissue == "fascia"]
    muscle = e.parameters["separate"]["muscle"]
    ignored = any(e.parameters[name]["fascia"] == muscle for name in SETS)
    return {"value": bool(areas) and not ignored, "n": len(areas), "area": sum(areas)}


# --- section, sockets, mesh


def segmented_tissues(e: Evidence) -> Fact:
    """Return whether there are all tissues and separate muscles, no nerves and no lymphatics."""
    regions = e.limb.regions
    tissues = sorted({region.tissue for region in regions})
    muscles = sum(region.tissue == "muscle" for region in regions)
    ignored = not any(word in region.name for region in regions for word in NOT_MODELLED)
    complete = tissues == sorted(LIMB_TISSUES) and muscles > 1
    return {"value": complete and ignored, "tissues": tissues, "muscles": muscles}


def sockets(e: Evidence) -> Fact:
    """Return the names of the sockets that have shapes of their own."""
    shapes = {repr(socket.model_dump(exclude={"name"})): n for n, socket in e.sockets.items()}
    return {"value": list(shapes.values())}


def _radial_overlap(skin: ClosedCurve, inner: ClosedCurve) -> NDArray[np.float64]:
    """Return skin radius less that of the socket's inner face at all polar angles, mm, (720,)."""
    angle = np.radians(np.arange(0, 360, 0.5))

    def radius(curve: ClosedCurve) -> NDArray[np.float64]:
        points = curve.evaluate(curve.sample(0.1))
        at = np.arctan2(points[:, 1], points[:, 0])
        order = np.argsort(at)
        return np.interp(angle, at[order], np.linalg.norm(points[order], axis=1), period=2 * np.pi)

    return radius(skin) - radius(inner)


def overlaps(e: Evidence) -> Fact:
    """Return the deepest overlap of limb and socket before contact, mm."""
    depth = {name: _radial_overlap(e.skin, face) for name, face in e.inner_faces.items()}
    return {"value": tuple(each.max() for each in depth.values()), "depth": depth}


def _in_limb(fields: SectionFields) -> NDArray[np.bool_]:
    return fields.tissue != TISSUES.index("socket")


def _limb_nodes(fields: SectionFields) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the limb's nodes, and its cells (n, 6) as places among them."""
    cells = fields.cells[_in_limb(fields)]
    inside = np.zeros(len(fields.points), bool)
    inside[cells] = True
    return np.flatnonzero(inside), (np.cumsum(inside) - 1)[cells]


def elements(e: Evidence, of: str) -> Fact:
    """Return the numbers of elements of the limb, or of the sockets."""
    inside = [_in_limb(result.fields) for result in e.results.values()]
    counts = [int((cells if of == "limb" else ~cells).sum()) for cells in inside]
    return {"value": (min(counts), max(counts)), "size": e.settings["size"]}


def areas(e: Evidence) -> dict[str, float]:
    """Return the area of each tissue, mm^2, the largest first."""
    area = {tissue: tissue_area(e.any_case().fields, tissue) for tissue in LIMB_TISSUES}
    return {tissue: area[tissue] for tissue in sorted(area, key=lambda name: -area[name])}


def shared_nodes(e: Evidence) -> Fact:
    """Return whether the limb is one connected mesh, without two nodes in one place."""
    fields = e.any_case().fields
    nodes, local = _limb_nodes(fields)
    links = coo_array(
        (np.ones(5 * len(local)), (np.repeat(local[:, 0], 5), local[:, 1:].ravel())),
        shape=(len(nodes), len(nodes)),
    )
    pieces, _ = connected_components(links, directed=False)
    x, y = fields.points[nodes].round(9).T
    places = len(np.unique(x + 1j * y))
    parts = {"nodes": len(nodes), "places": places, "pieces": pieces}
    return {"value": pieces == 1 and places == len(nodes), **parts}


def refined_at_thin_fascia(e: Evidence) -> Fact:
    """Return the size of elements in fascia at the bones over that in muscle."""
    fields = e.any_case().fields
    size = np.sqrt(fields.gauss_area.sum(axis=1) * 4 / np.sqrt(3))  # side of an equal triangle
    bone, fascia, muscle = (fields.cells_of(tissue) for tissue in ("bone", "fascia", "muscle"))
    thin = fascia[np.isin(fields.cells[fascia], fields.cells[bone]).any(axis=1)]
    if not len(thin):
        raise NotChecked("no element of fascia lies at a bone")
    fine, coarse = (float(np.median(size[cells])) for cells in (thin, muscle))
    return {"value": fine / coarse, "fine": fine, "coarse": coarse}


def other_meshes(e: Evidence) -> Fact:
    """Return the runs whose mesh of the limb is not that of the first."""
    if len(e.results) < 2:
        raise NotChecked("needs two runs to compare")
    meshes = {}
    for key, result in e.results.items():
        nodes, local = _limb_nodes(result.fields)
        meshes["_".join(key)] = (result.fields.points[nodes], local)
    first = next(iter(meshes.values()))
    same = {name: all(map(np.array_equal, first, mesh)) for name, mesh in meshes.items()}
    differ = [name for name in meshes if not same[name]]
    return {"value": differ, "n": sum(same.values()), "first": next(iter(meshes))}


# --- loading, contact, analysis


def loads(e: Evidence) -> list[str]:
    """Return the settings that are loads."""
    return [name for name in e.settings if any(word in name for word in LOADS)]


def stages(e: Evidence) -> list[str]:
    """Return the names of the stages of loading, which come after what the claims are on."""
    records = e.results.records.values()
    return list(dict.fromkeys(name for record in records for name in record.states))


def gradual_overclosure(e: Evidence) -> Fact:
    """Return whether the overclosure is the only load and is resolved over increments."""
    reached = [result.steps.load[result.steps.converged] for result in e.results.values()]
    complete = all(each.is_monotonic_increasing and each.iloc[-1] == 1 for each in reached)
    counts = sorted({len(each) for each in reached})
    return {"value": complete and min(counts) > 1 and not loads(e), "counts": counts}


def contact_points(e: Evidence) -> Fact:
    """Return the number of contact points on an edge of the skin."""
    result = e.any_case()
    edges = _free_edges(result.fields, result.fields.cells_of("skin"))
    return {"value": len(result.line.arc_mm) / len(edges)}


def supports(e: Evidence) -> Fact:
    """Return whether the tibia's inner boundary is fixed and the fibula free."""
    fields = e.any_case().fields
    ids = {name: region for region, name in fields.region_names.items()}
    moved = np.linalg.norm(fields.displacement, axis=1)
    tibia = moved[_free_edges(fields, fields.region == ids["tibia"])].max()
    fibula = moved[fields.cells[fields.region == ids["fibula"]]].mean()
    return {"value": tibia == 0 and fibula > 0, "tibia": tibia, "fibula": fibula}


def _free_edges(fields: SectionFields, chosen: NDArray[Any]) -> NDArray[np.int64]:
    """Return ends and middle of the edges of the chosen cells that no other cell has, (n, 3)."""
    cells = fields.cells[chosen]
    corners = cells[:, :3]
    edges = np.stack([corners, np.roll(corners, -1, axis=1), cells[:, 3:]], axis=2).reshape(-1, 3)
    uses = np.bincount(fields.cells[:, 3:].ravel(), minlength=len(fields.points))
    return edges[uses[edges[:, 2]] == 1]


# --- how maxima are read


def missing_quantities(e: Evidence) -> Fact:
    """Return what is missing of contact pressure, and of four quantities of each tissue."""
    found = set(zip(e.results.summary.tissue, e.results.summary["quantity"], strict=True))
    wanted = {(tissue, name) for tissue in SUMMARY_TISSUES for name in (*STRESSES, *STRAINS)}
    wanted.add(("skin", "contact_pressure_max"))
    return {"value": wanted - found, "n": len(wanted & found), "of": len(wanted)}


def _levels(e: Evidence) -> Iterator[tuple[Quantities, str, str, Maximum]]:
    """Return quantities, tissue, quantity and maximum of every maximum of the section's fields."""
    for result in e.results.values():
        quantities = result.quantities
        for tissue in SUMMARY_TISSUES:
            if len(result.fields.cells_of(tissue)):
                for name in reported(tissue):
                    yield quantities, tissue, name, quantities.maximum(tissue, name)


def maxima_reached(e: Evidence) -> Fact:
    """Return the share of maxima that five nodes and two neighbouring elements reach."""
    reached = []
    for quantities, tissue, name, level in _levels(e):
        pairs = quantities.pairs
        pair = quantities.nearest(tissue, level.x_mm, level.y_mm)
        nodal = quantities.nodal[name].ravel()[pairs.corner[pair]]
        mean = quantities.mean[name][pairs.cells[pair]]
        if name == "amp_log_strain":
            nodal, mean = np.abs(nodal), np.abs(mean)
        else:
            nodal, mean = np.sign(level.value) * nodal, np.sign(level.value) * mean
        least = abs(level.value) * (1 - SAME)
        reached.append(np.count_nonzero(nodal >= least) >= NODES and bool((mean >= least).all()))
    return {"value": sum(reached) / len(reached), "reached": sum(reached), "n": len(reached)}


def nodal_extremes(e: Evidence) -> Fact:
    """Return the smallest of the largest nodal values over the maxima reported."""
    spikes = []
    for quantities, tissue, name, level in _levels(e):
        inside = quantities.fields.cells_of(tissue)
        spikes.append(np.abs(quantities.nodal[name][inside]).max() / abs(level.value))
    return {"value": min(spikes), "median": np.median(spikes), "largest": max(spikes)}


def contact_spikes(e: Evidence) -> Fact:
    """Return whether spikes of contact pressure at single points do not count."""
    lines = [result.line for result in e.results.values()]
    ratios = [line.pressure_kPa.max() / line.running_mean_kPa.max() for line in lines]
    points = min(RUNNING_MEAN_MM / line.weight_mm.max() for line in lines)
    return {"value": points > 2 and min(ratios) >= 1, "points": points, "largest": max(ratios)}


def muscle_at_risk(e: Evidence) -> dict[str, float]:
    """Return the area of muscle beyond its threshold in each run, mm^2."""
    rows = e.damage[e.damage.tissue == "muscle"]
    keys = zip(rows.socket, rows.material_set, strict=True)
    return dict(zip(map(run_name, keys), rows.area_mm2, strict=True))


# --- the paper against itself


def equation_3(e: Evidence) -> Fact:
    """Return the share of the rows "Max both" that equation (3) gives from Tables 2 and 4."""
    both = published.changes()
    both = both[both.site == "max_both"]
    misses = []
    for row in both.itertuples():
        cell = (row.tissue, row.quantity, row.socket)
        change = relative_change(*(published.maximum()[(*cell, name)] for name in SETS))
        if abs(change - row.printed) > HALF_A_DIGIT:
            misses.append(f"{row.tissue} {row.socket} {QUANTITIES[row.quantity]} ({change:.0f} %)")
    n = len(both) - len(misses)
    return {"value": n / len(both), "n": n, "of": len(both), "misses": misses}


def bold_limits(e: Evidence) -> Fact:
    """Return the share of the smallest and largest magnitudes of Tables 2 and 4 that are bold."""
    right = []
    for _, row in published.maxima().groupby(["tissue", "quantity"]):
        magnitude = row.printed.abs()
        right += [row.bold[limit] == "1" for limit in (magnitude.idxmin(), magnitude.idxmax())]
    return {"value": sum(right) / len(right), "right": sum(right), "n": len(right)}
