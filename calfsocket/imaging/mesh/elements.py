"""Cells of a plane mesh as it was read, and the same as six-node triangles."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calfsocket.meshes.curves import Array

#: A node that a cell does not have.
NONE = -1
#: Nodes that count, by the names of meshio; a seventh or ninth node lies inside.
NODES = {"triangle": 3, "triangle6": 6, "triangle7": 6, "quad": 4, "quad8": 8, "quad9": 9}


@dataclass(frozen=True)
class Block:
    """Cells of one kind.

    Attributes
    ----------
    kind : str
        Its name as meshio has it.
    nodes : array
        Corners, then the nodes between them, then those inside; (m, k).
    """

    kind: str
    nodes: NDArray[np.int64]


def triangles(
    points: Array, blocks: Sequence[Block]
) -> tuple[Array, NDArray[np.int64], NDArray[np.int64]]:
    """Split cells of any kind into triangles, which cover the same area.

    A quadrilateral is split along its shorter diagonal. The node on a diagonal of a second-order
    one is its node in the middle, or where its map has it.

    Returns
    -------
    points : array
        Those given and nodes on diagonals, (n, 3).
    cells : array
        Six-node triangles, `NONE` where there is no node between two corners; (m, 6).
    of : array
        Number of the cell that each is from; (m,).
    """
    found: list[NDArray[np.int64]] = []
    sources: list[NDArray[np.int64]] = []
    first = 0
    for block in blocks:
        nodes = block.nodes[:, : NODES[block.kind]]
        numbers: NDArray[np.int64] = np.arange(first, first + len(nodes))
        first += len(nodes)
        corners = 3 if block.kind.startswith("triangle") else 4
        if corners == 3:
            rows: NDArray[np.int64] = np.full((len(nodes), 6), NONE, dtype=np.int64)
            rows[:, : nodes.shape[1]] = nodes
            found.append(rows)
            sources.append(numbers)
            continue
        between: NDArray[np.int64] = np.full((len(nodes), 4), NONE, dtype=np.int64)
        middle: NDArray[np.int64] = np.full(len(nodes), NONE, dtype=np.int64)
        if nodes.shape[1] == 9:
            middle = nodes[:, 8]
        elif nodes.shape[1] == 8:
            middle = len(points) + np.arange(len(nodes))
            x = points[nodes]
            points = np.concatenate([points, x[:, 4:].sum(1) / 2 - x[:, :4].sum(1) / 4])
        if nodes.shape[1] > 4:
            between = nodes[:, 4:8]
        found.append(_split(points, nodes[:, :4], between, middle))
        sources.append(np.repeat(numbers, 2))
    return points, np.concatenate(found), np.concatenate(sources)


def _split(
    points: Array,
    corners: NDArray[np.int64],
    between: NDArray[np.int64],
    middle: NDArray[np.int64],
) -> NDArray[np.int64]:
    x = points[corners]
    other = np.linalg.norm(x[:, 3] - x[:, 1], axis=1) < np.linalg.norm(x[:, 2] - x[:, 0], axis=1)
    # Turn by one corner where the diagonal 1-3 is the shorter one, and split along 0-2.
    corners = np.where(other[:, None], np.roll(corners, -1, axis=1), corners)
    between = np.where(other[:, None], np.roll(between, -1, axis=1), between)
    (a, b, c, d), (ab, bc, cd, da) = corners.T, between.T
    halves = np.stack(
        [np.stack([a, b, c, ab, bc, middle], 1), np.stack([a, c, d, middle, cd, da], 1)], axis=1
    )
    return halves.reshape(-1, 6)
