"""Cases along a limb of many levels: their contact as a map, and the worst level of each tissue."""

from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING

import numpy as np

from calfsocket.meshes.levels import LimbLevels, Place
from calfsocket.postprocess.contact_line import ContactLine
from calfsocket.postprocess.mesh_error import MESH_ERROR
from calfsocket.postprocess.pressure_map import MapLevel, PressureMap
from calfsocket.simulation.record import KEY, LEVEL, CaseRecord

if TYPE_CHECKING:
    import pandas as pd

Cases = dict[tuple[str, str], dict[Place, CaseRecord]]
"""Records by socket and material set, without their level, and by their level."""


def along(records: Iterable[CaseRecord]) -> Cases:
    """Return cases with a level by what they share along the limb."""
    found: Cases = {}
    for record in records:
        if record.level is not None:
            found.setdefault(record.along, {})[record.level] = record
    return found


def map_of(
    limb: LimbLevels,
    cases: Mapping[Place, CaseRecord],
    line_of: Callable[[CaseRecord], ContactLine],
    error_of: Callable[[CaseRecord], float],
) -> PressureMap:
    """Return the contact of a socket and material set over angle and height.

    Parameters
    ----------
    limb
        With all its levels, and those that could not be made.
    cases
        Of the socket and material set, by their level.
    line_of
        Returns the contact of a solved case.
    error_of
        Returns the mesh error of its largest contact pressure; NaN where it has none.
    """
    levels = [MapLevel.of(each, None, None, each.reason) for each in limb.refused]
    for level in limb.levels:
        place = Place(height=level.height, height_mm=level.height_mm)
        record = cases.get(place)
        if record is None:
            levels.append(MapLevel.of(place, level.limb, None, "not asked for"))
        elif record.solved:
            levels.append(
                MapLevel.of(place, level.limb, line_of(record), error_kPa=error_of(record))
            )
        else:
            levels.append(MapLevel.of(place, level.limb, None, record.message or "not finished"))
    levels.sort(key=lambda level: level.place.height)
    socket, material_set = next(iter(cases.values())).along
    return PressureMap(socket, material_set, tuple(levels), limb.levels[0].limb.frame)


def worst_levels(summary: "pd.DataFrame", records: Iterable[CaseRecord]) -> "pd.DataFrame":
    """Return at which level each quantity of each tissue is largest in magnitude.

    Parameters
    ----------
    summary
        That of all solved cases, and their levels by area (`with_levels`).
    records
        Of all cases.

    Returns
    -------
    DataFrame
        One row a socket, material set, tissue and quantity: value and unit, level and height_mm,
        region, x_mm, y_mm and anatomical angle_deg in the unloaded section, and the number of
        levels with results and of all. Levels by area have no site. The share of the skin in
        contact has no worst level.
    """
    records = list(records)
    of_all = along(records)
    of_key = {record.key: record for record in records}
    rows = summary.dropna(subset="value")
    rows = rows[rows.quantity != "contact_share"]
    cases = [of_key[key] for key in zip(rows.socket, rows.material_set, strict=True)]
    places = zip(cases, rows.x_mm, rows.y_mm, strict=True)
    rows = rows.assign(
        socket=[case.along[0] for case in cases],
        angle_deg=[float(case.frame.angle(np.array([x, y]))) for case, x, y in places],
        size=rows.value.abs(),
        levels=[len(of_all[case.along]) for case in cases],
    )
    groups = rows.groupby([*KEY, "tissue", "quantity"], sort=False)
    rows = rows.assign(levels_solved=groups["level"].transform("nunique"))
    columns = [
        *(*KEY, "tissue", "quantity", "value", "unit"),
        *([MESH_ERROR] if MESH_ERROR in rows else []),
        *LEVEL,
        *("region", "x_mm", "y_mm", "angle_deg", "levels_solved", "levels"),
    ]
    return rows.loc[groups["size"].idxmax(), columns].reset_index(drop=True)
