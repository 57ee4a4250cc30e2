"""The way through stages of loading as a table, and its limits in words."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from calfsocket.mechanics.stages import Limit, Point
from calfsocket.meshes.frame import Frame

if TYPE_CHECKING:
    import pandas as pd


def sides(frame: Frame) -> tuple[str, str]:
    """Return the names of +x and +y in columns: x and y where the axes are not known."""
    first, second, *_ = frame.words
    return first.removeprefix("+"), second.removeprefix("+")


def curve_table(points: Sequence[Point], frame: Frame) -> "pd.DataFrame":
    """Return one row an equilibrium: loads, motion of the socket, slip, and work.

    Forces, moments and work are for each mm of limb length; motion, work and changes of volume
    count from the donned socket. Moment and rotation are counter-clockwise in the section.
    """
    import pandas as pd

    x, y = sides(frame)
    tissues = list(dict.fromkeys(tissue for point in points for tissue in point.volume))
    return pd.DataFrame(
        {
            "stage": point.stage or "donned",
            f"force_{x}_N_per_mm": point.force[0],
            f"force_{y}_N_per_mm": point.force[1],
            "moment_N_mm_per_mm": point.force[2],
            f"displacement_{x}_mm": point.place[0],
            f"displacement_{y}_mm": point.place[1],
            "rotation_deg": float(np.degrees(point.place[2])),
            **{
                f"volume_{tissue}_percent": 100.0 * point.volume.get(tissue, 0.0)
                for tissue in tissues
            },
            "pressing_N_per_mm": point.pressing,
            "slipping_percent": 100.0 * point.slipping,
            "dissipated_N_mm_per_mm": point.dissipated,
            "applied_N_mm_per_mm": point.applied,
            "newton_iterations": point.iterations,
            "relative_imbalance": point.imbalance,
        }
        for point in points
    )


def in_words(limit: Limit, frame: Frame) -> str:
    """Say which force could not be borne, e.g. "limit reached at moment 23.4 N mm/mm of 40".

    Or up to where it was followed, if it still rose there.
    """
    names = (*(f"{side} force" for side in sides(frame)), "moment")
    units = ("N/mm", "N/mm", "N mm/mm")
    size = np.abs(limit.asked).max()
    parts = [
        f"{name} {reached:.4g} {unit} of {asked:.4g}"
        for name, unit, reached, asked in zip(names, units, limit.force, limit.asked, strict=True)
        if abs(asked - reached) > 1e-9 * size  # the others have come to what was asked for
    ]
    if limit.still_rises:
        return f"no equilibrium found beyond {', '.join(parts)}, where it still rises"
    return f"limit reached at {', '.join(parts)}"
