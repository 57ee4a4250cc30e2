"""Whether cases failed by chance, or where some input is."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calfsocket.uncertainty.inputs import Array

LEVEL = 0.05
"""Probability of calling failures that happened by chance a pattern, over all inputs together."""


@dataclass(frozen=True)
class Pattern:
    """Where cases failed.

    Attributes
    ----------
    inputs : mapping of str to str
        Inputs that failed cases have larger, or smaller, values of than the others: which.
    tells : bool
        Whether there are failures enough for the test to find anything.
    """

    inputs: dict[str, str]
    tells: bool


def pattern(names: Sequence[str], values: Array, failed: NDArray[np.bool_]) -> Pattern:
    """Compare the inputs (n, d) of failed cases with those of the others.

    By the rank sum test of Mann and Whitney for each input, at `LEVEL` over their number.
    """
    from scipy.stats import mannwhitneyu

    level = LEVEL / len(names)
    some, n = int(failed.sum()), len(failed)
    if not 0 < some < n or 2 / math.comb(n, some) > level:
        return Pattern({}, False)
    found = {}
    for i, name in enumerate(names):
        test = mannwhitneyu(values[failed, i], values[~failed, i])
        if test.pvalue < level:
            larger = test.statistic > some * (n - some) / 2
            found[name] = "large" if larger else "small"
    return Pattern(found, True)
