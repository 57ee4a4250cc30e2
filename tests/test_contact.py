"""The contact of single points, without a mesh: projection, friction, exact tangent."""

import numpy as np
import pytest

from calfsocket.contact import nitsche
from calfsocket.contact.friction import OPEN, SLIP, STICK, coulomb
from calfsocket.contact.nitsche import ContactState, SkinPoints
from calfsocket.contact.parameters import Contact
from calfsocket.contact.projection import EdgeChain, along_chain, order_chain, shape_functions


def circle_edges(n: int, radius: float) -> np.ndarray:
    """Quadratic edges of a circle, counter-clockwise, all nodes on it."""
    angle = 2 * np.pi * np.arange(2 * n) / (2 * n)
    nodes = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    ends = np.arange(n)
    return np.stack([nodes[2 * ends], nodes[(2 * ends + 2) % (2 * n)], nodes[2 * ends + 1]], 1)


@pytest.mark.parametrize("flipped_share", [0.0, 0.5, 1.0])
def test_chain_from_loose_edges_is_closed_and_counter_clockwise(flipped_share):
    rng = np.random.default_rng(1)
    edges = circle_edges(40, 10.0)
    shuffled = edges[rng.permutation(40)]
    flip = rng.random(40) < flipped_share
    shuffled[flip] = shuffled[flip][:, [1, 0, 2]]
    order, flipped = order_chain(shuffled)
    chain = along_chain(shuffled, order, flipped)
    np.testing.assert_allclose(chain[:, 1], np.roll(chain[:, 0], -1, axis=0), atol=1e-12)
    middle = chain[:, 2]
    ahead = np.roll(middle, -1, axis=0)
    assert np.sum(middle[:, 0] * ahead[:, 1] - ahead[:, 0] * middle[:, 1]) > 0
    np.testing.assert_allclose(chain, np.roll(edges, -_offset(edges, chain), axis=0), atol=1e-12)


def _offset(edges: np.ndarray, chain: np.ndarray) -> int:
    return int(np.argmin(np.linalg.norm(edges[:, 2] - chain[0, 2], axis=1)))


@pytest.mark.parametrize("broken", ["gap", "two loops"])
def test_what_is_no_single_closed_chain_is_refused(broken):
    edges = circle_edges(20, 10.0)
    if broken == "gap":
        edges = edges[:-1]
    else:
        edges = np.concatenate([edges, circle_edges(20, 5.0)])
    with pytest.raises(ValueError, match="chain"):
        order_chain(edges)


def half_circle(n: int, radius: float) -> np.ndarray:
    """Quadratic edges of a circle's upper half, from right to left."""
    return circle_edges(2 * n, radius)[:n]


@pytest.mark.parametrize(("body", "from_right"), [(0.8, False), (1.2, True)])
def test_an_open_chain_has_its_body_on_the_right(body, from_right):
    edges = half_circle(10, 10.0)
    rng = np.random.default_rng(2)
    order = rng.permutation(10)
    shuffled = edges[order]
    flip = rng.random(10) < 0.5
    shuffled[flip] = shuffled[flip][:, [1, 0, 2]]
    chain = along_chain(shuffled, *order_chain(shuffled, body * shuffled[:, 2]))
    expected = edges if from_right else edges[::-1][:, [1, 0, 2]]
    np.testing.assert_allclose(chain, expected, atol=1e-12)


@pytest.mark.parametrize("broken", ["no inside", "two pieces", "with a loop"])
def test_what_is_no_single_open_chain_is_refused(broken):
    edges = half_circle(10, 10.0)
    inside = 0.8 * edges[:, 2]
    if broken == "no inside":
        inside = None
    elif broken == "two pieces":
        edges = np.delete(edges, 4, axis=0)
        inside = 0.8 * edges[:, 2]
    else:
        edges = np.concatenate([edges, circle_edges(10, 5.0)])
        inside = 0.8 * edges[:, 2]
    with pytest.raises(ValueError, match="chain"):
        order_chain(edges, inside)


def test_points_beyond_the_ends_of_an_open_chain_have_no_partner():
    x = np.linspace(4.0, -4.0, 9)  # a plate above the skin: its body is on the right of -x
    ends = np.stack([x, np.zeros(9)], axis=1)
    chain = EdgeChain.from_edges(np.stack([ends[:-1], ends[1:], 0.5 * (ends[:-1] + ends[1:])], 1))
    assert not chain.closed
    assert chain.length == pytest.approx(8.0)
    points = np.array([[4.1, -0.1], [3.9, -0.1], [0.0, -0.1], [-3.9, 0.2], [-4.1, 0.2], [9.0, 0.0]])
    at = chain.project(points, np.zeros((8, 3, 2)))
    np.testing.assert_array_equal(at.beyond, [True, False, False, False, True, True])
    partners = ~at.beyond
    np.testing.assert_allclose(at.point[partners], points[partners] * [1, 0], atol=1e-12)
    np.testing.assert_allclose(at.normal, np.tile([0.0, -1.0], (6, 1)), atol=1e-12)
    np.testing.assert_allclose(at.arc[partners], 4.0 - points[partners, 0], atol=1e-12)
    # Slip does not wrap around.
    np.testing.assert_allclose(chain.slip(np.array([7.5]), np.array([0.5])), 7.0)
    # A nominal pressure of 1 MPa outweighs the gaps of at most 0.2 mm everywhere.
    pressed_down = np.tile([0.0, -1.0], (6, 1))
    state = nitsche.contact_state(
        points, pressed_down, at, np.zeros(6), np.zeros(6), Contact(friction=0.0)
    )
    np.testing.assert_array_equal(state.traction.pressure > 0, partners)


def test_neighbours_along_a_chain_wrap_only_where_it_closes():
    closed = EdgeChain.from_edges(circle_edges(6, 1.0))
    np.testing.assert_array_equal(closed.around(np.array([0, 5]), 1), [[5, 0, 1], [4, 5, 0]])
    opened = EdgeChain.from_edges(half_circle(6, 1.0))
    np.testing.assert_array_equal(opened.around(np.array([0, 5]), 1), [[0, 0, 1], [4, 5, 5]])


@pytest.mark.parametrize("distance", [-2.0, -0.1, 0.5])
def test_projection_on_a_circle_is_radial(distance):
    radius = 50.0
    chain = EdgeChain.from_edges(circle_edges(160, radius))
    angle = np.linspace(0.01, 6.2, 300)
    direction = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    at = chain.project((radius - distance) * direction, np.zeros((160, 3, 2)))
    # 160 quadratic edges follow the circle to 1e-6 mm and its normal to 1e-5.
    np.testing.assert_allclose(at.point, radius * direction, atol=2e-5)
    np.testing.assert_allclose(np.linalg.norm(at.point, axis=1), radius, atol=1e-6)
    np.testing.assert_allclose(at.normal, -direction, atol=2e-5)
    np.testing.assert_allclose(at.arc, radius * angle, atol=1e-5)
    assert chain.length == pytest.approx(2 * np.pi * radius, rel=1e-8)
    assert np.all(np.abs(at.xi) <= 1 + 1e-6)


def test_slip_is_measured_the_short_way_round():
    chain = EdgeChain.from_edges(circle_edges(160, 1.0))
    slip = chain.slip(np.array([0.1, 6.2]), np.array([6.2, 0.1]))
    expected = 0.1 - 6.2 + chain.length
    np.testing.assert_allclose(slip, [expected, -expected], rtol=1e-12)


def test_slip_of_a_rigid_rotation_of_both_bodies_is_zero():
    chain = EdgeChain.from_edges(circle_edges(64, 30.0))
    points = 30.2 * np.stack([np.cos([0.3, 2.0]), np.sin([0.3, 2.0])], axis=1)
    before = chain.project(points, np.zeros((64, 3, 2)))
    c, s = np.cos(0.7), np.sin(0.7)
    rotation = np.array([[c, -s], [s, c]])
    after = chain.project(points @ rotation.T, chain.reference @ rotation.T - chain.reference)
    np.testing.assert_allclose(chain.slip(after.arc, before.arc), 0.0, atol=1e-11)


def test_coulomb_by_hand():
    # mu = 0.4: open; stick at 0.39 p; slip forwards and backwards at 0.4 p.
    law = coulomb(np.array([-1.0, 1.0, 1.0, 2.0]), np.array([5.0, 0.39, 0.41, -3.0]), 0.4)
    np.testing.assert_array_equal(law.status, [OPEN, STICK, SLIP, SLIP])
    np.testing.assert_allclose(law.pressure, [0.0, 1.0, 1.0, 2.0])
    np.testing.assert_allclose(law.shear, [0.0, 0.39, 0.4, -0.8])


def case(seed: int, shear: float, gap: float, friction: float = 0.4):
    """Random points near a randomly bent socket, with a traction linear in their unknowns."""
    rng = np.random.default_rng(seed)
    n, k = 12, 5
    chain = EdgeChain.from_edges(circle_edges(24, 20.0))
    angle = rng.uniform(0, 2 * np.pi, n)
    radial = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    rest = (20.0 - gap) * radial
    shape = rng.normal(size=(n, 2, k))
    stress = rng.normal(size=(n, 2, k))
    pressed = -radial + shear * np.stack([-radial[:, 1], radial[:, 0]], axis=1)
    points = SkinPoints(reference=rest, weight=rng.uniform(0.1, 0.2, n), shape=shape)
    parameters = Contact(friction=friction, gamma=0.7, gamma_t=0.3)
    bend = 0.02 * rng.normal(size=(24, 2, 2))
    displacement = np.concatenate([bend, np.zeros((24, 1, 2))], axis=1)
    displacement[:, 1] = np.roll(displacement[:, 0], -1, axis=0)
    displacement[:, 2] = 0.01 * rng.normal(size=(24, 2))
    previous = chain.project(rest, displacement).arc - 0.01
    return chain, points, parameters, rest, stress, pressed, displacement, previous


def evaluate(data, unknowns, displacement, active_set=None):
    chain, points, parameters, rest, stress, pressed, _, previous = data
    position = rest + np.einsum("nck,nk->nc", points.shape, unknowns)
    traction = pressed + np.einsum("nck,nk->nc", stress, unknowns)
    at = chain.project(position, displacement)
    closing = np.full(len(position), -0.05)
    state = nitsche.contact_state(
        position, traction, at, closing, chain.slip(at.arc, previous), parameters, active_set
    )
    return state, traction


class Held:
    """An active set that holds all points on one branch."""

    def __init__(self, branch):
        self.branch = branch

    def branches(self, own):
        assert np.all(own != self.branch)
        return np.full(len(own), self.branch)


@pytest.mark.parametrize(
    ("shear", "gap", "expected", "held"),
    [
        (0.0, 0.1, STICK, None),
        (2.0, 0.1, SLIP, None),
        (-2.0, -0.3, SLIP, None),
        (0.1, -0.3, STICK, None),
        (0.0, 6.0, OPEN, None),
        (2.0, 0.1, STICK, Held(STICK)),
        (0.1, -0.3, SLIP, Held(-SLIP)),
    ],
)
def test_tangent_is_the_derivative_of_the_residual(shear, gap, expected, held):
    data = case(seed=3, shear=shear, gap=gap)
    _, points, parameters, _, stress, _, displacement, _ = data
    n, _, k = points.shape.shape
    unknowns = np.zeros((n, k))
    state, traction = evaluate(data, unknowns, displacement, held)
    assert np.all(state.traction.status == expected)
    exact, by_traction = nitsche.tangent(
        points, state, traction, parameters.gamma, parameters.gamma_t
    )
    exact[:, :, :k] += by_traction @ stress
    edge = state.projection.edge

    def residual(step: np.ndarray) -> np.ndarray:
        """Residual of each point on its own when its own k + 6 displacements move by `step`."""
        result = np.empty((n, k + 6))
        for i in range(n):
            moved = displacement.copy()
            moved[edge[i]] += step[i, k:].reshape(3, 2)
            one, _ = evaluate(data, step[:, :k], moved, held)
            skin, socket = nitsche.residual(points, one)
            result[i, :k], result[i, k:] = skin[i], socket[i].ravel()
            assert one.projection.edge[i] == edge[i]
        return result

    h = 1e-6
    for column in range(k + 6):
        step = np.zeros((n, k + 6))
        step[:, column] = h
        difference = (residual(step) - residual(-step)) / (2 * h)
        np.testing.assert_allclose(exact[:, :, column], difference, atol=2e-8, rtol=2e-7)
    if expected != OPEN:
        assert np.abs(exact).max() > 1e-2


def test_tangent_moves_with_each_parameter():
    data = case(seed=5, shear=0.1, gap=-0.3)
    _, points, parameters, _, _, _, displacement, _ = data
    state, traction = evaluate(data, np.zeros((12, 5)), displacement)

    def matrix(p: Contact) -> np.ndarray:
        return nitsche.tangent(points, state, traction, p.gamma, p.gamma_t)[0]

    base = matrix(parameters)
    for change in ({"gamma": 0.8}, {"gamma_t": 0.4}):
        assert np.abs(matrix(parameters.model_copy(update=change)) - base).max() > 1e-3


def test_traction_on_the_socket_balances_that_on_the_skin():
    data = case(seed=7, shear=0.2, gap=-0.2)
    points = SkinPoints(data[3], data[1].weight, np.tile(np.eye(2), (12, 1, 1)))
    state, _ = evaluate(data, np.zeros((12, 5)), data[6])
    skin, socket = nitsche.residual(points, state)
    np.testing.assert_allclose(skin, -socket.sum(axis=1), atol=1e-14)
    values = shape_functions(state.projection.xi)[0]
    np.testing.assert_allclose(values.sum(axis=1), 1.0, atol=1e-14)


def test_settled_slip_gives_the_shear_back():
    """Open, stick and slip both ways; T.e by hand, gamma_t 0.5, limit 0.4 * 2."""
    parameters = Contact(friction=0.4, gamma_t=0.5)
    pressure, shear = np.array([-1.0, 2.0, 2.0, 2.0]), np.array([0.3, 0.3, 0.6, -0.6])
    slip = np.array([0.7, 0.2, -1.0, 1.0])
    trial = shear - 0.5 * slip
    traction = coulomb(pressure, trial, 0.4)
    none = np.zeros(4)
    state = ContactState(None, none, none, slip, trial, traction)
    settled = nitsche.settled_slip(state, parameters)
    np.testing.assert_allclose(settled, [0.0, 0.2, -0.4, 0.4])
    again = coulomb(pressure, shear - 0.5 * settled, 0.4)
    np.testing.assert_allclose(again.shear, [0.0, 0.2, 0.8, -0.8])
    np.testing.assert_allclose(again.shear, traction.shear)
