"""A body pushed to and fro: stick, slip, reversal against Mindlin and Deresiewicz."""

from dataclasses import replace

import numpy as np
import pytest
from checks import failing
from scipy.integrate import quad

from calfsocket.verification.fretting import (
    LINE,
    locked_shear,
    loop_work,
    partial_loop,
    sliding,
    sliding_error,
)
from calfsocket.verification.hertz import press, push


@pytest.fixture(scope="module")
def loop():
    return partial_loop(LINE, steps=2)


def test_work_of_a_loop_by_quadrature():
    """The area between the two branches, each the first one doubled; any C cancels."""
    force, largest, mu = 0.3, 0.08, LINE.friction

    def g(x, c=0.7):
        change = [-p * np.log(p) / (np.pi * LINE.modulus) for p in (force, force - x / mu)]
        return c * x + mu * (change[0] - change[1])

    def width(Q):
        there = g(largest) - 2.0 * g(0.5 * (largest - Q))
        back = -g(largest) + 2.0 * g(0.5 * (largest + Q))
        return there - back

    area = quad(width, -largest, largest, epsabs=1e-14)[0]
    assert loop_work(LINE, force, largest) == pytest.approx(area, rel=1e-9)
    # Johnson 1985, section 7.4: without sliding it falls with the third power of Q1.
    small = loop_work(LINE, force, 2e-3) / loop_work(LINE, force, 1e-3)
    assert small == pytest.approx(8.0, rel=0.05)


def test_locked_shear_carries_the_force():
    pressed = press(LINE)
    limit = LINE.friction * pressed.force
    for share in (0.6, 0.0, -0.3):
        state = replace(pressed, tangential=share * limit)
        length = state.edges.length
        shear = locked_shear(state, 0.6 * limit, state.edges.x, length)
        assert -shear @ length == pytest.approx(share * limit, abs=1e-3 * limit)


def test_loop_without_sliding_is_mindlins(loop):
    assert 0.4 < loop.largest / (LINE.friction * loop.push.steps.force[0]) < 0.6
    assert failing(loop.checks(bar=0.03)) == []


def test_friction_takes_work_at_every_point(loop):
    assert loop.push.steps.work[3:].min() > 0
    assert loop.push.least_work > -0.01


def test_body_slides_at_the_limit_both_ways():
    slid = sliding(replace(LINE, divisions=4.0), step=1.0)
    assert sliding_error(slid) < 3e-3
    assert slid.steps.tangential[2] > 0 > slid.steps.tangential[6]
    assert slid.steps.tangential[10] == pytest.approx(slid.steps.tangential[2], rel=1e-3)


def test_after_a_turn_it_sticks_as_at_first():
    """Masing: the slope behind the turn is that of the start, twice the way for the same slip."""
    there = push(replace(LINE, divisions=4.0), [0.2, -0.2], 0.2)
    first = there.steps.tangential[1] / there.steps.way[1]
    back = np.diff(there.steps.tangential)[1:].sum() / np.diff(there.steps.way)[1:].sum()
    assert back == pytest.approx(first, rel=1e-3)
