"""What carries the socket, a rigid frame or an even load: tangent, slope, equilibrium, ranks."""

import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from calfsocket.contact.parameters import Contact
from calfsocket.contact.resultants import resultants
from calfsocket.mechanics.carrier import Control
from calfsocket.mechanics.limb_problem import limb_problem
from calfsocket.mechanics.newton import Newton
from calfsocket.mechanics.stepping import LoadStepper
from calfsocket.meshes import tags
from calfsocket.verification.friction import TurnedRing

RING = TurnedRing(overclosure=0.02, h=4.0)
ZERO = np.zeros(3)
LOAD = np.array([2e-2, 1e-2, 0.4])
FREE = (False, False, False)


def carried(ring=RING, comm=MPI.COMM_SELF, evenly=False):
    """Press a floating socket on the ring, and let a frame or an even load carry it."""
    problem = limb_problem(ring.mesh(comm), ring.laws, Contact(friction=ring.friction))
    stepper = LoadStepper(problem, (1.0,))
    stepper.run()
    problem.accept()
    frame = problem.carry(tags.SOCKET_OUTER, evenly)
    newton = Newton(problem)
    owned = stepper.newton.x.array
    newton.x.array[: len(owned)] = owned
    return problem, frame, newton


def solved(newton, control):
    newton.problem.carrier.control = control
    result = newton.solve()
    assert result.converged
    return result


CONTROLS = {
    "force": Control.of(FREE, LOAD, ZERO),
    "mixed": Control.of((False, True, False), LOAD, np.array([0.0, 0.01, 0.0])),
    "place": Control.of((True, True, True), ZERO, np.array([0.01, 0.0, 0.7])),
    "along": Control.along((True, False, False), LOAD, ZERO, np.array([0.0, 0.3, -0.5])),
}


@pytest.mark.parametrize("evenly", [False, True])
@pytest.mark.parametrize("name", CONTROLS)
def test_the_tangent_is_the_derivative_and_is_solved_with(name, evenly):
    """No equilibrium; the carrier is far turned or loaded, its nodes are off their places."""
    problem, frame, newton = carried(evenly=evenly)
    frame.control = CONTROLS[name]
    rng = np.random.default_rng(3)
    x = newton.x
    x.array[:] += 1e-3 * rng.normal(size=x.getLocalSize())
    x.array[-1] = 0.6
    direction, up, down, product = (x.duplicate() for _ in range(4))
    direction.array[:] = rng.normal(size=x.getLocalSize())
    step = 1e-7
    for sign, end in ((step, up), (-step, down)):
        moved = x.copy()
        moved.axpy(sign, direction)
        problem.residual(moved, end)
    newton.factorise()
    newton.tangent.mult(direction, product)
    exact = (up.array - down.array) / (2.0 * step)
    for rows in (slice(-3, None), problem.constrained, slice(None)):
        error = np.linalg.norm(product.array[rows] - exact[rows]) / np.linalg.norm(exact[rows])
        assert error < 1e-7
    assert newton.correction(product).array == pytest.approx(direction.array, rel=1e-6, abs=1e-8)


def test_a_frame_takes_over_what_floats_and_turns_it_by_the_exact_compliance():
    small = replace(RING, overclosure=2e-4, h=2.0)  # the exact slope is that of small strains
    _, frame, newton = carried(small)
    assert solved(newton, Control.of(FREE, ZERO, ZERO)).iterations == 0
    assert frame.centre == pytest.approx([0.0, 0.0], abs=1e-10)
    moment = 0.2 * small.slip_torque
    solved(newton, Control.of(FREE, np.array([0.0, 0.0, moment]), ZERO))
    assert frame.place[2] / moment == pytest.approx(small.compliance, rel=1e-3)
    assert frame.place[:2] == pytest.approx([0.0, 0.0], abs=1e-8)


def test_the_limb_bears_what_the_frame_applies():
    problem, frame, newton = carried()
    solved(newton, CONTROLS["force"])
    force, torque = problem.reaction(tags.TIBIA_MEDULLARY)
    contact = resultants(problem.contact, problem.contact.state())
    x, y = frame.centre + frame.place[:2]
    applied = LOAD[2] + x * LOAD[1] - y * LOAD[0]
    assert [*contact.force, *-force] == pytest.approx([*LOAD[:2]] * 2, rel=1e-8)
    assert [contact.on_socket, contact.on_skin] == pytest.approx([-applied, -torque], rel=1e-8)
    # Traction acts on two sides of the small gaps of the discrete contact.
    assert torque == pytest.approx(-applied, rel=1e-6)


def test_an_even_load_has_the_resultants_that_it_says_and_does_their_work():
    problem, carrier, newton = carried(evenly=True)
    solved(newton, CONTROLS["force"])
    assert carrier.load == pytest.approx(LOAD, rel=1e-12)
    force, torque = problem.reaction(tags.SOCKET_OUTER)
    x, y = carrier.place[:2]  # the ring's middle was the origin
    applied = LOAD[2] + x * LOAD[1] - y * LOAD[0]
    assert [*force, torque] == pytest.approx([*LOAD[:2], applied], rel=1e-8)
    assert [*problem.reaction(tags.TIBIA_MEDULLARY)[0]] == pytest.approx([*-LOAD[:2]], rel=1e-8)
    # On the ring the traction is LOAD[:2]/L, and LOAD[2]/(L r) around, but for a deformed outline.
    radius = RING.layers[-1][2]
    turned = carrier.arms / carrier._weight
    around = LOAD[2] / radius**2 * np.stack([-turned[:, 1], turned[:, 0]], axis=1)
    traction = problem.bodies_residual[carrier.own] / carrier._weight
    even = (LOAD[:2] + around) / (2.0 * np.pi * radius)
    assert traction == pytest.approx(even, abs=5e-3 * np.abs(even).max())


def test_force_and_place_are_two_ways_to_one_equilibrium():
    _, frame, newton = carried()
    solved(newton, CONTROLS["force"])
    place, w = frame.place.copy(), newton.problem.w.x.array.copy()
    other, frame, newton = carried()
    solved(newton, Control.of((True, True, True), ZERO, place))
    assert other.w.x.array == pytest.approx(w, abs=1e-8)
    # Half of the way of the load is where a control along it prescribes that.
    direction = LOAD * frame.scale
    solved(newton, Control.along(FREE, ZERO, 0.5 * place, direction))
    found = frame.scale * frame.force(newton.problem.bodies_residual)
    assert found / np.linalg.norm(found) == pytest.approx(
        direction / np.linalg.norm(direction), abs=1e-8
    )
    assert np.linalg.norm(found) == pytest.approx(0.5 * np.linalg.norm(direction), rel=0.1)


def test_newtons_method_is_quadratic():
    _, _, newton = carried()
    history = solved(newton, Control.of(FREE, 0.2 * LOAD, ZERO)).history
    assert len(history) <= 4
    assert history[1] < history[0] ** 2  # N/mm; the next one is rounding


PROGRAM = f"""
import json
import sys
sys.path.insert(0, {os.fspath(Path(__file__).parent)!r})
import numpy as np
from mpi4py import MPI
from test_frame import CONTROLS, carried, solved
found = []
for evenly in (False, True):
    problem, carrier, newton = carried(comm=MPI.COMM_WORLD, evenly=evenly)
    solved(newton, CONTROLS["force"])
    found += [*carrier.place, *carrier.force(problem.bodies_residual), newton.negative_modes()]
if MPI.COMM_WORLD.rank == 0:
    print(json.dumps([float(value) for value in found]))
"""


def test_ranks_agree(mpirun):
    found = [json.loads(mpirun(ranks, ["-c", PROGRAM])) for ranks in (1, 2, 3)]
    assert found[1] == pytest.approx(found[0], rel=1e-8, abs=1e-10)
    assert found[2] == pytest.approx(found[0], rel=1e-8, abs=1e-10)
