"""Files of a study, one small writer a format; a reader always sees a whole file.

Every file is written beside its place, flushed to the disk and moved there in one step.
"""

import errno
import fcntl
import json
import os
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from calfsocket.errors import WriteError, in_one_line
from calfsocket.outcomes import UNITS, cell_outcomes
from calfsocket.section_fields import GAUSS_POINTS, TISSUES, SectionFields

FLOAT_FORMAT = "%.10g"
FIELDS_FILE = "fields.vtu"

_UNFINISHED = ".unfinished-"
"""Start of the name of a file that is being written."""


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a temporary path in the folder of `path`; at the end it takes the place of `path`.

    If the body fails, `path` stays as it was.

    Raises
    ------
    WriteError
        When there is no space, no right, no such folder.
    """
    path = Path(path)
    try:
        with _temporary(path) as temporary:
            yield temporary
            umask = os.umask(0)
            os.umask(umask)
            temporary.chmod(0o666 & ~umask)  # mkstemp's files are for their owner alone
            with temporary.open("rb+") as file:
                os.fsync(file.fileno())
            temporary.replace(path)
    except WriteError:
        raise
    except OSError as error:
        advice = "; free some space" if error.errno in (errno.ENOSPC, errno.EDQUOT) else ""
        raise WriteError(f"{path}: cannot be written: {error.strerror or error}{advice}") from error


@contextmanager
def _temporary(path: Path) -> Iterator[Path]:
    """Give an empty file beside `path`, locked as long as this process lives and needs it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=_UNFINISHED, suffix=path.suffix)
    temporary = Path(name)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield temporary
    finally:
        os.close(handle)
        temporary.unlink(missing_ok=True)


def remove_unfinished(folder: Path) -> None:
    """Remove what processes that were killed while they wrote have left in a folder."""
    for temporary in folder.glob(f"{_UNFINISHED}*"):
        with suppress(OSError), temporary.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)  # refused while somebody writes
            temporary.unlink()


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold the folder's lock; other processes that ask for it wait."""
    folder.mkdir(parents=True, exist_ok=True)
    # The lock file stays: removing it would let two processes lock two different files.
    with (folder / ".lock").open("a") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


def write_json(path: Path, content: object) -> None:
    """Write JSON, indented, keys in the order given."""
    text = json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _text(value: object) -> str:
    if isinstance(value, float | np.floating):
        return "" if np.isnan(value) else FLOAT_FORMAT % (value + 0.0)  # -0 is written as 0
    return "" if value is None else str(value)


def merge_csv(
    path: Path, rows: pd.DataFrame, key: Sequence[str], order: Sequence[tuple[str, ...]]
) -> None:
    """Put a case's rows into a CSV that several cases share, in place of its earlier rows.

    Several processes may do so at the same time. Rows of other cases are kept to the letter.

    Parameters
    ----------
    path
        The shared file; made if it does not exist.
    rows
        This case's rows, in the order to keep. Floats are written with `FLOAT_FORMAT`,
        NaN as an empty cell.
    key
        Columns that name a case.
    order
        Cases in the study's order; cases that are not among them come last, in order of name.
    """
    path, key = Path(path), list(key)
    new = rows.map(_text)
    cases = set(new[key].itertuples(index=False, name=None))
    rank = {case: place for place, case in enumerate(order)}
    with locked(path.parent):
        merged = new
        if path.exists():
            old = _read_table(path, key)
            others = [case not in cases for case in old[key].itertuples(index=False, name=None)]
            merged = pd.concat([new, old[others]], ignore_index=True).fillna("")
        names = [tuple(case) for case in merged[key].itertuples(index=False, name=None)]
        places = sorted(
            range(len(names)), key=lambda i: (rank.get(names[i], len(rank)), names[i], i)
        )
        with replacing(path) as temporary:
            merged.iloc[places].to_csv(temporary, index=False)


def _read_table(path: Path, key: Sequence[str]) -> pd.DataFrame:
    """Read a CSV as text.

    Raises
    ------
    WriteError
        When it is no table with the columns of `key`, so that no row can be put into it.
    """
    try:
        table = pd.read_csv(path, dtype=str, keep_default_na=False)
        table[key]
    except (ValueError, KeyError) as error:
        raise WriteError(
            f"{path}: is not the table that was written there; move it away, or restore it "
            f"({in_one_line(error)})"
        ) from None
    return table


def write_fields(folder: Path, fields: SectionFields, socket: str, material_set: str) -> Path:
    """Write fields.vtu of one case, for ParaView and for `read_fields`.

    Nodes are doubled where regions meet, so that stresses may jump there. Point data are for
    looking at (displacement, and the outcomes averaged within each tissue); cell data hold what
    was computed, at the Gauss points; names of regions and tissues are in the field data, indexed
    by `region_ids` and by tissue.
    """
    import pyvista  # takes a second, which only this function needs

    n_nodes = len(fields.points)
    node_of_region = fields.region[:, None] * n_nodes + fields.cells
    copies, cells = np.unique(node_of_region, return_inverse=True)
    cells = cells.reshape(fields.cells.shape)
    node = copies % n_nodes
    pad = ((0, 0), (0, 1))
    grid = pyvista.UnstructuredGrid(
        {pyvista.CellType.QUADRATIC_TRIANGLE: cells}, np.pad(fields.points[node], pad)
    )
    grid.point_data["displacement"] = np.pad(fields.displacement[node], pad)
    unit_names = {"kPa": "kPa", "%": "percent"}
    for name, values in cell_outcomes(fields).nodal.items():
        at_node = np.empty(len(node))
        at_node[cells] = values
        grid.point_data[f"{name}_{unit_names[UNITS[name]]}"] = at_node
    grid.point_data["node"] = node
    grid.cell_data["region"] = fields.region
    grid.cell_data["tissue"] = fields.tissue
    n_cells = len(cells)
    grid.cell_data["gauss_stress_kPa"] = fields.stress.reshape(n_cells, 12)
    grid.cell_data["gauss_deformation_gradient"] = fields.deformation_gradient.reshape(n_cells, 12)
    grid.cell_data["gauss_pressure_kPa"] = fields.pressure
    ids = sorted(fields.region_names)
    grid.field_data["region_ids"] = np.array(ids)
    grid.field_data["region_names"] = [fields.region_names[i] for i in ids]
    grid.field_data["region_tissues"] = [fields.region_tissues[i] for i in ids]
    grid.field_data["tissue_names"] = list(TISSUES)
    grid.field_data["socket"] = [socket]
    grid.field_data["material_set"] = [material_set]
    path = Path(folder) / FIELDS_FILE
    with replacing(path) as temporary:
        temporary.write_text(_vtu(grid), encoding="ascii")
    return path


def _vtu(grid: Any) -> str:
    """Text of a grid's file. VTK itself must not write it: on a full disk it crashes."""
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridWriter

    writer = vtkXMLUnstructuredGridWriter()
    writer.SetInputData(grid)
    writer.SetDataModeToBinary()
    writer.WriteToOutputStringOn()
    writer.Write()
    text: str = writer.GetOutputString()
    return text


def read_fields(folder: Path) -> SectionFields:
    """Read back what `write_fields` wrote, without loss."""
    import pyvista

    grid = pyvista.read(Path(folder) / FIELDS_FILE)
    node = np.asarray(grid.point_data["node"])
    n_nodes = int(node.max()) + 1
    points, displacement = np.zeros((n_nodes, 2)), np.zeros((n_nodes, 2))
    points[node] = grid.points[:, :2]
    displacement[node] = grid.point_data["displacement"][:, :2]
    ids = [int(i) for i in grid.field_data["region_ids"]]
    n_cells = grid.n_cells
    return SectionFields(
        points=points,
        cells=node[grid.cells_dict[pyvista.CellType.QUADRATIC_TRIANGLE]],
        region=np.asarray(grid.cell_data["region"]),
        region_names=dict(zip(ids, map(str, grid.field_data["region_names"]), strict=True)),
        region_tissues=dict(zip(ids, map(str, grid.field_data["region_tissues"]), strict=True)),
        displacement=displacement,
        stress=np.asarray(grid.cell_data["gauss_stress_kPa"]).reshape(n_cells, 3, 4),
        deformation_gradient=np.asarray(grid.cell_data["gauss_deformation_gradient"]).reshape(
            n_cells, 3, 2, 2
        ),
        pressure=np.asarray(grid.cell_data["gauss_pressure_kPa"]),
        gauss_points=GAUSS_POINTS,
    )
