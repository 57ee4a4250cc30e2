"""A process that writes into a shared table; it imports no more than that needs."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from calfsocket.io.tables import merge_csv

KEY = ["socket", "material_set"]
ORDER = [(s, m) for s in ("TC", "TSB", "HS") for m in ("separate", "combined")]


def rows(socket: str, material_set: str, values: Any) -> pd.DataFrame:
    return pd.DataFrame({"socket": socket, "material_set": material_set, "value": values})


def write_often(path: Path, socket: str, material_set: str, start: Any) -> None:
    start.wait()
    for i in range(10):
        merge_csv(path, rows(socket, material_set, np.arange(200) + i), KEY, ORDER)
