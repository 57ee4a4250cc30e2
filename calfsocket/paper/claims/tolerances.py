"""What the words of the claims mean in numbers, beside ``expected`` in data/checks.csv.

They are the same for all claims and variants.
"""

SAME = 1e-6
"""Inputs that should equal a printed number may differ by this share (rounding of units)."""

THREE_FIGURES = 5e-3
"""Numbers recomputed from printed ones may differ by this share."""

HALF_A_DIGIT = 0.5 + 1e-9
"""A percentage printed without decimals stands for numbers within half a digit."""

DIFFERS_PCT = 1.0
"""Two values "differ" when they do by more than this, in % of the first."""

SITES_DIFFER_MM = 2.0
"""Two sites "differ" when they are farther apart than this: about three element sides."""

ABOUT = 1.25
"""A value is "about" another when neither is larger by more than this factor."""

ABOUT_COUNT = 1.1
"""The same for numbers of elements."""

ABOUT_POINTS = 15.0
"""A relative change is "about" another within so many percentage points, or within `ABOUT`."""

MOST = 0.9
"""A statement on all cells of a table holds when this share of them agrees."""

SEVERAL_HUNDRED_PCT = 200.0
"""Least relative change that is "several hundred percent"."""

MMHG_KPA = 0.133322
"""A millimetre of mercury, kPa."""


def about(ours: float, paper: float, factor: float = ABOUT) -> bool:
    """Whether two magnitudes agree within a factor."""
    return abs(paper) / factor <= abs(ours) <= abs(paper) * factor


def about_change(ours: float, paper: float) -> bool:
    """Whether two relative changes, %, agree; their signs count."""
    near = abs(ours - paper) <= ABOUT_POINTS
    return near or (ours * paper > 0 and about(ours, paper))
