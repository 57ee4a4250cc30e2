"""Every law at a material point against closed forms in principal stretches (numpy, no UFL)."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI
from scipy.optimize import brentq

from calfsocket.closed_forms import closed_cauchy, closed_energy, closed_kirchhoff
from calfsocket.forms import measures, mixed
from calfsocket.forms.accuracy import series_error
from calfsocket.laws import Hencky, Law, Ogden, Yeoh
from calfsocket.tissues import (
    BONE,
    FASCIA,
    FAT,
    MUSCLE,
    MUSCLE_AND_FASCIA,
    SKIN,
    SOCKET,
    VESSEL,
)

TWO_TERMS = Ogden(mu=(0.4, -0.05), alpha=(3.3, -2.7), d1=0.1)
AS_PRINTED = Ogden(mu=(0.012,), alpha=(14.0,), d1=1.67, form="as-printed")
INCOMPRESSIBLE = Ogden(mu=(0.012,), alpha=(4.6,), d1=0.0)
LAWS: dict[str, Law] = {
    "skin": SKIN,
    "fat": FAT,
    "muscle": MUSCLE,
    "combined": MUSCLE_AND_FASCIA,
    "two terms": TWO_TERMS,
    "as printed": AS_PRINTED,
    "incompressible": INCOMPRESSIBLE,
    "fascia": FASCIA,
    "vessel": VESSEL,
    "bone": BONE,
    "socket": SOCKET,
}


@dataclass(frozen=True)
class Point:
    energy: float
    P: np.ndarray  # (2, 2)
    cauchy: np.ndarray  # (4,)
    dP: np.ndarray  # (2, 2)


MaterialPoint = Callable[..., Point]


@pytest.fixture(scope="module")
def at() -> MaterialPoint:
    """Evaluate the forms at a constant F: compiled once a law and number of terms."""
    domain = mesh.create_unit_square(MPI.COMM_SELF, 1, 1)
    cell = np.array([0], dtype=np.int32)
    constant = lambda shape=(): fem.Constant(domain, np.zeros(shape))  # noqa: E731
    F, dF, p, dp = constant((2, 2)), constant((2, 2)), constant(), constant()
    expressions: dict[tuple[str, int], tuple[list[fem.Expression], mixed.LawFields]] = {}

    def compiled(name: str, n_terms: int) -> tuple[list[fem.Expression], mixed.LawFields]:
        if (name, n_terms) not in expressions:
            fields = mixed.LawFields(
                ogden_mu=tuple(constant() for _ in range(n_terms)),
                ogden_alpha=tuple(constant() for _ in range(n_terms)),
                **{
                    key: constant()
                    for key in ("c10", "c20", "c30", "hencky_mu", "inverse_bulk", "pressure_scale")
                },
            )
            values = (
                mixed.isochoric(name, F, fields).psi,
                mixed.first_piola(name, F, p, fields),
                measures.cauchy_stress(name, F, p, fields),
                mixed.first_piola_increment(name, F, p, dF, dp, fields),
            )
            centre = np.array([[0.3, 0.3]])
            expressions[name, n_terms] = ([fem.Expression(v, centre) for v in values], fields)
        return expressions[name, n_terms]

    def evaluate(law, F_value, p_value=0.0, dF_value=((0, 0), (0, 0)), dp_value=0.0) -> Point:
        n_terms = len(law.mu) if isinstance(law, Ogden) else 1
        values, fields = compiled(law.name, n_terms)
        F.value, dF.value, p.value, dp.value = F_value, dF_value, p_value, dp_value
        match law:
            case Ogden():
                for i in range(n_terms):
                    fields.ogden_mu[i].value = law.abaqus_mu[i]
                    fields.ogden_alpha[i].value = law.alpha[i]
            case Yeoh():
                fields.c10.value, fields.c20.value, fields.c30.value = law.c10, law.c20, law.c30
            case Hencky():
                fields.hencky_mu.value = law.initial_shear_modulus
        psi, P, sigma, dP = (value.eval(domain, cell).ravel() for value in values)
        return Point(psi[0], P.reshape(2, 2), sigma, dP.reshape(2, 2))

    return evaluate


def rotation(angle: float) -> np.ndarray:
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def deformations(ratio: float) -> dict[str, np.ndarray]:
    """Homogeneous deformations whose in-plane stretches reach the ratio l1/l2."""
    shear = np.sqrt(ratio) - 1 / np.sqrt(ratio)  # simple shear: l1 = 1/l2
    tilted = rotation(0.7) @ np.diag([ratio**0.7, ratio**-0.3]) @ rotation(0.3)
    return {
        "uniaxial stretch": np.diag([ratio, 1.0]),
        "uniaxial compression": np.diag([1.0, 1 / ratio]),
        "equibiaxial": np.diag([ratio**0.5, ratio**0.5]),
        "equibiaxial compression": np.diag([ratio**-0.5, ratio**-0.5]),
        "simple shear": np.array([[1.0, shear], [0.0, 1.0]]),
        "plane-strain compression": np.diag([ratio**0.5, ratio**-0.5]),
        "tilted": tilted,
    }


# 2: the range of the tissues; 3: vessels at their most; the series leave 1e-14 of the stress at 3.
@pytest.mark.parametrize("ratio", [1.0, 1 + 1e-9, 1.001, 1.2, 2.0, 3.0])
@pytest.mark.parametrize("name", LAWS)
def test_closed_forms(at: MaterialPoint, name: str, ratio: float) -> None:
    law = LAWS[name]
    for F in deformations(ratio).values():
        p = 0.3 * law.initial_shear_modulus
        exact, point = closed_cauchy(law, F, p), at(law, F, p)
        largest = np.abs(exact).max()
        assert np.allclose(point.cauchy, exact, rtol=0, atol=1e-12 * largest)
        P = (point.cauchy[[0, 3, 3, 1]].reshape(2, 2)) @ np.linalg.inv(F).T * np.linalg.det(F)
        assert np.allclose(point.P, P, rtol=0, atol=1e-12 * np.abs(P).max())
        stretches = np.append(np.linalg.svd(F, compute_uv=False), 1.0)
        # the closed form subtracts 3 from powers near 1
        cancelled = 1e-14 * law.initial_shear_modulus
        energy = closed_energy(law, stretches)
        assert point.energy == pytest.approx(energy, rel=1e-12, abs=cancelled)


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("stretch", [0.5, 0.8, 1.25, 2.0])
def test_uniaxial_stress_in_plane_strain(at: MaterialPoint, name: str, stretch: float) -> None:
    """Sides free: sigma22 = 0 gives the second stretch and p; volume by p = K (J - 1)."""
    law = LAWS[name]
    bulk = law.bulk_modulus

    def side_stress(side: float) -> float:
        stretches = np.array([stretch, side, 1.0])
        J = stretch * side
        return closed_kirchhoff(law, stretches)[1] / J + bulk * (J - 1)

    if np.isinf(bulk):
        side = 1 / stretch
        p = -closed_kirchhoff(law, np.array([stretch, side, 1.0]))[1]
    else:
        side = brentq(side_stress, 0.2 / stretch, 5 / stretch, xtol=1e-15, rtol=1e-15)
        p = bulk * (stretch * side - 1)
    F = np.diag([stretch, side])
    sigma = at(law, F, p).cauchy
    assert sigma[1] == pytest.approx(0, abs=1e-11 * max(abs(sigma[0]), abs(p)))
    assert sigma[0] == pytest.approx(closed_cauchy(law, F, p)[0], rel=1e-10)
    assert sigma[0] * (stretch - 1) > 0


@pytest.mark.parametrize("name", LAWS)
def test_reference_state(at: MaterialPoint, name: str) -> None:
    law, mu = LAWS[name], LAWS[name].initial_shear_modulus
    point = at(law, np.eye(2))
    assert point.energy == 0
    assert np.all(point.P == 0)
    assert np.all(point.cauchy == 0)
    shear = at(law, np.eye(2), dF_value=[[0, 1], [0, 0]])
    assert shear.dP == pytest.approx(mu * np.array([[0, 1], [1, 0]]), rel=1e-14)
    stretch = at(law, np.eye(2), dF_value=[[1, 0], [0, -1]])
    assert stretch.dP == pytest.approx(2 * mu * np.diag([1, -1]), rel=1e-14)
    # dilation in the plane: dev(e) = (1, 1, -2)/3, so tau = 2 mu/3 in each direction
    dilation = at(law, np.eye(2), dF_value=np.eye(2), dp_value=1.5)
    assert dilation.dP == pytest.approx((2 * mu / 3 + 1.5) * np.eye(2), rel=1e-14)
    spin = at(law, np.eye(2), dF_value=[[0, -1], [1, 0]])
    assert np.all(spin.dP == 0)


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
def test_initial_shear_modulus(at: MaterialPoint, name: str, mu: float) -> None:
    law = LAWS[name]
    assert law.initial_shear_modulus == pytest.approx(mu, rel=1e-14)
    assert at(law, np.eye(2), dF_value=[[0, 1], [0, 0]]).dP[0, 1] == pytest.approx(mu, rel=1e-14)


@pytest.mark.parametrize("name", LAWS)
def test_objective_and_isotropic(at: MaterialPoint, name: str) -> None:
    law, F, p = LAWS[name], np.array([[1.2, 0.3], [-0.1, 0.9]]), -0.01
    reference = at(law, F, p)
    for angle in (0.4, 2.0, np.pi):
        Q = rotation(angle)
        turned, turned_before = at(law, Q @ F, p), at(law, F @ Q, p)
        size = np.abs(reference.P).max()
        assert turned.energy == pytest.approx(reference.energy, rel=1e-13)
        assert turned_before.energy == pytest.approx(reference.energy, rel=1e-13)
        assert np.allclose(turned.P, Q @ reference.P, rtol=0, atol=1e-13 * size)
        assert np.allclose(turned_before.P, reference.P @ Q, rtol=0, atol=1e-13 * size)


def observed_order(errors: list[float]) -> float:
    return float(np.log2(np.array(errors[:-1]) / np.array(errors[1:])).min())


TAYLOR_POINTS = {
    "identity": np.eye(2),
    "equal stretches": 1.1 * rotation(0.3),
    "random": np.array([[1.15, 0.22], [-0.07, 0.91]]),
}


@pytest.mark.parametrize("where", TAYLOR_POINTS)
@pytest.mark.parametrize("name", LAWS)
def test_taylor(at: MaterialPoint, name: str, where: str) -> None:
    """Remainders of first order shrink with the square of the step: energy by P, P by dP."""
    law, F, p = LAWS[name], TAYLOR_POINTS[where], 0.2 * LAWS[name].initial_shear_modulus
    dF, dp = np.array([[0.3, -0.7], [0.5, 0.6]]), 0.4 * law.initial_shear_modulus
    base = at(law, F, p, dF, dp)
    energies, stresses = [], []
    for step in 0.004 * 0.5 ** np.arange(4):
        moved = at(law, F + step * dF, p + step * dp)
        # the energy is isochoric: its derivative is P without the pressure part p cof F
        cofactor = np.linalg.det(F) * np.linalg.inv(F).T
        slope = np.sum((base.P - p * cofactor) * dF)
        energies.append(abs(moved.energy - base.energy - step * slope))
        stresses.append(np.abs(moved.P - base.P - step * base.dP).max())
    assert observed_order(energies) > 1.9
    assert observed_order(stresses) > 1.9


@pytest.mark.parametrize("name", LAWS)
def test_tangent_smooth_at_equal_stretches(at: MaterialPoint, name: str) -> None:
    """Towards equal stretches the tangent tends to its value there: no division by l1 - l2."""
    law, dF = LAWS[name], [[0.3, -0.7], [0.5, 0.6]]
    for F in (np.eye(2), 1.1 * rotation(0.3)):
        there = at(law, F, dF_value=dF).dP
        assert np.isfinite(there).all()
        for distance in (1e-6, 1e-9, 1e-12, 1e-15):
            near = at(law, F + distance * np.diag([1, -1]), dF_value=dF).dP
            change = np.abs(near - there).max() / np.abs(there).max()
            assert change < 1e3 * distance + 1e-14


def test_as_printed_form(at: MaterialPoint) -> None:
    """Equation (1): sum mu/alpha (sum lb^alpha - 3), alpha/2 times Abaqus's form."""
    F = np.diag([1.3, 0.9])
    lb = np.array([1.3, 0.9, 1.0]) / (1.3 * 0.9) ** (1 / 3)
    printed = 0.012 / 14 * (np.sum(lb**14.0) - 3)
    assert at(AS_PRINTED, F).energy == pytest.approx(printed, rel=1e-13)
    abaqus = Ogden(AS_PRINTED.mu, AS_PRINTED.alpha, AS_PRINTED.d1)
    assert at(AS_PRINTED, F).P == pytest.approx(7 * at(abaqus, F).P, rel=1e-13)


def test_unknown_law() -> None:
    with pytest.raises(ValueError, match="'neo-hooke' is not one of ogden, yeoh, hencky"):
        mixed.isochoric("neo-hooke", ufl.Identity(2), None)


# The figures stated in forms/kinematics.py.
@pytest.mark.parametrize("alpha", [0.0, 2.5, 4.6, 12.0, 14.0, -26.0, 26.0])
def test_series_error(alpha: float) -> None:
    assert series_error(alpha, [1.001, 1.1, 2.0, 3.0]).max() < 1.1e-14
    assert series_error(alpha, 4.0) < 1e-12
    assert series_error(alpha, 6.8) < 1e-10
    assert series_error(alpha, 26.0) < 1e-6
    assert series_error(alpha, 100.0) > 1e-6  # a measure that can fail
