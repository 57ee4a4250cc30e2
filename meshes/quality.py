"""How good a mesh is: measured on the curved triangles, not on their corners."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from calfsocket.meshes.triangles import TriangleMesh

Array = NDArray[np.float64]


def shape_gradients(xi: Array) -> Array:
    """Return the gradients of the six quadratic shape functions of gmsh's triangle.

    Parameters
    ----------
    xi
        Points of the reference triangle (0, 0), (1, 0), (0, 1), shape (q, 2).

    Returns
    -------
    Array
        Derivative of function i along reference axis k, shape (q, 6, 2).
    """
    r, s = xi.T
    barycentric = np.stack([1 - r - s, r, s], axis=1)
    gradient = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])
    corners = (4 * barycentric - 1)[:, :, None] * gradient
    sides = [
        4 * (barycentric[:, [i]] * gradient[j] + barycentric[:, [j]] * gradient[i])
        for i, j in ((0, 1), (1, 2), (2, 0))
    ]
    return np.concatenate([corners, np.stack(sides, axis=1)], axis=1)


#: Reference coordinates of the six nodes.
NODES = np.array([[0, 0], [1, 0], [0, 1], [0.5, 0], [0.5, 0.5], [0, 0.5]])


#: A lattice of 45 points of the reference triangle, its nodes among them.
LATTICE = np.array([(r / 8, s / 8) for r in range(9) for s in range(9 - r)])


def jacobians(x: Array, xi: Array) -> Array:
    """Return dx/dxi at reference points.

    Parameters
    ----------
    x
        Nodes of curved triangles, mm, shape (m, 6, 2).
    xi
        Reference points, shape (q, 2).

    Returns
    -------
    Array
        Shape (m, q, 2, 2), mm; the last axis is the reference direction.
    """
    return np.einsum("mia,qik->mqak", x, shape_gradients(xi), optimize=True)


def determinant(j: Array) -> Array:
    """Return the determinants of 2 x 2 matrices, shape (..., 2, 2) -> (...)."""
    return j[..., 0, 0] * j[..., 1, 1] - j[..., 0, 1] * j[..., 1, 0]


def areas(x: Array) -> Array:
    """Return the areas of curved triangles (m, 6, 2), mm^2, shape (m,).

    det J is quadratic, and the rule of the three mid-side points is exact for quadratics.
    """
    return determinant(jacobians(x, NODES[3:])).sum(axis=1) / 6


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


def scaled_jacobians(x: Array, xi: Array = LATTICE) -> Array:
    r"""Return the scaled Jacobian of curved triangles (m, 6, 2), shape (m,).

    .. math:: \min_{\xi} \; \frac{2}{\sqrt 3}
        \frac{\det J(\xi)}{\max_{i \ne j} |t_i(\xi)| |t_j(\xi)|}

    with t the directions of the three sides mapped at that point: dx/dr, dx/ds and their
    difference. It is 1 for an equilateral triangle with straight sides, 0 where the mapping
    degenerates and negative where it inverts. The minimum is taken over the points `xi`.
    """
    j = jacobians(x, xi)
    r, s = j[..., 0], j[..., 1]
    lengths = np.sqrt([np.sum(side**2, axis=-1) for side in (r, s, s - r)])
    # The product of the two longest: all three over the shortest.
    longest = lengths.prod(axis=0) / lengths.min(axis=0)
    scaled: Array = (2 / np.sqrt(3) * determinant(j) / longest).min(axis=1)
    return scaled


def smallest_angles(x: Array) -> Array:
    """Return the smallest angle between the curved sides of triangles (m, 6, 2), degrees, (m,)."""
    j = jacobians(x, NODES[:3])
    r, s = j[..., 0], j[..., 1]
    # The two sides that leave each corner, as directions at that corner.
    leaving = [
        (r[:, 0], s[:, 0]),
        (s[:, 1] - r[:, 1], -r[:, 1]),
        (-s[:, 2], r[:, 2] - s[:, 2]),
    ]
    angles = [
        np.arctan2(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], np.sum(a * b, axis=1)) for a, b in leaving
    ]
    return np.rad2deg(np.min(angles, axis=0))


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
    own = mesh.cells[mesh.cell_tags == tag]
    middles, first, uses = np.unique(own[:, 3:], return_index=True, return_counts=True)
    sides = own[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)[first]
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


def quality_table(
    mesh: TriangleMesh, tissues: Mapping[str, str], area_in_data: Mapping[str, float]
) -> pd.DataFrame:
    """Return one row a region: what it is, how large, and how good its triangles are.

    Parameters
    ----------
    mesh
        The mesh.
    tissues
        Region -> tissue.
    area_in_data
        Region -> area the region should have, mm^2.

    Returns
    -------
    pandas.DataFrame
        region, tissue, triangles, area_mm2, data_mm2, deviation_percent, min_scaled_jacobian,
        min_angle_deg; regions in the order of their tags.
    """
    x = mesh.coordinates
    area, scaled, angle = areas(x), scaled_jacobians(x), smallest_angles(x)
    rows = []
    for name, tag in sorted(mesh.regions.items(), key=lambda item: item[1]):
        own = mesh.cell_tags == tag
        total = area[own].sum()
        rows.append(
            {
                "region": name,
                "tissue": tissues[name],
                "triangles": int(own.sum()),
                "area_mm2": total,
                "data_mm2": area_in_data[name],
                "deviation_percent": 100 * (total / area_in_data[name] - 1),
                "min_scaled_jacobian": scaled[own].min(),
                "min_angle_deg": angle[own].min(),
            }
        )
    return pd.DataFrame(rows)


def format_table(table: pd.DataFrame) -> str:
    """Return the table of `quality_table` as text for people."""
    return table.to_string(
        index=False,
        formatters={
            "area_mm2": "{:.1f}".format,
            "data_mm2": "{:.1f}".format,
            "deviation_percent": "{:+.2f}".format,
            "min_scaled_jacobian": "{:.3f}".format,
            "min_angle_deg": "{:.1f}".format,
        },
    )
