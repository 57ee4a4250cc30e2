"""The paper's own numbers, as printed: Tables 1 to 5, pressures, and its checkable claims.

The column `printed` holds the digits of the paper and is never corrected; where a number
contradicts others of the paper, `note` says so. Tissues, quantities and sets have this
package's names. Sites are those of `report.names.SITES`.
"""

from functools import cache
from importlib.resources import files

import pandas as pd

TABLES = (1, 2, 3, 4, 5)

# How its parts begin in the list of claims; all others have their own name there.
PARTS = {"1": "Introduction", "2": "Method", "3": "Results", "4": "Discussion", "T": "Tables"}


@cache
def table(number: int) -> pd.DataFrame:
    """Table 1 to 5, one row a printed number."""
    return _read(f"table{number}.csv").astype({"printed": float})


@cache
def pressure() -> pd.DataFrame:
    """Relative change of the largest contact pressure, and the vessels' pressure (text only)."""
    return _read("pressure.csv").astype({"printed": float})


@cache
def claims() -> pd.DataFrame:
    """Checkable claims: id, section, line of the text, kind, claim, and what its tables say."""
    return _read("claims.csv")


@cache
def checks() -> pd.DataFrame:
    """How each claim is checked: see `claims.rules`."""
    return _read("checks.csv").set_index("id")


def maxima() -> pd.DataFrame:
    """Tables 2 and 4 together."""
    return pd.concat([table(2), table(4)], ignore_index=True)


@cache
def maximum() -> "pd.Series[float]":
    """Tables 2 and 4 by tissue, quantity, socket and material set."""
    return maxima().set_index(["tissue", "quantity", "socket", "material_set"]).printed


def changes() -> pd.DataFrame:
    """Tables 3 and 5 together."""
    return pd.concat([table(3), table(5)], ignore_index=True)


def _read(name: str) -> pd.DataFrame:
    with (files("calfsocket.paper") / "data" / name).open(encoding="utf-8") as file:
        return pd.read_csv(file, dtype=str, keep_default_na=False)
