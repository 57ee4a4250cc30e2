"""Points that go to and fro between Newton's iterations: single points, without a mesh."""

import numpy as np
import pytest
from mpi4py import MPI

from calfsocket.contact.active_set import (
    EXTENSION,
    FARTHER,
    FARTHEST,
    FEW_CHANGES,
    ActiveSet,
    retreat,
    spread,
)
from calfsocket.contact.friction import OPEN, SLIP, STICK, branches, coulomb
from calfsocket.contact.projection import EdgeChain

EDGES = np.zeros(4, dtype=np.int64)


def array(*branch):
    return np.array(branch, dtype=np.int64)


@pytest.fixture
def active_set():
    return ActiveSet(MPI.COMM_SELF)


def test_branches_and_the_law_on_another_branch_by_hand():
    pressure, shear = np.array([-1.0, 1.0, 1.0, 2.0]), np.array([5.0, 0.3, 0.5, -3.0])
    own = branches(pressure, shear, 0.4)
    np.testing.assert_array_equal(own, [OPEN, STICK, SLIP, -SLIP])
    for law in (coulomb(pressure, shear, 0.4), coulomb(pressure, shear, 0.4, own)):
        np.testing.assert_allclose(law.shear, [0.0, 0.3, 0.4, -0.8])
    # Sticking holds more than friction may, slipping the other way has the other sign.
    other = coulomb(pressure, shear, 0.4, array(OPEN, -SLIP, STICK, STICK))
    np.testing.assert_allclose(other.shear, [0.0, -0.4, 0.5, -3.0])
    np.testing.assert_allclose(other.d_shear_pressure, [0.0, -0.4, 0.0, 0.0])
    np.testing.assert_allclose(other.d_shear_shear, [0.0, 0.0, 1.0, 1.0])
    np.testing.assert_array_equal(other.status, [OPEN, SLIP, STICK, STICK])


def test_outside_of_a_solve_every_point_is_on_its_own_branch(active_set):
    active_set.equilibrium = array(SLIP, SLIP, SLIP, SLIP)
    own = array(OPEN, STICK, SLIP, -SLIP)
    active_set.linearised(-own, EDGES)
    assert active_set.branches(own) is own
    with active_set.iterating(ahead=True):
        assert active_set.branches(own) is not own
    assert active_set.branches(own) is own
    assert not active_set.release()


def test_a_point_that_would_turn_round_sticks_for_one_iteration(active_set):
    with active_set.iterating(ahead=False):
        active_set.linearised(array(SLIP, -SLIP, STICK, SLIP), EDGES)
        own = array(-SLIP, SLIP, SLIP, OPEN)
        held = active_set.branches(own)
        np.testing.assert_array_equal(held, [STICK, STICK, SLIP, OPEN])
        active_set.linearised(held, EDGES)
        assert active_set.branches(own).tolist() == own.tolist()


def test_a_residual_that_vanishes_with_points_held_back_does_not_count(active_set):
    with active_set.iterating(ahead=False):
        active_set.linearised(array(SLIP), EDGES[:1])
        assert not active_set.release()
        assert active_set.branches(array(-SLIP)) == STICK
        assert active_set.release()
        assert active_set.branches(array(-SLIP)) == -SLIP
        active_set.linearised(array(-SLIP), EDGES[:1])
        assert active_set.branches(array(SLIP)) == STICK


def test_statuses_of_the_equilibrium_count_until_they_can_be_told(active_set):
    n = 1000
    active_set.equilibrium = equilibrium = np.full(n, SLIP)
    edges = np.zeros(n, dtype=np.int64)
    few, many = (equilibrium.copy() for _ in range(2))
    few[: int(FEW_CHANGES * n)] = STICK
    many[: int(FEW_CHANGES * n) + 1] = STICK
    with active_set.iterating(ahead=False):
        sticking = np.full(n, STICK)  # at the equilibrium itself
        np.testing.assert_array_equal(active_set.branches(equilibrium), sticking)
        active_set.linearised(sticking, edges)
        np.testing.assert_array_equal(active_set.branches(few), few)
        np.testing.assert_array_equal(active_set.branches(many), equilibrium)
        active_set.linearised(equilibrium, edges)
        np.testing.assert_array_equal(active_set.branches(many), many)
    with active_set.iterating(ahead=True):
        np.testing.assert_array_equal(active_set.branches(many), equilibrium)
        active_set.linearised(equilibrium, edges)
        np.testing.assert_array_equal(active_set.branches(many), many)


def test_only_points_in_contact_take_the_status_of_the_equilibrium(active_set):
    active_set.equilibrium = array(SLIP, OPEN, OPEN, STICK)
    with active_set.iterating(ahead=True):
        held = active_set.branches(array(OPEN, STICK, -SLIP, SLIP))
    np.testing.assert_array_equal(held, [OPEN, STICK, -SLIP, STICK])


def test_without_friction_points_stick_until_the_socket_has_moved_with_the_limb():
    free = ActiveSet(MPI.COMM_SELF, free=True)
    free.equilibrium = slipping = np.full(3, SLIP)
    edges = np.zeros(3, dtype=np.int64)
    with free.iterating(ahead=False):
        for expected in (STICK, STICK, SLIP):
            held = free.branches(slipping)
            np.testing.assert_array_equal(held, np.full(3, expected))
            free.linearised(held, edges)
    with free.iterating(ahead=True):
        np.testing.assert_array_equal(free.branches(slipping), slipping)


def test_slip_spreads_as_far_again_from_where_it_was():
    before = array(0, 2, 2, 1, 1, 1, 1, 1, 1, 1, -2)
    now = array(0, 2, 2, 2, 2, 1, 1, 1, 1, 1, -2)
    further = array(0, 2, 2, 2, 2, 2, 2, 1, 1, 1, -2)
    np.testing.assert_array_equal(spread(before, now, least=2), further)
    np.testing.assert_array_equal(spread(before[::-1], now[::-1], least=2), further[::-1])
    turned = [np.where(np.abs(b) == SLIP, -b, b) for b in (before, now, further)]
    np.testing.assert_array_equal(spread(*turned[:2], least=2), turned[2])
    np.testing.assert_array_equal(spread(before, now, least=3), now)


def test_slip_does_not_spread_over_other_slip_or_points_that_open():
    before = array(2, 1, 1, 1, 1, 1, 1, 1, -2)
    now = array(2, 2, 2, 1, 1, -2, -2, -2, -2)
    np.testing.assert_array_equal(spread(before, now, least=2), now)  # both want the two between
    now = array(2, 2, 2, 1, 0, 1, 1, 1, -2)
    np.testing.assert_array_equal(spread(before, now, least=2), array(2, 2, 2, 2, 0, 1, 1, 1, -2))


def test_a_zone_that_opens_between_sticking_points_spreads_by_a_fifth_on_each_side():
    before = np.full(30, STICK)
    now, further = before.copy(), before.copy()
    now[10:20], further[8:22] = SLIP, SLIP
    np.testing.assert_array_equal(spread(before, now, least=4), further)


def test_slip_spreads_to_each_point_once_in_a_solve(active_set):
    place = np.array([3.0, 0.0, 2.0, 1.0, 4.0, 5.0, 6.0, 7.0])  # not in order
    active_set.line_up(place, least=1)
    edges = np.zeros(8, dtype=np.int64)
    before = np.where(place < 1.0, SLIP, STICK)
    own = np.where(place < 2.0, SLIP, STICK)
    with active_set.iterating(ahead=False):
        active_set.linearised(before, edges)
        held = active_set.branches(own)
        np.testing.assert_array_equal(held, np.where(place < 3.0, SLIP, STICK))
        active_set.linearised(held, edges)
        assert active_set.branches(own).tolist() == own.tolist()  # it was too far
        active_set.linearised(own, edges)
        again = np.where(place < 3.0, SLIP, STICK)
        assert active_set.branches(again)[place == 3.0] == SLIP
        active_set.linearised(before, edges)
        assert active_set.branches(own).tolist() == own.tolist()  # not a second time


def zone(first, end, direction=SLIP, points=100):
    found = np.full(points, STICK)
    found[first:end] = direction
    return found


@pytest.mark.parametrize("direction", [SLIP, -SLIP])
def test_slip_retreats_by_two_thirds_of_what_turns_round(direction):
    before = zone(20, 80, direction)
    # A little, at one end or at both; of more, somewhat less than two thirds: 3 c^2 = 2 x0^2 + b^2.
    for now, further in [
        ((20, 74), (20, 76)),
        ((26, 80), (24, 80)),
        ((26, 74), (24, 76)),
        ((30, 70), (26, 74)),
    ]:
        found = retreat(before, zone(*now, direction), least=4)
        np.testing.assert_array_equal(found, zone(*further, direction))


def test_slip_does_not_retreat_less_within_an_edge_where_it_ends_or_beside_what_opens():
    before = zone(20, 80)
    for now in (zone(20, 77), zone(0, 0), before):
        np.testing.assert_array_equal(retreat(before, now, least=4), now)
    now = zone(20, 70)
    now[75] = OPEN
    np.testing.assert_array_equal(retreat(before, now, least=4), now)


def test_slip_retreats_less_from_an_equilibrium_alone(active_set):
    active_set.line_up(np.arange(100.0), least=4)
    edges = np.zeros(100, dtype=np.int64)
    active_set.equilibrium = before = zone(20, 80)
    for ahead, further in ((True, zone(24, 80)), (False, zone(26, 80))):
        with active_set.iterating(ahead):
            active_set.linearised(before, edges)
            active_set.linearised(before, edges)
            np.testing.assert_array_equal(active_set.branches(zone(26, 80)), further)


def test_iterations_in_which_a_tenth_of_the_points_change_are_counted(active_set):
    edges = np.zeros(100, dtype=np.int64)
    active_set.equilibrium = zone(0, 0)
    with active_set.iterating(ahead=False):
        for end in (0, 11, 21, 32):  # by 11, 10 and 11 of them
            active_set.linearised(zone(0, end), edges)
    assert active_set.unsettled == 2
    with active_set.iterating(ahead=False):
        assert active_set.unsettled == 0


def test_a_point_that_goes_back_to_an_edge_is_known(active_set):
    branch = np.full(3, STICK)
    with active_set.iterating(ahead=False):
        active_set.linearised(branch, array(4, 5, 6))
        np.testing.assert_array_equal(active_set.returning(array(5, 5, 6))[0], [-1, -1, -1])
        active_set.linearised(branch, array(5, 5, 7))
        np.testing.assert_array_equal(active_set.returning(array(4, 5, 8))[0], [5, -1, -1])
        np.testing.assert_array_equal(active_set.returning(array(5, 4, 6))[0], [-1, -1, 7])
    active_set.leave()
    np.testing.assert_array_equal(active_set.returning(array(5, 4, 6))[0], [-1, -1, -1])


def test_an_equilibrium_is_seen_on_the_edges_that_it_was_found_with(active_set):
    first, other = array(4, 7), array(5, 7)
    nowhere = array(-1, -1)
    with active_set.iterating(ahead=False):
        for edge in (first, other):
            assert active_set.returning(edge)[0].tolist() == nowhere.tolist()
            active_set.linearised(array(SLIP, SLIP), edge)
        assert active_set.returning(first)[0].tolist() == [5, -1]
    assert active_set.returning(first)[0].tolist() == [5, -1]
    active_set.leave()
    assert active_set.returning(first)[0].tolist() == nowhere.tolist()
    with active_set.iterating(ahead=False):
        assert active_set.returning(first)[0].tolist() == nowhere.tolist()


def test_a_point_that_goes_on_returning_may_stay_farther_beyond_the_end(active_set):
    branch = np.full(2, STICK)
    found = []
    with active_set.iterating(ahead=False):
        for k in range(7):
            active_set.linearised(branch, array(4 + k % 2, 6))
            found.append(active_set.returning(array(5 - k % 2, 6))[1])
    expected = np.minimum(EXTENSION * FARTHER ** np.array([0, 0, 1, 2, 3, 4, 5]), FARTHEST)
    np.testing.assert_allclose(np.array(found)[:, 0], expected)
    np.testing.assert_allclose(np.array(found)[:, 1], EXTENSION)


def test_a_point_stays_a_little_beyond_the_end_of_its_edge():
    """Two straight edges of 2 mm with a kink of 0.1 at x = 0; their bodies are below."""
    vertices = np.array([[-2.0, 0.0], [0.0, 0.0], [2.0, 0.2]])[::-1]
    ends = vertices[:-1], vertices[1:]
    chain = EdgeChain.from_edges(np.stack([*ends, 0.5 * (ends[0] + ends[1])], axis=1))
    extension = np.array([1e-3, 1e-3, 3e-3])
    beyond = np.array([5e-4, 2e-3, 2e-3])  # half an edge is 1 mm
    points = np.stack([beyond, 0.1 * beyond], axis=1)
    still = np.zeros((2, 3, 2))
    at = chain.project(points, still)
    np.testing.assert_array_equal(at.edge, [0, 0, 0])
    other = chain.stay(at, points, still, array(1, 1, 1), extension)
    np.testing.assert_array_equal(other.edge, [1, 0, 1])
    there = [[beyond[0], 0.0], at.point[1], [beyond[2], 0.0]]
    np.testing.assert_allclose(other.point, there, atol=1e-12)
    np.testing.assert_allclose(other.normal[0], [0.0, -1.0], atol=1e-12)
    assert chain.stay(at, points, still, array(-1, -1, -1), extension) is at
