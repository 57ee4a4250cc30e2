"""The error of a number by its change to a second mesh: the grid convergence index of two meshes.

Roache (1994, doi:10.1115/1.2910291): on meshes whose element sizes have the ratio r, a number that
converges with the order p and changes by e is off by e/(r^p - 1) on the finer one; where two meshes
alone cannot show the order, he takes that which the method has in theory and three times the
result. Here p is 2, that of stresses of quadratic displacements, and r^2 is the ratio of the
numbers of elements, so that

    mesh error = 3 e/(r^2 - 1)          where this mesh is the finer one,
    mesh error = e + 3 e/(r^2 - 1)      where the second is, and so has that error itself.

Two meshes may agree in one level by chance. So a level has the largest relative change among itself
and its neighbours, those of the shares above and below.
"""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from calfsocket.io.errors import InputError
from calfsocket.postprocess.levels import BELOW, LOWER, NEARLY_ALL, STATISTICS, UPPER
from calfsocket.postprocess.quantities import SIGNED

if TYPE_CHECKING:
    import pandas as pd

SAFETY = 3.0
"""Roache's factor for two meshes."""

SMALLEST_RATIO = 1.2
"""Of the numbers of elements: meshes that are more alike show no difference but by chance."""

SETTLED = 0.02
"""A number whose mesh error is a larger share of its magnitude has not settled."""

TOGETHER = "\N{NO-BREAK SPACE}"  # a narrow cell breaks before its bracket, not within it

MESH_ERROR = "mesh_error"
"""Column of a number's error in its unit; of levels behind the name of each."""


def error_of(column: str) -> str:
    """Return the column with the error of a column of levels."""
    return f"{column}_{MESH_ERROR}"


def times_change(cells: int, second: int) -> float:
    """Return by what the change of a number to a second mesh is multiplied.

    Parameters
    ----------
    cells, second : int
        Elements of the mesh and of the second one.

    Raises
    ------
    InputError
        Where the two have nearly as many.
    """
    ratio = max(cells, second) / min(cells, second)
    if ratio < SMALLEST_RATIO:
        raise InputError(
            f"the second mesh has {second} triangles, too nearly as many as the first, {cells}; "
            "choose another mesh size"
        )
    of_finer = SAFETY / (ratio - 1.0)
    return of_finer if cells > second else 1.0 + of_finer


def of_maxima(first: "pd.DataFrame", second: "pd.DataFrame", times: float) -> "pd.DataFrame":
    """Return rows of a summary with a column `mesh_error`, by the same rows of a second mesh.

    Components with a direction count by their magnitude. What the second mesh lacks has none.
    """
    key = ["tissue", "quantity"]
    other = second.drop_duplicates(key).set_index(key).value
    theirs = other.reindex(first.set_index(key).index).to_numpy()
    mine = first.value.to_numpy()
    signed = first.quantity.isin(SIGNED).to_numpy()
    change = np.where(signed, np.abs(mine) - np.abs(theirs), mine - theirs)
    return first.assign(**{MESH_ERROR: times * np.abs(change)})


def of_levels(first: "pd.DataFrame", second: "pd.DataFrame", times: float) -> "pd.DataFrame":
    """Return levels by area with a column for the error of each, by those of a second mesh.

    Means and levels of both ends may lie around 0: their changes count as shares of the rms where
    that is larger than they are.
    """
    key = ["tissue", "region", "quantity"]
    theirs = second.set_index(key).reindex(first.set_index(key).index)
    rms = first[["rms"]].to_numpy()
    errors: dict[str, NDArray[np.float64]] = {}
    for columns in (["mean"], ["rms"], BELOW, UPPER, LOWER):
        mine = first[[*columns]].to_numpy()
        size = np.abs(mine) if columns is BELOW else np.maximum(np.abs(mine), rms)
        change = np.abs(mine - theirs[[*columns]].to_numpy())
        share = np.divide(change, size, out=np.zeros_like(size), where=size > 0)
        found = times * np.maximum(_with_neighbours(share) * size, change)
        errors |= dict(zip(map(error_of, columns), found.T, strict=True))
    return first.assign(**{error_of(name): errors[error_of(name)] for name in STATISTICS})


def with_levels(
    summary: "pd.DataFrame", levels: "pd.DataFrame", level: str = NEARLY_ALL
) -> "pd.DataFrame":
    """Return rows of a summary, and behind them what nearly all of each tissue stays below.

    Parameters
    ----------
    summary, levels
        Of the same cases, both with or both without mesh errors; more columns stay.
    level
        One of `BELOW`.

    Returns
    -------
    DataFrame
        The rows of the summary, and of whole tissues and of contact rows with the quantity
        ``QUANTITY_below_99.9``, its value and its mesh_error in the place of all numbers.
    """
    import pandas as pd

    whole = levels[levels.region.fillna("") == ""]
    found = {"quantity": whole["quantity"] + f"_{level}", "value": whole[level]}
    if error_of(level) in whole:
        found[MESH_ERROR] = whole[error_of(level)]
    rows = whole.assign(**found)
    columns = [name for name in rows if name in summary]
    return pd.concat([summary, rows[columns]], ignore_index=True)


def _with_neighbours(shares: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the largest of each column and those beside it."""
    padded = np.pad(shares, ((0, 0), (1, 1)), mode="edge")
    return np.maximum(np.maximum(padded[:, :-2], padded[:, 2:]), shares)


def settled(value: float, error: float) -> bool:
    """Return whether a number has settled; False where its error is not known."""
    return bool(error <= SETTLED * abs(value))


def with_error(text: str, value: float, error: float, written: str = "", of: float = 0.0) -> str:
    """Return a number as text with its error behind it, and a star where it has not settled.

    Parameters
    ----------
    text
        The number. Its error has the same decimals; where these would be zeros, it says what it
        is below. A number that is 0 on both meshes stays alone, and so does one whose error is not
        known.
    value, error
        The number and its error.
    written
        How the error is written, where not with decimals.
    of
        What a change in percent is a change of, 100: it has settled where its error is small
        beside the larger of the two numbers.
    """
    if not (np.isfinite(error) and np.isfinite(value)) or value == 0 == error:
        return text
    decimals = len(text.partition(".")[2])
    half = 0.5 * 10.0**-decimals
    small = f"<{half:.{decimals + 1}f}" if error < half else f"{error:.{decimals}f}"
    star = "" if settled(max(abs(value + of), of), error) else "*"
    return f"{text}{TOGETHER}\N{PLUS-MINUS SIGN}{TOGETHER}{written or small}{star}"
