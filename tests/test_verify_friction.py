"""A socket turned on a limb: elastic slope, plateau, hysteresis, objective slip."""

from dataclasses import replace

import numpy as np
import pytest
from checks import failing
from mpi4py import MPI

from calfsocket.meshes import tags
from calfsocket.verification.friction import CYCLE, TurnedRing, rigid_turn, turn

RING = TurnedRing(h=2.8)


@pytest.fixture(scope="module")
def loop():
    return turn(RING)


def test_closed_forms_by_hand():
    """One layer of limb and socket alike: C is that of one ring."""
    law = RING.layers[-1][-1]
    ring = TurnedRing(layers=(("limb", 10.0, 20.0, law), (tags.SOCKET, 20.0, 24.0, law)))
    whole = (1 / 10.0**2 - 1 / 24.0**2) / (4 * np.pi * law.initial_shear_modulus)
    assert ring.compliance == pytest.approx(whole, rel=1e-12)
    assert ring.pressure > 0
    # In linear elasticity the pressure is as large as the overclosure.
    assert replace(ring, overclosure=4e-4).pressure == pytest.approx(2 * ring.pressure, rel=1e-4)


def test_a_cycle_is_as_it_should_be(loop):
    assert failing(loop.checks()) == []
    assert loop.slipping.sum() == 9
    torque = loop.steps.torque
    assert np.all(np.sign(torque[[2, 3, 4]]) == 1)
    assert np.all(np.sign(torque[[7, 8]]) == -1)
    # Coulomb's limit of the pressure in the same step.
    limit = RING.friction * loop.steps.pressure * 2.0 * np.pi * RING.radius**2
    np.testing.assert_allclose(abs(torque / limit)[loop.slipping], 1.0, rtol=1e-3)


def test_the_error_of_the_slope_falls_with_the_mesh(loop):
    finer = turn(replace(RING, h=1.4), CYCLE[:1])
    assert abs(finer.slope_error) < 0.3 * abs(loop.slope_error)


def test_limit_moves_with_the_coefficient_of_friction():
    half = turn(replace(RING, friction=0.2, h=4.0), (2.0,))
    assert half.steps.torque[1] / RING.slip_torque == pytest.approx(0.5, rel=2e-3)


@pytest.mark.parametrize("angle", [0.7, -2.5])
def test_a_rigid_turn_of_both_bodies_changes_nothing(angle):
    assert failing(rigid_turn(replace(RING, h=4.0), angle)) == []


@pytest.mark.parametrize("share", [0.5, 1.5])
def test_a_step_that_is_accepted_stays_an_equilibrium(share):
    """Stuck and sliding: neither creeps, however many steps follow."""
    ring = replace(RING, h=4.0)
    motion = ring.pressed(MPI.COMM_SELF)
    motion.step([tags.SOCKET], angle=share * ring.slip_turn)
    torque = motion.problem.reaction(tags.SOCKET_OUTER)[1]
    for _ in range(3):
        assert motion.step([tags.SOCKET]).iterations == 0
    assert motion.problem.reaction(tags.SOCKET_OUTER)[1] == pytest.approx(torque, rel=1e-8)
