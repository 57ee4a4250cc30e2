"""Levels by area: what a share of a tissue, of a region or of the skin in contact stays below.

Each Gauss point stands for its part of the undeformed area (`SectionFields.gauss_area`, by which
thresholds count, too), each point of the skin for its part of the undeformed length. The level of a
share s is the smallest value among the points such that those that are not above it have at
least the share s of the area:

    level(s) = min { v_i : sum of w_j with v_j <= v_i >= s sum of w_j },

the inverse of the area's cumulative distribution. So the share of the area beyond level(s), as
`thresholds.area_beyond` counts it, is at most 1 - s. A level depends on the field alone, not on how
elements lie beside each other: with smaller elements it converges to that of the field.

Components with a direction count by their magnitude, as in thresholds; what may be of either sign
has levels of both ends beside it.
"""

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calfsocket.postprocess.contact_line import ContactLine
from calfsocket.postprocess.fields import TISSUES, SectionFields
from calfsocket.postprocess.quantities import REPORTED, SIGNED, UNITS, Quantities, reported

if TYPE_CHECKING:
    import pandas as pd

SHARES = (50.0, 95.0, 99.0, 99.9)
"""Shares of the area, %."""

ALONG_SKIN = {"contact_pressure": "pressure_kPa", "contact_shear": "shear_kPa"}
"""Quantities along the skin in contact, in kPa: name -> array of `ContactLine`."""

NEVER_NEGATIVE = ("effective_stress", "contact_pressure")
"""Quantities that have one end."""

BY_MAGNITUDE = (*SIGNED, "contact_shear")
"""Quantities whose magnitude counts."""

BELOW, UPPER, LOWER = (
    tuple(f"{end}_{share:g}" for share in SHARES) for end in ("below", "upper", "lower")
)
STATISTICS = ("mean", "rms", *BELOW, *UPPER, *LOWER)
"""Columns of numbers: 99.9 % of the area is below `below_99.9` (in magnitude, where a sign is a
direction), with its sign below `upper_99.9` and above `lower_99.9`."""

NEARLY_ALL = BELOW[-1]
"""The level that stands for a tissue's largest value where one number is wanted: it settles."""

LEVEL_COLUMNS = ("tissue", "region", "quantity", "unit", "area_mm2", "length_mm", *STATISTICS)


def level(
    values: NDArray[np.float64], weights: NDArray[np.float64], share: ArrayLike
) -> NDArray[np.float64]:
    """Return the level that a share of the weights stays below (see this module).

    Parameters
    ----------
    values, weights : array
        Of points, one-dimensional; what each stands for, above 0.
    share : float or array of them
        In %, above 0 and at most 100.

    Returns
    -------
    array
        One of the values for each share, in their unit.
    """
    # As np.quantile by its method "inverted_cdf", which takes five times as long for a hundred.
    values, weights = np.asarray(values), np.asarray(weights)
    order = np.argsort(values)
    cumulative = np.cumsum(weights[order])
    cumulative /= cumulative[-1]
    place = np.searchsorted(cumulative, np.asarray(share) / 100)
    return np.asarray(values[order[np.minimum(place, len(values) - 1)]], dtype=np.float64)


def statistics(
    values: NDArray[np.float64], weights: NDArray[np.float64], quantity: str = ""
) -> dict[str, float]:
    """Return mean, root mean square and levels of values at points, by `STATISTICS`.

    The mean keeps the sign. Levels of both ends are NaN where values have one end.
    """
    mean = np.average(values, weights=weights)
    rms = np.sqrt(np.average(values**2, weights=weights))
    sized = np.abs(values) if quantity in BY_MAGNITUDE else values
    below, upper, lower = (level(each, weights, SHARES) for each in (sized, values, -values))
    numbers = np.concatenate([[mean, rms], below, upper, -lower])
    if quantity in NEVER_NEGATIVE:
        numbers[2 + len(SHARES) :] = np.nan
    return dict(zip(STATISTICS, map(float, numbers), strict=True))


def levels(
    quantities: Quantities, contact: ContactLine, lining: ContactLine | None = None
) -> "pd.DataFrame":
    """Return mean, root mean square and levels of every quantity, with `LEVEL_COLUMNS`.

    Those of the summary, and pressure and shear along the skin in contact.

    Parameters
    ----------
    lining
        Contact of a liner that is bonded to the skin.

    Returns
    -------
    DataFrame
        For each tissue and quantity a row of the whole tissue, whose region is empty, and one of
        each region with its undeformed area; for contact the undeformed length in contact.
    """
    import pandas as pd

    fields = quantities.fields
    rows: list[dict[str, object]] = []
    for tissue in (name for name in REPORTED if TISSUES.index(name) in fields.tissue):
        for region, cells in _parts(fields, tissue).items():
            area = fields.gauss_area[cells].sum()
            about = {"tissue": tissue, "region": region, "area_mm2": area}
            for quantity in reported(tissue):
                row = {"quantity": quantity, "unit": UNITS[quantity]}
                rows.append(about | row | _of_cells(quantities, cells, quantity))
        along = {"skin": contact, "liner": lining}.get(tissue)
        if along is not None:
            rows += _contact_rows(along, tissue)
    return pd.DataFrame(rows, columns=list(LEVEL_COLUMNS))


def levels_of(quantities: Quantities, wanted: Iterable[tuple[str, str]]) -> "pd.DataFrame":
    """Return `STATISTICS` of some quantities, one row a tissue and quantity, as of `levels`.

    Of whole tissues that the section has, and of any of its quantities.
    """
    import pandas as pd

    return pd.DataFrame(
        [
            {"tissue": tissue, "region": "", "quantity": quantity}
            | _of_cells(quantities, quantities.fields.cells_of(tissue), quantity)
            for tissue, quantity in wanted
        ],
        columns=["tissue", "region", "quantity", *STATISTICS],
    )


def _of_cells(quantities: Quantities, cells: NDArray[np.int64], quantity: str) -> dict[str, float]:
    values, areas = quantities.gauss[quantity][cells], quantities.fields.gauss_area[cells]
    return statistics(values.ravel(), areas.ravel(), quantity)


def _parts(fields: SectionFields, tissue: str) -> dict[str, NDArray[np.int64]]:
    """Return the cells of a tissue, by an empty name, and of each of its regions."""
    cells = fields.cells_of(tissue)
    ids = map(int, np.unique(fields.region[cells]))
    of_regions = {fields.region_names[i]: np.flatnonzero(fields.region == i) for i in ids}
    return {"": cells, **of_regions}


def _contact_rows(contact: ContactLine, tissue: str) -> list[dict[str, object]]:
    """Return the rows of contact along a surface; all is 0 where nothing touches."""
    touching = contact.status != "open"
    length = contact.weight_mm[touching]
    about = {"tissue": tissue, "region": "", "unit": "kPa", "length_mm": length.sum()}
    return [
        about
        | {"quantity": quantity}
        | (
            statistics(getattr(contact, array)[touching], length, quantity)
            if touching.any()
            else statistics(np.zeros(1), np.ones(1), quantity)
        )
        for quantity, array in ALONG_SKIN.items()
    ]
