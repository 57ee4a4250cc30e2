"""The mixed weak form on a small mesh: consistency of potential, residual and tangent."""

from dataclasses import dataclass

import numpy as np
import pytest
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI

from calfsocket.forms import mixed
from calfsocket.forms.element import section_element
from calfsocket.materials.fields import LawFields
from calfsocket.materials.laws import Hencky, Law, Ogden, Yeoh

# Regions 1 to 4, moduli of one size so that no law hides in another's rounding.
LAWS: dict[int, Law] = {
    1: Ogden(mu=(0.7, -0.1), alpha=(4.6, -3.0), d1=0.02),
    2: Ogden(mu=(0.4,), alpha=(26.0,), d1=0.0),
    3: Yeoh(c10=0.3, c20=0.8, c30=1.1),
    4: Hencky(e=1.3, nu=0.4),
}


@dataclass
class Problem:
    w: fem.Function
    fields: LawFields
    dx: ufl.Measure
    cell_tags: mesh.MeshTags
    residual_form: fem.Form
    tangent_form: fem.Form

    def residual(self) -> np.ndarray:
        return fem.assemble_vector(self.residual_form).array.copy()

    def tangent(self) -> np.ndarray:
        return fem.assemble_matrix(self.tangent_form).to_dense()

    def dofs(self, sub: int, region: int | None = None) -> np.ndarray:
        cells = self.cell_tags.indices if region is None else self.cell_tags.find(region)
        return np.unique(self.w.function_space.sub(sub).dofmap.list[cells].ravel())


def problem(laws: dict[int, Law]) -> Problem:
    domain = mesh.create_unit_square(MPI.COMM_SELF, 4, 2)
    cells = np.arange(domain.topology.index_map(2).size_local, dtype=np.int32)
    x = mesh.compute_midpoints(domain, 2, cells)[:, 0]
    cell_tags = mesh.meshtags(domain, 2, cells, 1 + np.floor(4 * x).astype(np.int32))
    w = fem.Function(fem.functionspace(domain, section_element()))
    names = {tag: f"region {tag}" for tag in laws}
    regions = {name: tag for tag, name in names.items()}
    by_name = {names[tag]: law for tag, law in laws.items()}
    fields = LawFields(domain, cell_tags, regions, by_name)
    dx = mixed.volume_measure(domain, fields.tags)
    return Problem(
        w,
        fields,
        dx,
        cell_tags,
        fem.form(mixed.residual(w, fields.materials, dx)),
        fem.form(mixed.tangent(w, fields.materials, dx)),
    )


@pytest.fixture(scope="module")
def compiled() -> Problem:
    return problem(LAWS)


@pytest.fixture
def section(compiled: Problem) -> Problem:
    compiled.w.x.array[:] = 0
    return compiled


def random_state(section: Problem, size: float = 0.01) -> np.ndarray:
    return size * np.random.default_rng(7).uniform(-1, 1, section.w.x.array.size)


def displace(section: Problem, gradient: np.ndarray) -> None:
    section.w.sub(0).interpolate(lambda x: gradient @ x[:2])


def test_element_is_conforming_crouzeix_raviart(section: Problem) -> None:
    """Six nodes and a bubble in two components; three pressures in each cell, shared with none."""
    domain = section.w.function_space.mesh
    n_cells = domain.topology.index_map(2).size_local
    domain.topology.create_entities(1)
    n_nodes = domain.topology.index_map(0).size_local + domain.topology.index_map(1).size_local
    assert len(section.dofs(0)) == 2 * (n_nodes + n_cells)
    assert len(section.dofs(1)) == 3 * n_cells
    assert section_element().dim == 14 + 3


def test_quadrature_degree(section: Problem) -> None:
    """Four is exact, five is not: neither a lower nor a silently estimated degree."""
    x = ufl.SpatialCoordinate(section.w.function_space.mesh)[0]

    def integral(power: int) -> float:
        return sum(
            fem.assemble_scalar(fem.form(x**power * section.dx(tag)))
            for tag in section.fields.materials
        )

    assert integral(4) == pytest.approx(1 / 5, rel=1e-14)
    assert abs(integral(6) - 1 / 7) > 1e-9


def test_residual_and_tangent_are_derivatives_of_the_potential(section: Problem) -> None:
    section.w.x.array[:] = random_state(section)
    potential = mixed.potential(section.w, section.fields.materials, section.dx)
    first = ufl.derivative(potential, section.w)
    second = ufl.derivative(
        mixed.residual(section.w, section.fields.materials, section.dx), section.w
    )
    residual, tangent = section.residual(), section.tangent()
    exact = fem.assemble_vector(fem.form(first)).array
    assert np.allclose(residual, exact, rtol=0, atol=1e-13 * np.abs(exact).max())
    exact = fem.assemble_matrix(fem.form(second)).to_dense()
    assert np.allclose(tangent, exact, rtol=0, atol=1e-13 * np.abs(exact).max())
    assert np.allclose(tangent, tangent.T, rtol=0, atol=1e-14 * np.abs(exact).max())


@pytest.mark.parametrize("where", ["reference", "equal stretches", "random"])
def test_taylor(section: Problem, where: str) -> None:
    potential = fem.form(mixed.potential(section.w, section.fields.materials, section.dx))
    if where == "equal stretches":
        displace(section, 0.1 * np.eye(2))
    elif where == "random":
        section.w.x.array[:] = random_state(section)
    start = section.w.x.array.copy()
    direction = np.random.default_rng(3).uniform(-1, 1, start.size)
    energy = fem.assemble_scalar(potential)
    residual, tangent = section.residual(), section.tangent()
    errors = []
    for step in 1e-3 * 0.5 ** np.arange(4):
        section.w.x.array[:] = start + step * direction
        of_energy = fem.assemble_scalar(potential) - energy - step * residual @ direction
        of_residual = section.residual() - residual - step * tangent @ direction
        errors.append((abs(of_energy), np.abs(of_residual).max()))
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert orders.min() > 1.9


def test_reference_is_stress_free_with_finite_tangent(section: Problem) -> None:
    assert np.all(section.residual() == 0)
    assert np.isfinite(section.tangent()).all()


def test_every_parameter_counts(section: Problem) -> None:
    """Residual and tangent move when any coefficient moves, in the cells of its law only.

    Looked at in unknowns that belong to one cell: bubbles and pressures.
    """
    state = random_state(section)
    section.w.x.array[:] = state
    residual, tangent = section.residual(), section.tangent()
    fields = section.fields
    regions = {fields.inverse_bulk: (1, 2, 3, 4), fields.pressure_scale: (1, 2, 3, 4)}
    for region in LAWS:
        regions |= dict.fromkeys(fields.of_region(f"region {region}").coefficients, (region,))
    assert len(regions) == 2 + 4 + 2 + 3 + 1
    for function, meant in regions.items():
        before = function.x.array.copy()
        function.x.array[:] += 0.1
        moved_residual, moved_tangent = section.residual(), section.tangent()
        function.x.array[:] = before
        for region in (1, 2, 3, 4):
            cells = section.cell_tags.find(region)
            bubbles = section.w.function_space.sub(0).dofmap.list[cells, 12:].ravel()
            inner = np.concatenate([bubbles, section.dofs(1, region)])
            moves = np.any(moved_residual[inner] != residual[inner])
            moves_tangent = np.any(moved_tangent[inner] != tangent[inner])
            assert moves == moves_tangent == (region in meant), (function.name, region)


@pytest.mark.parametrize("region", LAWS)
def test_bulk_modulus(section: Problem, region: int) -> None:
    """The pressure rows vanish at p = K (J - 1); at J = 1 for any p where incompressible."""
    bulk = LAWS[region].bulk_modulus
    stretch = 1.02 if np.isfinite(bulk) else 1.0
    displace(section, (stretch - 1) * np.eye(2))
    p = bulk * (stretch**2 - 1) if np.isfinite(bulk) else 0.3
    rows = section.dofs(1, region)
    section.w.x.array[rows] = p / LAWS[region].initial_shear_modulus
    residual = section.residual()[rows]
    assert np.abs(residual).max() < 1e-15
    section.w.x.array[rows] += 1.0
    assert (np.abs(section.residual()[rows]).max() > 1e-6) == np.isfinite(bulk)


def test_pressure_scale_only_scales_the_unknown(section: Problem) -> None:
    state = random_state(section)
    section.w.x.array[:] = state
    residual = section.residual()
    scale = section.fields.pressure_scale
    before = scale.x.array.copy()
    scale.x.array[:] *= 4
    section.w.x.array[section.dofs(1)] /= 4
    scaled = section.residual()
    scale.x.array[:] = before
    u, p = section.dofs(0), section.dofs(1)
    assert np.allclose(scaled[u], residual[u], rtol=1e-13, atol=1e-16)
    assert np.allclose(scaled[p], 4 * residual[p], rtol=1e-13, atol=1e-16)
