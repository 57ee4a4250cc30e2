"""Quantities of a solved section: the level of each stress and strain in each tissue, and where.

From Gauss points to nodes as Abaqus shows results by default: components are extrapolated linearly
to each cell's six nodes, quantities are formed there, and averaged over the cells of one tissue at
a node (Abaqus: of one section, hence of one material), never across tissues.

The level of a quantity in a tissue is the largest that at least five nodes and two neighbouring
cells hold, so that a spike at one node or in one cell does not count:

    level(pair) = min(fifth largest of the pair's nine nodal values, lower of the two cell means)

over all pairs of cells of the tissue with a common edge. The cell means are those of the Gauss
points, before any averaging: averaged, one cell's spike would lend itself to its neighbours. The
common edge's midpoint is the site.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from calfsocket.postprocess.contact_line import ContactLine
from calfsocket.postprocess.fields import GAUSS_POINTS, TISSUES, SectionFields

if TYPE_CHECKING:
    import pandas as pd

UNITS = {
    "effective_stress": "kPa",
    "shear_stress": "kPa",
    "amp_log_strain": "%",
    "shear_log_strain": "%",
    "pressure": "kPa",
}
"""Quantities of the summary, and their units."""

MEASURES = {**UNITS, "tensile_log_strain": "%"}
"""Quantities of a section's fields; tensile_log_strain is the largest principal value."""

CONTACT_UNITS = {
    "contact_pressure_max": "kPa",
    "contact_pressure_mean": "kPa",
    "contact_share": "%",
}
"""Quantities of the contact in the summary, and their units."""

SIGNED = ("shear_stress", "amp_log_strain", "shear_log_strain")
"""Components with a direction: the larger magnitude counts, with its sign."""

SUMMARY_TISSUES = ("skin", "fat", "muscle", "fascia", "vessel")
"""Soft tissues of a limb."""

REPORTED = (*SUMMARY_TISSUES, "liner")
"""What the summary has rows of, where a section has it."""

SUMMARY_COLUMNS = ("tissue", "quantity", "value", "unit", "x_mm", "y_mm", "region")


def reported(tissue: str) -> list[str]:
    """Return the quantities of a tissue that the summary has; pressure is that in the vessels."""
    return [name for name in UNITS if name != "pressure" or tissue == "vessel"]


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

    The in-plane F (..., 2, 2) has det F > 0, and F33 = 1. The result, (..., 3), is e11, e22 and the
    tensor's e12 (half of the engineering shear).
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


def principal_strains(
    strain: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return absolute maximum (AMP) and largest principal value of e11, e22, e12 (..., 3).

    The principal values are a +- r with a = (e11 + e22)/2, and 0 out of the plane: that of largest
    magnitude, signed, is a + r when a >= 0, else a - r; a + r is the largest in the plane.
    """
    e11, e22, e12 = np.moveaxis(strain, -1, 0)
    mean = 0.5 * (e11 + e22)
    radius = np.hypot(0.5 * (e11 - e22), e12)
    return np.where(mean >= 0, mean + radius, mean - radius), mean + radius


def first_largest(values: NDArray[np.float64]) -> int:
    """Lowest index among values equal to the largest but for rounding."""
    largest = values.max()
    return int(np.argmax(values >= largest - 1e-9 * abs(largest)))


def _measures(
    stress: NDArray[np.float64], strain: NDArray[np.float64], pressure: NDArray[np.float64]
) -> dict[str, NDArray[np.float64]]:
    """Return all quantities, in `MEASURES`, from components at whatever points these are given."""
    amp, tensile = principal_strains(strain)
    return {
        "effective_stress": effective_stress(stress),
        "shear_stress": stress[..., 3],
        "amp_log_strain": 100 * amp,
        "shear_log_strain": 100 * 2 * strain[..., 2],  # engineering shear, Abaqus's LE12
        "tensile_log_strain": 100 * tensile,
        "pressure": pressure,
    }


def _sign(signed: NDArray[np.float64], magnitude: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the sign, 1 or -1, that prevails in an average beside that of the magnitudes.

    It is 1 where the signed values cancel: rounding must not choose it.
    """
    return np.where(signed < -1e-9 * magnitude, -1.0, 1.0)


def _node_average(
    fields: SectionFields,
) -> Callable[[NDArray[np.float64]], NDArray[np.float64]]:
    """Return the function that averages nodal values (n_cells, 6) over the cells of one tissue."""
    node_of_tissue = fields.cells * len(TISSUES) + fields.tissue[:, None]
    _, inverse = np.unique(node_of_tissue, return_inverse=True)
    inverse = inverse.reshape(fields.cells.shape)
    count = np.bincount(inverse.ravel())
    return lambda values: (np.bincount(inverse.ravel(), values.ravel()) / count)[inverse]


@dataclass(frozen=True)
class Neighbours:
    """Pairs of cells of one tissue with a common edge, by the lower cell index."""

    cells: NDArray[np.int64]
    """(n_pairs, 2)."""
    corner: NDArray[np.int64]
    """Each of the pair's nine nodes once, as an index into the section's cells.ravel(), (n, 9)."""
    edge_node: NDArray[np.int64]
    """Node at the common edge's middle, (n_pairs,)."""


def neighbours(fields: SectionFields) -> Neighbours:
    """Return all pairs of edge neighbours within a tissue.

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
    """Return levels of pairs by nodal values (n_pairs, 9) and their cells' means (n_pairs, 2)."""
    fifth_largest = np.partition(nodal, 4, axis=1)[:, 4]
    return np.minimum(fifth_largest, mean.min(axis=1))


@dataclass(frozen=True)
class Maximum:
    """The level of a quantity in a tissue, signed for those of `SIGNED`, and where it is reached.

    The site is in the reference section. All is NaN where the tissue has no pair of cells.
    """

    value: float
    x_mm: float
    y_mm: float
    region: str


NOWHERE = Maximum(np.nan, np.nan, np.nan, "")


@dataclass(frozen=True)
class Quantities:
    """Stress and strain quantities of one section, by name, in `MEASURES`.

    amp_log_strain is averaged as a magnitude, and has the sign of the average of the signed
    values: in an incompressible tissue e1 = -e2, and signed values of opposite sign would cancel.
    There the sign means nothing.

    Strains count from the stress-free state (`SectionFields.elastic`): what the tissue is strained
    by its stress. A tissue that swells freely has none, a liner put on stretched has its stretch.
    """

    fields: SectionFields
    gauss: dict[str, NDArray[np.float64]]
    """At each cell's Gauss points, (n_cells, 3)."""
    nodal: dict[str, NDArray[np.float64]]
    """Averages over the cells of the tissue at each cell's six nodes, (n_cells, 6)."""
    mean: dict[str, NDArray[np.float64]]
    """Mean over each cell's Gauss points, (n_cells,)."""

    @classmethod
    def of(cls, fields: SectionFields) -> "Quantities":
        """Compute all quantities of a section."""
        strain = log_strain(fields.elastic)
        gauss = _measures(fields.stress, strain, fields.pressure)
        nodes = _measures(
            EXTRAPOLATION @ fields.stress, EXTRAPOLATION @ strain, fields.pressure @ EXTRAPOLATION.T
        )
        average = _node_average(fields)
        nodal = {name: average(values) for name, values in nodes.items()}
        mean = {name: values.mean(axis=1) for name, values in gauss.items()}
        amp = "amp_log_strain"
        at_nodes, over_cells = average(np.abs(nodes[amp])), np.abs(gauss[amp]).mean(axis=1)
        nodal[amp] = _sign(nodal[amp], at_nodes) * at_nodes
        mean[amp] = _sign(mean[amp], over_cells) * over_cells
        return cls(fields, gauss, nodal, mean)

    @cached_property
    def pairs(self) -> Neighbours:
        """Pairs of neighbours within a tissue."""
        return neighbours(self.fields)

    @cached_property
    def levels(self) -> dict[str, NDArray[np.float64]]:
        """Level of each quantity that each pair of neighbours holds, (n_pairs,).

        Stress and strain components are looked at in both directions, and the larger magnitude
        counts, with its sign; a pair that holds neither direction holds 0. amp_log_strain counts by
        its magnitude, with the sign that prevails in the two cells; pressure in compression.
        """
        found = {}
        for quantity, values in self.nodal.items():
            nodal = values.ravel()[self.pairs.corner]
            mean = self.mean[quantity][self.pairs.cells]
            levels = pair_levels(nodal, mean)
            if quantity == "amp_log_strain":
                magnitude = np.abs(mean)
                sign = _sign(mean.sum(axis=1), magnitude.sum(axis=1))
                levels = sign * pair_levels(np.abs(nodal), magnitude)
            elif quantity in SIGNED:
                down = pair_levels(-nodal, -mean)
                sign = np.where(down > levels, -1.0, 1.0)
                levels = sign * np.maximum(np.maximum(levels, down), 0.0)
            found[quantity] = levels
        return found

    def maximum(self, tissue: str, quantity: str) -> Maximum:
        """Return the level of a quantity in a tissue by the rule at the top of this file.

        It is the one of `levels` with the largest magnitude (the largest pressure). A tissue
        without two neighbouring cells holds no level: NaN.
        """
        return self._maxima[tissue, quantity]

    @cached_property
    def _maxima(self) -> dict[tuple[str, str], Maximum]:
        return {
            (tissue, quantity): self._maximum(inside, quantity)
            for tissue, inside in self._pairs_of.items()
            for quantity in self.levels
        }

    def _maximum(self, inside: NDArray[np.int64], quantity: str) -> Maximum:
        """Return the level of a quantity among some pairs."""
        if not len(inside):
            return NOWHERE
        sized = np.abs if quantity in SIGNED else np.asarray
        levels = self.levels[quantity][inside]
        pair = first_largest(sized(levels))
        cells = self.pairs.cells[inside[pair]]
        fuller = cells[first_largest(sized(self.mean[quantity][cells]))]
        x_mm, y_mm = self.fields.points[self.pairs.edge_node[inside[pair]]]
        region = self.fields.region_names[int(self.fields.region[fuller])]
        return Maximum(float(levels[pair]), float(x_mm), float(y_mm), region)

    def level_at(self, tissue: str, quantity: str, x_mm: float, y_mm: float) -> float:
        """Return the level that the tissue's pair nearest to a site holds (reference section).

        At the site of its own maximum a case holds that maximum. On the same mesh of the limb the
        pair is the same in both material sets, too.
        """
        if not len(self._pairs_of[tissue]):
            return np.nan
        return float(self.levels[quantity][self.nearest(tissue, x_mm, y_mm)])

    def nearest(self, tissue: str, x_mm: float, y_mm: float) -> int:
        """Return the tissue's pair whose common edge is nearest to a site (reference section)."""
        x, y = self._sites[tissue]
        return int(self._pairs_of[tissue][np.argmin(np.hypot(x - x_mm, y - y_mm))])

    @cached_property
    def _sites(self) -> dict[str, NDArray[np.float64]]:
        """Sites of the pairs of each tissue, (2, n)."""
        sites = self.fields.points[self.pairs.edge_node].T
        return {name: sites[:, inside] for name, inside in self._pairs_of.items()}

    @cached_property
    def _pairs_of(self) -> dict[str, NDArray[np.int64]]:
        """Pairs of each tissue."""
        tissue = self.fields.tissue[self.pairs.cells[:, 0]]
        return {name: np.flatnonzero(tissue == number) for number, name in enumerate(TISSUES)}


def contact_quantities(
    fields: SectionFields, contact: ContactLine, tissue: str = "skin"
) -> dict[str, Maximum]:
    """Return the contact quantities of `CONTACT_UNITS`, along the surface of a tissue.

    contact_pressure_max: largest 3 mm running mean along the skin, which drops single spikes.
    contact_pressure_mean: mean over the part of the skin in contact, by reference length.
    contact_share: that part's share of the outline, %.

    A socket that touches in pieces shorter than the window may have a mean above the maximum: the
    window then averages over skin without contact, and the mean does not.
    """
    smooth = contact.running_mean_kPa
    peak = first_largest(smooth)
    touching = contact.status != "open"
    length, pressure = contact.weight_mm[touching], contact.pressure_kPa[touching]
    mean = np.average(pressure, weights=length) if touching.any() else 0.0
    share = 100 * length.sum() / contact.weight_mm.sum()
    site = _reference_site(fields, tissue, contact.x_mm[peak], contact.y_mm[peak])
    return {
        "contact_pressure_max": Maximum(float(smooth[peak]), *site),
        "contact_pressure_mean": replace(NOWHERE, value=float(mean)),
        "contact_share": replace(NOWHERE, value=float(share)),
    }


def _reference_site(
    fields: SectionFields, tissue: str, x_mm: float, y_mm: float
) -> tuple[float, float, str]:
    """Return reference position and region of the tissue's node nearest to a deformed position."""
    inside = fields.cells_of(tissue)
    skin = fields.cells[inside]
    deformed = fields.deformed[skin]
    distance = np.hypot(deformed[..., 0] - x_mm, deformed[..., 1] - y_mm)
    cell, corner = np.unravel_index(np.argmin(distance), distance.shape)
    x, y = fields.points[skin[cell, corner]]
    return float(x), float(y), fields.region_names[int(fields.region[inside[cell]])]


def summary(
    quantities: Quantities,
    contact: ContactLine,
    levels: Mapping[str, Maximum] | None = None,
    lining: ContactLine | None = None,
) -> "pd.DataFrame":
    """Return the level of every quantity in every tissue, with `SUMMARY_COLUMNS`.

    Sites are positions in the reference section; a mean has none. Tissues that the section does
    not have are left out. `lining` is the contact of a liner that is bonded to the skin.
    """
    fields = quantities.fields
    rows = []
    for tissue in REPORTED:
        if TISSUES.index(tissue) not in fields.tissue:
            continue
        for name in reported(tissue):
            rows.append((tissue, name, UNITS[name], quantities.maximum(tissue, name)))
        along = {"skin": contact, "liner": lining}.get(tissue)
        if along is not None:
            known = levels if tissue == "skin" else None
            found = known or contact_quantities(fields, along, tissue)
            rows += [(tissue, name, CONTACT_UNITS[name], value) for name, value in found.items()]
    return summary_table(rows)


def summary_table(rows: Iterable[tuple[str, str, str, Maximum]]) -> "pd.DataFrame":
    """Return tissue, quantity, unit and level as a table with `SUMMARY_COLUMNS`."""
    import pandas as pd

    return pd.DataFrame(
        [
            {"tissue": tissue, "quantity": quantity, "unit": unit, **vars(level)}
            for tissue, quantity, unit, level in rows
        ],
        columns=list(SUMMARY_COLUMNS),
    )
