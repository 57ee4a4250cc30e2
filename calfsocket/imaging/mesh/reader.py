"""A plane mesh from a file of another program: its triangles, and its sets by name."""

from collections.abc import Mapping, Sequence
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from calfsocket.imaging.mesh.abaqus import read_deck
from calfsocket.imaging.mesh.elements import NODES, Block, triangles
from calfsocket.io.errors import InputError
from calfsocket.io.schema import check_readable, nearest, read_text
from calfsocket.meshes.curves import Array

if TYPE_CHECKING:
    import meshio

#: Ends of names.
SUFFIXES = (".msh", ".inp", ".vtu", ".vtk")
#: How a file that is not understood is written anew.
_AGAIN = {
    ".msh": "export it again, as version 2.2 or 4.1, its physical groups alone"
    " (Mesh.SaveAll = 0) and not partitioned",
    ".vtu": "save it again, with numbers in the file itself",
    ".vtk": "save it as .vtu",
}
#: Largest file, bytes: some million triangles.
MAX_BYTES = 200_000_000
#: Arrays of numbers of cells that say the region, where there are several, in lower case.
_REGION_ARRAYS = (
    "gmsh:physical", "region", "regions", "material", "materials", "materialids", "material_ids",
    "matid", "partid", "part", "label", "labels", "cellentityids", "tissue",
)  # fmt: skip
#: Start of the names of regions among the field data of calfsocket's `fields.vtu`.
_OWN_REGION = "region "
#: Beginnings of kinds of cells that are parts of a section's edges, or points.
_LOWER = ("line", "vertex")


@dataclass(frozen=True)
class ReadMesh:
    """Triangles of a plane mesh as the file has them.

    Attributes
    ----------
    path : Path
    points : array
        (n, 3), in the file's unit.
    cells : array
        Six-node triangles, -1 where there is no node between two corners; (m, 6).
    sets : mapping of str to array of bool
        Which triangles are in it, (m,), in the file's order.
    edges : mapping of str to array
        Nodes of sets of nodes or edges.
    split : int
        Quadrilaterals that were split.
    """

    path: Path
    points: Array
    cells: NDArray[np.int64]
    sets: Mapping[str, NDArray[np.bool_]]
    edges: Mapping[str, NDArray[np.int64]]
    split: int


def is_mesh(path: Path) -> bool:
    """Return whether a file is a mesh by its name."""
    return path.suffix.lower() in SUFFIXES


def read_mesh(path: Path | str, data: str | None = None) -> ReadMesh:
    """Read a plane mesh.

    Parameters
    ----------
    path
        gmsh (.msh), Abaqus (.inp) or VTK (.vtu, .vtk).
    data
        Array of numbers of cells that says the region, of a file without named sets.

    Raises
    ------
    InputError
        When the file cannot be read, is solid, or does not say its regions.
    """
    path = Path(path)
    if not is_mesh(path):
        raise InputError(f"{path}: is not a mesh; give {', '.join(SUFFIXES)}")
    check_readable(path, MAX_BYTES)
    if path.suffix.lower() == ".inp":
        deck = read_deck(path, _text(path))
        points, blocks, nodes = deck.points, deck.blocks, dict(deck.node_sets)
        sets = {name: np.array(numbers) for name, numbers in deck.element_sets.items()}
        edges = {name: np.array(numbers) for name, numbers in nodes.items()}
    else:
        points, blocks, sets, edges = _by_meshio(path, data)
    if not blocks or not sum(len(block.nodes) for block in blocks):
        raise InputError(f"{path}: has no triangles or quadrilaterals; give the mesh of a section")
    for block in blocks:
        if block.nodes.min() < 0 or block.nodes.max() >= len(points):
            raise InputError(f"{path}: names nodes that it does not have; export it again")
    if not np.isfinite(points).all():
        raise InputError(f"{path}: has coordinates that are no numbers; export it again")
    points, cells, of = triangles(points, blocks)
    quads = sum(len(block.nodes) for block in blocks if block.kind.startswith("quad"))
    chosen = {}
    for name, numbers in sets.items():
        inside = np.zeros(int(of.max()) + 1, dtype=bool)
        inside[numbers] = True
        if inside.any():
            chosen[name] = inside[of]
    if not chosen:
        raise InputError(f"{path}: has no sets of triangles; name one for each tissue")
    return ReadMesh(path, points, cells, chosen, edges, quads)


def _text(path: Path) -> str:
    """Return a deck; what is not UTF-8 has names and comments of a Windows code page."""
    try:
        return read_text(path, MAX_BYTES)
    except InputError:
        content = path.read_bytes()
        if b"\0" in content:
            raise
        return content.decode("cp1252", errors="replace")


def _by_meshio(
    path: Path, data: str | None
) -> tuple[Array, list[Block], dict[str, NDArray[np.int64]], dict[str, NDArray[np.int64]]]:
    """Return points, plane cells, sets of them, and nodes of named edges."""
    mesh = _read(path)
    if not np.size(mesh.points):
        raise InputError(f"{path}: has no nodes; {_AGAIN[path.suffix.lower()]}")
    points: Array = np.asarray(mesh.points, dtype=np.float64).reshape(len(mesh.points), -1)
    points = np.pad(points, ((0, 0), (0, 3 - points.shape[1])))
    flat = [number for number, cells in enumerate(mesh.cells) if cells.type in NODES]
    for cells in mesh.cells:
        if cells.type not in NODES and not cells.type.startswith(_LOWER) and len(cells.data):
            what = "elements of a solid" if cells.dim == 3 else "no triangles or quadrilaterals of"\
                " first or second order"  # fmt: skip
            raise InputError(
                f"{path}: has {len(cells.data)} {cells.type}, which are {what}; give the mesh of"
                " one section"
            )
    blocks = [
        Block(mesh.cells[n].type, np.asarray(mesh.cells[n].data, dtype=np.int64)) for n in flat
    ]
    starts = np.cumsum([0, *(len(block.nodes) for block in blocks)])
    lines = [number for number, cells in enumerate(mesh.cells) if cells.type.startswith("line")]
    sets, edges = {}, {}
    named = {name: each for name, each in mesh.cell_sets.items() if not name.startswith("gmsh:")}
    for name, members in named.items():
        inside = [start + _members(members[n]) for n, start in zip(flat, starts, strict=False)]
        if any(len(each) for each in inside):
            sets[name] = np.concatenate(inside)
        along = [mesh.cells[n].data[_members(members[n])].ravel() for n in lines]
        if any(len(each) for each in along):
            edges[name] = np.unique(np.concatenate(along))
    for name, members in mesh.point_sets.items():
        edges[name] = np.asarray(members, dtype=np.int64)
    if sets and data is None:
        return points, blocks, sets, edges
    array = _region_array(path, mesh, flat, data)
    values = np.concatenate([np.asarray(mesh.cell_data[array][n]).ravel() for n in flat])
    names = _names(mesh)
    for value in np.unique(values):
        sets[names.get((2, int(value)), str(int(value)))] = np.flatnonzero(values == value)
    for n in lines:
        tags = np.asarray(mesh.cell_data[array][n]).ravel()
        for tag in np.unique(tags):
            name = names.get((1, int(tag)), f"edges {int(tag)}")
            on = np.asarray(mesh.cells[n].data[tags == tag]).ravel()
            edges[name] = np.union1d(edges.get(name, on), on)
    return points, blocks, sets, edges


def _read(path: Path) -> "meshio.Mesh":
    import meshio

    said = StringIO()
    try:
        with redirect_stdout(said), redirect_stderr(said), np.errstate(all="ignore"):
            return meshio.read(path)
    # Whatever a reader of many formats runs into; meshio itself exits where it gives up.
    except (Exception, SystemExit) as error:
        # Before it exits it has printed why, and then that it could not read the file.
        why = str(error) if isinstance(error, Exception) else said.getvalue().partition("Error:")[0]
        why = "" if isinstance(error, KeyError) else why  # a key of its own tables, no words
        reason = f" ({' '.join(why.split())[:150]})" if why.strip() else ""
        kind = path.suffix.lower()
        raise InputError(f"{path}: cannot be read as {kind}{reason}; {_AGAIN[kind]}") from None


def _members(members: "NDArray[np.integer] | None") -> NDArray[np.int64]:
    return np.empty(0, dtype=np.int64) if members is None else np.asarray(members, dtype=np.int64)


def _names(mesh: "meshio.Mesh") -> dict[tuple[int, int], str]:
    """Return names by dimension and number, as gmsh has them, or calfsocket in its `fields.vtu`."""
    own = {name for name in mesh.field_data if str(name).startswith(_OWN_REGION)}
    found = {}
    for name, said in mesh.field_data.items():
        if name in own:
            found[2, int(np.ravel(said)[0])] = str(name).removeprefix(_OWN_REGION)
        elif np.size(said) == 2 and not own:
            tag, dim = (int(value) for value in np.ravel(said))
            found[dim, tag] = str(name)
    return found


def _region_array(path: Path, mesh: "meshio.Mesh", flat: Sequence[int], wanted: str | None) -> str:
    """Return the name of the array of whole numbers of cells that says the region."""
    whole = []
    for name, values in mesh.cell_data.items():
        of_cells = [np.asarray(values[n]) for n in flat]
        if all(each.size == len(each) and np.all(each == np.round(each)) for each in of_cells):
            whole.append(name)
    if wanted is not None:
        if wanted not in whole:
            raise InputError(
                f"{path}: has no array of whole numbers of cells '{wanted}';"
                + (f" {nearest(wanted, whole)}" if whole else " it has none")
            )
        return wanted
    known = [name for known in _REGION_ARRAYS for name in whole if name.lower() == known]
    if known:
        return known[0]
    if len(whole) != 1:
        raise InputError(
            f"{path}: does not say its regions: it has no sets, and"
            + (
                f" the arrays {', '.join(whole)}; say which one by --data"
                if whole
                else " no array of whole numbers of its cells"
                + (f" ({', '.join(mesh.cell_data)} has others)" if mesh.cell_data else "")
                + "; add one"
            )
        )
    return whole[0]
