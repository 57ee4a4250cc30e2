"""Every law at a material point against closed forms in principal stretches."""

from functools import cache
from typing import NamedTuple

import numpy as np
import pandas as pd
from dolfinx import fem, mesh
from mpi4py import MPI
from scipy.optimize import brentq

from calfsocket.forms import measures, mixed
from calfsocket.io.fenics import evaluate
from calfsocket.materials.fields import Kind, kind
from calfsocket.materials.laws import Law, Ogden
from calfsocket.materials.material_set import MaterialSet
from calfsocket.materials.tissues import MUSCLE_AND_FASCIA
from calfsocket.postprocess.extract import KILOPASCAL
from calfsocket.verification.report import Check, Curve, Section, check_each, curves
from calfsocket.verification.sampling import FloatArray

TABLE_1: dict[str, Law] = {
    **MaterialSet.paper("separate").tissue_laws(),
    "combined": MUSCLE_AND_FASCIA,
}
LAWS: dict[str, Law] = {
    **TABLE_1,
    "two terms": Ogden(mu=(0.4, -0.05), alpha=(3.3, -2.7), d1=0.1),
    "as printed": Ogden(mu=(0.012,), alpha=(14.0,), d1=1.67, form="as-printed"),
    "incompressible": Ogden(mu=(0.012,), alpha=(4.6,), d1=0.0),
}


class Point(NamedTuple):
    """What the forms give at a deformation gradient; MPa."""

    energy: float  #: isochoric energy per reference volume
    #: (2, 2) first Piola-Kirchhoff stress, and its increment in the direction asked for
    P: FloatArray
    dP: FloatArray
    cauchy: FloatArray  #: (4,) s11, s22, s33, s12


@cache
def _compiled(of: Kind) -> tuple[mesh.Mesh, list[fem.Constant], list[fem.Expression]]:
    """Return a mesh, F, dF, p, dp and the law's parameters on it, and the forms of them."""
    form, size = of
    domain = mesh.create_unit_square(MPI.COMM_SELF, 1, 1)
    F, dF = (fem.Constant(domain, np.zeros((2, 2))) for _ in range(2))
    p, dp, *bulk = (fem.Constant(domain, np.float64(0.0)) for _ in range(4))
    parameters = [fem.Constant(domain, np.float64(0.0)) for _ in range(size)]
    material = mixed.Material(form, tuple(parameters), *bulk)
    values = (
        mixed.isochoric(form, F, tuple(parameters)).psi,
        mixed.first_piola(material, F, p),
        mixed.first_piola_increment(material, F, p, dF, dp),
        measures.cauchy_stress(material, F, p),
    )
    centre = np.array([[0.3, 0.3]])
    return domain, [F, dF, p, dp, *parameters], [fem.Expression(v, centre) for v in values]


NOTHING: FloatArray = np.zeros((2, 2))


def at_point(
    law: Law, F: FloatArray, p: float = 0.0, dF: FloatArray = NOTHING, dp: float = 0.0
) -> Point:
    """Evaluate the program's forms at F (2, 2) and p (MPa), with the increment along dF and dp."""
    domain, constants, forms = _compiled(kind(law))
    for constant, value in zip(constants, (F, dF, p, dp, *law.coefficients()), strict=True):
        constant.value = value
    cell = np.array([0], dtype=np.int32)
    psi, P, dP, sigma = (evaluate(form, domain, cell).ravel() for form in forms)
    return Point(float(psi[0]), P.reshape(2, 2), dP.reshape(2, 2), sigma)


def rotation(angle: float) -> FloatArray:
    """Rotation by an angle in rad, (2, 2)."""
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def free_sides(law: Law, stretch: float) -> tuple[FloatArray, float]:
    """F (2, 2) and p (MPa) of a uniaxial stress in the plane: sides free, s22 = 0."""
    bulk = law.bulk_modulus

    def side_stress(side: float) -> float:
        J = stretch * side
        isochoric = law.kirchhoff(np.array([stretch, side, 1.0]))[1]
        return float(isochoric / J + bulk * (J - 1))

    if np.isinf(bulk):
        side = 1 / stretch
        p = -float(law.kirchhoff(np.array([stretch, side, 1.0]))[1])
    else:
        side = brentq(side_stress, 0.2 / stretch, 5 / stretch, xtol=1e-15, rtol=1e-15)
        p = bulk * (stretch * side - 1)
    return np.diag([stretch, side]), p


def _deformations(ratio: float) -> dict[str, list[FloatArray]]:
    """Deformation gradients that do not depend on the law, by load case."""
    root, one = ratio**0.5, np.eye(2)
    shear = root - 1.0 / root  # l1 = 1/l2
    return {
        "equibiaxial": [root * one, one / root],
        "simple shear": [np.array([[1.0, shear], [0.0, 1.0]]), np.array([[1.0, 0.0], [-shear, 1]])],
        "plane-strain compression": [np.diag([root, 1.0 / root]), np.diag([1.0, 1.0 / ratio])],
        "tilted": [rotation(0.7) @ np.diag([ratio**0.7, ratio**-0.3]) @ rotation(0.3)],
    }


LOAD_CASES = ("uniaxial", *_deformations(2.0))


def load_case(law: Law, name: str, ratio: float) -> list[tuple[FloatArray, float]]:
    """F (2, 2) and p (MPa) of a case whose in-plane stretches have the ratio l1/l2.

    Equibiaxial: both are its root, and its inverse. Except for uniaxial stress the pressure is one
    that does not depend on the deformation.
    """
    if name == "uniaxial":
        # With J near 1 the other stretch is 1/stretch, hence the root.
        return [free_sides(law, ratio**0.5), free_sides(law, ratio**-0.5)]
    return [(F, 0.3 * law.initial_shear_modulus) for F in _deformations(ratio)[name]]


def stress_error(law: Law, F: FloatArray, p: float) -> float:
    """Error of Cauchy and first Piola stress and of the energy, relative to the exact ones."""
    point, exact = at_point(law, F, p), law.cauchy(F, p)
    sigma = np.array([[exact[0], exact[3]], [exact[3], exact[1]]])
    P = sigma @ np.linalg.inv(F).T * np.linalg.det(F)
    energy = law.energy(np.append(np.linalg.svd(F, compute_uv=False), 1.0))
    # Near F = I the closed form of the energy subtracts 3 from numbers near 1.
    cancelled = 1e-14 * law.initial_shear_modulus
    return max(
        float(np.abs(point.cauchy - exact).max() / np.abs(exact).max()),
        float(np.abs(point.P - P).max() / np.abs(P).max()),
        max(0.0, abs(point.energy - energy) - cancelled) / max(abs(energy), cancelled),
    )


def worst_error(law: Law, case: str, ratio: float) -> float:
    """Largest `stress_error` of a load case."""
    return max(stress_error(law, F, p) for F, p in load_case(law, case, ratio))


def objectivity_error(law: Law) -> float:
    """Error of stress and energy of a body turned after, and before, its deformation."""
    F, p = np.array([[1.2, 0.3], [-0.1, 0.9]]), -0.01
    reference = at_point(law, F, p)
    P, size = reference.P, np.abs(reference.P).max()
    worst = 0.0
    for angle in (0.4, 2.0, np.pi):
        Q = rotation(angle)
        for there, exact in ((Q @ F, Q @ P), (F @ Q, P @ Q)):
            turned = at_point(law, there, p)
            energy = turned.energy / reference.energy - 1.0
            worst = max(worst, float(np.abs(turned.P - exact).max() / size), abs(energy))
    return worst


def moduli_error(law: Law) -> float:
    """Error of the tangent at F = I against the initial shear modulus.

    In shear, in stretch without a change of area, and in dilation of the plane, where the strain's
    deviator is (1, 1, -2)/3; relative.
    """
    mu, errors = law.initial_shear_modulus, []
    p = 1.5 * mu
    for dF, dP in (
        ([[0.0, 1.0], [0.0, 0.0]], mu * np.array([[0.0, 1.0], [1.0, 0.0]])),
        ([[1.0, 0.0], [0.0, -1.0]], 2 * mu * np.diag([1.0, -1.0])),
        (np.eye(2), (2 * mu / 3 + p) * np.eye(2)),
        ([[0.0, -1.0], [1.0, 0.0]], np.zeros((2, 2))),
    ):
        dp = 0.5 * p * np.trace(dF)
        found = at_point(law, np.eye(2), 0.0, np.array(dF), dp).dP
        errors.append(np.abs(found - dP).max() / mu)
    return float(max(errors))


TAYLOR_POINTS = {
    "F = I": np.eye(2),
    "equal stretches": 1.1 * rotation(0.3),
    "general F": np.array([[1.15, 0.22], [-0.07, 0.91]]),
}


def taylor_orders(law: Law, where: str) -> tuple[float, float]:
    """Least order of the remainders of the energy and of the stress, step by halved step."""
    F, p = TAYLOR_POINTS[where], 0.2 * law.initial_shear_modulus
    dF, dp = np.array([[0.3, -0.7], [0.5, 0.6]]), 0.4 * law.initial_shear_modulus
    base = at_point(law, F, p, dF, dp)
    # The energy is isochoric: its derivative is P without the pressure part p cof F.
    slope = np.sum((base.P - p * np.linalg.det(F) * np.linalg.inv(F).T) * dF)
    remainders = []
    for step in 0.004 * 0.5 ** np.arange(4):
        moved = at_point(law, F + step * dF, p + step * dp)
        energy = abs(moved.energy - base.energy - step * slope)
        remainders.append((energy, np.abs(moved.P - base.P - step * base.dP).max()))
    energy, stress = -np.diff(np.log2(remainders), axis=0).max(axis=0)
    return float(energy), float(stress)


RATIOS = (2.0, 3.0)
CLOSED = "principal stretches, numpy"
LOG_STRAINS = np.linspace(0.02, 0.5, 25)
"""Magnitudes of the logarithmic strain in the figure."""


def report() -> Section:
    """Measure stress, moduli, objectivity and Taylor's orders of every law."""
    laws = LAWS.values()
    errors = {
        ratio: pd.DataFrame(
            {case: [worst_error(law, case, ratio) for law in laws] for case in LOAD_CASES}
        )
        for ratio in RATIOS
    }
    orders = np.array([taylor_orders(law, where) for law in laws for where in TAYLOR_POINTS])
    moduli, turned = (max(map(error, laws)) for error in (moduli_error, objectivity_error))
    stress = {
        f"stress and energy up to l1/l2 = {ratio:g}, {case}, worst of {len(LAWS)} laws": largest
        for ratio, frame in errors.items()
        for case, largest in frame.max().items()
    }
    least = {
        f"order of Taylor's test, {what}": order
        for what, order in zip(("energy", "stress"), orders.min(axis=0), strict=True)
    }
    source = "mu of Table 1; E/(2 (1 + nu)); 2 C10"
    return Section(
        [
            *check_each(stress, 1e-12, CLOSED),
            Check("initial moduli by the tangent", moduli, 1e-14, source),
            Check("stress after and before a rotation", turned, 1e-13, "objectivity, isotropy"),
            *check_each(least, 1.9, "2", rule="at least"),
        ],
        {
            "material_stress": curves(
                ("stretch", "magnitude of Cauchy stress, kPa"), _stress_lines(), yscale="log"
            )
        },
        {
            f"up to {ratio:g}": frame.assign(law=list(LAWS))[["law", *frame]]
            for ratio, frame in errors.items()
        },
    )


def _stress_lines() -> list[Curve]:
    """Uniaxial stress of the tissues of Table 1: closed forms, and the forms at some points."""
    lines: list[Curve] = []
    for k, (name, law) in enumerate(TABLE_1.items()):
        for sign in (-1, 1):
            stretches = np.exp(sign * LOG_STRAINS)
            exact = [abs(law.cauchy(*free_sides(law, s))[0]) for s in stretches]
            some = stretches[::4]
            forms = [abs(at_point(law, *free_sides(law, s)).cauchy[0]) for s in some]
            lines.append((stretches, KILOPASCAL * np.array(exact), f"C{k}", None))
            label = name if sign > 0 else None
            lines.append((some, KILOPASCAL * np.array(forms), f"oC{k}", label))
    return lines
