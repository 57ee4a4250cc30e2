"""Surfaces of a limb's tissues as scanners and segmentation programs write them."""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from inspect import signature
from pathlib import Path
from typing import Any

import numpy as np
import pyvista
from vtkmodules.vtkCommonCore import vtkLogger

from calfsocket.imaging.aop import read_aop
from calfsocket.imaging.ply import read_ply
from calfsocket.io.errors import InputError
from calfsocket.io.schema import check_readable
from calfsocket.meshes.curves import Array

#: Units of length, mm.
UNITS = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "inch": 25.4}
#: Largest file of a surface that is read, bytes: some ten million triangles.
MAX_BYTES = 1_000_000_000
#: Width of a limb, mm: the second largest side of its box. One in metres, cm or inch is below.
WIDTH = (40.0, 400.0)
#: Points that are closer together than this, mm, are one.
_SAME = 1e-4
#: Parts of a file with fewer triangles than this are debris: fewer do not close a bone.
_FEWEST_TRIANGLES = 20
#: The one algorithm that pyvista has in Debian 13, which later releases want to be named.
_ALGORITHM = (
    {"algorithm": "dataset_surface"}
    if "algorithm" in signature(pyvista.DataSetFilters.extract_surface).parameters
    else {}
)


@dataclass(frozen=True, eq=False)
class Shell:
    """A connected surface.

    Attributes
    ----------
    name : str
        The file's name without extension, and where it has several shells "shell 1", "shell 2",
        ... by decreasing area.
    surface : PolyData
        Triangles, mm.
    path : Path
        The file.
    """

    name: str
    surface: pyvista.PolyData
    path: Path

    @property
    def title(self) -> str:
        """Name it for records, without the folder."""
        file = self.path.name
        return f"{file}: {self.name}" if self.name != self.path.stem else file

    def __str__(self) -> str:
        """Name it for messages."""
        return f"{self.path}: {self.name}" if self.name != self.path.stem else str(self.path)


def read_shells(paths: Sequence[Path], units: str) -> list[Shell]:
    """Read surfaces and separate them into connected shells, the largest of each file first.

    Raises
    ------
    InputError
        When a file cannot be read or has no surface in it.
    """
    if len(set(paths)) < len(paths):
        twice = next(path for path in paths if list(paths).count(path) > 1)
        raise InputError(f"{twice}: is given twice; give each file once")
    return [shell for path in paths for shell in _separated(path, _scaled(path, units))]


def _scaled(path: Path, units: str) -> pyvista.PolyData:
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise InputError(
            f"{path}: is no surface; the formats of surfaces are {', '.join(sorted(READERS))},"
            " those of plane meshes .msh, .inp, .vtu, .vtk"
        )
    check_readable(path, MAX_BYTES)
    try:
        points, triangles = reader(path)
    except InputError:
        raise
    except _UNREADABLE as error:
        words = " ".join(str(error).split())[:100]
        raise InputError(
            f"{path}: cannot be read as {path.suffix.lower()[1:].upper()}, or is not complete"
            f"{f' ({words})' if words else ''}; export it again"
        ) from None
    if not len(triangles):
        raise InputError(f"{path}: has no triangles; export the surface, not its points alone")
    if triangles.min() < 0 or triangles.max() >= len(points):
        raise InputError(f"{path}: names points that it does not have; export it again")
    points = points * UNITS[units]
    if not np.isfinite(points).all():
        raise InputError(f"{path}: has coordinates that are no numbers; export it again")
    surface = pyvista.PolyData.from_regular_faces(points, triangles)
    return surface.clean(tolerance=_SAME, absolute=True)


#: What readers raise for files that are no such files.
_UNREADABLE = (
    ValueError, KeyError, IndexError, TypeError, OSError, EOFError, MemoryError,
    OverflowError, AttributeError,
)  # fmt: skip


_FILE = re.compile(r"^\w+: |(while )?reading file \S+ ")


@contextmanager
def vtk_errors() -> Iterator[None]:
    """Raise a ValueError for what VTK's readers print."""
    catcher = pyvista.VtkErrorCatcher(send_to_logging=False)
    verbosity = vtkLogger.GetCurrentVerbosityCutoff()
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
    try:
        with catcher:
            yield
    finally:
        vtkLogger.SetStderrVerbosity(verbosity)
    if catcher.events:
        # Without the file, which is named already, and places in bytes.
        raise ValueError(
            re.split(r" in stream|\.\d+$|[.:] *$", _FILE.sub("", catcher.events[0].alert))[0]
        )


def _by_vtk(path: Path) -> tuple[Array, np.ndarray]:
    """Read by VTK, which finds the mistakes of STL, OBJ and VTP."""
    if path.suffix.lower() == ".stl":
        _check_stl(path)
    with vtk_errors():
        reader = pyvista.get_reader(str(path)).reader  # its own `read` may raise what VTK prints
        reader.Update()
        surface: Any = pyvista.wrap(reader.GetOutput())
    if not isinstance(surface, pyvista.PolyData):
        raise ValueError("no surface")
    if surface.n_points and surface.faces.size and not surface.is_all_triangles:
        surface = surface.triangulate()
    faces = surface.faces.reshape(-1, 4)[:, 1:] if surface.faces.size else np.empty((0, 3), int)
    return np.asarray(surface.points, dtype=float), faces


def _check_stl(path: Path) -> None:
    """Raise a ValueError where a binary file is shorter than its header says."""
    size = path.stat().st_size
    with path.open("rb") as file:
        start = file.read(84)
    is_text = start.lstrip().startswith(b"solid") and b"\0" not in start
    number = int.from_bytes(start[80:84], "little")
    if not is_text and size < 84 + 50 * number:
        raise ValueError(f"{number} triangles announced, {max(0, size - 84) // 50} there")


READERS: Mapping[str, Callable[[Path], tuple[Array, np.ndarray]]] = {
    ".stl": _by_vtk,
    ".obj": _by_vtk,
    ".vtp": _by_vtk,
    ".ply": read_ply,
    ".aop": read_aop,
}


def as_surface(cells: pyvista.DataSet) -> pyvista.PolyData:
    """Return the faces of cells that only one of them has."""
    return cells.extract_surface(**_ALGORITHM)


def _separated(path: Path, surface: pyvista.PolyData) -> list[Shell]:
    labelled = surface.connectivity()
    label = labelled.cell_data["RegionId"]
    shells = []
    for number in range(int(label.max()) + 1):
        cells = np.flatnonzero(label == number)
        if len(cells) >= _FEWEST_TRIANGLES:
            shells.append(as_surface(labelled.extract_cells(cells)).triangulate())
    if not shells:
        raise InputError(
            f"{path}: has {surface.n_cells} triangles, which make no surface of a limb"
        )
    shells.sort(key=lambda each: -each.area)
    for each in shells:
        each.clear_data()
    if len(shells) == 1:
        return [Shell(path.stem, shells[0], path)]
    return [Shell(f"shell {i}", each, path) for i, each in enumerate(shells, start=1)]


def check_size(what: str, points: Array, units: str, kind: str = "limb") -> None:
    """Raise an InputError unless points span the size of a limb, or of the `kind` that it is."""
    sides = np.sort(np.ptp(points, axis=0))
    low, high = WIDTH
    if low <= sides[1] <= high:
        return
    fits = [
        name
        for name, factor in UNITS.items()
        if name != units and low <= sides[1] * factor / UNITS[units] <= high
    ]
    advice = (
        f"its lengths may be in {' or '.join(fits)}: add --units {fits[0]}"
        if fits
        else f"give one {kind}, in mm, or say its unit by --units"
    )
    box = " x ".join(f"{side:.3g}" for side in sides if side)
    raise InputError(
        f"{what}: is {box} mm, which is no {kind} ({low:g} to {high:g} mm wide); {advice}"
    )
