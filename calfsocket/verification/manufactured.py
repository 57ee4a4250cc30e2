"""Manufactured solutions on curved triangles, with stresses of the laws' closed forms."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
import ufl
from dolfinx import fem

from calfsocket.materials.laws import Law
from calfsocket.materials.tissues import FASCIA, SKIN
from calfsocket.mechanics.constraints import Constraint
from calfsocket.mechanics.problem import Problem
from calfsocket.meshes.distributed import SectionMesh
from calfsocket.verification.problems import solved
from calfsocket.verification.report import LOG, Check, Draw, curves, order
from calfsocket.verification.sampling import Array, FloatArray, at_points
from calfsocket.verification.strips import INNER, LEFT, OUTER, Field, quarter_ring


@dataclass(frozen=True)
class Manufactured:
    """A displacement x -> u (mm) and a pressure (MPa); both take (2, n).

    The displacement takes complex positions, too.
    """

    law: Law
    displacement: Field
    pressure: Field


def gradient(displacement: Field, x: Array) -> FloatArray:
    """Grad u by a complex step; (2, 2, n)."""
    step = 1e-30j
    moved = (x + step * np.eye(2)[:, [j]] for j in range(2))
    return np.stack([displacement(at).imag / step.imag for at in moved], axis=1)


WAVE, AMPLITUDE = 2.0 * np.pi / 50.0, 0.8
"""Wave number (1/mm) and amplitude (mm). With half the wave length the pressure's rate has to be
looked for with more elements: 1.35, 1.56, 1.75 from 4 to 32 elements across."""


def _shears(x: Array) -> Array:
    first = x[0] + AMPLITUDE * np.sin(WAVE * x[1])
    return np.array([first - x[0], AMPLITUDE * np.sin(WAVE * first + 0.5)])


def isochoric() -> Manufactured:
    """Shear along x, then along y, J = 1 exactly; fascia, with a pressure of its own."""

    def pressure(x: Array) -> Array:
        return 0.2 * FASCIA.c10 * np.sin(WAVE * x[0]) * np.sin(WAVE * x[1] + 0.2)

    return Manufactured(FASCIA, _shears, pressure)


def compressible() -> Manufactured:
    """Shear as well, and swell by some 0.5 %; skin, with the pressure of its bulk modulus."""
    k, a = WAVE, 0.04

    def displacement(x: Array) -> Array:
        swell = np.array([np.sin(k * x[0] + 0.3) * np.cos(k * x[1]), np.sin(k * (x[0] - x[1]))])
        return np.asarray(_shears(x) + a * swell)

    def pressure(x: Array) -> Array:
        F = np.eye(2)[:, :, None] + gradient(displacement, x)
        return np.asarray(SKIN.bulk_modulus * (np.linalg.det(F.T) - 1.0))

    return Manufactured(SKIN, displacement, pressure)


def nominal_stress(exact: Manufactured, x: Array) -> FloatArray:
    """P = (tau + J p I) F^-T at positions, MPa, from the spectral form of b = F F^T; (2, 2, n)."""
    F = np.moveaxis(np.eye(2)[:, :, None] + gradient(exact.displacement, x), 2, 0)
    squared, n = np.linalg.eigh(F @ F.swapaxes(1, 2))
    tau = exact.law.kirchhoff(np.array([*np.sqrt(squared.T), np.ones(len(F))]))[:2]
    principal = tau + np.sqrt(squared.prod(axis=1)) * exact.pressure(x)
    kirchhoff = np.einsum("pik,kp,pjk->pij", n, principal, n)
    return np.moveaxis(kirchhoff @ np.linalg.inv(F).swapaxes(1, 2), 0, 2)


RATES = {"u L2": 2.9, "u H1": 1.9, "p L2": 1.9}
"""Least fitted rates; the element's orders are 3, 2 and 2."""

DIVISIONS = (6, 8, 12, 16, 24)


def manufactured_error(exact: Manufactured, section: SectionMesh, inner: str) -> dict[str, float]:
    """Solve for a solution prescribed at the boundary `inner` of a region; relative errors.

    Of displacement ("u L2"), its gradient ("u H1") and pressure ("p L2").
    """
    domain = section.mesh

    def loads(v: Any) -> ufl.Form:
        # Polynomials of degree 5: their error is far below that of the element.
        stress = fem.Function(fem.functionspace(domain, ("Lagrange", 5, (2, 2))))
        stress.interpolate(lambda x: nominal_stress(exact, x[:2]).reshape(4, -1))
        return ufl.inner(stress, ufl.grad(v)) * ufl.dx(domain, metadata={"quadrature_degree": 8})

    (region,) = section.regions
    constraint = Constraint(inner, values=exact.displacement)
    problem = Problem(section, {region: exact.law}, [constraint], [loads])
    # Loads grown in proportion need not lead there, so the solution is looked for where it is.
    scale = exact.law.initial_shear_modulus
    problem.w.sub(0).interpolate(lambda x: exact.displacement(x[:2]))
    problem.w.sub(1).interpolate(lambda x: exact.pressure(x[:2]) / scale)
    solved(problem)
    at = at_points(section, problem.w, problem.fields)
    H = gradient(exact.displacement, at.x)
    pairs = {
        "u L2": (at.u, exact.displacement(at.x)),
        "u H1": (at.F - np.eye(2)[:, :, None], H),
        "p L2": (at.p, exact.pressure(at.x)),
    }

    def norm(values: Array) -> float:
        return float(np.sqrt(np.sum(at.weight * np.abs(values) ** 2)))

    return {name: norm(found - u) / norm(u) for name, (found, u) in pairs.items()}


def convergence(exact: Manufactured, divisions: Sequence[int] = DIVISIONS) -> pd.DataFrame:
    """Errors by norm on a quarter ring with numbers of elements across; the index is h in mm."""
    errors = [manufactured_error(exact, quarter_ring(n), LEFT) for n in divisions]
    return pd.DataFrame(errors, index=(OUTER - INNER) / np.array(divisions))


def convergences() -> dict[str, pd.DataFrame]:
    """Solve for both solutions on all meshes."""
    return {
        "compressible": convergence(compressible()),
        "incompressible": convergence(isochoric()),
    }


def checks(convergences: Mapping[str, pd.DataFrame]) -> list[Check]:
    """Compare the fitted orders with the element's."""
    return [
        Check(
            f"{name}: order of {norm}",
            order(errors.index, errors[norm]),
            least,
            "manufactured solution",
            rule="at least",
        )
        for name, errors in convergences.items()
        for norm, least in RATES.items()
    ]


def figure(convergences: Mapping[str, pd.DataFrame]) -> Draw:
    """Plot the errors over the element size."""
    lines = [
        (errors.index, errors[norm], f"{style}C{k}", f"{name}, {norm}")
        for (name, errors), style in zip(convergences.items(), ("o-", "s--"), strict=True)
        for k, norm in enumerate(RATES)
    ]
    return curves(("element size, mm", "relative error"), lines, **LOG)
