"""A bending strip of fascia, and the elements that fail it.

**Bending.** A thin strip of fascia between two of muscle is bent by a displacement of an edge. The
elements that were not chosen are solved for comparison: P2 with a continuous P1 pressure, and P2
with a pressure constant in each element.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import basix.ufl
import numpy as np
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from numpy.typing import NDArray
from petsc4py import PETSc

from calfsocket.forms import mixed
from calfsocket.io.errors import SolveError
from calfsocket.materials.fields import LawFields
from calfsocket.materials.law import Law
from calfsocket.materials.tissues import FASCIA, MUSCLE
from calfsocket.mechanics.constraints import Constraint, constrained_unknowns
from calfsocket.mechanics.newton import Newton
from calfsocket.mechanics.problem import Problem
from calfsocket.meshes.distributed import SectionMesh
from calfsocket.verification.problems import solved
from calfsocket.verification.report import LOG, Check, Curve, Figure, curves
from calfsocket.verification.sampling import Points, at_points
from calfsocket.verification.strips import BOTTOM, LEFT, RIGHT, TOP, strip_mesh

Array = NDArray[Any]

OURS, CONTINUOUS, CONSTANT = "P2 + bubble / P1 discontinuous", "P2 / P1 continuous", "P2 / P0"
ELEMENTS = (OURS, CONTINUOUS, CONSTANT)
LOADS = (0.5, 1.0)


class OtherElement:
    """The same bodies with another pressure, assembled by dolfinx: for this comparison alone.

    Parameters
    ----------
    section : SectionMesh
        The bodies.
    laws : mapping of region name to law
        Their laws.
    constraints : sequence of Constraint
        What is prescribed.
    element : str
        `CONTINUOUS` or `CONSTANT`.
    """

    def __init__(
        self,
        section: SectionMesh,
        laws: Mapping[str, Law],
        constraints: Sequence[Constraint],
        element: str,
    ) -> None:
        domain = section.mesh
        pressure = ("Lagrange", 1, False) if element == CONTINUOUS else ("Lagrange", 0, True)
        family, degree, discontinuous = pressure
        mixed_element = basix.ufl.mixed_element(
            [
                basix.ufl.element("Lagrange", "triangle", 2, shape=(2,)),
                basix.ufl.element(family, "triangle", degree, discontinuous=discontinuous),
            ]
        )
        V = fem.functionspace(domain, mixed_element)
        self.section, self.w, self.load = section, fem.Function(V), 1.0
        self.fields = LawFields(domain, section.cell_tags, section.regions, laws)
        dx = mixed.volume_measure(domain, self.fields.tags)
        self._residual = fem.form(mixed.residual(self.w, self.fields.materials, dx))
        self._tangent = fem.form(mixed.tangent(self.w, self.fields.materials, dx))
        constrained, self._values = constrained_unknowns(V, section, constraints)
        self._at = np.flatnonzero(constrained).astype(np.int32)
        self.right = fem.locate_dofs_topological(
            V.sub(0).sub(0), 1, section.facet_tags.find(section.boundaries[RIGHT])
        )

    def create_vector(self) -> PETSc.Vec:
        """Return a vector of unknowns, zero."""
        return fem_petsc.create_vector(self._residual)

    def create_matrix(self) -> PETSc.Mat:
        """Return a matrix with the tangent's pattern."""
        return fem_petsc.create_matrix(self._tangent)

    def residual(self, x: PETSc.Vec, f: PETSc.Vec) -> None:
        """Residual f at x, in N/mm; constrained unknowns have their distance from their value."""
        self.forces(x, f)
        f.array[self._at] = x.array_r[self._at] - self.load * self._values[self._at]

    def tangent(self, x: PETSc.Vec, A: PETSc.Mat) -> None:
        """Compute the derivative A of the residual at x."""
        self.w.x.array[:] = x.array_r
        A.zeroEntries()
        fem_petsc.assemble_matrix_mat(A, self._tangent)
        A.assemble()
        A.zeroRows(self._at, diag=1.0)

    def stability(self, x: PETSc.Vec, A: PETSc.Mat) -> tuple[PETSc.Mat, int]:
        """Stability is not asked for."""
        raise NotImplementedError

    def forces(self, x: PETSc.Vec, f: PETSc.Vec) -> None:
        """Residual of the tissues alone."""
        self.w.x.array[:] = x.array_r
        f.set(0.0)
        fem_petsc.assemble_vector(f, self._residual)

    def solve(self) -> float:
        """Solve; return the force at the right edge, N/mm."""
        newton = Newton(self)
        for self.load in LOADS:
            result = newton.solve()
            if not result.converged:
                raise SolveError(f"no equilibrium: {result.reason}, {result.residual:.2g} N/mm")
        newton.iterate()
        f = newton.x.duplicate()
        self.forces(newton.x, f)
        return float(f.array_r[self.right].sum())


@dataclass(frozen=True)
class Bending:
    """A fascia strip bent in muscle."""

    force: float  #: force that moves the right edge, N/mm
    deflection: float  #: mean of the squared deflection of the fascia, root, mm


@cache
def bending(element: str, across: int, fascia_across: int = 1, depth: float = 0.6) -> Bending:
    """Bend 1 mm of fascia between strips of muscle, 5 mm each, 24 mm long.

    The left edge is fixed, the upper and lower ones slide along x, and the right edge takes the
    displacement -depth (1 - cos(2 pi y/24))/2 along x and none along y.

    Parameters
    ----------
    element : str
        One of `ELEMENTS`.
    across : int
        Elements in 5 mm of muscle; elements are as long as these are wide.
    fascia_across : int
        Elements across the fascia.
    depth : float
        mm.
    """
    length = 24.0
    section = strip_mesh(
        [("inner", 5.0, across), ("fascia", 1.0, fascia_across), ("outer", 5.0, across)],
        length,
        round(length * across / 5.0),
    )

    def pressed(x: Array) -> Array:
        push = 0.5 * depth * (1.0 - np.cos(2.0 * np.pi * x[1] / length))
        return np.array([-push, 0.0 * push])

    constraints = [Constraint(LEFT), Constraint(BOTTOM, (1,)), Constraint(TOP, (1,))]
    constraints.append(Constraint(RIGHT, values=pressed))
    laws: dict[str, Law] = {"inner": MUSCLE, "fascia": FASCIA, "outer": MUSCLE}
    if element == OURS:
        problem = solved(Problem(section, laws, constraints), LOADS)
        force = float(problem.reaction(RIGHT)[0][0])
        return Bending(force, _deflection(at_points(section, problem.w, problem.fields), section))
    other = OtherElement(section, laws, constraints, element)
    force = other.solve()
    return Bending(force, _deflection(at_points(section, other.w, other.fields), section))


def _deflection(at: Points, section: SectionMesh) -> float:
    fascia = at.region == section.regions["fascia"]
    return float(np.sqrt(np.average(at.u[0, fascia] ** 2, weights=at.weight[fascia])))


def bending_errors(element: str, fine: Bending, across: int = 5) -> tuple[float, float]:
    """Relative errors of force and deflection against a fine solution."""
    coarse = bending(element, across)
    return coarse.force / fine.force - 1.0, coarse.deflection / fine.deflection - 1.0


REFERENCE = (20, 4)
"""Elements across 5 mm of muscle and across 1 mm of fascia in the fine solution."""


def checks(errors: Mapping[str, tuple[float, float]]) -> list[Check]:
    """Check what the element must pass, and what each of the others must fail."""
    source = "the same element, four times as fine"
    force, deflection = errors[OURS]
    found = [
        Check(f"bending, {OURS}: force", force, 1e-5, source),
        Check(f"bending, {OURS}: deflection", deflection, 1e-3, source),
    ]
    for name, which, quantity, wrong in (
        (CONTINUOUS, 0, "force", 50.0),
        (CONSTANT, 1, "deflection", 2.0),
    ):
        off = 100.0 * abs(errors[name][which])
        label = f"bending, {name}: {quantity} off by"
        found.append(Check(label, off, wrong, source, "%", "at least"))
    return found


def figure(fine: Bending) -> Figure:
    """Plot the errors of the three elements over the element size."""
    across, lines = (5, 10), list[Curve]()
    for k, name in enumerate(ELEMENTS):
        bent = [bending(name, n, n // 5) for n in across]
        sizes = [5.0 / n for n in across]
        force = [abs(b.force / fine.force - 1.0) for b in bent]
        deflection = [abs(b.deflection / fine.deflection - 1.0) for b in bent]
        lines.append((sizes, force, f"o-C{k}", f"{name}: force"))
        lines.append((sizes, deflection, f"s--C{k}", "deflection"))
    caption = "A bending fascia: three elements."
    return curves("element_bending", caption, ("element size, mm", "relative error"), lines, **LOG)
