"""Tissues without contact: a body with prescribed displacements and loads."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import basix
import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from numpy.typing import NDArray
from petsc4py import PETSc

from calfsocket.forms import mixed
from calfsocket.forms.element import section_element
from calfsocket.io.errors import SolveError
from calfsocket.materials.fields import LawFields
from calfsocket.materials.law import Law
from calfsocket.mechanics.kernels.library import JIT_OPTIONS
from calfsocket.mechanics.newton import Solver
from calfsocket.meshes.distributed import SectionMesh

FloatArray = NDArray[np.float64]
Array = NDArray[Any]
Field = Callable[[Array], Array]


class Body:
    """Tissues without contact: a `solver.Problem` of the forms and laws of the program.

    Parameters
    ----------
    section : SectionMesh
        Its regions have laws.
    laws : dict of region name to law
        The laws.
    held : list of (boundary, component, field)
        Where a displacement component has the values of a field of positions (2, n) -> (2, n), mm.
    element
        Mixed element; the program's own unless given.
    loads : callable, optional
        Makes the form of the external loads from the test function of the displacement.
    """

    def __init__(
        self,
        section: SectionMesh,
        laws: dict[str, Law],
        held: Sequence[tuple[str, int, Field]],
        element: Any = None,
        loads: Callable[[Any], ufl.Form] | None = None,
    ) -> None:
        domain = section.mesh
        self.section = section
        self.V = fem.functionspace(domain, section_element() if element is None else element)
        self.w = fem.Function(self.V)
        self.fields = LawFields(domain, section.cell_tags, section.regions, laws)
        dx = mixed.volume_measure(domain, self.fields.tags)
        self._residual, self._tangent = (
            fem.form(form(self.w, self.fields.materials, dx), jit_options=JIT_OPTIONS)
            for form in (mixed.residual, mixed.tangent)
        )
        self._load = np.zeros_like(self.w.x.array)
        if loads is not None:
            form = fem.form(loads(ufl.TestFunctions(self.V)[0]))
            self._load = fem.assemble_vector(form).array.copy()
        held_dofs, values = [], []
        for boundary, component, field in held:
            facets = section.facet_tags.find(section.boundaries[boundary])
            space = self.V.sub(0).sub(component)
            collapsed, _ = space.collapse()
            value = fem.Function(collapsed)
            value.interpolate(lambda x, c=component, f=field: f(x[:2])[c])
            dofs = fem.locate_dofs_topological((space, collapsed), 1, facets)
            held_dofs.append(dofs[0])
            values.append(value.x.array[dofs[1]])
        self.held, first = np.unique(np.concatenate(held_dofs), return_index=True)
        self.prescribed = np.concatenate(values)[first]
        self._b = fem_petsc.create_vector(self._residual)
        self.share = 1.0

    def solve(self, steps: int = 1) -> None:
        """Solve from the present `w`, with loads and displacements grown in steps."""
        solver = Solver(self)
        solver.x.array[:] = self.w.x.array
        for step in range(steps):
            self.share = (step + 1) / steps
            result = solver.solve()
            if not result.converged:
                raise SolveError(f"no equilibrium: {result.reason} at {result.residual:.2g} N/mm")
        self._correct(solver.x)
        self._set(solver.x)

    def start_from(self, displacement: Field, pressure: Field) -> None:
        """Put fields of positions (2, n) into `w`; mm and MPa."""
        scale = self.fields.pressure_scale.x.array[0]
        self.w.sub(0).interpolate(lambda x: displacement(x[:2]))
        self.w.sub(1).interpolate(lambda x: pressure(x[:2]) / scale)

    def reaction(self, component: int, boundary: str) -> float:
        """Force that holds a boundary, N per mm."""
        facets = self.section.facet_tags.find(self.section.boundaries[boundary])
        dofs = fem.locate_dofs_topological(self.V.sub(0).sub(component), 1, facets)
        self._assemble()
        return float(self._b.array_r[dofs].sum())

    def create_vector(self) -> PETSc.Vec:
        """Return a vector of unknowns, zero."""
        x = self._b.duplicate()
        x.set(0.0)
        return x

    def create_matrix(self) -> PETSc.Mat:
        """Return a matrix with the tangent's pattern."""
        A = fem_petsc.create_matrix(self._tangent)
        A.setOption(PETSc.Mat.Option.KEEP_NONZERO_PATTERN, True)
        return A

    def residual(self, x: PETSc.Vec, f: PETSc.Vec) -> None:
        """Residual f at x, in N/mm; held unknowns have their distance from what they should be."""
        self._set(x)
        self._assemble()
        self._b.copy(f)
        f.array[self.held] = x.array_r[self.held] - self.share * self.prescribed

    def tangent(self, x: PETSc.Vec, A: PETSc.Mat) -> None:
        """Compute the derivative A of the residual at x."""
        self._set(x)
        A.zeroEntries()
        fem_petsc.assemble_matrix_mat(A, self._tangent)
        A.assemble()
        # Rows alone: what a prescribed displacement does to its neighbours stays in the columns.
        A.zeroRows(self.held, diag=1.0)

    def stability(self, x: PETSc.Vec, A: PETSc.Mat) -> tuple[PETSc.Mat, int]:
        """Tangent of the tissues, symmetric, and the number of pressure unknowns."""
        self._set(x)
        A.zeroEntries()
        fem_petsc.assemble_matrix_mat(A, self._tangent)
        A.assemble()
        A.zeroRowsColumns(self.held, diag=1.0)
        return A, int(self.V.sub(1).collapse()[0].dofmap.index_map.size_global)

    def _correct(self, x: PETSc.Vec) -> None:
        """One Newton iteration more: the program's tolerance, 1e-9 N/mm, is not yet rounding."""
        A, f, change = self.create_matrix(), x.duplicate(), x.duplicate()
        self.residual(x, f)
        self.tangent(x, A)
        ksp = PETSc.KSP().create(x.getComm())
        ksp.setOperators(A)
        ksp.setType(PETSc.KSP.Type.PREONLY)
        ksp.getPC().setType(PETSc.PC.Type.LU)
        ksp.getPC().setFactorSolverType("mumps")
        ksp.solve(f, change)
        x.axpy(-1.0, change)

    def _set(self, x: PETSc.Vec) -> None:
        self.w.x.array[:] = x.array_r

    def _assemble(self) -> None:
        with self._b.localForm() as local:
            local.set(0.0)
        fem_petsc.assemble_vector(self._b, self._residual)
        self._b.array[:] -= self.share * self._load


@dataclass(frozen=True)
class Points:
    """A solved body at the quadrature points of its cells.

    Attributes
    ----------
    x, u : (2, n)
        Position and displacement, mm.
    F : (2, 2, n)
        Deformation gradient.
    p : (n,)
        Pressure, MPa, > 0 in tension.
    weight : (n,)
        Quadrature weight times area element, mm^2.
    region : (n,)
        Region tag.
    """

    x: FloatArray
    u: FloatArray
    F: FloatArray
    p: FloatArray
    weight: FloatArray
    region: NDArray[np.int32]


def at_points(body: Body, degree: int = 8) -> Points:
    """Evaluate a body at the points of a quadrature rule of some degree."""
    domain = body.section.mesh
    points, weights = map(np.asarray, basix.make_quadrature(basix.CellType.triangle, degree))
    cells = np.arange(domain.topology.index_map(2).size_local, dtype=np.int32)
    u, p_dof = ufl.split(body.w)

    def evaluate(expression: Any) -> Array:
        values = fem.Expression(expression, points, comm=domain.comm).eval(domain, cells)
        return np.asarray(values).reshape(len(cells) * len(points), -1).T

    area = np.abs(evaluate(ufl.JacobianDeterminant(domain))[0])
    region = np.zeros(len(cells), dtype=np.int32)
    region[body.section.cell_tags.indices] = body.section.cell_tags.values
    return Points(
        x=evaluate(ufl.SpatialCoordinate(domain)),
        u=evaluate(u),
        F=evaluate(ufl.Identity(2) + ufl.grad(u)).reshape(2, 2, -1),
        p=evaluate(mixed.pressure(p_dof, body.fields.pressure_scale))[0],
        weight=area * np.tile(weights, len(cells)),
        region=np.repeat(region, len(points)),
    )
