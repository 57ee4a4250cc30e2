"""The mesh on several ranks: the same mesh, and the same refusal."""

import hashlib
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from dolfinx.mesh import entities_to_geometry
from geometry import LIMB, section_of
from mpi4py import MPI

from calfsocket.io.errors import InputError
from calfsocket.io.fenics import cell_nodes
from calfsocket.meshes.distributed import SectionMesh, distribute
from calfsocket.meshes.rings import ring_mesh
from calfsocket.meshes.section import section_mesh
from calfsocket.meshes.sizing import mesh_size
from calfsocket.meshes.socket import NormalOffset
from calfsocket.meshes.triangles import TriangleMesh


def fingerprint(comm: MPI.Comm, section: SectionMesh) -> str:
    """On rank 0, a hash of all that the mesh is, put into the order of gmsh."""
    mesh = section.mesh
    owned = mesh.topology.index_map(2).size_local
    ghosts = mesh.topology.index_map(2).num_ghosts
    assert np.array_equal(section.cell_tags.indices, np.arange(owned + ghosts))
    assert (ghosts > 0) == (comm.size > 1)
    mesh.topology.create_connectivity(1, 0)
    mesh.topology.create_connectivity(1, 2)
    facet_nodes = entities_to_geometry(mesh, 1, section.facet_tags.indices)
    facet_nodes = np.sort(mesh.geometry.input_global_indices[facet_nodes], axis=1)
    facets = np.column_stack([section.facet_tags.values, facet_nodes])
    parts = comm.gather(
        (
            mesh.topology.original_cell_index[:owned],
            section.cell_tags.values[:owned],
            mesh.geometry.input_global_indices[cell_nodes(mesh)[:owned]],
            mesh.geometry.input_global_indices,
            mesh.geometry.x,
            facets,
        )
    )
    if parts is None:
        return ""
    cell, cell_tags, nodes, node, x, facets = (
        np.concatenate(part) for part in zip(*parts, strict=True)
    )
    order = np.argsort(cell)
    assert np.array_equal(cell[order], np.arange(len(cell)))
    points = np.empty((node.max() + 1, 3))
    points[node] = x
    return hashlib.sha256(
        b"".join(
            np.ascontiguousarray(array).tobytes()
            for array in (
                cell_tags[order],
                np.sort(nodes[order]),
                points,
                np.unique(facets, axis=0),
            )
        )
    ).hexdigest()


@pytest.fixture
def coarse() -> TriangleMesh:
    return section_of("TSB")


def test_the_numbering_of_gmsh_is_found_again(coarse: TriangleMesh) -> None:
    mesh = distribute(MPI.COMM_SELF, lambda: coarse).mesh
    assert np.array_equal(mesh.geometry.x[:, :2], coarse.points[mesh.geometry.input_global_indices])
    nodes = mesh.geometry.input_global_indices[cell_nodes(mesh)]
    cells = coarse.cells[mesh.topology.original_cell_index]
    assert np.array_equal(np.sort(nodes, axis=1), np.sort(cells, axis=1))


PROGRAM = """
import json
import sys
sys.path.insert(0, {tests!r})
from mpi4py import MPI
from calfsocket.io.errors import InputError
from test_meshes_parallel import fingerprint
from calfsocket.meshes.limb import Limb
from calfsocket.meshes.rings import ring_mesh
from calfsocket.meshes.section import section_mesh
from calfsocket.meshes.sizing import mesh_size
from calfsocket.meshes.socket import Socket
comm = MPI.COMM_WORLD
parts = Limb.reference(), Socket.reference("TSB"), mesh_size("coarse")
seen = [fingerprint(comm, section_mesh(comm, *parts))]
if comm.rank == comm.size - 1:  # a rank by itself
    seen.append(fingerprint(MPI.COMM_SELF, ring_mesh(MPI.COMM_SELF, {ring})))
for size, error in ((0.0, InputError), ("no number", RuntimeError)):
    try:
        ring_mesh(comm, [("fat", 1.0, 2.0)], None, size)
        seen.append("made")
    except error:
        seen.append("refused")
# One rank writes for all: lines that several write at once may be mixed.
of_all = comm.gather(seen)
if comm.rank == 0:
    print(json.dumps(of_all))
"""
RING = [("fat", 10.0, 20.0)], (19.0, 24.0), 2.0


def test_several_ranks_see_the_mesh_of_one_and_its_refusal(
    coarse: TriangleMesh, mpirun: Callable[..., str]
) -> None:
    alone = MPI.COMM_SELF
    expected = [
        fingerprint(alone, distribute(alone, lambda: coarse)),
        fingerprint(alone, ring_mesh(alone, *RING)),
    ]
    program = PROGRAM.format(tests=str(Path(__file__).parent), ring=str(RING)[1:-1])
    first, second, third = json.loads(mpirun(3, ["-c", program]))
    assert first == [expected[0], "refused", "refused"]
    assert second == ["", "refused", "refused"]
    assert third == ["", expected[1], "refused", "refused"]


def test_other_errors_keep_their_cause() -> None:
    def fail() -> TriangleMesh:
        raise ArithmeticError("so it is")

    with pytest.raises(RuntimeError, match="ArithmeticError: so it is") as caught:
        distribute(MPI.COMM_SELF, fail)
    assert isinstance(caught.value.__cause__, ArithmeticError)
    turned_over = NormalOffset(base=60.0)
    with pytest.raises(InputError, match="crosses itself"):
        section_mesh(MPI.COMM_SELF, LIMB, turned_over, mesh_size("coarse"))
