"""Mesh sizes by name and by number of triangles."""

from dataclasses import astuple, replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from calfsocket.io.errors import InputError
from calfsocket.meshes import gmsh_model, sizing
from calfsocket.meshes.limb import limb_curves
from calfsocket.meshes.section import build, write_section
from calfsocket.meshes.sizing import (
    BLOCK,
    COUNT_TOLERANCE,
    FEWEST_TRIANGLES,
    MOST_TRIANGLES,
    SIZES,
    TRIALS,
    LimbSizes,
    mesh_size,
    named_size,
)
from tiny_study import tiny_limb, tiny_socket


def test_a_number_has_the_shape_of_paper():
    size = mesh_size("12000")
    assert size == replace(SIZES["paper"], name="12000", triangles=12000)


@pytest.mark.parametrize("name", [str(FEWEST_TRIANGLES - 1), str(MOST_TRIANGLES + 1), "0"])
def test_numbers_out_of_range_are_refused(name):
    with pytest.raises(InputError, match=f"{name} triangles; give {FEWEST_TRIANGLES} to"):
        mesh_size(name)


@pytest.mark.parametrize("name", ["papier", "-9000", "1e4", "9000.0", "٩٠٠٠", ""])
def test_other_names_are_refused(name):
    with pytest.raises(InputError, match="or a number of triangles"):
        mesh_size(name)


def test_where_sizes_are_compared_they_have_names():
    assert named_size("medium") is SIZES["medium"]
    with pytest.raises(InputError, match="no mesh size '9000'"):
        named_size("9000")


def test_scaling_changes_every_length():
    twice = mesh_size("12000").scaled(2.0)
    assert twice.triangles is None
    for before, after in zip(astuple(SIZES["paper"])[1:-1], astuple(twice)[1:-1], strict=True):
        assert after == 2.0 * before


@pytest.mark.parametrize("wanted", [7000, 15_000, 32_000, 200_000])
@pytest.mark.parametrize(("area", "along", "power"), [(2e4, 9e3, 2), (2e4, 0, 2), (3e4, 0, 1.8)])
def test_the_number_is_met(wanted, area, along, power):
    """Meshes with a law of their own between factor and triangles; the second one mostly fits."""
    asked = []

    def factor(size):
        return size.largest / SIZES["paper"].largest

    def count(size):
        asked.append(factor(size))
        return int(area * factor(size) ** -power + along / factor(size))

    size = replace(SIZES["paper"], triangles=wanted).for_triangles(
        count, lambda size: area / factor(size) ** 2
    )
    assert len(asked) <= (2 if power == 2 else TRIALS + 1)
    assert factor(size) == asked[-1]
    assert count(size) == pytest.approx(wanted, rel=COUNT_TOLERANCE)


def test_a_size_that_is_final_asks_for_nothing():
    def refuse(_):
        pytest.fail("no trial")

    assert SIZES["coarse"].for_triangles(refuse, refuse) is SIZES["coarse"]


def test_a_section_has_about_so_many_triangles():
    mesh = build(tiny_limb(), tiny_socket("A"), mesh_size("7000"))
    assert len(mesh.cells) == pytest.approx(7000, rel=2 * COUNT_TOLERANCE)


@pytest.mark.parametrize("reach", [1.6, 3.1, 40.0])
def test_a_gap_is_the_distance_of_the_nearest_other_curve_within_the_reach(reach):
    limb = tiny_limb()
    sizes = LimbSizes(limb_curves(limb), limb.contact_boundary)
    gaps = np.split(sizes._gaps(reach), np.cumsum([*map(len, sizes._curves)])[:-1])
    near = 0
    for number, (points, found) in enumerate(zip(sizes._curves, gaps, strict=True)):
        others = np.concatenate([each for i, each in enumerate(sizes._curves) if i != number])
        wanted = cKDTree(others).query(points)[0]
        is_near = wanted <= reach
        np.testing.assert_array_equal(found[is_near], wanted[is_near])
        assert np.isinf(found[wanted > 1.001 * reach]).all()
        near += is_near.sum()
    assert 0 < near


@pytest.mark.parametrize("reach", [0.1, 1.9, 5.0, 40.0])
def test_what_is_near_is_the_same_by_blocks_as_from_every_point(reach):
    """Whatever the reach, and where the last blocks are not whole."""
    t = np.linspace(0.0, 2.0 * np.pi, 200, endpoint=False)
    points = np.stack([9.3 * np.cos(t), 4.1 * np.sin(t)], axis=1)
    around = sizing.Surroundings(points)
    assert any(n % BLOCK for n in around._grid.shape[:2])
    distance, nearest = around._within(reach)
    wanted = cKDTree(points).query(around._grid, distance_upper_bound=reach)[0]
    np.testing.assert_array_equal(distance, wanted)
    is_near = np.isfinite(wanted)
    assert (nearest[~is_near] == len(points)).all()
    away = np.linalg.norm(points[nearest[is_near]] - around._grid[is_near], axis=1)
    np.testing.assert_allclose(away, wanted[is_near], rtol=1e-12)
    assert is_near.any()


def test_a_file_of_a_number_of_triangles_takes_no_mesh_more_than_the_number(monkeypatch, tmp_path):
    made = []
    generate = gmsh_model.mesh

    def count(*given, **options):
        made.append(given)
        generate(*given, **options)

    monkeypatch.setattr(gmsh_model, "mesh", count)
    limb, socket, size = tiny_limb(), tiny_socket("A"), replace(SIZES["paper"], triangles=7000)
    mesh = build(limb, socket, size)
    trials = len(made)
    table = write_section(tmp_path / "a.msh", limb, socket, size)
    assert len(made) == 2 * trials
    assert table.triangles.sum() == len(mesh.cells)
