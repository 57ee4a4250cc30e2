"""Patch test of tissues side by side: displacements linear, pressures constant in each strip."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import ufl

from calfsocket.materials.laws import Law, Ogden
from calfsocket.materials.material_set import MaterialSet
from calfsocket.materials.tissues import FASCIA, MUSCLE
from calfsocket.mechanics.constraints import Constraint
from calfsocket.mechanics.problem import Problem
from calfsocket.verification.problems import solved
from calfsocket.verification.radial import RingLaw
from calfsocket.verification.report import Check
from calfsocket.verification.sampling import Array, at_points
from calfsocket.verification.strips import BOTTOM, LEFT, RIGHT, TOP, strip_mesh


@dataclass(frozen=True)
class Patch:
    """Errors of a patch test."""

    displacement: float  #: largest error over the largest displacement
    stretch: float  #: largest error of a component of F
    pressure: float  #: largest error over the largest pressure of the strip


STIFF_MUSCLE = Ogden(
    mu=tuple(1e4 * mu for mu in MUSCLE.mu), alpha=MUSCLE.alpha, d1=1e-4 * MUSCLE.d1
)


def patch_strips() -> dict[str, list[Law]]:
    """Return strips of the patch tests: modulus ratio 1e4, incompressible, and all tissues."""
    separate = MaterialSet.paper("separate").tissue_laws()
    return {
        "muscle beside 1e4 times muscle": [MUSCLE, STIFF_MUSCLE, MUSCLE],
        "incompressible block": [FASCIA],
        "all tissues": list(separate.values()),
    }


def patch_test(
    laws: Sequence[Law], along: float = 0.97, stress: float = -0.002, turn: float = 0.3
) -> Patch:
    """Solve the patch test of strips with these laws.

    They are stretched by `along`; the nominal `stress` across them, MPa, acts as a traction on the
    last one; the whole is turned by `turn`, rad.
    """
    names = [f"strip_{k}" for k in range(len(laws))]
    section = strip_mesh([(name, 2.0, 2) for name in names], 4.0, 4, bend=0.15)
    across, pressures = [], []
    for law in laws:
        reduced = RingLaw(law)
        P, hoop = np.array([stress]), np.array([along], dtype=np.longdouble)
        radial = reduced.radial_stretch(P, hoop)
        sigma = reduced.cauchy(P, radial, hoop)[:, 0]
        across.append(float(radial[0]))
        # Isochoric stress has no trace.
        pressures.append(float(sigma.sum()) / 3.0)
    edges = 2.0 * np.arange(len(laws) + 1)
    moved = np.concatenate([[0.0], np.cumsum(2.0 * np.array(across))])
    Q = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])

    def displacement(x: Array) -> Array:
        return np.asarray(Q @ np.array([np.interp(x[0], edges, moved), along * x[1]]) - x)

    def loads(v: Any) -> ufl.Form:
        ds = ufl.Measure("ds", section.mesh, subdomain_data=section.facet_tags)
        traction = ufl.as_vector([stress * Q[0, 0], stress * Q[1, 0]])
        return ufl.inner(traction, v) * ds(section.boundaries[RIGHT])

    sides = [Constraint(side, values=displacement) for side in (LEFT, BOTTOM, TOP)]
    problem = Problem(section, dict(zip(names, laws, strict=True)), sides, [loads])
    solved(problem, (0.5, 1.0))
    at = at_points(section, problem.w, problem.fields)
    u = displacement(at.x)
    strip = at.region - 1
    F = np.array(across)[strip] * np.outer(Q[:, 0], [1, 0])[:, :, None]
    F = F + along * np.outer(Q[:, 1], [0, 1])[:, :, None]
    p = np.array(pressures)[strip]
    return Patch(
        float(np.abs(at.u - u).max() / np.abs(u).max()),
        float(np.abs(at.F - F).max()),
        float(np.abs(at.p / p - 1.0).max()),
    )


def checks() -> list[Check]:
    """Measure every patch."""
    patches = {f"patch, {name}": patch_test(laws) for name, laws in patch_strips().items()}
    return [
        check
        for name, patch in patches.items()
        for check in (
            Check(f"{name}: displacement", patch.displacement, 1e-12, "linear field"),
            Check(f"{name}: pressure", patch.pressure, 1e-10, "constant in a strip"),
        )
    ]
