r"""What merging fascia and muscle changes: the paper's relative changes of maxima and at sites.

Equation (3) of the paper, in percent, of signed values with the Separate set as reference,

.. math:: 100 \frac{c - s}{|s|},

is positive when the signed value rises. For a negative stress whose magnitude grows it is
negative: in 32 of 60 cells of the paper its sign is opposite to that of the change of magnitude,

.. math:: 100 \frac{|c| - |s|}{|s|},

which stands beside it here.
"""

from typing import Any

import numpy as np
import pandas as pd

from calfsocket.postprocess.quantities import (
    SUMMARY_TISSUES,
    UNITS,
    Maximum,
    contact_rows,
    first_largest,
    level_at,
    running_mean,
)
from calfsocket.postprocess.quantities import maximum as tissue_maximum
from calfsocket.report.results import Results, SolvedCase

COLUMNS = (
    "socket",
    "tissue",
    "outcome",
    "site",
    "separate",
    "combined",
    "relative_change_pct",
    "magnitude_change_pct",
    "region",
    "x_mm",
    "y_mm",
)
SITES = ("max_separate", "max_combined", "max_both")


def relative_change(separate: float, combined: float) -> float:
    """Equation (3) of signed values, %; NaN where the reference is 0."""
    return 100 * (combined - separate) / abs(separate) if separate else np.nan


def magnitude_change(separate: float, combined: float) -> float:
    """Change of magnitude, %; NaN where the reference is 0."""
    return relative_change(abs(separate), abs(combined))


def relative_changes(results: Results) -> pd.DataFrame:
    """Compare the two sets in every socket that has both.

    Parameters
    ----------
    results : Results
        Of a study.

    Returns
    -------
    DataFrame
        One row a socket, tissue, outcome and site, with `COLUMNS`: values of both sets in the
        outcome's unit (`outcomes.UNITS`), changes in %, and the site in the reference section.
        site "max_separate" compares both sets where Separate has its maximum, "max_combined" where
        Combined has it, "max_both" each set's own maximum, wherever it is (paper, section 2.4).
        Contact pressure stands with the skin: contact_pressure_max at its sites, and
        contact_pressure_mean, which has no site.
    """
    rows: list[dict[str, Any]] = []
    for socket in filter(results.complete, results.sockets):
        separate, combined = results.case(socket, "separate"), results.case(socket, "combined")
        for tissue in SUMMARY_TISSUES:
            for outcome in UNITS:
                if outcome != "pressure" or tissue == "vessel":
                    rows += _tissue_rows(separate, combined, tissue, outcome, socket)
            if tissue == "skin":
                rows += _contact_rows(separate, combined, socket)
    return pd.DataFrame(rows, columns=list(COLUMNS))


def _row(separate: float, combined: float, site: str, held: Maximum | None) -> dict[str, Any]:
    place = held or Maximum(np.nan, np.nan, np.nan, "")
    return {
        "site": site,
        "separate": separate,
        "combined": combined,
        "relative_change_pct": relative_change(separate, combined),
        "magnitude_change_pct": magnitude_change(separate, combined),
        "region": place.region,
        "x_mm": place.x_mm,
        "y_mm": place.y_mm,
    }


def _tissue_rows(
    separate: SolvedCase, combined: SolvedCase, tissue: str, outcome: str, socket: str
) -> list[dict[str, Any]]:
    s, c = (
        tissue_maximum(case.fields, case.outcomes, case.pairs, tissue, outcome)
        for case in (separate, combined)
    )

    def at(case: SolvedCase, site: Maximum) -> float:
        place = (site.x_mm, site.y_mm)
        return level_at(case.fields, case.outcomes, case.pairs, tissue, outcome, place)

    rows = [
        _row(s.value, at(combined, s), "max_separate", s),
        _row(at(separate, c), c.value, "max_combined", c),
        _row(s.value, c.value, "max_both", None),
    ]
    return [{"socket": socket, "tissue": tissue, "outcome": outcome, **row} for row in rows]


def _contact_rows(separate: SolvedCase, combined: SolvedCase, socket: str) -> list[dict[str, Any]]:
    cases = (separate, combined)
    # point by point: the skin's mesh is the same in both sets
    smooth = [running_mean(case.contact) for case in cases]
    peaks, means = [], []
    for case in cases:
        largest, mean, _ = contact_rows(case.fields, case.contact)
        peaks.append(Maximum(*(largest[key] for key in ("value", "x_mm", "y_mm", "region"))))
        means.append(mean["value"])
    rows = []
    for site, own, peak in zip(SITES, smooth, peaks, strict=False):
        point = first_largest(own)
        rows.append(_row(smooth[0][point], smooth[1][point], site, peak))
    rows.append(_row(peaks[0].value, peaks[1].value, "max_both", None))
    both_means = _row(means[0], means[1], "max_both", None)
    skin = {"socket": socket, "tissue": "skin"}
    return [
        *({**skin, "outcome": "contact_pressure_max", **row} for row in rows),
        {**skin, "outcome": "contact_pressure_mean", **both_means},
    ]
