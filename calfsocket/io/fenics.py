"""What differs between the supported releases of dolfinx: 0.9 of Debian 13, 0.11 of PyPI."""

from collections.abc import Callable
from typing import Any

import dolfinx
import ffcx.compiler
import ffcx.options
import numpy as np
from dolfinx import fem
from dolfinx.common import IndexMap, timing
from dolfinx.mesh import GhostMode, Mesh
from mpi4py import MPI
from numpy.typing import NDArray

try:
    from dolfinx.io.gmsh import cell_perm_array as cell_perm_array
    from dolfinx.io.gmsh import read_from_msh as read_from_msh
    from dolfinx.io.gmsh import ufl_mesh as ufl_mesh
except ImportError:  # 0.9
    from dolfinx.io.gmshio import cell_perm_array as cell_perm_array
    from dolfinx.io.gmshio import read_from_msh as read_from_msh
    from dolfinx.io.gmshio import ufl_mesh as ufl_mesh

#: Of the messages in which ranks tell each other who ghosts what.
_TAG = 1202

VERSION = tuple(int(part) for part in dolfinx.__version__.split(".")[:2])


def cell_partitioner(ghosts: GhostMode) -> Callable[..., Any]:
    """Return a partitioner of a mesh in which two cells meet at a facet."""
    if VERSION < (0, 10):
        return dolfinx.mesh.create_cell_partitioner(ghosts)
    return dolfinx.mesh.create_cell_partitioner(ghosts, 2)


def cell_nodes(mesh: Mesh) -> NDArray[np.int32]:
    """Return the geometry nodes of each local cell, (n, 6)."""
    if VERSION < (0, 10):
        return mesh.geometry.dofmap
    geometry: Any = mesh.geometry
    return geometry.dofmaps[0]


def expression_code(expression: Any, points: NDArray[np.float64]) -> str:
    """Return FFCx's C code of an expression at points of the reference cell, shape (n, 2)."""
    options = ffcx.options.get_options({"scalar_type": "float64"})
    code, other = ffcx.compiler.compile_ufl_objects([(expression, points)], options=options)
    # 0.9: header and code; later releases: both in a list, and the endings of their files.
    return other if VERSION < (0, 10) else code[1]


def evaluate(
    expression: fem.Expression, mesh: Mesh, entities: NDArray[np.int32]
) -> NDArray[np.float64]:
    """Evaluate an expression on cells, (n,), or on facets: cell and local facet, (n, 2).

    On facets its points must be symmetric, as Gauss points are. They run from the facet's first
    vertex in its cell to the second one.

    Returns
    -------
    (n, m) float
        Values at the points of each entity, points first, then components, then the unknowns of an
        argument.
    """
    if VERSION < (0, 10):
        return expression.eval(mesh, entities.ravel())
    values = expression.eval(mesh, entities)
    if entities.ndim == 2:
        # Later releases let the points of two cells at one facet agree: on one side they run back.
        mesh.topology.create_entity_permutations()
        cell, facet = entities.T
        back = mesh.topology.get_facet_permutations()[3 * cell + facet] == 1
        values[back] = values[back, ::-1]
    return values.reshape(len(values), int(np.prod(values.shape[1:])))  # of a rank without any, too


def numbering(
    comm: MPI.Comm, size: int, ghosts: NDArray[np.int64], owners: NDArray[np.int32]
) -> IndexMap:
    """Return the map of `size` owned indices and of the ghosts of others (collective)."""
    tag = () if VERSION < (0, 10) else (_TAG,)
    return IndexMap(comm, size, ghosts, owners, *tag)


def timed(task: str) -> tuple[int, float]:
    """Return how often dolfinx did a task, by its name in 0.9, and the seconds that it took."""
    if VERSION >= (0, 10) and task == "Build dofmap data":
        task = "Dofmap builder: build dofmap data"
    try:
        count, seconds, *_ = timing(task)
    except RuntimeError:  # not used so far
        return 0, 0.0
    return int(count), float(getattr(seconds, "total_seconds", lambda: seconds)())
