r"""The element by itself: patch test, manufactured solutions, and a fascia strip that bends.

**Patch test.** Strips of tissues side by side, with curved triangles inside, take the compatible
field x -> Q (l_i x + c_i, l y): one stretch l along the strips for all, and across them in each the
stretch l_i at which its law has the common nominal stress P_xx. Its displacement is linear and its
pressure constant in each strip, so that the element must give it to rounding. Q is a rotation.

**Manufactured solutions.** On a quarter ring of curved triangles a displacement of sines is held at
the inner arc, and the body force and tractions that it needs are applied; they are made from
`closed_forms` by a complex step. The displacement is a shear along y after one along x, which keeps
every volume; for the compressible law a swelling is added.

**Bending.** A thin strip of fascia between two of muscle is bent by a displacement of an
edge. The elements that were not taken are solved beside the one that was: P2 with a continuous P1
pressure, and P2 with a pressure constant in each element.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import basix
import basix.ufl
import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from matplotlib.axes import Axes
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from calfsocket.closed_forms import closed_kirchhoff
from calfsocket.errors import SolveError
from calfsocket.forms import mixed
from calfsocket.forms.element import section_element
from calfsocket.laws import Law, Ogden, law_fields, law_tags
from calfsocket.meshes.distributed import SectionMesh, distribute
from calfsocket.meshes.triangles import TriangleMesh
from calfsocket.model import COMPILER_OPTIONS
from calfsocket.solver import Solver
from calfsocket.tissues import FASCIA, MUSCLE, SKIN, material_set
from calfsocket.verification.radial import RingLaw
from calfsocket.verification.report import Check, Figure, Section

FloatArray = NDArray[np.float64]
Array = NDArray[Any]
Field = Callable[[Array], Array]


# -- a body with prescribed displacements and loads -----------------------------------------------


def taylor_hood() -> Any:
    """P2 displacement and continuous P1 pressure."""
    return basix.ufl.mixed_element(
        [
            basix.ufl.element("Lagrange", "triangle", 2, shape=(2,)),
            basix.ufl.element("Lagrange", "triangle", 1),
        ]
    )


def constant_pressure() -> Any:
    """P2 displacement and a pressure constant in each element."""
    return basix.ufl.mixed_element(
        [
            basix.ufl.element("Lagrange", "triangle", 2, shape=(2,)),
            basix.ufl.element("Lagrange", "triangle", 0, discontinuous=True),
        ]
    )


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
        by_tag = {section.regions[name]: law for name, law in laws.items()}
        self.fields = law_fields(domain, section.cell_tags, by_tag)
        dx = mixed.volume_measure(domain, law_tags(domain, section.cell_tags, by_tag))
        self._residual = fem.form(
            mixed.residual(self.w, self.fields, dx), jit_options=COMPILER_OPTIONS
        )
        self._tangent = fem.form(
            mixed.tangent(self.w, self.fields, dx), jit_options=COMPILER_OPTIONS
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

    def stability_tangent(self, x: PETSc.Vec, A: PETSc.Mat) -> None:
        """Tangent of the tissues, symmetric."""
        self._set(x)
        A.zeroEntries()
        fem_petsc.assemble_matrix_mat(A, self._tangent)
        A.assemble()
        A.zeroRowsColumns(self.held, diag=1.0)

    def pressure_unknowns(self) -> int:
        """Return the number of pressure unknowns."""
        return int(self.V.sub(1).collapse()[0].dofmap.index_map.size_global)

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
        p=evaluate(mixed.pressure(p_dof, body.fields))[0],
        weight=area * np.tile(weights, len(cells)),
        region=np.repeat(region, len(points)),
    )


# -- strips ---------------------------------------------------------------------------------------

LEFT, RIGHT, BOTTOM, TOP = "left", "right", "bottom", "top"


def strip_mesh(
    widths: Sequence[tuple[str, float, int]],
    length: float,
    n: int,
    bend: float = 0.0,
    place: Field | None = None,
) -> SectionMesh:
    """Return strips side by side: (region, width in mm, elements across), `length` mm long.

    The strips follow each other along x and run along y, with n elements. All nodes, mid-sides
    too, are moved by `bend` element sizes at most, at random but always the same; those on the
    edges of strips stay, so that triangles are curved inside and not at the edges. `place` moves
    the nodes on, mid-sides too: positions (2, n) -> (2, n).
    """

    def build() -> TriangleMesh:
        x_lines, columns = [0.0], []
        for tag, (_, width, across) in enumerate(widths, start=1):
            x_lines += list(x_lines[-1] + width * np.arange(1, 2 * across + 1) / (2 * across))
            columns += [tag] * across
        x, y = np.array(x_lines), np.linspace(0.0, length, 2 * n + 1)
        nodes = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
        size = min(np.diff(x).min(), np.diff(y).min())
        move = size * bend * np.random.default_rng(1).uniform(-1, 1, nodes.shape)
        edge = 2 * np.cumsum([0, *(across for _, _, across in widths)])
        move[edge] = 0.0
        move[:, [0, -1]] = 0.0
        row = len(y)

        def at(i: Array, j: Array) -> Array:
            return np.asarray(i * row + j)

        i, j = (2 * index.ravel() for index in np.indices((len(columns), n)))
        # Two triangles a box, the diagonal turned from box to box.
        lower = [(0, 0), (2, 0), (2, 2), (1, 0), (2, 1), (1, 1)]
        upper = [(0, 0), (2, 2), (0, 2), (1, 1), (1, 2), (0, 1)]
        turned = (i + j) // 2 % 2 == 1
        cells = []
        for corners in (lower, upper):
            # Turned boxes are mirrored in y, and their nodes taken the other way round.
            mirrored = [(a, 2 - b) for a, b in corners]
            mirrored = [mirrored[k] for k in (0, 2, 1, 5, 4, 3)]
            straight = np.stack([at(i + a, j + b) for a, b in corners], axis=1)
            mirror = np.stack([at(i + a, j + b) for a, b in mirrored], axis=1)
            cells.append(np.where(turned[:, None], mirror, straight))
        tags = np.repeat(np.array(columns, dtype=np.int32), n)
        last = len(x) - 1
        sides = [
            *(((0, 2 * k), (0, 2 * k + 2), (0, 2 * k + 1), 1) for k in range(n)),
            *(((last, 2 * k), (last, 2 * k + 2), (last, 2 * k + 1), 2) for k in range(n)),
            *(((2 * k, 0), (2 * k + 2, 0), (2 * k + 1, 0), 3) for k in range(last // 2)),
            *(
                ((2 * k, row - 1), (2 * k + 2, row - 1), (2 * k + 1, row - 1), 4)
                for k in range(last // 2)
            ),
        ]
        points = (nodes + move).reshape(-1, 2)
        return TriangleMesh(
            points=points if place is None else place(points.T).T,
            cells=np.concatenate(cells).astype(np.int64),
            cell_tags=np.concatenate([tags, tags]),
            facets=np.array([[a * row + b for a, b in side[:3]] for side in sides], dtype=np.int64),
            facet_tags=np.array([side[3] for side in sides], dtype=np.int32),
            regions={name: tag for tag, (name, _, _) in enumerate(widths, start=1)},
            boundaries={LEFT: 1, RIGHT: 2, BOTTOM: 3, TOP: 4},
        )

    return distribute(MPI.COMM_SELF, build)


# -- patch test -----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Patch:
    """Errors of a patch test.

    Attributes
    ----------
    displacement : float
        Largest error over the largest displacement.
    stretch : float
        Largest error of a component of F.
    pressure : float
        Largest error over the largest pressure of the strip.
    """

    displacement: float
    stretch: float
    pressure: float


STIFF_MUSCLE = Ogden(tuple(1e4 * mu for mu in MUSCLE.mu), MUSCLE.alpha, 1e-4 * MUSCLE.d1)


def patch_strips() -> dict[str, list[Law]]:
    """Return strips of the patch tests: modulus ratio 1e4, incompressible, and all tissues."""
    separate = material_set("separate")
    return {
        "muscle beside 1e4 times muscle": [MUSCLE, STIFF_MUSCLE, MUSCLE],
        "incompressible block": [FASCIA],
        "all tissues": list(separate.values()),
    }


def patch_test(
    laws: Sequence[Law], along: float = 0.97, stress: float = -0.002, turn: float = 0.3
) -> Patch:
    """Solve the patch test.

    Parameters
    ----------
    laws : sequence of law
        One a strip.
    along : float
        Stretch along the strips.
    stress : float
        Nominal stress across the strips, MPa; it acts as a traction on the last one.
    turn : float
        Angle by which the whole is turned, rad.
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

    sides = [(side, c, displacement) for side in (LEFT, BOTTOM, TOP) for c in range(2)]
    body = Body(section, dict(zip(names, laws, strict=True)), sides, loads=loads)
    body.solve(steps=2)
    at = at_points(body)
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


# -- manufactured solutions -----------------------------------------------------------------------


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
    `closed_kirchhoff` gives; these, by the trace and determinant of b, are analytic, which the
    complex step in `body_force` needs.
    """
    G = exact.gradient(x)
    F = np.array([[1.0 + G[0, 0], G[0, 1]], [G[1, 0], 1.0 + G[1, 1]]])
    J = F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0]
    b = np.einsum("ik...,jk...->ij...", F, F)
    half, root = 0.5 * (b[0, 0] + b[1, 1]), np.sqrt(0.25 * (b[0, 0] - b[1, 1]) ** 2 + b[0, 1] ** 2)
    squared = np.array([half + root, J**2 / (half + root)])
    tau = closed_kirchhoff(exact.law, np.array([*np.sqrt(squared), np.ones_like(J)]))
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
    """Errors over element sizes.

    Attributes
    ----------
    h : (n,)
        Element sizes, mm.
    errors : dict of str to (n,)
        Relative errors: "u L2", "u H1" (of the gradient) and "p L2".
    """

    h: FloatArray
    errors: dict[str, FloatArray]

    def rate(self, norm: str) -> float:
        """Slope of the error over h, fitted in the logarithms."""
        return float(np.polyfit(np.log(self.h), np.log(self.errors[norm]), 1)[0])


RATES = {"u L2": 2.9, "u H1": 1.9, "p L2": 1.9}
"""Least fitted rates; the element's orders are 3, 2 and 2."""

INNER, OUTER = 8.0, 16.0
DIVISIONS = (6, 8, 12, 16, 24)


def quarter_ring(n: int) -> SectionMesh:
    """Return a quarter of a ring, n elements across; mid-side nodes lie on arcs."""

    def place(x: Array) -> Array:
        radius, angle = INNER + x[0], x[1] / INNER
        return radius * np.array([np.cos(angle), np.sin(angle)])

    return strip_mesh([("ring", OUTER - INNER, n)], 0.5 * np.pi * INNER, 2 * n, place=place)


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
    body = Body(
        section,
        {region: exact.law},
        [(held, c, exact.displacement) for c in range(2)],
        loads=loads,
    )
    # Loads grown in proportion need not lead there, so the solution is looked for where it is.
    body.start_from(exact.displacement, exact.pressure)
    body.solve()
    at = at_points(body)
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


# -- bending --------------------------------------------------------------------------------------

ELEMENTS: dict[str, Callable[[], Any]] = {
    "P2 + bubble / P1 discontinuous": section_element,
    "P2 / P1 continuous": taylor_hood,
    "P2 / P0": constant_pressure,
}


@dataclass(frozen=True)
class Bending:
    """A fascia strip bent in muscle.

    Attributes
    ----------
    force : float
        Force that moves the right edge, N/mm.
    deflection : float
        Mean of the squared deflection of the fascia, root, mm.
    """

    force: float
    deflection: float


@cache
def bending(element: str, across: int, fascia_across: int = 1, depth: float = 0.6) -> Bending:
    """Bend 1 mm of fascia between strips of muscle, 5 mm each, 24 mm long.

    The left edge is held, the upper and lower ones slide along x, and the right edge takes the
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

    def none(x: Array) -> Array:
        return np.zeros_like(x)

    def pressed(x: Array) -> Array:
        push = 0.5 * depth * (1.0 - np.cos(2.0 * np.pi * x[1] / length))
        return np.array([-push, 0.0 * push])

    held: list[tuple[str, int, Field]] = [(LEFT, 0, none), (LEFT, 1, none)]
    held += [(BOTTOM, 1, none), (TOP, 1, none), (RIGHT, 0, pressed), (RIGHT, 1, pressed)]
    laws: dict[str, Law] = {"inner": MUSCLE, "fascia": FASCIA, "outer": MUSCLE}
    body = Body(section, laws, held, element=ELEMENTS[element]())
    body.solve(steps=2)
    at = at_points(body)
    fascia = at.region == section.regions["fascia"]
    weight, u = at.weight[fascia], at.u[0, fascia]
    return Bending(body.reaction(0, RIGHT), float(np.sqrt(np.average(u**2, weights=weight))))


def bending_errors(element: str, fine: Bending, across: int = 5) -> tuple[float, float]:
    """Relative errors of force and deflection against a fine solution."""
    coarse = bending(element, across)
    return coarse.force / fine.force - 1.0, coarse.deflection / fine.deflection - 1.0


# -- report ---------------------------------------------------------------------------------------

OURS, CONTINUOUS, CONSTANT = ELEMENTS
REFERENCE = (20, 4)
"""Elements across 5 mm of muscle and across 1 mm of fascia in the fine solution."""


def report() -> Section:
    """Patch test, rates, and the elements that were not taken."""
    checks = []
    for name, laws in patch_strips().items():
        patch = patch_test(laws)
        checks += [
            Check(f"patch, {name}: displacement", patch.displacement, 1e-12, "", "linear field"),
            Check(f"patch, {name}: pressure", patch.pressure, 1e-10, "", "constant in a strip"),
        ]
    solutions = {"compressible": compressible(), "incompressible": isochoric()}
    rates = {name: convergence(exact) for name, exact in solutions.items()}
    for name, result in rates.items():
        for norm, least in RATES.items():
            short = max(0.0, least - result.rate(norm))
            rate = f"{name}: {norm} at order {result.rate(norm):.2f}, short of {least}"
            checks.append(Check(rate, short, 0.0, "", "manufactured solution"))
    fine = bending(OURS, *REFERENCE)
    errors = {name: bending_errors(name, fine) for name in ELEMENTS}
    source = "the same element, four times as fine"
    checks += [
        Check(f"bending, {OURS}: force", errors[OURS][0], 1e-5, "", source),
        Check(f"bending, {OURS}: deflection", errors[OURS][1], 1e-3, "", source),
    ]
    # What must fail: a deficit of the error from what speaks against the element.
    for name, which, wrong in ((CONTINUOUS, 0, 0.5), (CONSTANT, 1, 0.02)):
        quantity = ("force", "deflection")[which]
        error = errors[name][which]
        label = f"bending, {name}: {quantity} off by {100 * error:+.0f} %, short of {wrong:.0%}"
        checks.append(Check(label, max(0.0, wrong - abs(error)), 0.0, "", source))

    def rate_plot(axes: Axes) -> None:
        for (name, result), style in zip(rates.items(), ("o-", "s--"), strict=True):
            for k, norm in enumerate(RATES):
                axes.loglog(
                    result.h, result.errors[norm], style, color=f"C{k}", label=f"{name}, {norm}"
                )
        axes.set(xlabel="element size, mm", ylabel="relative error")
        axes.legend(fontsize="small")

    def bending_plot(axes: Axes) -> None:
        across = (5, 10)
        for name in ELEMENTS:
            off = [abs(bending(name, n, n // 5).force / fine.force - 1.0) for n in across]
            bent = [abs(bending(name, n, n // 5).deflection / fine.deflection - 1) for n in across]
            sizes = [5.0 / n for n in across]
            (line,) = axes.loglog(sizes, off, "o-", label=f"{name}: force")
            axes.loglog(sizes, bent, "s--", color=line.get_color(), label=f"{name}: deflection")
        axes.set(xlabel="element size, mm", ylabel="relative error")
        axes.legend(fontsize="small")

    return Section(
        "The element",
        __doc__ or "",
        checks,
        [
            Figure("element_rates", rate_plot, "Manufactured solutions on curved triangles."),
            Figure("element_bending", bending_plot, "A bending fascia: three elements."),
        ],
    )
