"""Regions with stress-free states of their own: swollen tissue, layers that are stretched."""

import numpy as np
import pytest
from dolfinx import fem
from mpi4py import MPI

from calfsocket.forms import mixed
from calfsocket.materials.laws import Hencky, Ogden, Yeoh
from calfsocket.mechanics.constraints import Constraint
from calfsocket.mechanics.limb_problem import limb_problem
from calfsocket.mechanics.problem import Problem
from calfsocket.mechanics.stepping import LoadStepper
from calfsocket.meshes import tags
from calfsocket.meshes.rings import ring_mesh
from calfsocket.postprocess.extract import section_fields
from calfsocket.verification import tangent

# Moduli of one size, so that no law hides in another's rounding.
LAYERS = [("bone", 10.0, 14.0), ("muscle", 14.0, 22.0), ("skin", 22.0, 26.0)]
LAWS = {
    "bone": Hencky(e=1.3, nu=0.4),
    "muscle": Ogden(mu=(0.7,), alpha=(4.6,), d1=0.02),
    "skin": Ogden(mu=(0.4,), alpha=(26.0,), d1=0.0),
    "socket": Yeoh(c10=0.3, c20=0.8, c30=1.1),
}
TISSUES = dict.fromkeys(LAWS, "skin")


def tight(x):
    """A layer whose circumference is 5 % smaller, and which is wrung a little (n, 2, 2)."""
    t = np.stack([-x[:, 1], x[:, 0]], axis=1) / np.linalg.norm(x, axis=1)[:, None]
    n = np.stack([t[:, 1], -t[:, 0]], axis=1)
    return np.eye(2) - 0.05 * np.einsum("ni,nj->nij", t, t) + 0.02 * np.einsum("ni,nj->nij", n, t)


STATES = {"muscle": 1.03, "skin": tight, "socket": 0.98}


def ring():
    section = ring_mesh(MPI.COMM_SELF, LAYERS, (25.9, 30.0), h=4.0)
    problem = limb_problem(section, LAWS)
    problem.load = 1.0
    return problem


def noise(problem, size=0.01):
    x = problem.create_vector()
    x.array[:] = size * np.random.default_rng(3).normal(size=x.getLocalSize())
    x.array[problem.constrained] = 0.0
    problem.set_unknowns(x)
    return x


def internal_force(problem):
    values = np.zeros(len(problem.w.x.array))
    problem._tissues.add_residuals(values)
    return values


def test_residual_is_that_of_the_assembled_form():
    problem = ring()
    noise(problem)
    without = internal_force(problem)
    problem.set_stress_free(STATES)
    problem.load = 0.7
    dx = mixed.volume_measure(problem.section.mesh, problem.fields.tags)
    form = mixed.residual(problem.w, problem.fields.materials, dx)
    expected = fem.assemble_vector(fem.form(form)).array
    size = abs(expected).max()
    np.testing.assert_allclose(internal_force(problem), expected, rtol=0, atol=1e-13 * size)
    assert abs(without - expected).max() > 0.1 * size


@pytest.mark.parametrize("load", [0.4, 1.0])
def test_tangent_is_the_derivative_of_the_residual(load):
    """Contact's tractions come from the skin's stress-free state, too."""
    problem = ring()
    problem.set_stress_free(STATES)
    problem.load = load
    x = noise(problem, 1e-3)
    assert (problem.contact.state().traction.pressure > 0).any()
    for seed in range(3):
        direction = tangent.random_direction(problem, x, seed)
        assert tangent.difference(problem, x, direction).error < 1e-6


def test_the_identity_is_the_reference():
    """To rounding: the skin's traction comes from another compiled expression then."""
    problem = ring()
    x = noise(problem, 1e-3)
    f, A, product = x.duplicate(), problem.create_matrix(), x.duplicate()

    def computed():
        problem.residual(x, f)
        problem.tangent(x, A)
        A.mult(x, product)
        fields = section_fields(problem, TISSUES)
        return f.array.copy(), product.array.copy(), fields.stress, fields.deformation_gradient

    before = computed()
    problem.set_stress_free({"muscle": lambda x: np.tile(np.eye(2), (len(x), 1, 1))})
    for then, now in zip(before, computed(), strict=True):
        np.testing.assert_allclose(now, then, rtol=0, atol=1e-13 * abs(then).max())


def test_a_region_goes_back_to_its_reference():
    problem = ring()
    x = noise(problem)
    before = internal_force(problem)
    problem.set_stress_free(STATES)
    problem.set_stress_free(dict.fromkeys(STATES, 1.0))
    problem.set_unknowns(x)
    assert np.array_equal(internal_force(problem), before)


def swollen(ratio, outside, laws=LAWS):
    """Rings whose inner face moves as free swelling has it, and their outer face if it is held."""
    section = ring_mesh(MPI.COMM_SELF, LAYERS, None, h=4.0)
    constraints = [Constraint(tags.TIBIA_MEDULLARY, values=outside)]
    if outside is not free:
        constraints.append(Constraint(tags.SKIN_SURFACE, values=outside))
    problem = Problem(section, {name: laws[name] for name in section.regions}, constraints)
    problem.set_stress_free(dict.fromkeys(section.regions, ratio))
    stepper = LoadStepper(problem, [0.5, 1.0])
    stepper.run()
    return problem


RATIO = 1.2


def free(x):
    return (np.sqrt(RATIO) - 1.0) * x


def held(x):
    return 0.0 * x


def test_free_swelling_is_stress_free():
    problem = swollen(RATIO, free)
    fields = section_fields(problem, TISSUES)
    assert abs(fields.stress).max() < 1e-7  # kPa, of moduli of 1000
    u = (np.sqrt(RATIO) - 1.0) * fields.points
    np.testing.assert_allclose(fields.displacement, u, rtol=0, atol=1e-9)
    np.testing.assert_allclose(np.linalg.det(fields.deformation_gradient), RATIO, rtol=1e-9)
    assert problem.smallest_volume_ratio()[0] == pytest.approx(1.0, abs=1e-10)


def test_confined_swelling_has_its_stress_in_closed_form():
    r"""F = I, so Fe = I / sqrt(ratio) and, for Hencky's law, with ln J = - ln ratio,

    sigma11 = sigma22 = 2 mu ln(J) / (6 J) + K (J - 1),
    sigma33 = - 4 mu ln(J) / (6 J) + K (J - 1).
    """
    law = LAWS["bone"]
    problem = swollen(RATIO, held, dict.fromkeys(LAWS, law))
    fields = section_fields(problem, TISSUES)
    J, mu, K = 1.0 / RATIO, law.initial_shear_modulus, law.bulk_modulus
    shear, pressure = 2.0 * mu * np.log(J) / (6.0 * J), K * (J - 1.0)
    expected = 1000.0 * np.array([shear + pressure, shear + pressure, pressure - 2.0 * shear, 0.0])
    np.testing.assert_allclose(
        fields.stress, np.broadcast_to(expected, fields.stress.shape), rtol=0, atol=1e-8
    )
    assert problem.smallest_volume_ratio()[0] == pytest.approx(J, rel=1e-10)
    assert abs(fields.displacement).max() < 1e-10


def test_a_state_that_bends_the_body_is_stress_free_there():
    """G is the gradient of a map: the body that has gone there has no stress."""
    section = ring_mesh(MPI.COMM_SELF, LAYERS, None, h=2.0)
    problem = Problem(section, {name: LAWS[name] for name in section.regions})
    bend = 2e-3

    def gradient(x):
        zero = np.zeros(len(x))
        rows = [1.0 + zero, bend * x[:, 1], -bend * x[:, 0], 1.0 + zero]
        return np.stack(rows, axis=1).reshape(-1, 2, 2)

    problem.load = 1.0
    problem.set_stress_free(dict.fromkeys(section.regions, gradient))
    rigid = abs(internal_force(problem)).max()
    problem.w.sub(0).interpolate(lambda x: 0.5 * bend * np.stack([x[1] ** 2, -(x[0] ** 2)]))
    # What curved sides leave of a parabola.
    assert abs(internal_force(problem)).max() < 1e-3 * rigid


@pytest.mark.parametrize(
    ("states", "words"),
    [
        ({"muscle": 0.0}, "volume ratio 0, not > 0"),
        ({"muscle": float("nan")}, "volume ratio nan"),
        ({"tendon": 1.1}, "no region tendon"),
    ],
)
def test_states_without_a_volume_are_refused(states, words):
    with pytest.raises(ValueError, match=words):
        ring().set_stress_free(states)


def test_newtons_method_finds_a_stretched_layer_on_the_limb():
    """The layer presses on what is below, and its own volume stays."""
    section = ring_mesh(MPI.COMM_SELF, LAYERS, (25.9, 30.0), h=4.0)
    # It leaves most of the socket, which would fall off.
    problem = limb_problem(section, LAWS, support="outer-fixed")
    problem.set_stress_free({"skin": tight})
    LoadStepper(problem, [0.25, 0.5, 0.75, 1.0]).run()
    fields = section_fields(problem, TISSUES)
    names = {name: tag for tag, name in fields.region_names.items()}
    below = fields.pressure[fields.region == names["muscle"]]
    assert below.mean() > 1.0
    J = np.linalg.det(problem.elastic_gradients())
    skin = problem.section.cell_tags.find(problem.section.regions["skin"])
    np.testing.assert_allclose(J[skin].mean(axis=1), 1.0, atol=1e-3)
