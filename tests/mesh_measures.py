"""What is measured on meshes in tests alone: proofs that no point is inverted, element layers."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from calfsocket.meshes.curves import Array
from calfsocket.meshes.quality import NODES, areas, determinant, jacobians
from calfsocket.meshes.triangles import TriangleMesh


def area(mesh: TriangleMesh, region: str) -> float:
    """Area of a region, mm^2."""
    return areas(mesh.coordinates)[mesh.cell_tags == mesh.regions[region]].sum()


def facets(mesh: TriangleMesh, boundary: str) -> NDArray[np.int64]:
    """Nodes of the facets of a boundary, (k, 3)."""
    return mesh.facets[mesh.facet_tags == mesh.boundaries[boundary]]


def jacobian_bounds(x: Array) -> tuple[Array, Array]:
    """Return lower and upper bounds of det J on whole curved triangles (m, 6, 2), mm^2, (m,).

    det J is quadratic on the triangle, so that it lies between the smallest and the largest of
    its six Bezier coefficients: the values d at the corners and, at the sides,
    2 d_ij - (d_i + d_j) / 2 with the value d_ij in the middle. A positive lower bound proves that
    no point of the triangle is inverted.
    """
    d = determinant(jacobians(x, NODES))
    sides = [2 * d[:, 3 + i] - (d[:, i] + d[:, (i + 1) % 3]) / 2 for i in range(3)]
    coefficients = np.column_stack([d[:, :3], *sides])
    return coefficients.min(axis=1), coefficients.max(axis=1)


@dataclass(frozen=True)
class ElementLayers:
    """Element layers of a band, at each corner node on the curves that bound it.

    Parameters
    ----------
    points
        The nodes, mm, shape (n, 2).
    thickness
        Shortest distance from the node to another of the curves, mm, shape (n,).
    count
        Fewest element sides on a path through the band from the node to another of the curves,
        shape (n,). Where it is 1, a side joins two curves and one element may fill the band;
        where it is k, no line across the band crosses fewer than k elements.
    """

    points: Array
    thickness: Array
    count: NDArray[np.int64]


def layers_across(mesh: TriangleMesh, region: str) -> ElementLayers:
    """Count the element layers between the curves that bound a region."""
    tag = mesh.regions[region]
    cells = mesh.cells[mesh.cell_tags == tag]
    middles, first, uses = np.unique(cells[:, 3:], return_index=True, return_counts=True)
    sides = cells[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)[first]
    nodes, ends = np.unique(sides, return_inverse=True)
    ends = ends.reshape(-1, 2)
    graph = coo_array((np.ones(len(ends)), ends.T), shape=(len(nodes), len(nodes))).tocsr()

    # Sides of one triangle only lie on a curve, which is known by what lies behind it: another
    # region or, where nothing does, -1.
    behind = np.full(len(mesh.points), -1)
    for other in set(mesh.regions.values()) - {tag}:
        behind[mesh.cells[mesh.cell_tags == other]] = other
    on_curve = uses == 1
    ends, sides, middles = ends[on_curve], sides[on_curve], middles[on_curve]
    curve_of_side = behind[middles]
    s = np.linspace(0.0, 1.0, 8, endpoint=False)[:, None, None]
    start, end, middle = (mesh.points[i] for i in (sides[:, 0], sides[:, 1], middles))
    samples = (1 - s) * (1 - 2 * s) * start + s * (2 * s - 1) * end + 4 * s * (1 - s) * middle

    thickness = np.full(len(nodes), np.inf)
    count = np.full(len(nodes), np.inf)
    curve_of_node = np.full(len(nodes), -2)
    curve_of_node[ends] = curve_of_side[:, None]
    for curve in np.unique(curve_of_side):
        elsewhere = curve_of_node != curve
        tree = cKDTree(samples[:, curve_of_side == curve].reshape(-1, 2))
        distance = tree.query(mesh.points[nodes[elsewhere]])[0]
        thickness[elsewhere] = np.minimum(thickness[elsewhere], distance)
        hops = dijkstra(
            graph,
            directed=False,
            unweighted=True,
            min_only=True,
            indices=np.flatnonzero(curve_of_node == curve),
        )
        count[elsewhere] = np.minimum(count[elsewhere], hops[elsewhere])
    measured = (curve_of_node != -2) & np.isfinite(count)
    return ElementLayers(
        mesh.points[nodes[measured]], thickness[measured], count[measured].astype(np.int64)
    )
