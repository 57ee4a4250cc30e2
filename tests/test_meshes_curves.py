"""Curves: through their points, of the right area, and offset by the right distance."""

import numpy as np
import pytest
from geometry import LIMB, LOOPS, SKIN
from scipy.interpolate import BSpline
from scipy.spatial import cKDTree

from calfsocket.io.errors import InputError
from calfsocket.meshes import curves
from calfsocket.meshes.curves import ClosedCurve
from calfsocket.meshes.socket import Bump, NormalOffset, Socket, bumps_at


def dense(curve: ClosedCurve) -> np.ndarray:
    return curve.evaluate(curve.sample(0.02))


def test_a_spline_goes_through_its_points_and_is_smooth_where_it_closes() -> None:
    points = LIMB.curves["tibia"].points
    tibia = LOOPS["tibia"]
    assert tibia.evaluate(tibia.knots[:-1]) == pytest.approx(np.array(points), abs=1e-12)
    for derivative in (0, 1, 2):
        start, end = tibia.evaluate([0.0, tibia.period], derivative)
        assert start == pytest.approx(end, abs=1e-10)
    chord = np.hypot(*np.subtract(points[1], points[0]))
    assert tibia.knots[1] == pytest.approx(chord)


def test_area_perimeter_and_curvature_of_a_circle() -> None:
    circle = curves.ellipse([3.0, -2.0], [5.0, 5.0], 17.0)
    assert circle.area == pytest.approx(np.pi * 25, rel=1e-4)
    assert circle.perimeter == pytest.approx(np.pi * 10, rel=1e-4)
    # Second derivatives of a cubic spline are less exact than its points.
    assert circle.curvature(circle.knots) == pytest.approx(1 / 5, rel=0.02)
    # Counter-clockwise, the outward normal points away from the centre.
    outward = (circle.evaluate([1.0, 2.0]) - [3.0, -2.0]) / 5
    assert circle.normal([1.0, 2.0]) == pytest.approx(outward, abs=1e-3)


def test_an_ellipse_is_turned_counter_clockwise() -> None:
    ellipse = curves.ellipse([1.0, 2.0], [3.0, 1.0], 90.0)
    assert ellipse.evaluate(0.0) == pytest.approx([1.0, 5.0])
    assert dense(ellipse).max(axis=0) == pytest.approx([2.0, 5.0], abs=1e-3)


@pytest.mark.parametrize("region", LIMB.regions, ids=lambda region: region.name)
def test_regions_have_the_areas_of_the_data(region) -> None:
    area = LOOPS[region.outer].area - sum(LOOPS[hole].area for hole in region.holes)
    # The data are rounded to 0.1 mm^2.
    assert area == pytest.approx(region.area, abs=0.06)


def test_the_skin_is_as_thick_as_the_data_say() -> None:
    distance = cKDTree(dense(SKIN)).query(dense(LOOPS["skin_inner"]))[0]
    assert distance == pytest.approx(1.6, abs=1e-3)


@pytest.mark.parametrize("angle, fat", [(0.0, 4.4), (104.0, 3.4), (185.0, 6.6), (325.0, 4.9)])
def test_fat_has_its_thickness_at_the_angles_of_the_data(angle: float, fat: float) -> None:
    """The outer face of the fascia lies at 1.6 mm + fat under the skin at this polar angle."""
    t = SKIN.sample(0.01)
    points = SKIN.evaluate(t)
    turn = (np.rad2deg(np.arctan2(points[:, 1], points[:, 0])) - angle + 180) % 360 - 180
    place = t[np.argmin(np.abs(turn))]
    below = SKIN.evaluate(place) - (1.6 + fat) * SKIN.normal(place)
    assert cKDTree(dense(LOOPS["fascia_outer"])).query(below)[0] < 0.01


def test_offsets_keep_their_distance_from_what_they_stand_for() -> None:
    """Every curve is within the tolerance of the exact one, between the points that were tried."""

    def exact(t: np.ndarray) -> np.ndarray:
        return SKIN.evaluate(t) - 1.6 * SKIN.normal(t)

    t = np.linspace(0.0, SKIN.period, 20_011)
    error = np.linalg.norm(LOOPS["skin_inner"].evaluate(t) - exact(t), axis=1).max()
    assert 0 < error < 1.5 * curves.INTERPOLATION_TOLERANCE


def test_samples_are_as_dense_as_promised() -> None:
    for step in (0.1, 3.0):
        points = SKIN.evaluate(np.append(SKIN.sample(step), SKIN.period))
        gaps = np.linalg.norm(np.diff(points, axis=0), axis=1)
        assert 0.5 * step < gaps.min() <= gaps.max() <= step


def test_the_b_spline_is_the_same_curve() -> None:
    degree, knots, multiplicities, control = SKIN.b_spline()
    # Of a periodic B-spline the outer knots are repeated as often as its degree; scipy wants one
    # more.
    extended = np.concatenate([knots[:1], np.repeat(knots, multiplicities), knots[-1:]])
    t = np.linspace(0.0, SKIN.period, 1001)
    assert BSpline(extended, control, degree)(t) == pytest.approx(SKIN.evaluate(t), abs=1e-10)
    assert control[0] == pytest.approx(control[-1], abs=1e-12)
    # What gmsh and OpenCASCADE check: poles that differ = multiplicities but the last.
    assert len(control) - 1 == multiplicities[:-1].sum()


def test_a_curve_that_jumps_is_refused() -> None:
    with pytest.raises(InputError, match="turns too sharply"):
        curves.offset(SKIN, lambda points: np.where(points[:, 0] > 0, 1.0, 2.0))


@pytest.mark.parametrize("name", ["TC", "TSB", "HS"])
def test_walls_have_one_thickness(name: str) -> None:
    inner, outer = Socket.reference(name).faces(LIMB)
    assert cKDTree(dense(inner)).query(dense(outer))[0] == pytest.approx(4.5, abs=1e-3)


def test_bumps_are_gaussian_and_periodic() -> None:
    bumps = [Bump(center=350.0, width=10.0, amplitude=2.0)]
    # One width away on either side, once across 0 degrees: 2 exp(-1/2).
    assert bumps_at(bumps, np.array([350.0, 0.0, 340.0])) == pytest.approx(
        [2.0, 2.0 * np.exp(-0.5), 2.0 * np.exp(-0.5)]
    )


def test_a_socket_that_folds_over_is_refused() -> None:
    socket = NormalOffset(base=0.5, bumps=(Bump(center=90.0, width=0.5, amplitude=30.0),))
    with pytest.raises(InputError, match=r"a wall of 4.5 mm folds over where .* at 9\d degrees, "):
        socket.faces(LIMB)
