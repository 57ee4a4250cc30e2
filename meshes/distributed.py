"""The mesh on all ranks: built on one, distributed to the others."""

from collections.abc import Callable
from dataclasses import dataclass

import dolfinx
import numpy as np
from dolfinx.graph import adjacencylist
from dolfinx.io.utils import distribute_entity_data
from dolfinx.mesh import GhostMode, Mesh, MeshTags
from mpi4py import MPI
from numpy.typing import NDArray

from calfsocket.io.errors import CalfsocketError
from calfsocket.io.fenics import cell_partitioner, cell_perm_array, ufl_mesh
from calfsocket.meshes.gmsh_model import TRIANGLE6
from calfsocket.meshes.triangles import TriangleMesh


@dataclass(frozen=True)
class SectionMesh:
    """A limb and its socket, two bodies in one dolfinx mesh of curved (quadratic) triangles.

    Cells that share a facet with a neighbouring rank's cells are ghosted, and tagged there, too.

    dolfinx renumbers cells and nodes, and differently for each number of ranks. Two arrays lead
    back to the numbering of gmsh, which depends on the input alone:
    ``mesh.topology.original_cell_index[c]`` is the row of local cell c (ghosts included) in
    ``TriangleMesh.cells``, and ``mesh.geometry.input_global_indices[n]`` the row of local node n
    in ``TriangleMesh.points``. Results collected in the order of these are the same on any number
    of ranks.
    """

    mesh: Mesh  #: lengths in mm
    cell_tags: MeshTags  #: region of each cell
    facet_tags: MeshTags  #: boundary of each facet on a named boundary
    regions: dict[str, int]  #: name -> tag, the same on all ranks
    boundaries: dict[str, int]

    def cell_regions(self) -> NDArray[np.int32]:
        """Region tag of each local cell, ghosts included."""
        regions = np.zeros(len(self.cell_tags.indices), dtype=np.int32)
        regions[self.cell_tags.indices] = self.cell_tags.values
        return regions


def distribute(comm: MPI.Comm, build: Callable[[], TriangleMesh]) -> SectionMesh:
    """Call `build` on rank 0 of `comm` and return its mesh on all ranks.

    An exception raised by `build` is raised on every rank: no rank waits for a mesh that will
    never come.
    """
    triangles: TriangleMesh | None = None
    failure: Exception | None = None
    if comm.rank == 0:
        try:
            triangles = build()
        except CalfsocketError as error:
            failure = error
        except Exception as error:  # whatever it is, the other ranks must hear of it
            failure = RuntimeError(f"the mesh was not built: {type(error).__name__}: {error}")
            failure.__cause__ = error
    names = None if triangles is None else (triangles.regions, triangles.boundaries)
    heard, names = comm.bcast((failure, names), root=0)
    if heard is not None:
        raise failure or heard
    assert names is not None
    if triangles is None:  # other ranks contribute nothing
        triangles = TriangleMesh(
            points=np.empty((0, 2)),
            cells=np.empty((0, 6), dtype=np.int64),
            cell_tags=np.empty(0, dtype=np.int32),
            facets=np.empty((0, 3), dtype=np.int64),
            facet_tags=np.empty(0, dtype=np.int32),
            regions=names[0],
            boundaries=names[1],
        )

    domain = ufl_mesh(TRIANGLE6, 2, dtype=np.float64)
    cell_type = dolfinx.mesh.CellType
    cells = triangles.cells[:, cell_perm_array(cell_type.triangle, 6)].copy()
    facets = triangles.facets[:, cell_perm_array(cell_type.interval, 3)].copy()
    mesh = dolfinx.mesh.create_mesh(
        comm,
        cells,
        x=triangles.points.copy(),
        e=domain,
        partitioner=cell_partitioner(GhostMode.shared_facet),
    )

    def tags(dim: int, entities: np.ndarray, values: np.ndarray, name: str) -> MeshTags:
        local_entities, local_values = distribute_entity_data(mesh, dim, entities, values)
        mesh.topology.create_connectivity(dim, 0)
        mesh.topology.create_connectivity(dim, mesh.topology.dim)
        meshtags = dolfinx.mesh.meshtags_from_entities(
            mesh, dim, adjacencylist(local_entities), local_values
        )
        meshtags.name = name
        return meshtags

    return SectionMesh(
        mesh=mesh,
        cell_tags=tags(2, cells, triangles.cell_tags, "cell_tags"),
        facet_tags=tags(1, facets, triangles.facet_tags, "facet_tags"),
        regions=triangles.regions,
        boundaries=triangles.boundaries,
    )
