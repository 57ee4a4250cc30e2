"""The loops over cells in C against the weak form that dolfinx assembles."""

import numpy as np
import pytest
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI

from calfsocket.contact.parameters import Contact
from calfsocket.forms import mixed
from calfsocket.forms.element import section_element
from calfsocket.materials.laws import Hencky, Ogden, Yeoh
from calfsocket.mechanics.kernels import cells
from calfsocket.mechanics.kernels import library as native
from calfsocket.mechanics.limb_problem import limb_problem
from calfsocket.meshes.rings import ring_mesh

LAYERS = [("bone", 10.0, 14.0), ("muscle", 14.0, 29.0), ("fascia", 29.0, 30.0), ("skin", 30, 32.0)]
# Moduli of one size, so that no law hides in another's rounding.
SOFT = {
    "bone": Hencky(e=1.3, nu=0.4),
    "muscle": Ogden(mu=(0.7,), alpha=(4.6,), d1=0.02),
    "fascia": Yeoh(c10=0.3, c20=0.8, c30=1.1),
    "skin": Ogden(mu=(0.4,), alpha=(26.0,), d1=0.0),
    "socket": Hencky(e=2.0, nu=0.4),
}
TWO_TERMS = SOFT | {"muscle": Ogden(mu=(0.7, -0.1), alpha=(4.6, -3.0), d1=0.02)}


def ring(laws=SOFT, **settings):
    section = ring_mesh(MPI.COMM_SELF, LAYERS, (31.9, 36.0), h=4.0)
    model = limb_problem(section, {name: laws[name] for name in section.regions}, **settings)
    rng = np.random.default_rng(3)
    model.w.x.array[:] = 0.01 * rng.normal(size=len(model.w.x.array))
    return model


def by_loops(model):
    values = np.zeros(len(model.w.x.array))
    model._tissues.add_residuals(values)
    return values


def by_dolfinx(model):
    dx = mixed.volume_measure(model.section.mesh, model.fields.tags)
    residual = mixed.residual(model.w, model.fields.materials, dx)
    if model.foundation is not None:
        u, anchor = ufl.split(model.w)[0], ufl.split(model.foundation.anchor)[0]
        residual += (
            model.foundation.stiffness * ufl.inner(u - anchor, ufl.TestFunctions(model.V)[0]) * dx
        )
    return fem.assemble_vector(fem.form(residual)).array


@pytest.mark.parametrize("laws", [SOFT, TWO_TERMS], ids=["one term", "two terms"])
def test_residual_is_that_of_the_assembled_form(laws):
    model = ring(laws)
    expected = by_dolfinx(model)
    np.testing.assert_allclose(by_loops(model), expected, rtol=0, atol=1e-13 * abs(expected).max())


def test_residual_follows_parameters_and_unknowns():
    """What a residual depends on is read when it is asked for."""
    model = ring()
    before = by_loops(model)
    model.set_laws({"skin": Ogden(mu=(0.5,), alpha=(20.0,), d1=0.0)})
    model.w.x.array[:] *= 0.5
    expected = by_dolfinx(model)
    np.testing.assert_allclose(by_loops(model), expected, rtol=0, atol=1e-13 * abs(expected).max())
    assert abs(before - expected).max() > 0.1 * abs(expected).max()


def test_cells_may_be_turned_over():
    """Mirrored, their vertices run clockwise."""
    model = ring()
    model.section.mesh.geometry.x[:, 0] *= -1.0
    expected = by_dolfinx(model)
    np.testing.assert_allclose(by_loops(model), expected, rtol=0, atol=1e-13 * abs(expected).max())


def test_an_elastic_foundation_is_in_the_residual():
    """A spring to where it is at rest, of its own stiffness in each cell."""
    model = ring(contact=Contact(friction=0.0))
    rng = np.random.default_rng(4)
    without = by_loops(model)
    stiffness, anchor = (f.x.array for f in (model.foundation.stiffness, model.foundation.anchor))
    stiffness[:] = rng.uniform(1.0, 2.0, len(stiffness))
    anchor[:] = 0.01 * rng.normal(size=len(anchor))
    expected = by_dolfinx(model)
    np.testing.assert_allclose(by_loops(model), expected, rtol=0, atol=1e-13 * abs(expected).max())
    assert abs(without - expected).max() > 1e-3 * abs(expected).max()


def test_unknowns_that_are_not_finite_give_a_residual_that_is_not():
    """Newton's method may overshoot; the flags that C is compiled with must not hide it."""
    model = ring()
    cell = model.section.cell_tags.find(model.section.regions["muscle"])[0]
    dofs = model.V.dofmap.list[cell]
    model.w.x.array[dofs[0]] = np.nan
    assert np.isnan(by_loops(model)[dofs]).any()


def test_a_processor_without_avx2_computes_the_same(monkeypatch):
    model = ring()
    expected = by_loops(model)
    monkeypatch.setattr(
        native, "COMPILE_ARGUMENTS", [*native.COMPILE_ARGUMENTS, "-DPLAIN", "-mno-avx"]
    )
    monkeypatch.setattr(native, "_module", native._module.__wrapped__)
    found = by_loops(ring())
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14 * abs(expected).max())
    assert np.any(found != expected)  # in another order of operations


def test_quadrature_has_as_many_points_as_the_loops_in_c():
    points, weights = cells.quadrature()
    assert points.shape == (6, 2)
    assert weights.sum() == pytest.approx(0.5)


def test_straight_cells_are_refused():
    """The loops in C read six nodes a cell."""
    domain = mesh.create_unit_square(MPI.COMM_SELF, 1, 1)
    with pytest.raises(ValueError, match="3 nodes, not 6"):
        cells.reference_element(fem.functionspace(domain, section_element()))
