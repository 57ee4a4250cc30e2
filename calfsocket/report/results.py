"""The results of a study, read back from its folder."""

import json
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from calfsocket.io.errors import InputError
from calfsocket.postprocess.contact_line import ContactLine
from calfsocket.postprocess.fields import TISSUES, SectionFields
from calfsocket.postprocess.quantities import CellOutcomes, Neighbours, cell_outcomes, neighbours
from calfsocket.postprocess.vtu import FIELDS_FILE, read_fields
from calfsocket.report.calibration import Calibration, read_calibration
from calfsocket.report.names import SOCKETS

RUN_FILE = "run.json"
SUMMARY_FILE = "summary.csv"
STEPS_FILE = "steps.csv"
CONTACT_FILE = "contact.csv"

VARIANTS_FOLDER = "variants"

MATERIAL_SETS = ("separate", "combined")
PAPER = tuple((socket, name) for socket in SOCKETS for name in MATERIAL_SETS)
"""The paper's six cases."""


@dataclass(frozen=True)
class SolvedCase:
    """A solved case: its fields, and what is read from them more than once."""

    fields: SectionFields
    contact: ContactLine

    @cached_property
    def outcomes(self) -> CellOutcomes:
        """Outcomes cell by cell."""
        return cell_outcomes(self.fields)

    @cached_property
    def pairs(self) -> Neighbours:
        """Pairs of neighbouring cells within a tissue."""
        return neighbours(self.fields)


@dataclass(frozen=True)
class Results:
    """Results of a study: all cases that reached their full load.

    Attributes
    ----------
    folder : Path
        Where the files are.
    run : dict
        Content of run.json.
    summary, contact : DataFrame
        Rows of summary.csv and contact.csv of the solved cases, in the order of the study.
    steps : DataFrame
        All rows of steps.csv.
    sockets, material_sets : tuple of str
        Those of the solved cases, in the order of the study.
    cases : tuple of (str, str)
        Socket and material set of the solved cases.
    left_out : dict of str to str
        Name of every case that did not reach its full load -> why.
    """

    folder: Path
    run: dict[str, Any]
    summary: pd.DataFrame
    steps: pd.DataFrame
    contact: pd.DataFrame
    sockets: tuple[str, ...]
    material_sets: tuple[str, ...]
    cases: tuple[tuple[str, str], ...]
    left_out: dict[str, str]
    _solved: dict[tuple[str, str], SolvedCase] = field(
        default_factory=dict, repr=False, compare=False
    )

    def fields(self, socket: str, material_set: str) -> SectionFields:
        """Displacement, stress and strain of a solved case, read when first asked for."""
        return self.case(socket, material_set).fields

    def case(self, socket: str, material_set: str) -> SolvedCase:
        """Fields and contact of a solved case, read when first asked for."""
        key = (socket, material_set)
        if key not in self.cases:
            raise InputError(f"{self.folder}: holds no solved case {_name(key)}")
        if key not in self._solved:
            fields = _fields(self.folder / _name(key))
            self._solved[key] = SolvedCase(fields, contact_line(of_case(self.contact, key), fields))
        return self._solved[key]

    @cached_property
    def calibration(self) -> Calibration:
        """The calibration in the study's folder; that of a variant is its study's.

        Raises
        ------
        NoCalibration, InputError
            When there is none, or it cannot be used.
        """
        folder = self.folder.resolve()
        is_variant = folder.parent.name == VARIANTS_FOLDER
        return read_calibration(folder.parents[1] if is_variant else self.folder)

    @cached_property
    def of_paper(self) -> "Results | None":
        """These results without cases that are not the paper's; None where no other is solved."""
        cases = tuple(key for key in self.cases if is_of_paper(key))
        if not cases or cases == self.cases:
            return self if cases else None
        return replace(
            self,
            summary=_only(self.summary, cases),
            contact=_only(self.contact, cases),
            sockets=tuple(dict.fromkeys(socket for socket, _ in cases)),
            material_sets=tuple(
                name for name in self.material_sets if any(key[1] == name for key in cases)
            ),
            cases=cases,
            left_out={
                name: why
                for name, why in self.left_out.items()
                if name in {"_".join(key) for key in PAPER}
            },
        )

    def complete(self, socket: str) -> bool:
        """Whether both material sets of a socket are solved."""
        return all((socket, name) in self.cases for name in MATERIAL_SETS)

    def value(self, socket: str, material_set: str, tissue: str, outcome: str) -> float:
        """Value of summary.csv; NaN where there is none."""
        rows = of_case(self.summary, (socket, material_set))
        values = rows.value[(rows.tissue == tissue) & (rows.outcome == outcome)]
        return float(values.iloc[0]) if len(values) else np.nan


def read_results(folder: Path) -> Results:
    """Read a study's results.

    Raises
    ------
    InputError
        When a file is missing or cannot be read, or no case reached its full load.
    """
    folder = Path(folder)
    run = _read_run(folder / RUN_FILE)
    entries = run["cases"]
    known = _order(run)
    solved = tuple(key for key in known if entries[_name(key)]["status"] == "solved")
    left_out = {
        _name(key): entries[_name(key)].get("message") or "not finished"
        for key in known
        if key not in solved
    }
    if not solved:
        why = "; ".join(f"{name}: {text}" for name, text in left_out.items()) or "it holds no case"
        raise InputError(f"{folder}: no case reached its full load ({why}); solve the study first")
    tables = {
        name: _read_table(folder / name, solved)
        for name in (SUMMARY_FILE, STEPS_FILE, CONTACT_FILE)
    }
    for key in solved:
        if not (folder / _name(key) / FIELDS_FILE).is_file():
            raise InputError(f"{folder / _name(key)}: holds no {FIELDS_FILE}; solve the case again")
    return Results(
        folder=folder,
        run=run,
        summary=_only(tables[SUMMARY_FILE], solved),
        steps=tables[STEPS_FILE],
        contact=_only(tables[CONTACT_FILE], solved),
        sockets=tuple(dict.fromkeys(socket for socket, _ in solved)),
        material_sets=tuple(
            name
            for name in dict.fromkeys(key[1] for key in known)
            if any(key[1] == name for key in solved)
        ),
        cases=solved,
        left_out=left_out,
    )


def is_of_paper(key: tuple[str, str]) -> bool:
    """Tell whether a case is one of the paper's six, by its names, which no other may have."""
    return key in PAPER


def _order(run: dict[str, Any]) -> list[tuple[str, str]]:
    """Socket and material set of every case of a run, in the order of the study."""
    entries = run["cases"]
    names = dict.fromkeys((*run["inputs"].get("cases", ()), *map("_".join, PAPER), *entries))
    found = []
    for name in names:
        if name in entries:
            socket, _, material_set = name.rpartition("_")
            entry = entries[name]
            found.append((entry.get("socket", socket), entry.get("material_set", material_set)))
    return found


def of_case(table: pd.DataFrame, key: tuple[str, str]) -> pd.DataFrame:
    """Rows of a case."""
    return table[(table.socket == key[0]) & (table.material_set == key[1])]


def contact_line(rows: pd.DataFrame, fields: SectionFields) -> ContactLine:
    """Contact of a case from its rows of contact.csv.

    The length that each point stands for is not in the file: it is the weight of the Gauss point of
    the skin's outline that lies, deformed, where the row says.
    """
    edges = free_edges(fields, fields.tissue == TISSUES.index("skin"))
    per_edge = len(rows) // len(edges)
    s, weight = np.polynomial.legendre.leggauss(per_edge)
    shape = np.column_stack([s * (s - 1) / 2, s * (s + 1) / 2, 1 - s**2])
    slope = np.column_stack([s - 0.5, s + 0.5, -2 * s])
    position = shape @ (fields.points + fields.displacement)[edges]
    length = weight * np.linalg.norm(slope @ fields.points[edges], axis=2)
    place = rows[["x_mm", "y_mm"]].to_numpy()
    _, nearest = cKDTree(position.reshape(-1, 2)).query(place)
    return ContactLine(
        arc_mm=rows.arc_mm.to_numpy(),
        angle_deg=rows.angle_deg.to_numpy(),
        x_mm=place[:, 0],
        y_mm=place[:, 1],
        pressure_kPa=rows.pressure_kPa.to_numpy(),
        shear_kPa=rows.shear_kPa.to_numpy(),
        gap_mm=rows.gap_mm.to_numpy(),
        weight_mm=length.ravel()[nearest],
        status=rows.status.to_numpy(dtype=str),
        circumference_mm=float(length.sum()),
    )


def free_edges(fields: SectionFields, chosen: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return ends and middle of the edges of the chosen cells that no other cell has, (n, 3)."""
    cells = fields.cells[chosen]
    corners = cells[:, :3]
    edges = np.stack([corners, np.roll(corners, -1, axis=1), cells[:, 3:]], axis=2).reshape(-1, 3)
    uses = np.bincount(fields.cells[:, 3:].ravel(), minlength=len(fields.points))
    return edges[uses[edges[:, 2]] == 1]


def _name(key: tuple[str, str]) -> str:
    return "_".join(key)


def _read_run(path: Path) -> dict[str, Any]:
    try:
        run = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read ({error}); name a folder of results") from None
    for key in ("inputs", "laws", "limb", "sockets", "cases"):
        if not (isinstance(run, dict) and isinstance(run.get(key), dict)):
            raise InputError(f"{path}: has no '{key}'; it is not the run.json of a study")
    return run


def _read_table(path: Path, solved: tuple[tuple[str, str], ...]) -> pd.DataFrame:
    try:
        table = pd.read_csv(path)
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read ({error}); solve the study again") from None
    for column in ("socket", "material_set"):
        if column not in table:
            raise InputError(f"{path}: has no column '{column}'; it is not the table of a study")
    for key in solved:
        if of_case(table, key).empty:
            raise InputError(f"{path}: has no row of {_name(key)}, which {RUN_FILE} calls solved")
    return table


def _only(table: pd.DataFrame, solved: tuple[tuple[str, str], ...]) -> pd.DataFrame:
    return pd.concat([of_case(table, key) for key in solved], ignore_index=True)


def _fields(folder: Path) -> SectionFields:
    try:
        return read_fields(folder)
    except (OSError, ValueError, KeyError) as error:
        raise InputError(
            f"{folder / FIELDS_FILE}: cannot be read ({error}); solve the case again"
        ) from None
