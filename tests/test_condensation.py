"""The condensed tangent against the assembled one: same product, same solution, same inertia."""

from dataclasses import replace

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from mpi4py import MPI
from petsc4py import PETSc

from calfsocket.contact.parameters import Contact
from calfsocket.forms import mixed
from calfsocket.io.petsc_options import defaults
from calfsocket.materials.laws import Hencky, Ogden
from calfsocket.materials.material_set import MaterialSet
from calfsocket.mechanics.constraints import Constraint
from calfsocket.mechanics.limb_problem import SUPPORT_STIFFNESS, limb_problem
from calfsocket.mechanics.newton import Newton
from calfsocket.mechanics.problem import LARGEST_BULK_RATIO, Problem
from calfsocket.meshes.rings import ring_mesh

LAYERS = [
    ("bone", 10.0, 14.0),
    ("muscle", 14.0, 29.0),
    ("fascia", 29.0, 30.0),
    ("fat", 30.0, 31.0),
    ("skin", 31.0, 32.0),
]
SEPARATE = MaterialSet.paper("separate").tissue_laws()


GIVEN_ORDER, PORD, METIS = 1, 4, 5  # MUMPS's ICNTL(7)

# Just stiff enough in volume for its constant pressure to stay outside, K/mu = 1100.
STIFF = SEPARATE | {"muscle": Hencky(e=0.05, nu=3298 / 6602)}


def ring(h=4.0, laws=SEPARATE, **settings):
    section = ring_mesh(MPI.COMM_SELF, LAYERS, (31.9, 36.0), h=h)
    return limb_problem(section, {name: laws[name] for name in section.regions}, **settings)


def state(model, size=1e-3, seed=3):
    """A state that is no equilibrium, its tangent, and its solver."""
    solver = Newton(model)
    x = solver.x
    x.array[:] = size * np.random.default_rng(seed).normal(size=x.getLocalSize())
    x.array[model.constrained] = 0.0
    model.load = 0.5
    solver.factorise()
    return solver


def assembled(model):
    """The tissues' tangent by dolfinx, from the same weak form that has the residual."""
    dx = mixed.volume_measure(model.section.mesh, model.fields.tags)
    A = fem_petsc.assemble_matrix(fem.form(mixed.tangent(model.w, model.fields.materials, dx)))
    A.assemble()
    A.zeroRowsColumns(model.constrained.astype(PETSc.IntType), diag=1.0)
    return A


def without_contact(model):
    """Take contact out of the tangent."""
    tangent = model.contact.tangent

    def nothing():
        contact = tangent()
        return replace(
            contact, by_motion=0.0 * contact.by_motion, by_traction=0.0 * contact.by_traction
        )

    model.contact.tangent = nothing


def random_vector(solver, seed=1):
    v = solver.x.duplicate()
    v.array[:] = np.random.default_rng(seed).normal(size=v.getLocalSize())
    return v


def product(solver, v):
    out = v.duplicate()
    solver.tangent.mult(v, out)
    return out


@pytest.mark.parametrize("laws", [SEPARATE, STIFF], ids=["separate", "stiff in volume"])
def test_product_is_that_of_the_assembled_form(laws):
    model = ring(laws=laws)
    without_contact(model)
    solver = state(model)
    v = random_vector(solver)
    expected = assembled(model) * v
    assert (product(solver, v) - expected).norm() < 1e-13 * expected.norm()


def test_solution_is_that_of_the_assembled_form():
    model = ring(support="outer-fixed")  # without contact nothing else holds it
    without_contact(model)
    solver = state(model)
    v = random_vector(solver)
    assert (solver.correction(assembled(model) * v) - v).norm() < 1e-9 * v.norm()


@pytest.mark.parametrize("friction", [0.0, 0.4])
def test_solution_undoes_the_product_with_contact(friction):
    solver = state(ring(contact=Contact(friction=friction)))
    v = random_vector(solver)
    assert (solver.correction(product(solver, v)) - v).norm() < 1e-8 * v.norm()


def test_an_elastic_foundation_is_in_the_product():
    """Of a floating, frictionless socket; it adds its stiffness times the mass matrix."""
    founded, free = ring(contact=Contact(friction=0.0)), ring()
    solvers = [state(model) for model in (founded, free)]
    np.testing.assert_equal(np.unique(founded.foundation.stiffness.x.array), [0, SUPPORT_STIFFNESS])
    founded.foundation.stiffness.x.array[:] *= 1e5  # to be seen beside PETG
    for solver, model in zip(solvers, (founded, free), strict=True):
        without_contact(model)
        solver.factorise()
    one = solvers[0].x.duplicate()
    shift, parent = founded.V.sub(0).sub(0).collapse()
    ones = fem.Function(shift)
    ones.interpolate(lambda x: np.ones(x.shape[1]))
    one.array[np.asarray(parent)] = ones.x.array
    force = (product(solvers[0], one) - product(solvers[1], one)).array
    dx = ufl.Measure("dx", founded.section.mesh, subdomain_data=founded.section.cell_tags)
    area = fem.assemble_scalar(fem.form(1.0 * dx(founded.section.regions["socket"])))
    total = force[np.asarray(parent)] @ ones.x.array
    assert total == pytest.approx(1e5 * SUPPORT_STIFFNESS * area, rel=1e-6)


def test_a_constant_pressure_stays_outside_only_where_volume_is_stiff():
    model = ring()
    fascia = model.section.cell_tags.find(model.section.regions["fascia"])
    kept = np.flatnonzero(model._keeps_constant())
    np.testing.assert_array_equal(kept, np.sort(fascia))
    # Just under and over the bound: nu of K/mu = 2 (1 + nu) / (3 (1 - 2 nu)).
    for ratio, outside in ((0.99 * LARGEST_BULK_RATIO, False), (1.01 * LARGEST_BULK_RATIO, True)):
        nu = (3 * ratio - 2) / (6 * ratio + 2)
        laws = {name: SEPARATE[name] for name in model.section.regions}
        stiff = limb_problem(model.section, laws | {"muscle": Hencky(e=0.05, nu=nu)})
        muscle = model.section.cell_tags.find(model.section.regions["muscle"])
        assert np.all(stiff._keeps_constant()[muscle] == outside)


def test_condensed_inertia_counts_as_the_whole_does():
    """Sylvester: negative eigenvalues of the whole are those inside and those of the rest."""
    model = ring(h=12.0, support="outer-fixed")
    without_contact(model)
    solver = state(model)
    model.contact.constraint_tangent = model.contact.tangent
    whole = assembled(model)
    n = whole.getSize()[0]
    eigenvalues = np.linalg.eigvalsh(whole.getValues(range(n), range(n)))
    pressures = 3 * model.section.mesh.topology.index_map(2).size_global
    assert solver.negative_modes() == np.count_nonzero(eigenvalues < 0) - pressures


def test_the_pattern_follows_a_limb_that_slides_far():
    """A third of the way round, the skin meets edges that the pattern was not laid out for."""
    model = ring()
    solver = state(model)
    before = solver.tangent.getPythonContext().matrix
    tangent = model.contact.tangent
    edges = len(model.contact.chain.start)
    turned = (tangent().edge + edges // 3) % edges
    ahead = model.contact.edges_ahead
    model.contact.tangent = lambda: replace(tangent(), edge=turned)
    model.contact.edges_ahead = lambda: (ahead() + edges // 3) % edges
    solver.factorise()
    after = solver.tangent.getPythonContext().matrix
    assert after.handle != before.handle
    v = random_vector(solver)
    assert (solver.correction(product(solver, v)) - v).norm() < 1e-8 * v.norm()


def test_options_of_petsc_reach_the_factorisation():
    options = PETSc.Options()
    options["calfsocket_mat_mumps_icntl_14"] = 123
    try:
        solver = state(ring())
    finally:
        del options["calfsocket_mat_mumps_icntl_14"]
    factor = solver.tangent.getPythonContext().ksp.getPC().getFactorMatrix()
    assert factor.getMumpsIcntl(14) == 123
    assert factor.getMumpsIcntl(8) == 0
    assert not PETSc.Options("calfsocket_").hasName("mat_mumps_icntl_8")


def test_a_matrix_that_cannot_be_factorised_gives_no_finite_step_and_spoils_no_later_one():
    """Newton's method may overshoot; the attempt ends, and the next one starts from good values."""
    solver = state(ring())
    v = random_vector(solver)
    expected = solver.correction(v)
    condensed = solver.tangent.getPythonContext()
    values = condensed.layout.values.copy()
    for good in (False, True):
        condensed.layout.values[:] = values if good else np.nan
        condensed.matrix.assemble()
        condensed.setUp(None)
        found = v.duplicate()
        condensed.apply(None, v, found)
        assert np.isfinite(found.norm()) == good
    assert (found - expected).norm() < 1e-12 * expected.norm()


def test_laws_that_become_incompressible_keep_their_constant_pressure():
    """With muscle's K infinite from one tangent to the next, its pressure is found all the same."""
    model = ring()
    solver = state(model)
    outside = len(solver.tangent.getPythonContext().unknowns)
    muscle = SEPARATE["muscle"]
    model.set_laws({"muscle": Ogden(mu=muscle.mu, alpha=muscle.alpha, d1=0.0)})
    solver.factorise()
    cells_of_muscle = model.section.cell_tags.find(model.section.regions["muscle"])
    assert len(solver.tangent.getPythonContext().unknowns) == outside + len(cells_of_muscle)
    v = random_vector(solver)
    assert (solver.correction(product(solver, v)) - v).norm() < 1e-8 * v.norm()
    model.set_laws({"muscle": muscle})
    solver.factorise()
    assert len(solver.tangent.getPythonContext().unknowns) == outside


def test_prescribed_values_are_in_product_and_solution():
    """Unknowns that are away from their value pull on their neighbours, in every tissue."""
    laws = {**SEPARATE, "muscle": STIFF["muscle"]}
    layers = ring_mesh(MPI.COMM_SELF, LAYERS, None, 4.0)
    pulled = [
        Constraint("tibia_medullary"),
        Constraint("skin_surface", values=lambda x: 0.01 * x),
    ]
    problem = Problem(layers, {name: laws[name] for name in layers.regions}, pulled)
    newton = Newton(problem)
    newton.x.array[:] = 1e-3 * np.random.default_rng(3).normal(size=newton.x.getLocalSize())
    newton.factorise()
    dx = mixed.volume_measure(layers.mesh, problem.fields.tags)
    whole = fem_petsc.assemble_matrix(
        fem.form(mixed.tangent(problem.w, problem.fields.materials, dx))
    )
    whole.assemble()
    whole.zeroRows(problem.constrained.astype(PETSc.IntType), diag=1.0)
    v = random_vector(newton)
    expected = whole * v
    assert (product(newton, v) - expected).norm() < 1e-13 * expected.norm()
    assert (newton.correction(expected) - v).norm() < 1e-8 * v.norm()


def test_unknowns_are_in_the_order_of_elimination():
    """MUMPS takes it, and has less to do than by PORD; one built with METIS asks METIS itself."""

    def operations(**options):
        with defaults(**options):
            solver = state(ring(h=1.0))
        factor = solver.tangent.getPythonContext().ksp.getPC().getFactorMatrix()
        return factor.getMumpsInfog(7), factor.getMumpsRinfog(3)

    given, ours = operations()
    assert given in (GIVEN_ORDER, METIS)
    own, theirs = operations(mat_mumps_icntl_7=str(PORD))
    assert own == PORD
    assert ours < 0.95 * theirs
