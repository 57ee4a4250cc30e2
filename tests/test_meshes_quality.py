"""Measures of quality, on triangles whose values are known."""

from dataclasses import replace

import numpy as np
import pytest
from mesh_measures import jacobian_bounds, layers_across

from calfsocket.meshes import quality, rings
from calfsocket.meshes.smoothing import smooth
from calfsocket.meshes.triangles import TriangleMesh


def triangle(*corners: tuple[float, float]) -> np.ndarray:
    """Six nodes of a triangle with straight sides, shape (1, 6, 2)."""
    c = np.array(corners, dtype=float)
    return np.concatenate([c, (c + np.roll(c, -1, axis=0)) / 2])[None]


EQUILATERAL = triangle((0, 0), (2, 0), (1, np.sqrt(3)))


def bent(height: float) -> np.ndarray:
    """The equilateral triangle with the middle of its base moved down by `height`."""
    x = EQUILATERAL.copy()
    x[0, 3, 1] -= height
    return x


def test_an_equilateral_triangle_is_perfect() -> None:
    assert quality.scaled_jacobians(EQUILATERAL) == pytest.approx(1.0)
    assert quality.smallest_angles(EQUILATERAL) == pytest.approx(60.0)
    assert quality.areas(EQUILATERAL) == pytest.approx(np.sqrt(3))
    # det J is twice the area everywhere.
    assert np.array(jacobian_bounds(EQUILATERAL)) == pytest.approx(2 * np.sqrt(3))


def test_a_right_triangle_of_sides_3_4_5() -> None:
    x = triangle((0, 0), (4, 0), (0, 3))
    # 2/sqrt(3) times det J = 12 over the product of the two longest sides, 4 * 5.
    assert quality.scaled_jacobians(x) == pytest.approx(2 / np.sqrt(3) * 12 / 20)
    assert quality.smallest_angles(x) == pytest.approx(np.rad2deg(np.arctan2(3, 4)))


def test_a_curved_side_counts() -> None:
    # The parabola over a chord of length 2 with height 0.3 encloses 2/3 * 2 * 0.3.
    assert quality.areas(bent(0.3)) == pytest.approx(np.sqrt(3) + 0.4)
    # At its end the parabola is 4 * 0.3 / 2 steep: the angle there grows, that opposite does not.
    assert quality.smallest_angles(bent(0.3)) == pytest.approx(60.0)
    assert quality.smallest_angles(bent(-0.3)) == pytest.approx(60 - np.rad2deg(np.arctan(0.6)))
    assert quality.scaled_jacobians(bent(-0.3)) < 0.9


def test_inversion_is_seen_although_the_corners_are_perfect() -> None:
    # The tangent at the ends of the base reaches the slope of the sides at sqrt(3)/2.
    assert jacobian_bounds(bent(-0.86))[0] > 0
    assert jacobian_bounds(bent(-0.87))[0] < 0
    assert quality.scaled_jacobians(bent(-0.87)) < 0
    clockwise = triangle((0, 0), (0, 3), (4, 0))
    assert quality.scaled_jacobians(clockwise) < 0


def test_bounds_hold_on_the_whole_triangle() -> None:
    x = np.random.default_rng(1).normal(size=(200, 6, 2))
    lower, upper = jacobian_bounds(x)
    values = quality.determinant(quality.jacobians(x, quality.LATTICE))
    assert (lower[:, None] <= values + 1e-12).all()
    assert (values <= upper[:, None] + 1e-12).all()


def strip(rows: int) -> TriangleMesh:
    """A band of thickness 1 between two others, in `rows` rows of triangles; 12 mm long."""
    heights = np.concatenate([[-1.0], np.linspace(0.0, 1.0, rows + 1), [2.0]])
    corner = np.arange(13 * len(heights)).reshape(len(heights), 13)
    points = [(x, y) for y in heights for x in range(13)]
    cells, tags, middles = [], [], {}

    def middle(a: int, b: int) -> int:
        key = (min(a, b), max(a, b))
        if key not in middles:
            middles[key] = len(points)
            points.append(tuple(np.add(points[a], points[b]) / 2))
        return middles[key]

    for row in range(len(heights) - 1):
        for i in range(12):
            a, b = corner[row, i], corner[row, i + 1]
            d, c = corner[row + 1, i], corner[row + 1, i + 1]
            for t in ((a, b, c), (a, c, d)):
                cells.append([*t, middle(t[0], t[1]), middle(t[1], t[2]), middle(t[2], t[0])])
                tags.append(1 if row == 0 else 3 if row == len(heights) - 2 else 2)
    return TriangleMesh(
        points=np.array(points),
        cells=np.array(cells),
        cell_tags=np.array(tags, dtype=np.int32),
        facets=np.empty((0, 3), dtype=np.int64),
        facet_tags=np.empty(0, dtype=np.int32),
        regions={"below": 1, "band": 2, "above": 3},
        boundaries={},
    )


@pytest.mark.parametrize("rows", [1, 2, 3])
def test_layers_across_a_band_are_its_rows(rows: int) -> None:
    layers = layers_across(strip(rows), "band")
    # Far from the ends of the band, which are curves as well: five corner nodes on either side.
    inside = (layers.points[:, 0] > 3.5) & (layers.points[:, 0] < 8.5)
    assert inside.sum() == 10
    assert (layers.count[inside] == rows).all()
    assert layers.thickness[inside] == pytest.approx(1.0)


def test_layers_of_a_ring_count_towards_the_nearest_curve() -> None:
    mesh = rings.build([("bone", 6.0, 8.0), ("fascia", 8.0, 9.0), ("skin", 9.0, 12.0)], None, 1.5)
    layers = layers_across(mesh, "fascia")
    # 16 pi / 1.5 and 18 pi / 1.5 sides on the two circles, one layer of them.
    assert len(layers.count) == pytest.approx(71, abs=3)
    assert (layers.count == 1).all()
    assert layers.thickness == pytest.approx(1.0, abs=5e-3)


def test_smoothing_mends_a_spoilt_mesh() -> None:
    good = rings.build([("fat", 10.0, 20.0)], (19.0, 24.0), 2.0)
    # Push every corner inside a region by up to 0.6 mm, sides staying straight.
    on_side = np.unique(good.facets)
    push = np.random.default_rng(3).uniform(-0.6, 0.6, good.points.shape)
    push[on_side] = 0.0
    points = good.points + push
    for i, j in ((0, 1), (1, 2), (2, 0)):
        middle = good.cells[:, 3 + i]
        straight = ~np.isin(middle, on_side)
        ends = good.cells[straight]
        points[middle[straight]] = (points[ends[:, i]] + points[ends[:, j]]) / 2
    spoilt = replace(good, points=points)
    mended = smooth(spoilt)
    before, after = (quality.scaled_jacobians(m.coordinates) for m in (spoilt, mended))
    assert before.min() < 0.3 < 0.5 < after.min()
    assert np.array_equal(mended.points[on_side], good.points[on_side])
    assert np.array_equal(mended.cells, good.cells)
    total = quality.areas(good.coordinates).sum()
    assert quality.areas(mended.coordinates).sum() == pytest.approx(total, rel=1e-12)
