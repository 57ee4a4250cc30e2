"""The error indicator against fields whose error is known."""

from dataclasses import replace

import numpy as np
import pytest

from calfsocket.postprocess.fields import GAUSS_POINTS, SectionFields
from calfsocket.postprocess.recovery import recovery_error
from sections import grid, section

BARYCENTRIC = np.column_stack([1 - GAUSS_POINTS.sum(axis=1), GAUSS_POINTS])


def plate(n: int, tissues: tuple[str, ...] = ("muscle",)) -> SectionFields:
    """A square of side 1 in bands of equal width, one for each tissue."""
    points, cells = grid(n, n)
    points = points / n
    middle = points[cells[:, :3]].mean(axis=1)[:, 0]
    region = 1 + np.minimum(len(tissues) * middle, len(tissues) - 1).astype(int)
    names = {1 + i: (f"band {i}", tissue) for i, tissue in enumerate(tissues)}
    return section(points, cells, region, names)


def stressed(fields: SectionFields, shear) -> SectionFields:
    """Set the shear stress, a function of the position, at the Gauss points."""
    x = np.einsum("gv,mvi->mgi", BARYCENTRIC, fields.points[fields.cells[:, :3]])
    stress = np.zeros_like(fields.stress)
    stress[..., 3] = shear(x[..., 0], x[..., 1])
    return replace(fields, stress=stress)


def total(fields: SectionFields) -> float:
    return float(np.linalg.norm(recovery_error(fields)))


def test_a_linear_field_has_no_error():
    fields = stressed(plate(4), lambda x, y: 3 - 2 * x + 5 * y)
    assert total(fields) < 1e-14


def test_a_pressure_has_no_error():
    fields = stressed(plate(4), lambda x, y: 1 + x)
    fields.stress[:, :, :3] = np.random.default_rng(1).normal(size=(len(fields.cells), 1, 1))
    assert total(fields) < 1e-14


def test_the_error_of_a_smooth_field_falls_with_the_square_of_the_sides():
    def shear(x, y):
        return np.sin(3 * x) * np.cos(2 * y)

    errors = [total(stressed(plate(n), shear)) for n in (8, 16)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.2)


def test_the_error_of_a_strain_counts_as_that_of_a_stress():
    fields = plate(4)
    F = fields.deformation_gradient.copy()
    F[..., 0, 1] = np.random.default_rng(1).uniform(0, 0.1, F.shape[:2])
    assert total(replace(fields, deformation_gradient=F)) > 0.1


def test_a_tissue_counts_in_its_own_stress_and_area():
    """A stiff, thin tissue beside a soft, thick one."""

    def jagged(x, y):
        return np.where(x < 0.25, 1e4, 1.0) * (2 + np.sin(8 * np.pi * x))

    fields = stressed(plate(16, ("fascia", "muscle", "muscle", "muscle")), jagged)
    error = recovery_error(fields)
    assert np.linalg.norm(error[fields.cells_of("fascia")]) == pytest.approx(
        np.linalg.norm(error[fields.cells_of("muscle")]), rel=0.3
    )


def test_a_jump_between_tissues_is_no_error():
    fields = stressed(plate(4, ("fascia", "muscle")), lambda x, y: np.where(x < 0.5, 7.0, 1.0))
    assert total(fields) < 1e-14
    assert total(replace(fields, region=np.ones_like(fields.region))) > 0.05


def test_bone_and_socket_have_none():
    fields = stressed(plate(4, ("bone", "socket")), lambda x, y: x**2)
    assert total(fields) == 0.0


def test_an_error_beside_a_large_value_counts_more():
    def waves(x, y):
        return np.where(x < 0.5, 10.0, 1.0) + np.sin(16 * np.pi * x)

    fields = stressed(plate(16, ("muscle", "fascia")), waves)
    one_tissue = replace(fields, region=np.ones_like(fields.region))
    middle = fields.points[fields.cells[:, :3]].mean(axis=1)[:, 0]
    error = recovery_error(one_tissue)
    large, small = (np.linalg.norm(error[inside]) for inside in (middle < 0.4, middle > 0.6))
    assert large > 4 * small > 0.0
