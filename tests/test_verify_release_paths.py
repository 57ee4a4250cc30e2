"""Three ways to put a socket on a limb: springs that stiffen, a socket that shrinks."""

import numpy as np
import pytest
from mpi4py import MPI
from scipy.optimize import brentq

from calfsocket.contact.expanded import CLEARANCE
from calfsocket.contact.friction import OPEN
from calfsocket.contact.parameters import Contact
from calfsocket.materials.material_set import MaterialSet
from calfsocket.mechanics.limb_problem import GUIDE_STIFFNESS, limb_problem
from calfsocket.mechanics.prescribed_motion import PrescribedMotion
from calfsocket.mechanics.stepping import LoadStepper, LoadSteps
from calfsocket.meshes import tags
from calfsocket.meshes.rings import ring_mesh
from calfsocket.verification.friction import TurnedRing
from calfsocket.verification.radial import RadialSolution, Ring, exact_ring
from calfsocket.verification.release_paths import (
    DAMPING,
    StiffeningContact,
    path_problem,
)
from calfsocket.verification.sampling import skin_mean

LIMB = (
    Ring("bone", "bone", 10.0, 14.0),
    Ring("muscle", "muscle", 14.0, 26.0),
    Ring("fat", "fat", 26.0, 30.0),
    Ring("skin", "skin", 30.0, 32.0),
)
LAWS = MaterialSet.paper("separate").tissue_laws()
OVERCLOSURE = 0.2
THICKNESS = 4.5


def section(inner=LIMB[-1].outer - OVERCLOSURE, thickness=THICKNESS, h=2.0):
    layers = [(ring.name, ring.inner, ring.outer) for ring in LIMB]
    return ring_mesh(MPI.COMM_SELF, layers, (inner, inner + thickness), h)


def regions(mesh):
    return {name: LAWS[name] for name in mesh.regions}


def mean_pressure(model):
    return skin_mean(model.contact, model.contact.state().traction.pressure)


def stepped(model, largest=0.25, to=1.0):
    """Load the model; mean contact pressure at each load."""
    pressures = {}

    def read(step):
        model.set_unknowns(stepper.newton.x)
        pressures[step.load] = mean_pressure(model)

    stepper = LoadStepper(model, LoadSteps(first=largest, largest=largest), on_step=read)
    stepper.run()
    return stepper, pressures


@pytest.fixture(scope="module")
def stiffened():
    mesh = section()
    return stepped(limb_problem(mesh, regions(mesh), interface=StiffeningContact))


def test_springs_carry_what_the_exact_ring_gives(stiffened):
    """p = e (overclosure left), at stiffnesses below and above gamma, and rigid in the end."""
    _, pressures = stiffened
    assert list(pressures) == [0.25, 0.5, 0.75, 1.0]
    for load, pressure in pressures.items():
        if load == 1.0:
            exact = exact_ring(LAWS, OVERCLOSURE, rings=LIMB).pressure
        else:
            stiffness = 1e-2 * (load / (1.0 - load)) ** 2

            def excess(share, stiffness=stiffness):
                left = (1.0 - share) * OVERCLOSURE
                return exact_ring(LAWS, OVERCLOSURE, share, LIMB).pressure - stiffness * left

            share = brentq(excess, 1e-3, 1.0, xtol=1e-12)
            exact = exact_ring(LAWS, OVERCLOSURE, share, LIMB).pressure
        assert pressure == pytest.approx(exact, rel=1e-5), load


def test_springs_carry_their_shear_over():
    """Turned on soft springs; the shear stays as they stiffen, and the next turn is elastic."""
    ring = TurnedRing(h=4.0)
    model = limb_problem(
        ring.mesh(MPI.COMM_SELF),
        ring.laws,
        Contact(gamma=1.0, gamma_t=0.3),
        support="outer-fixed",
        interface=StiffeningContact,
    )
    motion = PrescribedMotion(model)
    model.contact.load = 0.8  # of the springs alone: the outer face keeps its place
    motion.solve()
    stiffness = 0.3 * 1e-2 * 16.0
    turn = 0.3 * 0.4 * mean_pressure(model) / (stiffness * ring.radius)
    springs = 1.0 / (2.0 * np.pi * ring.radius**3 * stiffness)
    motion.step([tags.SOCKET], angle=turn)
    torque = model.reaction(tags.SOCKET_OUTER)[1]
    assert torque == pytest.approx(turn / (ring.compliance + springs), rel=1e-3)
    for load in (0.85, 0.95, 1.0):  # below gamma, above it, and rigid
        model.accept()
        model.contact.load = load
        motion.solve()
        assert model.reaction(tags.SOCKET_OUTER)[1] == pytest.approx(torque, rel=1e-4)
    motion.step([tags.SOCKET], angle=turn)
    more = model.reaction(tags.SOCKET_OUTER)[1] - torque
    assert more == pytest.approx(turn / ring.compliance, rel=3e-3)


def test_springs_forget_what_is_taken_back(stiffened):
    contact = stiffened[0].problem.contact
    contact.load = 0.9
    position = contact.deformed_points()
    before = contact.slip(contact.state().projection.arc)
    contact.accept()
    contact.revert()
    np.testing.assert_array_equal(contact.slip(contact.state().projection.arc), before)
    np.testing.assert_array_equal(contact.deformed_points(), position)


def shrinking():
    mesh = section()
    return path_problem("shrunk", mesh, regions(mesh))


@pytest.fixture(scope="module")
def shrunk():
    return stepped(shrinking())


def test_shrinking_socket_has_the_pressure_of_one_made_at_its_size(shrunk):
    stepper, pressures = shrunk
    swelling = stepper.problem.contact.swelling
    touching = 0
    for load, pressure in pressures.items():
        size = 1.0 + swelling * (1.0 - load)
        inner = size * (LIMB[-1].outer - OVERCLOSURE)
        overclosure = LIMB[-1].outer - inner
        if overclosure < 0:
            assert pressure == 0.0
            continue
        touching += 1
        socket = Ring("socket", "socket", inner, inner + size * THICKNESS)
        solution = RadialSolution([*LIMB, socket], LAWS, (0.0, 1.0, 0.0), jump=overclosure)
        assert pressure == pytest.approx(-solution.at_end("skin")[1], rel=2e-5), load
    assert 2 <= touching < len(pressures)
    np.testing.assert_allclose(
        pressures[1.0], exact_ring(LAWS, OVERCLOSURE, 1.0, LIMB).pressure, 2e-5
    )


def test_swollen_socket_is_clear_of_the_limb_and_guided():
    model = shrinking()
    contact = model.contact
    state = contact.state()
    assert np.all(state.traction.status == OPEN)
    assert state.gap.min() == pytest.approx(CLEARANCE, rel=1e-3)
    x, f = model.create_vector(), model.create_vector()
    model.residual(x, f)
    assert f.norm() == 0.0
    # Shifted by 0.01 mm it is pushed back by the foundation, until the load is full.
    body = model.body([tags.SOCKET])
    x.array[body.dofs] = 0.01 * body.shift * [1.0, 0.0]
    for load in (0.0, 0.1):
        model.load = load
        size = 1.0 + contact.swelling * (1.0 - load)
        inner, outer = (size * (31.8 + t) for t in (0.0, THICKNESS))
        model.residual(x, f)
        force = (1.0 - load) * GUIDE_STIFFNESS * 0.01 * np.pi * (outer**2 - inner**2)
        assert f.array[body.dofs[:, 0]].sum() == pytest.approx(force, rel=1e-4), load


def test_drag_holds_back_what_moved_in_the_step_and_is_gone_at_full_load():
    mesh = section(h=4.0)
    model = path_problem("stiffened", mesh, regions(mesh))
    body = model.body([tags.SOCKET])
    x, f, rested = (model.create_vector() for _ in range(3))
    x.array[body.dofs] = 0.01 * body.shift * [1.0, 0.0]
    inner = LIMB[-1].outer - OVERCLOSURE
    area = np.pi * ((inner + THICKNESS) ** 2 - inner**2)
    for load in (0.0, 0.6, 1.0):
        model.load = load
        model.foundation.rest(0.0)
        model.residual(x, f)
        model.foundation.rest(model.w.x.array)
        model.residual(x, rested)
        drag = (f - rested).array[body.dofs].sum(axis=0)
        expected = DAMPING * (1.0 - load) * 0.01 * area
        np.testing.assert_allclose(drag, [expected, 0.0], rtol=1e-4, atol=1e-12)


@pytest.mark.parametrize("path", ["shrunk", "stiffened"])
def test_tangent_is_the_derivative_of_the_residual(path):
    """In any direction under load; before it, where only foundations resist, of the socket."""
    mesh = section(h=4.0)
    model = path_problem(path, mesh, regions(mesh))
    rng = np.random.default_rng(4)
    body = model.body([tags.SOCKET])
    x, plus, minus, direction = (model.create_vector() for _ in range(4))
    A = model.create_matrix()
    direction.array[body.dofs] = body.shift * [1.0, 0.5]
    for load, h in ((0.0, 1e-3), (0.7, 1e-7)):
        model.load = load
        model.tangent(x, A)
        model.residual(x + h * direction, plus)
        model.residual(x - h * direction, minus)
        difference = (plus - minus) / (2 * h)
        assert (A * direction - difference).norm() < 1e-6 * difference.norm()
        x.array[:] = 1e-4 * rng.normal(size=x.getLocalSize())
        direction.array[:] = rng.normal(size=x.getLocalSize())
        for vector in (x, direction):
            vector.array[model.constrained] = 0.0
