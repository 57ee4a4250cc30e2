"""Files of a mesh as other programs write them, for tests of their import."""

from collections.abc import Callable, Mapping
from pathlib import Path

import meshio
import numpy as np
from numpy.typing import NDArray

from calfsocket.export.mesh_file import write_msh
from calfsocket.meshes.triangles import TriangleMesh

Write = Callable[[TriangleMesh, Path], None]


def msh22(mesh: TriangleMesh, path: Path) -> None:
    """gmsh 2.2, as `calfsocket export` writes it."""
    write_msh(path, mesh)


def msh41(mesh: TriangleMesh, path: Path) -> None:
    """gmsh 4.1, written by gmsh itself, of a file of the other version."""
    from calfsocket.io.system import gmsh

    old = path.with_name("old.msh")
    write_msh(old, mesh)
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.open(str(old))
        gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
        gmsh.write(str(path))
    finally:
        gmsh.finalize()
        old.unlink()


def vtu(mesh: TriangleMesh, path: Path) -> None:
    """VTK, also its old binary format, with the regions' numbers in an array."""
    meshio.Mesh(
        np.pad(mesh.points, ((0, 0), (0, 1))),
        [("triangle6", mesh.cells)],
        cell_data={"region": [mesh.cell_tags]},
    ).write(path)


def inp(mesh: TriangleMesh, path: Path) -> None:
    """Abaqus, flat, with a set for each region."""
    path.write_text(deck(mesh.points, {"CPE6": mesh.cells}, sets_of(mesh)))


def sets_of(mesh: TriangleMesh) -> dict[str, NDArray[np.int64]]:
    """Cells of each region."""
    return {name: np.flatnonzero(mesh.cell_tags == tag) for name, tag in mesh.regions.items()}


def deck(
    points: NDArray[np.float64],
    elements: Mapping[str, NDArray[np.int64]],
    sets: Mapping[str, NDArray[np.int64]],
    more: str = "",
) -> str:
    """Return an input file of Abaqus: nodes, elements by type, and sets of them."""
    lines = ["*HEADING", "** a comment", "*NODE"]
    lines += [
        ", ".join([str(number), *map(repr, map(float, x))]) for number, x in enumerate(points, 1)
    ]
    number = 0
    for kind, cells in elements.items():
        lines.append(f"*Element, type={kind}")
        for nodes in cells + 1:
            number += 1
            lines.append(", ".join(map(str, [number, *nodes])))
    for name, cells in sets.items():
        lines.append(f"*ELSET, ELSET={name}")
        lines += [",".join(map(str, cells[i : i + 16] + 1)) for i in range(0, len(cells), 16)]
    return "\n".join(lines) + "\n" + more


WRITERS: dict[str, Write] = {
    "a.msh": msh22,
    "b.msh": msh41,
    "c.vtu": vtu,
    "d.inp": inp,
    "e.vtk": vtu,
}
