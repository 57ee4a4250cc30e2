"""How good a mesh is: measured on the curved triangles, not on their corners."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from calfsocket.meshes.curves import Array
from calfsocket.meshes.triangles import TriangleMesh

if TYPE_CHECKING:
    import pandas as pd


def shape_gradients(xi: Array) -> Array:
    """Return the gradients of the six shape functions at reference points, (q, 2) -> (q, 6, 2)."""
    r, s = xi.T
    barycentric = np.stack([1 - r - s, r, s], axis=1)
    gradient = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])
    corners = (4 * barycentric - 1)[:, :, None] * gradient
    sides = [
        4 * (barycentric[:, [i]] * gradient[j] + barycentric[:, [j]] * gradient[i])
        for i, j in ((0, 1), (1, 2), (2, 0))
    ]
    return np.concatenate([corners, np.stack(sides, axis=1)], axis=1)


#: Of the table of a mesh's quality.
COLUMNS = [
    "region", "tissue", "triangles", "area_mm2", "data_mm2", "deviation_percent",
    "min_scaled_jacobian", "min_angle_deg",
]  # fmt: skip
#: Reference coordinates of the six nodes.
NODES = np.array([[0, 0], [1, 0], [0, 1], [0.5, 0], [0.5, 0.5], [0, 0.5]])
#: Triangles whose lattices fit into a processor's cache.
TOGETHER = 1000
#: A lattice of 45 points of the reference triangle, its nodes among them.
LATTICE = np.array([(r / 8, s / 8) for r in range(9) for s in range(9 - r)])


def jacobians(x: Array, xi: Array) -> Array:
    """Return dx/dxi of curved triangles (m, 6, 2) at reference points (q, 2), mm.

    Of shape (m, q, 2, 2); the last axis is the reference direction.
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
    a, b, c = (np.sqrt(side[..., 0] ** 2 + side[..., 1] ** 2) for side in (r, s, s - r))
    # The product of the two longest: all three over the shortest.
    longest = a * b * c / np.minimum(np.minimum(a, b), c)
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


def quality_table(
    mesh: TriangleMesh, tissues: Mapping[str, str], area_in_data: Mapping[str, float]
) -> "pd.DataFrame":
    """Return one row a region: what it is, how large, and how good its triangles are.

    `tissues` and `area_in_data` are by region, areas in mm^2; columns are `COLUMNS`, rows in the
    order of the regions' tags.
    """
    x = mesh.coordinates
    import pandas as pd

    cells = pd.DataFrame(
        {
            "tag": mesh.cell_tags,
            "area_mm2": areas(x),
            "min_scaled_jacobian": np.concatenate(
                [scaled_jacobians(x[i : i + TOGETHER]) for i in range(0, len(x), TOGETHER)]
            ),
            "min_angle_deg": smallest_angles(x),
        }
    ).groupby("tag")
    table = cells.min().assign(area_mm2=cells.area_mm2.sum(), triangles=cells.size())
    table["region"] = table.index.map({tag: name for name, tag in mesh.regions.items()})
    table["tissue"], table["data_mm2"] = table.region.map(tissues), table.region.map(area_in_data)
    table["deviation_percent"] = 100 * (table.area_mm2 / table.data_mm2 - 1)
    return table[COLUMNS].reset_index(drop=True)


def format_table(table: "pd.DataFrame") -> str:
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
