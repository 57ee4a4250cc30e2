"""A bending strip of fascia, and the elements that fail it."""

from collections.abc import Mapping, Sequence
from functools import cache
from typing import NamedTuple

import basix.ufl
import numpy as np
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
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
from calfsocket.verification.report import LOG, Check, Curve, Draw, curves
from calfsocket.verification.sampling import Array, at_points
from calfsocket.verification.strips import BOTTOM, LEFT, RIGHT, TOP, strip_mesh

OURS, CONTINUOUS, CONSTANT = "P2 + bubble / P1 discontinuous", "P2 / P1 continuous", "P2 / P0"
ELEMENTS = (OURS, CONTINUOUS, CONSTANT)
PRESSURES = {
    CONTINUOUS: basix.ufl.element("Lagrange", "triangle", 1),
    CONSTANT: basix.ufl.element("Lagrange", "triangle", 0, discontinuous=True),
}
LOADS = (0.5, 1.0)


class OtherElement:
    """A `System` of the same bodies with one of `PRESSURES`, for this comparison alone."""

    def __init__(
        self,
        section: SectionMesh,
        laws: Mapping[str, Law],
        constraints: Sequence[Constraint],
        element: str,
    ) -> None:
        domain = section.mesh
        displacement = basix.ufl.element("Lagrange", "triangle", 2, shape=(2,))
        V = fem.functionspace(domain, basix.ufl.mixed_element([displacement, PRESSURES[element]]))
        self.w, self.load = fem.Function(V), 1.0
        self.fields = LawFields(domain, section.cell_tags, section.regions, laws)
        dx = mixed.volume_measure(domain, self.fields.tags)
        self._residual = fem.form(mixed.residual(self.w, self.fields.materials, dx))
        self._tangent = fem.form(mixed.tangent(self.w, self.fields.materials, dx))
        constrained, self._values = constrained_unknowns(V, section, constraints)
        self._at = np.flatnonzero(constrained).astype(np.int32)
        facets = section.facet_tags.find(section.boundaries[RIGHT])
        self._right = fem.locate_dofs_topological(V.sub(0).sub(0), 1, facets)

    def create_vector(self) -> PETSc.Vec:
        """Return a vector of unknowns, zero."""
        return fem_petsc.create_vector(self._residual)

    def create_matrix(self) -> PETSc.Mat:
        """Return a matrix with the tangent's pattern."""
        return fem_petsc.create_matrix(self._tangent)

    def residual(self, x: PETSc.Vec, f: PETSc.Vec) -> None:
        """Residual f at x, in N/mm; constrained unknowns have their distance from their value."""
        self._forces(x, f)
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

    def _forces(self, x: PETSc.Vec, f: PETSc.Vec) -> None:
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
        self._forces(newton.x, f)
        return float(f.array_r[self._right].sum())


class Bending(NamedTuple):
    """A fascia strip bent in muscle."""

    force: float  #: force that moves the right edge, N/mm
    deflection: float  #: mean of the squared deflection of the fascia, root, mm


@cache
def bending(element: str, across: int) -> Bending:
    """Bend 1 mm of fascia between strips of muscle, 5 mm each, 24 mm long.

    The left edge is fixed, the upper and lower ones slide along x, and the right edge takes the
    displacement -d (1 - cos(2 pi y/24))/2 along x, d = 0.6 mm, and none along y. There are `across`
    elements in 5 mm of muscle, as long as wide, and a fifth as many across the fascia.
    """
    length, depth = 24.0, 0.6
    section = strip_mesh(
        [("inner", 5.0, across), ("fascia", 1.0, across // 5), ("outer", 5.0, across)],
        length,
        round(length * across / 5.0),
    )

    def pressed(x: Array) -> Array:
        push = 0.5 * depth * (1.0 - np.cos(2.0 * np.pi * x[1] / length))
        return np.array([-push, 0.0 * push])

    constraints = [Constraint(LEFT), Constraint(BOTTOM, (1,)), Constraint(TOP, (1,))]
    constraints.append(Constraint(RIGHT, values=pressed))
    laws: dict[str, Law] = {"inner": MUSCLE, "fascia": FASCIA, "outer": MUSCLE}
    model: Problem | OtherElement
    if element == OURS:
        model = solved(Problem(section, laws, constraints), LOADS)
        force = float(model.reaction(RIGHT)[0][0])
    else:
        model = OtherElement(section, laws, constraints, element)
        force = model.solve()
    at = at_points(section, model.w, model.fields)
    fascia = at.region == section.regions["fascia"]
    square = np.average(at.u[0, fascia] ** 2, weights=at.weight[fascia])
    return Bending(force, float(np.sqrt(square)))


def bending_errors(element: str, fine: Bending, across: int = 5) -> Bending:
    """Relative errors of force and deflection against a fine solution."""
    return Bending(*np.divide(bending(element, across), fine) - 1.0)


REFERENCE = 20
"""Elements across 5 mm of muscle in the fine solution."""


def checks(errors: Mapping[str, Bending]) -> list[Check]:
    """Check what the element must pass, and what each of the others must fail."""
    source, ours = "the same element, four times as fine", errors[OURS]
    force, deflection = (
        100.0 * abs(errors[CONTINUOUS].force),
        100.0 * abs(errors[CONSTANT].deflection),
    )
    return [
        Check(f"bending, {OURS}: force", ours.force, 1e-5, source),
        Check(f"bending, {OURS}: deflection", ours.deflection, 1e-3, source),
        Check(f"bending, {CONTINUOUS}: force off by", force, 50.0, source, "%", "at least"),
        Check(f"bending, {CONSTANT}: deflection off by", deflection, 2.0, source, "%", "at least"),
    ]


def figure(fine: Bending) -> Draw:
    """Plot the errors of the three elements over the element size."""
    across, lines = np.array([5, 10]), list[Curve]()
    for k, name in enumerate(ELEMENTS):
        force, deflection = np.abs([bending_errors(name, fine, int(n)) for n in across]).T
        lines.append((5.0 / across, force, f"o-C{k}", f"{name}: force"))
        lines.append((5.0 / across, deflection, f"s--C{k}", "deflection"))
    return curves(("element size, mm", "relative error"), lines, **LOG)
