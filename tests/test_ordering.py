"""Nested dissection: an order of elimination that fills little."""

import numpy as np
import pytest

from calfsocket.mechanics import ordering

SIDE = 24
GRID = np.arange(SIDE * SIDE, dtype=np.int32).reshape(SIDE, SIDE)


@pytest.fixture(scope="module")
def squares():
    """Vertices of each square of a grid."""
    corners = GRID[:-1, :-1], GRID[1:, :-1], GRID[1:, 1:], GRID[:-1, 1:]
    return np.stack(corners, axis=-1).reshape(-1, 4)


def needs_metis():
    if ordering._metis() is None:
        pytest.skip("METIS is inside MUMPS here, or missing")


def entries(cliques, place):
    """Entries of the factor, when vertices are eliminated in this order."""
    neighbours = {int(v): set() for v in np.unique(cliques)}
    for clique in cliques.tolist():
        for v in clique:
            neighbours[v].update(clique)
    count = 0
    for v in sorted(neighbours, key=lambda vertex: place[vertex]):
        front = neighbours.pop(v) - {v}
        count += len(front) + 1
        for other in front:
            neighbours[other] |= front
            neighbours[other].discard(v)
    return count


def test_each_vertex_has_a_place_of_its_own(squares):
    needs_metis()
    place = ordering.nested_dissection([squares])
    assert sorted(place) == list(range(SIDE * SIDE))


def test_it_fills_less_than_row_by_row(squares):
    needs_metis()
    row_by_row = entries(squares, np.arange(SIDE * SIDE))
    assert entries(squares, ordering.nested_dissection([squares])) < 0.7 * row_by_row


def test_cliques_of_several_sizes_count_as_one_graph(squares):
    """Two halves, and what joins them: the order is good for the whole."""
    needs_metis()
    crossing = np.isin(squares, GRID[SIDE // 2]).any(axis=1)
    pairs = np.concatenate([squares[crossing][:, [i, j]] for i in range(4) for j in range(i)])
    parts = [squares[~crossing], pairs]
    assert np.array_equal(ordering.nested_dissection(parts), ordering.nested_dissection([squares]))


def test_numbers_without_a_clique_have_no_place(squares):
    needs_metis()
    place = ordering.nested_dissection([2 * squares])
    assert np.array_equal(place[::2], ordering.nested_dissection([squares]))
    assert not place[1::2].any()


def test_without_metis_the_solver_orders(squares, monkeypatch):
    monkeypatch.setattr(ordering, "_metis", lambda: None)
    assert ordering.nested_dissection([squares]) is None
