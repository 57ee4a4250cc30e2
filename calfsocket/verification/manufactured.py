r"""Manufactured solutions on curved triangles.

**Manufactured solutions.** On a quarter ring of curved triangles a displacement of sines is held at
the inner arc, and the body force and tractions that it needs are applied; they are made from
`Law.kirchhoff` by a complex step. The displacement is a shear along y after one along x, which
keeps every volume; for the compressible law a swelling is added.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from numpy.typing import NDArray

from calfsocket.materials.laws import Law
from calfsocket.materials.tissues import FASCIA, SKIN
from calfsocket.mechanics.constraints import Constraint
from calfsocket.mechanics.problem import Problem
from calfsocket.meshes.distributed import SectionMesh
from calfsocket.verification.problems import solved
from calfsocket.verification.report import LOG, Check, Figure, curves
from calfsocket.verification.sampling import at_points
from calfsocket.verification.strips import INNER, LEFT, OUTER, quarter_ring

FloatArray = NDArray[np.float64]
Array = NDArray[Any]
Field = Callable[[Array], Array]


@dataclass(frozen=True)
class Manufactured:
    """A displacement x -> u (mm) with its gradient, and a pressure (MPa); all take (2, n)."""

    law: Law
    displacement: Field
    gradient: Field
    pressure: Field


WAVE, AMPLITUDE = 2.0 * np.pi / 50.0, 0.8
"""Wave number (1/mm) and amplitude (mm). With half the wave length the pressure's rate has to be
looked for with more elements: 1.35, 1.56, 1.75 from 4 to 32 elements across."""


def isochoric() -> Manufactured:
    """Shear along x, then along y, J = 1 exactly; fascia, with a pressure of its own."""

    def pressure(x: Array) -> Array:
        return 0.2 * FASCIA.c10 * np.sin(WAVE * x[0]) * np.sin(WAVE * x[1] + 0.2)

    return Manufactured(FASCIA, _shears, _shears_gradient, pressure)


def compressible() -> Manufactured:
    """Shear as well, and swell by some 0.5 %; skin, with the pressure of its bulk modulus."""
    k, a = WAVE, 0.04

    def displacement(x: Array) -> Array:
        swell = np.array([np.sin(k * x[0] + 0.3) * np.cos(k * x[1]), np.sin(k * (x[0] - x[1]))])
        return np.asarray(_shears(x) + a * swell)

    def gradient(x: Array) -> Array:
        s, t, d = k * x[0] + 0.3, k * x[1], np.cos(k * (x[0] - x[1]))
        swell = np.array([[np.cos(s) * np.cos(t), -np.sin(s) * np.sin(t)], [d, -d]])
        return np.asarray(_shears_gradient(x) + a * k * swell)

    def pressure(x: Array) -> Array:
        G = gradient(x)
        J = (1.0 + G[0, 0]) * (1.0 + G[1, 1]) - G[0, 1] * G[1, 0]
        return np.asarray(SKIN.bulk_modulus * (J - 1.0))

    return Manufactured(SKIN, displacement, gradient, pressure)


def _shears(x: Array) -> Array:
    first = x[0] + AMPLITUDE * np.sin(WAVE * x[1])
    return np.array([first - x[0], AMPLITUDE * np.sin(WAVE * first + 0.5)])


def _shears_gradient(x: Array) -> Array:
    first = x[0] + AMPLITUDE * np.sin(WAVE * x[1])
    slope = AMPLITUDE * WAVE * np.cos(WAVE * x[1])
    then = AMPLITUDE * WAVE * np.cos(WAVE * first + 0.5)
    return np.array([[0.0 * slope, slope], [then, then * slope]])


def nominal_stress(exact: Manufactured, x: Array) -> Array:
    r"""P = tau F^-T at positions, MPa; (2, 2, n).

    In the plane tau = beta b + eta I with b = F F^T, so that it has the principal values that
    `Law.kirchhoff` gives; these, by the trace and determinant of b, are analytic, which the
    complex step in `body_force` needs.
    """
    G = exact.gradient(x)
    F = np.array([[1.0 + G[0, 0], G[0, 1]], [G[1, 0], 1.0 + G[1, 1]]])
    J = F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0]
    b = np.einsum("ik...,jk...->ij...", F, F)
    half, root = 0.5 * (b[0, 0] + b[1, 1]), np.sqrt(0.25 * (b[0, 0] - b[1, 1]) ** 2 + b[0, 1] ** 2)
    squared = np.array([half + root, J**2 / (half + root)])
    tau = exact.law.kirchhoff(np.array([*np.sqrt(squared), np.ones_like(J)]))
    beta = (tau[0] - tau[1]) / (2.0 * root)
    eta = tau[0] - beta * squared[0] + J * exact.pressure(x)
    cofactor = np.array([[F[1, 1], -F[1, 0]], [-F[0, 1], F[0, 0]]])
    # tau F^-T = beta F + eta F^-T
    return np.asarray(beta * F + eta * cofactor / J)


def body_force(exact: Manufactured, x: Array) -> Array:
    """Return -Div P in MPa/mm, by a complex step; (2, n)."""
    step = 1e-30
    force = np.zeros_like(x)
    for j in range(2):
        shifted = x.astype(complex)
        shifted[j] += 1j * step
        force -= nominal_stress(exact, shifted)[:, j].imag / step
    return force


@dataclass(frozen=True)
class Convergence:
    """Errors over element sizes."""

    h: FloatArray  #: (n,) element sizes, mm
    errors: dict[str, FloatArray]  #: relative errors: "u L2", "u H1" (of the gradient) and "p L2"

    def rate(self, norm: str) -> float:
        """Slope of the error over h, fitted in the logarithms."""
        return float(np.polyfit(np.log(self.h), np.log(self.errors[norm]), 1)[0])


RATES = {"u L2": 2.9, "u H1": 1.9, "p L2": 1.9}
"""Least fitted rates; the element's orders are 3, 2 and 2."""

DIVISIONS = (6, 8, 12, 16, 24)


def manufactured_error(exact: Manufactured, section: SectionMesh, held: str) -> dict[str, float]:
    """Solve for a manufactured solution, held on one boundary; relative errors.

    Parameters
    ----------
    exact : Manufactured
        The solution.
    section : SectionMesh
        With one region.
    held : str
        Boundary with the exact displacement; on the others acts the exact traction.
    """
    domain = section.mesh

    def loads(v: Any) -> ufl.Form:
        # Polynomials of degree 5: their error is far below that of the element.
        force = fem.Function(fem.functionspace(domain, ("Lagrange", 5, (2,))))
        force.interpolate(lambda x: body_force(exact, x[:2]))
        stress = fem.Function(fem.functionspace(domain, ("Lagrange", 5, (2, 2))))
        stress.interpolate(lambda x: nominal_stress(exact, x[:2]).reshape(4, -1))
        # Traction where the displacement is held, too, does nothing.
        rule = {"quadrature_degree": 8}
        traction = stress * ufl.FacetNormal(domain)
        return ufl.inner(force, v) * ufl.dx(domain, metadata=rule) + ufl.inner(
            traction, v
        ) * ufl.ds(domain, metadata=rule)

    (region,) = section.regions
    constraint = Constraint(held, values=exact.displacement)
    problem = Problem(section, {region: exact.law}, [constraint], [loads])
    # Loads grown in proportion need not lead there, so the solution is looked for where it is.
    scale = exact.law.initial_shear_modulus
    problem.w.sub(0).interpolate(lambda x: exact.displacement(x[:2]))
    problem.w.sub(1).interpolate(lambda x: exact.pressure(x[:2]) / scale)
    solved(problem)
    at = at_points(section, problem.w, problem.fields)
    G = exact.gradient(at.x)

    def norm(values: Array) -> float:
        return float(np.sqrt(np.sum(at.weight * np.abs(values) ** 2)))

    u, p = exact.displacement(at.x), exact.pressure(at.x)
    return {
        "u L2": norm(at.u - u) / norm(u),
        "u H1": norm(at.F - np.eye(2)[:, :, None] - G) / norm(G),
        "p L2": norm(at.p - p) / norm(p),
    }


def convergence(exact: Manufactured, divisions: Sequence[int] = DIVISIONS) -> Convergence:
    """Solve on a quarter ring with several numbers of elements across."""
    errors = [manufactured_error(exact, quarter_ring(n), LEFT) for n in divisions]
    return Convergence(
        (OUTER - INNER) / np.array(divisions),
        {norm: np.array([error[norm] for error in errors]) for norm in errors[0]},
    )


def convergences() -> dict[str, Convergence]:
    """Solve for both solutions on all meshes."""
    return {
        "compressible": convergence(compressible()),
        "incompressible": convergence(isochoric()),
    }


def checks(convergences: Mapping[str, Convergence]) -> list[Check]:
    """Compare the fitted orders with the element's."""
    return [
        Check(
            f"{name}: order of {norm}",
            result.rate(norm),
            least,
            "manufactured solution",
            rule="at least",
        )
        for name, result in convergences.items()
        for norm, least in RATES.items()
    ]


def figure(convergences: Mapping[str, Convergence]) -> Figure:
    """Plot the errors over the element size."""
    lines = [
        (result.h, result.errors[norm], f"{style}C{k}", f"{name}, {norm}")
        for (name, result), style in zip(convergences.items(), ("o-", "s--"), strict=True)
        for k, norm in enumerate(RATES)
    ]
    caption = "Manufactured solutions on curved triangles."
    return curves("element_rates", caption, ("element size, mm", "relative error"), lines, **LOG)
