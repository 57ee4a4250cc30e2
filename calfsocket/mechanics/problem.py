"""Bodies in equilibrium: mesh, laws, constraints, loads and contact, as residual and tangent."""

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import ufl
from dolfinx import fem, la
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from calfsocket.contact.active_set import ActiveSet
from calfsocket.contact.interface import ContactInterface, ContactPair
from calfsocket.contact.nitsche import ContactState
from calfsocket.contact.parameters import Contact
from calfsocket.forms.element import section_element
from calfsocket.forms.kinematics import deformation_gradient
from calfsocket.io.fenics import cell_nodes, evaluate
from calfsocket.materials.fields import LawFields
from calfsocket.materials.law import Law
from calfsocket.materials.stress_free import StressFreeState
from calfsocket.mechanics.bodies import Body
from calfsocket.mechanics.carrier import COMPONENTS, Carrier
from calfsocket.mechanics.condensation import CondensedTangent
from calfsocket.mechanics.constraints import Constraint, constrained_unknowns
from calfsocket.mechanics.even_load import EvenLoad
from calfsocket.mechanics.foundation import Foundation, FoundationTerm
from calfsocket.mechanics.frame import RigidFrame
from calfsocket.mechanics.kernels.cells import CellLoops, quadrature
from calfsocket.mechanics.layout import Layout
from calfsocket.meshes.distributed import SectionMesh
from calfsocket.meshes.quality import determinant

FloatArray = NDArray[np.float64]
Load = Callable[[Any], ufl.Form]
"""Makes the form of an external load, N/mm, from the test function of the displacement."""

TISSUE_RESIDUAL = PETSc.Log.Event("TissueResidual")

LARGEST_BULK_RATIO = 1e3
"""Ratio K/mu up to which a cell's constant pressure is eliminated from the linear system.

It is exact at any ratio; the condensed matrix then has stiffnesses of this ratio side by side."""


@dataclass(frozen=True)
class Site:
    """A region, and the middle of a cell in it, mm in the undeformed section."""

    region: str
    x_mm: float
    y_mm: float

    def __str__(self) -> str:
        return f"{self.region} at ({self.x_mm:.1f}, {self.y_mm:.1f}) mm"


class Problem:
    """Residual and tangent of bodies with laws, constraints and loads, in PETSc's terms.

    Parameters
    ----------
    section : SectionMesh
        The bodies in one mesh, distributed over a communicator.
    laws : mapping of region name to law
        The law of each region.
    constraints : sequence of Constraint
        What is prescribed on boundaries; where two of them meet the first one counts.
    loads : sequence of callable
        External loads at full load, which grow in proportion to it.
    contact : ContactPair, optional
        Boundaries that may touch.
    foundation : Foundation, optional
        An elastic foundation.

    Attributes
    ----------
    V : fem.FunctionSpace
        Space of `forms.element.section_element`.
    w : fem.Function
        Displacement (mm) and scaled pressure.
    fields : LawFields
        Parameters of the laws, and where each kind of law is.
    constrained : (n,) int
        Owned unknowns that are constrained.
    prescribed : (n,) float
        Values of all local unknowns at full load; those of constrained ones count.
    foundation : FoundationTerm or None
        The foundation.
    carrier : Carrier or None
        What carries a boundary: a rigid frame, or an even load.
    """

    def __init__(
        self,
        section: SectionMesh,
        laws: Mapping[str, Law],
        constraints: Sequence[Constraint] = (),
        loads: Sequence[Load] = (),
        contact: ContactPair | None = None,
        foundation: Foundation | None = None,
    ) -> None:
        self.section = section
        self.region_laws = dict(laws)
        domain = section.mesh
        self.comm: MPI.Comm = domain.comm
        self.V = fem.functionspace(domain, section_element())
        self.w = fem.Function(self.V, name="displacement_and_pressure")
        self.fields = LawFields(domain, section.cell_tags, section.regions, laws)
        self.foundation = FoundationTerm(foundation, section, self.V) if foundation else None
        self._tissues = CellLoops(
            self.w,
            self.fields,
            (self.foundation.stiffness, self.foundation.anchor) if self.foundation else None,
        )
        index_map = self.V.dofmap.index_map
        self._b = PETSc.Vec().createGhost(
            index_map.ghosts.astype(PETSc.IntType),
            (index_map.size_local, index_map.size_global),
            comm=self.comm,
        )
        self._constrained, self.prescribed = constrained_unknowns(self.V, section, constraints)
        self.constrained = np.flatnonzero(self._constrained[: self.V.dofmap.index_map.size_local])
        self._has_values = any(constraint.values is not None for constraint in constraints)
        self._external = self._assemble_loads(loads)
        self._contact: ContactInterface | None = None
        if contact is not None:
            self._contact = contact.kind(self.w, section, laws, self.fields, contact)
        self.carrier: Carrier | None = None
        self._layout: Layout | None = None
        self._expressions: dict[str, tuple[Hashable, fem.Expression]] = {}
        self._load = 0.0

    def restart(self, laws: Mapping[str, Law], contact: Contact | None = None) -> None:
        """Go back to where it was made, with other numbers in laws and contact (collective).

        What depends on the geometry alone stays: spaces, compiled expressions, the interface and
        the layout of the tangent, so that Newton's method, which must be made anew, finds it
        analysed. Stress-free states are those of the reference again.

        Raises
        ------
        ValueError
            If a region would change its kind of law, or a carrier has a boundary.
        """
        if self.carrier is not None:
            raise ValueError("a problem with a carrier cannot go back to where it was made")
        self.fields.stress_free.clear()
        self.set_laws(laws)
        self.w.x.array[:] = 0.0
        if self.foundation is not None:
            self.foundation.rest(self.w.x.array)
        if self._contact is not None:
            self._contact.restart(contact or self._contact.parameters)
        self.load = 0.0

    @property
    def contact(self) -> ContactInterface:
        """Contact between the bodies.

        Raises
        ------
        ValueError
            If the problem has none.
        """
        if self._contact is None:
            raise ValueError("the problem has no contact")
        return self._contact

    @property
    def has_contact(self) -> bool:
        """Whether bodies may touch."""
        return self._contact is not None

    @property
    def load(self) -> float:
        """Share of all that grows with the load, 0 to 1."""
        return self._load

    @load.setter
    def load(self, load: float) -> None:
        self._load = load
        if self._contact is not None:
            self._contact.load = load
        if self.foundation is not None:
            self.foundation.set_load(load)
        self.fields.stress_free.set_load(load)

    def set_stress_free(self, states: Mapping[str, StressFreeState]) -> None:
        """Change the stress-free states of regions (collective).

        They grow in proportion to the load; at the full load, they are what is given at once. The
        volume ratio 1 takes a region back to where it is stress free in the undeformed section.

        Parameters
        ----------
        states : mapping of region name to StressFreeState
            A volume ratio, or in-plane tensors G at positions. Other regions keep theirs.

        Raises
        ------
        ValueError
            If there is no such region, or no volume would be left of it.
        """
        self.fields.stress_free.set_load(self._load)
        self.fields.stress_free.set(states)

    def set_laws(self, laws: Mapping[str, Law]) -> None:
        """Change the parameters of the laws of regions; nothing is compiled again.

        Raises
        ------
        ValueError
            If a region would change its kind of law.
        """
        self.fields.set_laws(laws)
        # A new mapping: callers keep the earlier one to go back to it.
        self.region_laws = {**self.region_laws, **laws}

    def carry(self, boundary: str, evenly: bool = False) -> Carrier:
        """Let a rigid frame or an even load carry a boundary from now on, as it is (collective).

        Vectors and matrices then have its three unknowns, so that Newton's method must be made
        anew.
        """
        kind = EvenLoad if evenly else RigidFrame
        self.carrier = carrier = kind(self.V, self.section, boundary, self.w.x.array)
        owned = self.V.dofmap.index_map.size_local
        self._constrained[carrier.constrained] = True
        self.constrained = np.flatnonzero(self._constrained[:owned])
        return carrier

    # -- history of friction --------------------------------------------------------------------

    @property
    def slip_history(self) -> FloatArray:
        """Place from which the slip of each skin point counts, mm; empty without contact."""
        return np.zeros(0) if self._contact is None else self._contact.converged_arc

    @slip_history.setter
    def slip_history(self, arc: FloatArray) -> None:
        if self._contact is not None:
            self._contact.converged_arc = arc

    def accept(self) -> None:
        """Take the slip so far as done; tractions stay what they are (collective)."""
        if self._contact is not None:
            self._contact.accept()

    def revert(self) -> None:
        """Take the last `accept` back."""
        if self._contact is not None:
            self._contact.revert()

    @property
    def active_set(self) -> ActiveSet | None:
        """Active set of contact; None without contact."""
        return None if self._contact is None else self._contact.active_set

    # -- for Newton's method --------------------------------------------------------------------

    def create_vector(self) -> PETSc.Vec:
        """Return a vector of unknowns, zero, without ghosts (collective)."""
        x = PETSc.Vec().createMPI(self._size, comm=self.comm)
        x.set(0.0)
        return x

    @property
    def _size(self) -> tuple[int, int]:
        """Unknowns of this rank and of all."""
        index_map = self.V.dofmap.index_map
        mine, every = (self.carrier.extra, COMPONENTS) if self.carrier else (0, 0)
        return index_map.size_local + mine, index_map.size_global + every

    def create_matrix(self) -> PETSc.Mat:
        """Return the tangent as a matrix of PETSc's that also solves (collective).

        Its Python context is the `CondensedTangent`; its values are those of the last `tangent`.
        """
        parts: dict[str, Any] = {
            "tissues": self._tissues,
            "constrained": self._constrained,
            "keeps_constant": self._keeps_constant(),
            "contact": self._contact,
        }
        condensed = (
            self.carrier.tangent(self.V, **parts)
            if self.carrier
            else CondensedTangent(self.V, **parts, prescribed=self._has_values, layout=self._layout)
        )
        if self._layout is None and not self.carrier:
            self._layout = condensed.layout
        size = self._size
        return PETSc.Mat().createPython((size, size), condensed, comm=self.comm)

    def _keeps_constant(self) -> NDArray[np.bool_]:
        """Local cells too stiff in volume to take their constant pressure out of the system."""
        inverse_ratio = self.fields.inverse_bulk.x.array * self.fields.pressure_scale.x.array
        return np.asarray(inverse_ratio < 1.0 / LARGEST_BULK_RATIO)

    def residual(self, x: PETSc.Vec, f: PETSc.Vec) -> None:
        """Residual in N/mm; constrained unknowns have their distance from their value (collective).

        Newton's method may overshoot to unknowns that are not finite; the residual is not either,
        then, which the line search understands.
        """
        if not np.isfinite(x.norm()):
            f.set(np.nan)
            return
        self._assemble_residual(x)
        b, values = self._b.array_r, f.array
        values[: len(b)] = b
        at = self.constrained
        values[at] = x.array_r[at] - self._load * self.prescribed[at]
        if self.carrier is not None:
            self.carrier.add_to(values, x.array_r, b)

    def tangent(self, x: PETSc.Vec, A: PETSc.Mat) -> None:
        """Exact derivative of `residual` (collective)."""
        self.set_unknowns(x)
        condensed = A.getPythonContext()
        condensed.keep(self._keeps_constant())
        condensed.assemble(self._contact.tangent() if self._contact is not None else None)
        if self.carrier is not None:
            self._assemble_residual(x)  # its forces turn with it
            condensed.assemble_border(self._b.array_r)
        A.assemble()

    def stability(self, x: PETSc.Vec, A: PETSc.Mat) -> tuple[PETSc.Mat, int]:
        """Condensed tangent of the tissues with contact as a constraint (collective)."""
        self.set_unknowns(x)
        condensed = A.getPythonContext()
        condensed.keep(self._keeps_constant())
        condensed.assemble(
            self._contact.constraint_tangent() if self._contact is not None else None
        )
        pressures = 3 * self.section.mesh.topology.index_map(2).size_global
        expected = pressures - condensed.negative_inside()
        if self.carrier is not None:  # its modes are not in the matrix
            self._assemble_residual(x)
            condensed.assemble_border(self._b.array_r)
            expected -= condensed.negative_of_carrier()
        return condensed.matrix, expected

    def set_unknowns(self, x: PETSc.Vec) -> None:
        """Copy a vector into `w`, ghosts included (collective)."""
        owned = self.V.dofmap.index_map.size_local
        self.w.x.array[:owned] = x.array_r[:owned]
        self.w.x.scatter_forward()
        if self.carrier is not None:
            self.carrier.take(x)

    # -- what a converged state shows -----------------------------------------------------------

    def body(self, regions: Sequence[str] | None = None) -> Body:
        """Return the displacement unknowns of regions, or of all (collective)."""
        return Body.of(self.V, self.section, list(self.section.regions if not regions else regions))

    @property
    def bodies_residual(self) -> FloatArray:
        """Owned values of the last residual, with the forces that hold constrained unknowns."""
        return np.array(self._b.array_r)

    def reaction(self, boundary: str) -> tuple[FloatArray, float]:
        """Force and torque that hold a constrained boundary, at the last residual (collective).

        Returns
        -------
        force, torque : (2,) float, float
            N per mm, and N mm per mm about the origin at the deformed positions.
        """
        section = self.section
        body = self.body()
        facets = section.facet_tags.find(section.boundaries[boundary])
        there = fem.locate_dofs_topological(self.V.sub(0).sub(0), 1, facets)
        owned = np.isin(body.dofs[:, 0], there[there < self.V.dofmap.index_map.size_local])
        dofs = body.dofs[owned]
        # The residual at a constrained unknown is the force that holds it.
        force = self._b.array_r[dofs]
        position = body.reference[owned] + self.w.x.array[dofs]
        torque = position[:, 0] @ force[:, 1] - position[:, 1] @ force[:, 0]
        total = self.comm.allreduce(np.array([*force.sum(axis=0), torque]))
        return total[:2], float(total[2])

    def force_balance(self, x: PETSc.Vec, boundary: str) -> tuple[float, float]:
        """Compare the contact force on the skin with the reaction of what holds it (collective).

        At the equilibrium x; the constrained boundary holds the body of the skin.

        Returns
        -------
        imbalance, pressing : float
            |contact force on the skin + reaction at the boundary| and the integral of the contact
            pressure over the skin, both in N per mm of limb length.
        """
        state = self._assemble_residual(x)
        assert state is not None
        force, pressing = self.contact.force(state)
        return float(np.linalg.norm(force + self.reaction(boundary)[0])), pressing

    def evaluate(
        self,
        name: str,
        make: Callable[[], Any],
        points: FloatArray,
        cells: NDArray[np.int32],
        of: Hashable = None,
    ) -> FloatArray:
        """Evaluate an expression at points of cells, as `io.fenics.evaluate` does (collective).

        It is made and compiled when a name is first evaluated, and again when it is made `of`
        something else.
        """
        known = self._expressions.get(name)
        if known is None or known[0] != of:
            known = of, fem.Expression(make(), points, comm=self.comm)
            self._expressions[name] = known
        return evaluate(known[1], self.section.mesh, cells)

    def elastic_gradients(self) -> FloatArray:
        """In-plane Fe = F G^-1 at the quadrature points of the owned cells (collective).

        Of shape (m, q, 2, 2); F itself where no region has a stress-free state G of its own.
        """
        points = quadrature()[0]
        cells = np.arange(self.section.mesh.topology.index_map(2).size_local, dtype=np.int32)
        gradients = self.evaluate(
            "F", lambda: deformation_gradient(ufl.split(self.w)[0]), points, cells
        )
        gradients = gradients.reshape(len(cells), len(points), 2, 2)
        state = self.fields.stress_free
        return gradients if state.tensor is None else gradients @ np.linalg.inv(state.at(points))

    def smallest_volume_ratio(self) -> tuple[float, str]:
        """Smallest elastic J = det Fe of all quadrature points, and its region (collective)."""
        J = determinant(self.elastic_gradients())
        value, site = self.smallest(J.min(axis=1, initial=np.inf))
        return value, site.region

    def least_balanced_region(self, x: PETSc.Vec) -> str:
        """Region with the largest residual, or one that is not finite, at `x` (collective)."""
        self._assemble_residual(x)
        residual = fem.Function(self.V)
        owned = len(self._b.array_r)
        residual.x.array[:owned] = np.abs(np.nan_to_num(self._b.array_r, nan=np.inf))
        residual.x.array[self.constrained] = 0.0
        residual.x.scatter_forward()
        cells = self.section.mesh.topology.index_map(2).size_local
        in_cell = residual.x.array[self.V.dofmap.list[:cells]].max(axis=1, initial=0.0)
        return self.smallest(-in_cell)[1].region

    def smallest(self, cell_values: FloatArray) -> tuple[float, "Site"]:
        """Smallest of a value per owned cell, and where it is (collective)."""
        mine = (np.inf, 0, 0.0, 0.0)
        if len(cell_values):
            cell = int(np.argmin(cell_values))
            mesh = self.section.mesh
            x, y, _ = mesh.geometry.x[cell_nodes(mesh)[cell, :3]].mean(axis=0)
            region = int(self.section.cell_regions()[cell])
            mine = (float(cell_values[cell]), region, float(x), float(y))
        value, tag, x, y = min(self.comm.allgather(mine))
        names = {number: name for name, number in self.section.regions.items()}
        return value, Site(names[tag], x, y)

    # -- assembly -------------------------------------------------------------------------------

    def _assemble_residual(self, x: PETSc.Vec) -> ContactState | None:
        self.set_unknowns(x)
        with TISSUE_RESIDUAL:
            with self._b.localForm() as local:
                local.set(0.0)
                self._tissues.add_residuals(local.array_w)
            self._b.ghostUpdate(PETSc.InsertMode.ADD_VALUES, PETSc.ScatterMode.REVERSE)
        if self._external is not None:
            self._b.array[:] -= self._load * self._external
        return self._contact.add_residual(self._b) if self._contact is not None else None

    def _assemble_loads(self, loads: Sequence[Load]) -> FloatArray | None:
        """Assemble the forces of all loads at the owned unknowns, N/mm (collective)."""
        if not loads:
            return None
        v = ufl.TestFunctions(self.V)[0]
        total = fem.assemble_vector(fem.form(sum(load(v) for load in loads)))
        total.scatter_reverse(la.InsertMode.add)
        return np.array(total.array[: self.V.dofmap.index_map.size_local])
