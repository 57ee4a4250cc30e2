"""Pressure across meshes that do not match; gamma, Gauss points and ranks must not matter."""

import json

import numpy as np
import pytest
from mpi4py import MPI

from calfsocket.verification.contact_patch import EQUAL, STIFF, patch, shifted, spread

RANKS = """
import json, sys
import numpy as np
from calfsocket.meshes import distributed, rings
from calfsocket.verification.contact_patch import shifted
from dolfinx.cpp.graph import AdjacencyList_int32
from mpi4py import MPI

owner = json.loads(sys.argv[1])  # rank of the limb and of the socket, or null
if owner is not None:
    build = rings.build
    parts = {}

    def remember(*parameters):
        mesh = build(*parameters)
        parts["tags"] = mesh.cell_tags
        return mesh

    def by_body(mode):
        def partition(comm, n, cell_types, cells):
            ranks = np.where(parts["tags"] == 1, *owner) if comm.rank == 0 else np.empty(0)
            return AdjacencyList_int32(ranks.astype(np.int32).reshape(-1, 1))
        return partition

    rings.build = remember
    distributed.cell_partitioner = by_body
result = shifted(MPI.COMM_WORLD, h=4.0)
if MPI.COMM_WORLD.rank == 0:
    print(json.dumps(result.__dict__ | {"force": result.force.tolist()}))
"""


@pytest.fixture(scope="module")
def usual():
    return shifted(MPI.COMM_SELF, h=2.8)


@pytest.fixture(scope="module")
def one():
    return shifted(MPI.COMM_SELF, h=4.0)


def test_pressure_on_a_stiff_socket_is_uniform_and_gets_more_so():
    coarse, fine = patch(4.0, STIFF), patch(2.0, STIFF)
    assert fine["points"] < 1e-3
    assert fine["points"] < 0.25 * coarse["points"]
    assert fine["imbalance"] < 1e-5


def test_scatter_on_a_soft_socket_is_bounded_and_falls_with_gauss_points():
    few, usual_points = patch(2.8, EQUAL, 3), patch(2.8, EQUAL)
    assert usual_points["points"] < 3e-2
    assert usual_points["edges"] < 1.5e-2
    assert usual_points["points"] < few["points"]


def test_gap_and_pressure_are_complementary(usual):
    assert 0.3 < usual.open_share < 0.6
    assert usual.least_pressure == 0.0
    assert usual.penetration < 5e-3
    assert usual.overlap < 1e-3
    assert usual.complementarity < 2e-3
    assert shifted(MPI.COMM_SELF, h=1.4).complementarity < usual.complementarity


def test_gamma_does_not_matter_over_two_decades(usual):
    assert spread([usual, *(shifted(MPI.COMM_SELF, 2.8, gamma) for gamma in (0.1, 10.0))]) < 1e-3


def test_gauss_points_do_not_matter(usual):
    assert spread([usual, shifted(MPI.COMM_SELF, h=2.8, points=3)]) < 2e-3


@pytest.mark.parametrize(
    ("ranks", "owner"),
    [
        pytest.param(2, None, id="2-as-partitioned", marks=pytest.mark.slow),
        pytest.param(2, (0, 1), id="2-limb-first"),
        pytest.param(2, (1, 0), id="2-socket-first"),
        pytest.param(3, None, id="3-as-partitioned", marks=pytest.mark.slow),
        pytest.param(3, (2, 0), id="3-one-rank-empty"),
    ],
)
def test_it_does_not_matter_which_rank_holds_which_side(ranks, owner, one, mpirun):
    several = json.loads(mpirun(ranks, ["-c", RANKS, json.dumps(owner)], timeout=120))
    assert several["newton"] == one.newton
    np.testing.assert_allclose(several["force"][0], one.force[0], rtol=1e-8)
    for key in ("pressing", "peak", "open_share", "penetration", "complementarity"):
        assert several[key] == pytest.approx(getattr(one, key), rel=1e-6), key
