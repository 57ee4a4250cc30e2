"""Meshes of curved triangles for the element: strips side by side, and a quarter of a ring."""

from collections.abc import Callable, Sequence

import numpy as np
from mpi4py import MPI

from calfsocket.meshes.distributed import SectionMesh, distribute
from calfsocket.meshes.triangles import TriangleMesh
from calfsocket.verification.sampling import Array

Field = Callable[[Array], Array]

LEFT, RIGHT, BOTTOM, TOP = "left", "right", "bottom", "top"

LOWER = np.array([(0, 0), (2, 0), (2, 2), (1, 0), (2, 1), (1, 1)])
UPPER = np.array([(0, 0), (2, 2), (0, 2), (1, 1), (1, 2), (0, 1)])
"""Nodes of the two triangles of a box of three by three; the diagonal is turned from box to box."""


def strip_mesh(
    widths: Sequence[tuple[str, float, int]],
    length: float,
    n: int,
    bend: float = 0.0,
    place: Field | None = None,
) -> SectionMesh:
    """Return strips side by side: (region, width in mm, elements across), `length` mm long.

    The strips follow each other along x and run along y, with n elements. All nodes, mid-sides
    too, are moved by `bend` element sizes at most, at random but always the same; those on the
    edges of strips stay, so that triangles are curved inside and not at the edges. `place` moves
    the nodes on, mid-sides too: positions (2, n) -> (2, n).
    """

    def build() -> TriangleMesh:
        x_lines, columns = [0.0], []
        for tag, (_, width, across) in enumerate(widths, start=1):
            x_lines += list(x_lines[-1] + width * np.arange(1, 2 * across + 1) / (2 * across))
            columns += [tag] * across
        x, y = np.array(x_lines), np.linspace(0.0, length, 2 * n + 1)
        nodes = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
        size = min(np.diff(x).min(), np.diff(y).min())
        move = size * bend * np.random.default_rng(1).uniform(-1, 1, nodes.shape)
        edge = 2 * np.cumsum([0, *(across for _, _, across in widths)])
        move[edge] = 0.0
        move[:, [0, -1]] = 0.0
        number = np.arange(len(x) * len(y)).reshape(len(x), len(y))
        i, j = np.indices((len(columns), n)).reshape(2, -1, 1)
        cells = []
        for triangle in (LOWER, UPPER):
            # Turned boxes are mirrored in y, and their nodes taken the other way round.
            mirrored = triangle[[0, 2, 1, 5, 4, 3]] * [1, -1] + [0, 2]
            a, b = np.where(((i + j) % 2 == 1)[:, :, None], mirrored, triangle).transpose(2, 0, 1)
            cells.append(number[2 * i + a, 2 * j + b])
        tags = np.repeat(np.array(columns, dtype=np.int32), n)
        sides = [
            np.stack([edge[:-2:2], edge[2::2], edge[1::2]], axis=1)
            for edge in (number[0], number[-1], number[:, 0], number[:, -1])
        ]
        points = (nodes + move).reshape(-1, 2)
        return TriangleMesh(
            points=points if place is None else place(points.T).T,
            cells=np.concatenate(cells),
            cell_tags=np.concatenate([tags, tags]),
            facets=np.concatenate(sides),
            facet_tags=np.repeat(np.arange(1, 5, dtype=np.int32), [len(side) for side in sides]),
            regions={name: tag for tag, (name, _, _) in enumerate(widths, start=1)},
            boundaries={LEFT: 1, RIGHT: 2, BOTTOM: 3, TOP: 4},
        )

    return distribute(MPI.COMM_SELF, build)


INNER, OUTER = 8.0, 16.0
"""Radii of the quarter ring, mm."""


def quarter_ring(n: int) -> SectionMesh:
    """Return a quarter of a ring, n elements across; mid-side nodes lie on arcs."""

    def place(x: Array) -> Array:
        radius, angle = INNER + x[0], x[1] / INNER
        return radius * np.array([np.cos(angle), np.sin(angle)])

    return strip_mesh([("ring", OUTER - INNER, n)], 0.5 * np.pi * INNER, 2 * n, place=place)
