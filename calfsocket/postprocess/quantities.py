"""Outcomes of a solved section: the level each stress and strain holds in each tissue, and where.

From Gauss points to nodes as Abaqus shows results by default: components are extrapolated linearly
to each cell's six nodes, outcomes are formed there, and averaged over the cells of one tissue at a
node (Abaqus: of one section, hence of one material), never across tissues.

The level of an outcome in a tissue is the largest that at least five nodes and two neighbouring
cells hold, so that a spike at one node or in one cell does not count:

    level(pair) = min(fifth largest of the pair's nine nodal values, lower of the two cell means)

over all pairs of cells of the tissue with a common edge. The cell means are those of the Gauss
points, before any averaging: averaged, one cell's spike would lend itself to its neighbours. The
common edge's midpoint is the site.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from calfsocket.postprocess.contact_line import ContactLine
from calfsocket.postprocess.fields import GAUSS_POINTS, TISSUES, SectionFields

UNITS = {
    "effective_stress": "kPa",
    "shear_stress": "kPa",
    "amp_log_strain": "%",
    "shear_log_strain": "%",
    "pressure": "kPa",
}
# Components with a direction: the larger magnitude counts, with its sign.
SIGNED = ("shear_stress", "amp_log_strain", "shear_log_strain")
SUMMARY_TISSUES = ("skin", "fat", "muscle", "fascia", "vessel")
SUMMARY_COLUMNS = (
    "socket",
    "material_set",
    "tissue",
    "outcome",
    "value",
    "unit",
    "x_mm",
    "y_mm",
    "region",
)
RUNNING_MEAN_MM = 3.0

_NODES = np.array([[0, 0], [1, 0], [0, 1], [0.5, 0], [0.5, 0.5], [0, 0.5]])


def _linear(points: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.column_stack([np.ones(len(points)), points])


# The linear function through three Gauss values, taken at the six nodes, (6, 3):
# a corner is 5/3 of its own Gauss value less 1/3 of the two others.
EXTRAPOLATION = _linear(_NODES) @ np.linalg.inv(_linear(GAUSS_POINTS))


def log_strain(deformation_gradient: NDArray[np.float64]) -> NDArray[np.float64]:
    """Logarithmic strain ln V = ln(F F^T) / 2 in the plane.

    ln V = (ln J / 2) I + ln((m + r)/J)/(2r) dev B, with B = F F^T, m = tr B / 2 and m -+ r its
    eigenvalues. The factor of dev B is regular as r -> 0, where eigenvectors are not.

    Parameters
    ----------
    deformation_gradient
        In-plane F, det F > 0, (..., 2, 2); F33 = 1.

    Returns
    -------
    strain
        e11, e22 and the tensor's e12 (half of the engineering shear), (..., 3).
    """
    f = deformation_gradient
    b = f @ np.swapaxes(f, -1, -2)
    m = 0.5 * (b[..., 0, 0] + b[..., 1, 1])
    d, b12 = 0.5 * (b[..., 0, 0] - b[..., 1, 1]), b[..., 0, 1]
    r, jacobian = np.hypot(d, b12), np.linalg.det(f)
    y = r / m
    # ln((m + r)/J) = atanh(y): its series where the quotient by r loses digits
    small = y < 1e-2
    series = (1 + y**2 / 3 + y**4 / 5 + y**6 / 7) / m
    factor = 0.5 * np.where(small, series, np.log((m + r) / jacobian) / np.where(small, 1, r))
    mean = 0.5 * np.log(jacobian)
    return np.stack([mean + factor * d, mean - factor * d, factor * b12], axis=-1)


def effective_stress(stress: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mises stress of s11, s22, s33, s12 (..., 4), in the unit of the stress."""
    s11, s22, s33, s12 = np.moveaxis(stress, -1, 0)
    return np.sqrt(
        0.5 * ((s11 - s22) ** 2 + (s22 - s33) ** 2 + (s33 - s11) ** 2) + 3 * s12**2,
    )


def absolute_maximum_principal(strain: NDArray[np.float64]) -> NDArray[np.float64]:
    """Principal value of largest magnitude of e11, e22, e12 (..., 3), signed (AMP).

    The principal values are a +- r with a = (e11 + e22)/2, and 0 out of the plane: a + r when
    a >= 0, else a - r.
    """
    e11, e22, e12 = np.moveaxis(strain, -1, 0)
    mean = 0.5 * (e11 + e22)
    radius = np.hypot(0.5 * (e11 - e22), e12)
    return np.where(mean >= 0, mean + radius, mean - radius)


def _outcomes(
    stress: NDArray[np.float64], strain: NDArray[np.float64], pressure: NDArray[np.float64]
) -> dict[str, NDArray[np.float64]]:
    """Outcomes from components, in `UNITS`, at whatever points these are given."""
    return {
        "effective_stress": effective_stress(stress),
        "shear_stress": stress[..., 3],
        "amp_log_strain": 100 * absolute_maximum_principal(strain),
        "shear_log_strain": 100 * 2 * strain[..., 2],  # engineering shear, Abaqus's LE12
        "pressure": pressure,
    }


@dataclass(frozen=True)
class CellOutcomes:
    """Outcomes by name, in `UNITS`, cell by cell.

    Attributes
    ----------
    nodal
        Averages over the cells of the tissue at each cell's six nodes, (n_cells, 6).
    mean
        Mean over each cell's Gauss points, (n_cells,).

    Notes
    -----
    amp_log_strain is averaged as a magnitude, and has the sign of the average of the signed
    values: in an incompressible tissue e1 = -e2, and signed values of opposite sign would cancel.
    There the sign means nothing.
    """

    nodal: dict[str, NDArray[np.float64]]
    mean: dict[str, NDArray[np.float64]]


def _sign(signed: NDArray[np.float64], magnitude: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give the sign, 1 or -1, that prevails in an average beside that of the magnitudes.

    It is 1 where the signed values cancel: rounding must not choose it.
    """
    return np.where(signed < -1e-9 * magnitude, -1.0, 1.0)


def node_average(
    fields: SectionFields,
) -> Callable[[NDArray[np.float64]], NDArray[np.float64]]:
    """Give the function that averages nodal values (n_cells, 6) over the cells of one tissue."""
    node_of_tissue = fields.cells * len(TISSUES) + fields.tissue[:, None]
    _, inverse = np.unique(node_of_tissue, return_inverse=True)
    inverse = inverse.reshape(fields.cells.shape)
    count = np.bincount(inverse.ravel())
    return lambda values: (np.bincount(inverse.ravel(), values.ravel()) / count)[inverse]


def cell_outcomes(fields: SectionFields) -> CellOutcomes:
    """Outcomes at the nodes, averaged within each tissue, and the means over the cells."""
    strain = log_strain(fields.deformation_gradient)
    gauss = _outcomes(fields.stress, strain, fields.pressure)
    nodes = _outcomes(
        EXTRAPOLATION @ fields.stress, EXTRAPOLATION @ strain, fields.pressure @ EXTRAPOLATION.T
    )
    average = node_average(fields)
    nodal = {name: average(values) for name, values in nodes.items()}
    mean = {name: values.mean(axis=1) for name, values in gauss.items()}
    amp = "amp_log_strain"
    at_nodes, over_cells = average(np.abs(nodes[amp])), np.abs(gauss[amp]).mean(axis=1)
    nodal[amp] = _sign(nodal[amp], at_nodes) * at_nodes
    mean[amp] = _sign(mean[amp], over_cells) * over_cells
    return CellOutcomes(nodal, mean)


@dataclass(frozen=True)
class Neighbours:
    """Pairs of cells of one tissue with a common edge, by the lower cell index.

    Attributes
    ----------
    cells
        (n_pairs, 2).
    corner
        Each of the pair's nine nodes once, as an index into cells.ravel(), (n_pairs, 9).
    edge_node
        Node at the common edge's middle, (n_pairs,).
    """

    cells: NDArray[np.int64]
    corner: NDArray[np.int64]
    edge_node: NDArray[np.int64]


def neighbours(fields: SectionFields) -> Neighbours:
    """All pairs of edge neighbours within a tissue.

    A mid-side node belongs to one edge, so two cells that have it are neighbours.
    """
    middle = fields.cells[:, 3:].ravel()
    order = np.argsort(middle, kind="stable")
    same = np.flatnonzero(middle[order[1:]] == middle[order[:-1]])
    first, second = order[same], order[same + 1]  # 3 * cell + local edge
    cells = np.column_stack([first // 3, second // 3])
    keep = fields.tissue[cells[:, 0]] == fields.tissue[cells[:, 1]]
    by_cell = np.lexsort((cells[keep, 1], cells[keep, 0]))
    cells, first, second = cells[keep][by_cell], first[keep][by_cell], second[keep][by_cell]
    edge = second % 3
    # the second cell's nodes off the common edge: the corner opposite and two mid-sides
    off_edge = np.column_stack([(edge + 2) % 3, 3 + (edge + 1) % 3, 3 + (edge + 2) % 3])
    corner = np.hstack([6 * cells[:, :1] + np.arange(6), 6 * cells[:, 1:] + off_edge])
    return Neighbours(cells, corner, middle[first])


def pair_levels(nodal: NDArray[np.float64], mean: NDArray[np.float64]) -> NDArray[np.float64]:
    """Level that each pair holds: min(fifth largest nodal value, lower cell mean).

    Parameters
    ----------
    nodal
        Values at each pair's nine nodes, (n_pairs, 9).
    mean
        Means of each pair's two cells, (n_pairs, 2).
    """
    fifth_largest = np.partition(nodal, 4, axis=1)[:, 4]
    return np.minimum(fifth_largest, mean.min(axis=1))


def signed_levels(outcomes: CellOutcomes, pairs: Neighbours, outcome: str) -> NDArray[np.float64]:
    """Level of an outcome that each pair of neighbours holds, in `UNITS`, (n_pairs,).

    Stress and strain components are looked at in both directions, and the larger magnitude counts,
    with its sign; a pair that holds neither direction holds 0. amp_log_strain counts by its
    magnitude, with the sign that prevails in the two cells; pressure in compression.
    """
    nodal = outcomes.nodal[outcome].ravel()[pairs.corner]
    mean = outcomes.mean[outcome][pairs.cells]
    if outcome == "amp_log_strain":
        magnitude = np.abs(mean)
        sign = _sign(mean.sum(axis=1), magnitude.sum(axis=1))
        return sign * pair_levels(np.abs(nodal), magnitude)
    if outcome in SIGNED:
        up, down = pair_levels(nodal, mean), pair_levels(-nodal, -mean)
        return np.where(down > up, -1.0, 1.0) * np.maximum(np.maximum(up, down), 0.0)
    return pair_levels(nodal, mean)


@dataclass(frozen=True)
class Maximum:
    """Level held by a tissue, and its site in the reference section (mm)."""

    value: float
    x_mm: float
    y_mm: float
    region: str


def first_largest(values: NDArray[np.float64]) -> int:
    """Lowest index among values equal to the largest but for rounding."""
    largest = values.max()
    return int(np.argmax(values >= largest - 1e-9 * abs(largest)))


def _pairs_of(fields: SectionFields, pairs: Neighbours, tissue: str) -> NDArray[np.int64]:
    return np.flatnonzero(fields.tissue[pairs.cells[:, 0]] == TISSUES.index(tissue))


def maximum(
    fields: SectionFields, outcomes: CellOutcomes, pairs: Neighbours, tissue: str, outcome: str
) -> Maximum:
    """Level of an outcome in a tissue by the rule at the top of this file.

    It is the one of `signed_levels` with the largest magnitude (the largest pressure). A tissue
    without two neighbouring cells holds no level: NaN.
    """
    inside = _pairs_of(fields, pairs, tissue)
    if not len(inside):
        return Maximum(np.nan, np.nan, np.nan, "")
    levels = signed_levels(outcomes, pairs, outcome)[inside]
    pair = first_largest(np.abs(levels) if outcome in SIGNED else levels)
    cells = pairs.cells[inside[pair]]
    mean = outcomes.mean[outcome][cells]
    fuller = cells[first_largest(np.abs(mean) if outcome in SIGNED else mean)]
    x_mm, y_mm = fields.points[pairs.edge_node[inside[pair]]]
    return Maximum(
        value=float(levels[pair]),
        x_mm=float(x_mm),
        y_mm=float(y_mm),
        region=fields.region_names[int(fields.region[fuller])],
    )


def level_at(
    fields: SectionFields,
    outcomes: CellOutcomes,
    pairs: Neighbours,
    tissue: str,
    outcome: str,
    site_mm: tuple[float, float],
) -> float:
    """Level that the tissue's pair nearest to a site of the reference section holds.

    At the site of its own maximum a case holds that maximum. The limb's mesh is the same in both
    material sets, so that there the pair is the same, too.
    """
    inside = _pairs_of(fields, pairs, tissue)
    if not len(inside):
        return np.nan
    distance = np.linalg.norm(fields.points[pairs.edge_node[inside]] - site_mm, axis=1)
    return float(signed_levels(outcomes, pairs, outcome)[inside[np.argmin(distance)]])


def running_mean(contact: ContactLine, window_mm: float = RUNNING_MEAN_MM) -> NDArray[np.float64]:
    """Contact pressure averaged over a window along the closed skin outline, kPa, (n,).

    Each point stands for its own piece of the outline; the window is centred on the piece and
    takes parts of pieces at its ends.
    """
    width = contact.weight_mm
    ends = np.concatenate([[0.0], np.cumsum(width)])
    total = ends[-1]
    if window_mm > total:
        raise ValueError(f"the window of {window_mm} mm is longer than the outline, {total:.4g} mm")
    integral = np.concatenate([[0.0], np.cumsum(width * contact.pressure_kPa)])
    # once around before and after, so that windows across the start see both sides
    ends = np.concatenate([ends[:-1] - total, ends[:-1], ends + total])
    integral = np.concatenate(
        [integral[:-1] - integral[-1], integral[:-1], integral + integral[-1]],
    )
    middle = np.cumsum(width) - 0.5 * width
    upper = np.interp(middle + 0.5 * window_mm, ends, integral)
    lower = np.interp(middle - 0.5 * window_mm, ends, integral)
    return (upper - lower) / window_mm


def _reference_site(fields: SectionFields, x_mm: float, y_mm: float) -> tuple[float, float, str]:
    """Give the reference position and region of the skin node nearest to a deformed position."""
    skin = fields.cells[fields.tissue == TISSUES.index("skin")]
    region = fields.region[fields.tissue == TISSUES.index("skin")]
    deformed = (fields.points + fields.displacement)[skin]
    distance = np.hypot(deformed[..., 0] - x_mm, deformed[..., 1] - y_mm)
    cell, corner = np.unravel_index(np.argmin(distance), distance.shape)
    x, y = fields.points[skin[cell, corner]]
    return float(x), float(y), fields.region_names[int(region[cell])]


def contact_rows(fields: SectionFields, contact: ContactLine) -> list[dict[str, Any]]:
    """Contact pressure on the skin, as rows of the summary.

    contact_pressure_max: largest 3 mm running mean along the skin, which drops single spikes.
    contact_pressure_mean: mean over the part of the skin in contact, by reference length.
    contact_share: that part's share of the outline, %.
    """
    smooth = running_mean(contact)
    peak = first_largest(smooth)
    touching = contact.status != "open"
    share = contact.weight_mm[touching].sum() / contact.weight_mm.sum()
    mean = (
        np.average(contact.pressure_kPa[touching], weights=contact.weight_mm[touching])
        if touching.any()
        else 0.0
    )
    x, y, region = _reference_site(fields, contact.x_mm[peak], contact.y_mm[peak])
    nowhere = {"x_mm": np.nan, "y_mm": np.nan, "region": ""}
    return [
        {
            "outcome": "contact_pressure_max",
            "value": smooth[peak],
            "unit": "kPa",
            "x_mm": x,
            "y_mm": y,
            "region": region,
        },
        {"outcome": "contact_pressure_mean", "value": mean, "unit": "kPa", **nowhere},
        {"outcome": "contact_share", "value": 100 * share, "unit": "%", **nowhere},
    ]


def summary_rows(
    fields: SectionFields, contact: ContactLine, socket: str, material_set: str
) -> pd.DataFrame:
    """Rows of summary.csv of one case, in long form.

    Sites are positions in the reference section; a mean has none. Tissues that the section does
    not have are left out.
    """
    outcomes, pairs = cell_outcomes(fields), neighbours(fields)
    rows: list[dict[str, object]] = []
    for tissue in SUMMARY_TISSUES:
        if TISSUES.index(tissue) not in fields.tissue:
            continue
        for outcome, unit in UNITS.items():
            if outcome == "pressure" and tissue != "vessel":
                continue
            held = maximum(fields, outcomes, pairs, tissue, outcome)
            rows.append({"tissue": tissue, "outcome": outcome, "unit": unit, **vars(held)})
        if tissue == "skin":
            rows += [{"tissue": tissue, **row} for row in contact_rows(fields, contact)]
    frame = pd.DataFrame(rows, columns=list(SUMMARY_COLUMNS))
    return frame.assign(socket=socket, material_set=material_set)
