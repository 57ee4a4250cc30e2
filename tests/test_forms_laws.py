"""Every law at a material point against closed forms in principal stretches (numpy, no UFL)."""

from itertools import product

import numpy as np
import pytest
from series import series_error

from calfsocket.materials.laws import Ogden
from calfsocket.verification.material_point import (
    LAWS,
    LOAD_CASES,
    TAYLOR_POINTS,
    at_point,
    free_sides,
    moduli_error,
    objectivity_error,
    rotation,
    taylor_orders,
    worst_error,
)


@pytest.mark.parametrize(
    ("case", "ratio"),
    [
        # 2: the range of the tissues; 3: vessels at their most; the series leave 1e-14 of the
        # stress at 3.
        *product(LOAD_CASES, [1.001, 1.2, 2.0, 3.0]),
        *product(["equibiaxial", "simple shear", "tilted"], [1.0, 1 + 1e-9]),
    ],
)
@pytest.mark.parametrize("name", LAWS)
def test_closed_forms(name: str, case: str, ratio: float) -> None:
    assert worst_error(LAWS[name], case, ratio) < 1e-12


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("stretch", [0.5, 0.8, 1.25, 2.0])
def test_uniaxial_stress_in_plane_strain(name: str, stretch: float) -> None:
    """Sides free: sigma22 = 0 gives the second stretch and p; volume by p = K (J - 1)."""
    law = LAWS[name]
    F, p = free_sides(law, stretch)
    sigma = at_point(law, F, p).cauchy
    assert sigma[1] == pytest.approx(0, abs=1e-11 * max(abs(sigma[0]), abs(p)))
    assert sigma[0] == pytest.approx(law.cauchy(F, p)[0], rel=1e-10)
    assert sigma[0] * (stretch - 1) > 0
    if np.isfinite(law.bulk_modulus):
        assert p == pytest.approx(law.bulk_modulus * (np.linalg.det(F) - 1), rel=1e-9)


@pytest.mark.parametrize("name", LAWS)
def test_reference_state(name: str) -> None:
    point = at_point(LAWS[name], np.eye(2))
    assert point.energy == 0
    assert np.all(point.P == 0)
    assert np.all(point.cauchy == 0)
    assert moduli_error(LAWS[name]) < 1e-14


# Printed moduli (Table 1) are initial shear moduli in Abaqus's form. By hand, as printed:
# mu alpha/2 = 0.012 * 7 = 0.084; E/(2(1 + nu)): 0.01/2.98, 11800/2.788, 459/2.8; 2 C10 = 9.82.
@pytest.mark.parametrize(
    ("name", "mu"),
    [
        ("skin", 0.22),
        ("fat", 0.0017),
        ("muscle", 0.001907),
        ("combined", 0.012),
        ("two terms", 0.35),
        ("as printed", 0.084),
        ("fascia", 9.82),
        ("vessel", 0.01 / 2.98),
        ("bone", 11800 / 2.788),
        ("socket", 459 / 2.8),
    ],
)
def test_initial_shear_modulus(name: str, mu: float) -> None:
    law, dF = LAWS[name], np.array([[0, 1], [0, 0]])
    assert law.initial_shear_modulus == pytest.approx(mu, rel=1e-14)
    assert at_point(law, np.eye(2), dF=dF).dP[0, 1] == pytest.approx(mu, rel=1e-14)


@pytest.mark.parametrize("name", LAWS)
def test_objective_and_isotropic(name: str) -> None:
    assert objectivity_error(LAWS[name]) < 1e-13


@pytest.mark.parametrize("where", TAYLOR_POINTS)
@pytest.mark.parametrize("name", LAWS)
def test_taylor(name: str, where: str) -> None:
    """Remainders of first order shrink with the square of the step: energy by P, P by dP."""
    assert min(taylor_orders(LAWS[name], where)) > 1.9


@pytest.mark.parametrize("name", LAWS)
def test_tangent_smooth_at_equal_stretches(name: str) -> None:
    """Towards equal stretches the tangent tends to its value there: no division by l1 - l2."""
    law, dF = LAWS[name], np.array([[0.3, -0.7], [0.5, 0.6]])
    for F in (np.eye(2), 1.1 * rotation(0.3)):
        there = at_point(law, F, dF=dF).dP
        assert np.isfinite(there).all()
        for distance in (1e-6, 1e-9, 1e-12, 1e-15):
            near = at_point(law, F + distance * np.diag([1, -1]), dF=dF).dP
            change = np.abs(near - there).max() / np.abs(there).max()
            assert change < 1e3 * distance + 1e-14


def test_as_printed_form() -> None:
    """Equation (1): sum mu/alpha (sum lb^alpha - 3), alpha/2 times Abaqus's form."""
    law, F = LAWS["as printed"], np.diag([1.3, 0.9])
    lb = np.array([1.3, 0.9, 1.0]) / (1.3 * 0.9) ** (1 / 3)
    printed = 0.012 / 14 * (np.sum(lb**14.0) - 3)
    assert at_point(law, F).energy == pytest.approx(printed, rel=1e-13)
    abaqus = Ogden(mu=law.mu, alpha=law.alpha, d1=law.d1)
    assert at_point(law, F).P == pytest.approx(7 * at_point(abaqus, F).P, rel=1e-13)


# The figures stated in forms/kinematics.py.
@pytest.mark.parametrize("alpha", [0.0, 2.5, 4.6, 12.0, 14.0, -26.0, 26.0])
def test_series_error(alpha: float) -> None:
    assert series_error(alpha, [1.001, 1.1, 2.0, 3.0]).max() < 1.1e-14
    assert series_error(alpha, 4.0) < 1e-12
    assert series_error(alpha, 6.8) < 1e-10
    assert series_error(alpha, 26.0) < 1e-6
    assert series_error(alpha, 100.0) > 1e-6  # a measure that can fail
