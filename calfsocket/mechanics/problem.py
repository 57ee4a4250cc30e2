"""A case made discrete: mesh, spaces, tissues and contact, as residual and tangent."""

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

import numpy as np
import ufl
from dolfinx import fem, la
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from calfsocket.contact.interface import ContactInterface
from calfsocket.contact.nitsche import ContactParameters
from calfsocket.forms import mixed
from calfsocket.forms.element import section_element
from calfsocket.forms.kinematics import deformation_gradient
from calfsocket.io.errors import InputError
from calfsocket.materials.fields import LawFields, kind
from calfsocket.materials.law import Law
from calfsocket.mechanics.condensation import CondensedTangent
from calfsocket.mechanics.kernels.cells import CellLoops, quadrature
from calfsocket.meshes import tags
from calfsocket.meshes.distributed import SectionMesh

SocketSupport = Literal["floating", "outer-fixed"]

SUPPORT_STIFFNESS = 1e-7
"""Bedding of a floating socket in N/mm^3, only where there is no friction to stop it turning."""

TISSUE_RESIDUAL = PETSc.Log.Event("TissueResidual")

LARGEST_BULK_RATIO = 1e3
"""Ratio K/mu up to which a cell's constant pressure is eliminated from the linear system.

It is exact at any ratio; the condensed matrix then has stiffnesses of this ratio side by side."""


class Model:
    """Residual and tangent of limb, socket and their contact, in PETSc's terms.

    Parameters
    ----------
    section : SectionMesh
        Limb and socket in one mesh, distributed over a communicator. The limb is held at the
        boundary "tibia_medullary"; one named "sides" cannot move in x.
    region_laws : mapping of region name to law
        The law of each region, "socket" among them.
    contact : ContactParameters
        Friction and Nitsche stiffness.
    socket_support : {"floating", "outer-fixed"}
        Whether the socket rests on the limb alone, or is held at its outer face.

    Attributes
    ----------
    w : fem.Function
        Displacement (mm) and scaled pressure.
    contact : ContactInterface
        The contact pair; its `load` is the load of the model.
    held : (n,) int
        Owned unknowns that are fixed at zero.
    bedding, anchor : fem.Function
        Where there is a bedding: its stiffness in each cell, N/mm^3, and the displacement at which
        it is at rest.
    interface : type of ContactInterface
        How the overclosure is released; `ContactInterface` itself closes the gaps in proportion.
    """

    bedding: fem.Function
    anchor: fem.Function
    interface: ClassVar[type[ContactInterface]] = ContactInterface

    def __init__(
        self,
        section: SectionMesh,
        region_laws: Mapping[str, Law],
        contact: ContactParameters | None = None,
        socket_support: SocketSupport = "floating",
    ) -> None:
        contact = contact or ContactParameters()
        self.section = section
        self.region_laws = dict(region_laws)
        domain = section.mesh
        self.comm: MPI.Comm = domain.comm
        self.V = fem.functionspace(domain, section_element())
        self.w = fem.Function(self.V, name="displacement_and_pressure")
        self.fields = LawFields(domain, section.cell_tags, section.regions, region_laws)
        frictionless = socket_support == "floating" and contact.fric_coeff == 0.0
        stiffness = self.bedding_stiffness(frictionless)
        bedding = None
        if stiffness:
            self.bedding = self._by_region(stiffness)
            self.anchor = fem.Function(self.V)
            bedding = self.bedding, self.anchor
        self._tissues = CellLoops(self.w, self.fields, bedding)
        self._b = la.create_petsc_vector(self.V.dofmap.index_map, self.V.dofmap.index_map_bs)
        held: dict[str, tuple[int, ...]] = {tags.TIBIA_MEDULLARY: (0, 1)}
        if socket_support == "outer-fixed":
            held[tags.SOCKET_OUTER] = (0, 1)
        if tags.SIDES in section.boundaries:
            held[tags.SIDES] = (0,)
        self._fix(held)
        self.contact = self.interface(
            self.w,
            self._skin_material(),
            section.facet_tags,
            section.boundaries[tags.SKIN_SURFACE],
            section.boundaries[tags.SOCKET_INNER],
            contact,
        )

    def set_laws(self, region_laws: Mapping[str, Law]) -> None:
        """Change the parameters of regions' laws; nothing is compiled again.

        Raises
        ------
        ValueError
            If a region would change its kind of law.
        """
        self.fields.set_laws(region_laws)
        self.region_laws = {**self.region_laws, **region_laws}  # who has the old ones keeps them

    # -- for the solver -------------------------------------------------------------------------

    def create_vector(self) -> PETSc.Vec:
        """Return a vector of unknowns, zero, without ghosts (collective)."""
        index_map = self.V.dofmap.index_map
        x = PETSc.Vec().createMPI((index_map.size_local, index_map.size_global), comm=self.comm)
        x.set(0.0)
        return x

    def create_matrix(self) -> PETSc.Mat:
        """Return the tangent as a matrix of PETSc's that also solves (collective).

        Its Python context is the `CondensedTangent`; its values are those of the last `tangent`.
        """
        index_map = self.V.dofmap.index_map
        size = (index_map.size_local, index_map.size_global)
        condensed = CondensedTangent(
            self.V,
            self._tissues,
            self._constrained,
            self._keeps_constant(),
            self.contact,
        )
        return PETSc.Mat().createPython((size, size), condensed, comm=self.comm)

    def _keeps_constant(self) -> NDArray[np.bool_]:
        """Local cells too stiff in volume to take their constant pressure out of the system."""
        inverse_bulk, mu = (
            field.x.array for field in (self.fields.inverse_bulk, self.fields.pressure_scale)
        )
        stiff = inverse_bulk * mu < 1.0 / LARGEST_BULK_RATIO
        return np.asarray(stiff)

    def residual(self, x: PETSc.Vec, f: PETSc.Vec) -> None:
        """Residual in N/mm; fixed unknowns have their own value instead (collective).

        Newton's method may overshoot to unknowns that are not finite; the residual is not either,
        then, which the line search understands.
        """
        if not np.isfinite(x.norm()):
            f.set(np.nan)
            return
        self._assemble_residual(x)
        self._b.copy(f)
        held = self.held
        f.array[held] = x.array_r[held]

    def tangent(self, x: PETSc.Vec, A: PETSc.Mat) -> None:
        """Exact derivative of `residual` (collective)."""
        self.set_unknowns(x)
        condensed = A.getPythonContext()
        condensed.keep(self._keeps_constant())
        condensed.assemble(self.contact.tangent())
        A.assemble()

    def stability(self, x: PETSc.Vec, A: PETSc.Mat) -> tuple[PETSc.Mat, int]:
        """Condensed tangent of the tissues with contact as a constraint (collective)."""
        self.set_unknowns(x)
        condensed = A.getPythonContext()
        condensed.keep(self._keeps_constant())
        condensed.assemble(self.contact.constraint_tangent())
        pressures = 3 * self.section.mesh.topology.index_map(2).size_global
        return condensed.matrix, pressures - condensed.negative_inside()

    def set_unknowns(self, x: PETSc.Vec) -> None:
        """Copy a vector into `w`, ghosts included (collective)."""
        owned = self.V.dofmap.index_map.size_local
        self.w.x.array[:owned] = x.array_r
        self.w.x.scatter_forward()

    # -- what a converged state shows -----------------------------------------------------------

    def force_balance(self, x: PETSc.Vec) -> tuple[float, float]:
        """Compare the contact force on the skin with the reaction of the tibia (collective).

        Returns
        -------
        imbalance, pressing : float
            |contact force on the skin + reaction at the medullary boundary| and the integral of the
            contact pressure over the skin, both in N per mm of limb length.
        """
        state = self._assemble_residual(x)
        at, law = state.projection, state.traction
        traction = law.pressure[:, None] * at.normal + law.shear[:, None] * at.tangent
        weight = self.contact.points.weight
        local = np.concatenate([weight @ traction, [weight @ law.pressure], np.zeros(2)])
        b = self._b.array_r
        for component in range(2):
            # The residual at a held unknown is the force that holds it.
            local[3 + component] = b[self._tibia_owned[component]].sum()
        total = self.comm.allreduce(local)
        return float(np.linalg.norm(total[:2] + total[3:])), float(total[2])

    def smallest_volume_ratio(self) -> tuple[float, str]:
        """Smallest J = det F of all quadrature points and the region it is in (collective)."""
        F = deformation_gradient(ufl.split(self.w)[0])
        J = fem.Expression(ufl.det(F), quadrature()[0], self.comm)
        cells = np.arange(self.section.mesh.topology.index_map(2).size_local, dtype=np.int32)
        return self._smallest_by_region(
            J.eval(self.section.mesh, cells).min(axis=1, initial=np.inf)
        )

    def least_balanced_region(self, x: PETSc.Vec) -> str:
        """Region with the largest residual, or one that is not finite, at `x` (collective)."""
        self._assemble_residual(x)
        residual = fem.Function(self.V)
        owned = len(self._b.array_r)
        residual.x.array[:owned] = np.abs(np.nan_to_num(self._b.array_r, nan=np.inf))
        residual.x.array[self.held] = 0.0
        residual.x.scatter_forward()
        cells = self.section.mesh.topology.index_map(2).size_local
        in_cell = residual.x.array[self.V.dofmap.list[:cells]].max(axis=1, initial=0.0)
        return self._smallest_by_region(-in_cell)[1]

    def _smallest_by_region(self, cell_values: NDArray[np.float64]) -> tuple[float, str]:
        """Smallest of a value per owned cell, and the region that it is in (collective)."""
        mine = (np.inf, 0)
        if len(cell_values):
            cell = int(np.argmin(cell_values))
            mine = (float(cell_values[cell]), int(self.region_ids()[cell]))
        value, region = min(self.comm.allgather(mine))
        return value, {tag: name for name, tag in self.section.regions.items()}[region]

    # -- assembly -------------------------------------------------------------------------------

    def _assemble_residual(self, x: PETSc.Vec) -> Any:
        self.set_unknowns(x)
        with TISSUE_RESIDUAL:
            with self._b.localForm() as local:
                local.set(0.0)
                self._tissues.add_residuals(local.array_w)
            self._b.ghostUpdate(PETSc.InsertMode.ADD_VALUES, PETSc.ScatterMode.REVERSE)
        return self.contact.add_residual(self._b)

    def _fix(self, boundaries: Mapping[str, tuple[int, ...]]) -> None:
        """Hold components of the displacement on boundaries at zero."""
        section = self.section
        owned = self.V.dofmap.index_map.size_local
        self._constrained = np.zeros_like(self.w.x.array, dtype=bool)
        self._tibia_owned = []
        for name, components in boundaries.items():
            facets = section.facet_tags.find(section.boundaries[name])
            for component in components:
                space = self.V.sub(0).sub(component)
                dofs = fem.locate_dofs_topological(space, 1, facets)
                self._constrained[dofs] = True
                if name == tags.TIBIA_MEDULLARY:
                    self._tibia_owned.append(dofs[dofs < owned])
        self.held = np.flatnonzero(self._constrained[:owned])

    def bedding_stiffness(self, frictionless: bool) -> dict[str, float]:
        """Stiffness in N/mm^3 of a bedding by region; none where a region is not named.

        Parameters
        ----------
        frictionless : bool
            Whether nothing else stops a floating socket from turning.
        """
        return {tags.SOCKET: SUPPORT_STIFFNESS} if frictionless else {}

    def _by_region(self, values: Mapping[str, float]) -> fem.Function:
        function = fem.Function(fem.functionspace(self.section.mesh, ("DG", 0)))
        for name, value in values.items():
            function.x.array[self.section.cell_tags.find(self.section.regions[name])] = value
        return function

    def region_ids(self) -> NDArray[np.int32]:
        """Region tag of each local cell, ghosts included."""
        cells = self.section.cell_tags
        regions = np.zeros(len(cells.indices), dtype=np.int32)
        regions[cells.indices] = cells.values
        return regions

    def _skin_material(self) -> mixed.Material:
        """Material of the cells on the skin's surface, the same on every rank."""
        section = self.section
        section.mesh.topology.create_connectivity(1, 2)
        facet_to_cell = section.mesh.topology.connectivity(1, 2)
        regions = self.region_ids()
        facets = section.facet_tags.find(section.boundaries[tags.SKIN_SURFACE])
        mine = {int(regions[facet_to_cell.links(facet)[0]]) for facet in facets}
        names = {tag: name for name, tag in section.regions.items()}
        there = {names[tag] for part in self.comm.allgather(mine) for tag in part}
        if len({kind(self.region_laws[name]) for name in there}) != 1:
            laws = sorted({self.region_laws[name].name for name in there})
            raise InputError(f"skin surface: laws {laws} meet there; one is allowed")
        return self.fields.of_region(there.pop())
