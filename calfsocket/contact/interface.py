"""The contact interface of a distributed mesh: skin quadrature points against the socket's face."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from calfsocket.contact import nitsche
from calfsocket.contact.active_set import ActiveSet
from calfsocket.contact.nitsche import ContactState, SkinPoints
from calfsocket.contact.parameters import Contact
from calfsocket.contact.projection import (
    EdgeChain,
    Projection,
    along_chain,
    order_chain,
    shape_functions,
)
from calfsocket.forms import mixed
from calfsocket.forms.kinematics import deformation_gradient
from calfsocket.io.errors import InputError
from calfsocket.io.fenics import cell_nodes, evaluate
from calfsocket.materials.fields import LawFields, kind
from calfsocket.materials.law import Law
from calfsocket.meshes.distributed import SectionMesh

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

CONTACT_RESIDUAL = PETSc.Log.Event("ContactResidual")
CONTACT_TANGENT = PETSc.Log.Event("ContactTangent")

PATTERN_REACH = 1.5
"""Slip in mm for which the matrix pattern is laid out ahead."""

CONSTRAINT_STIFFNESS = 10.0
"""Stiffness of contact in MPa/mm for counting negative modes; 0.1 to 1000 give the same count."""


# Vertices and mid-side node of each edge of the reference triangle, and its direction.
_EDGE_VERTICES = np.array([[1, 2], [0, 2], [0, 1]])
_EDGE_DIRECTION = np.array([[-1.0, 1.0], [0.0, 1.0], [1.0, 0.0]])


@dataclass(frozen=True)
class Face:
    """Boundary edges of owned cells on this rank.

    Attributes
    ----------
    entities : (m, 2)
        Cell and local facet.
    nodes : (m, 3, 2)
        Undeformed vertices and mid-side node, in mm.
    dofs : (m, 3, 2)
        Local index of each node's displacement components.
    inside : (m, 2)
        Undeformed vertex of the edge's cell that is not on the edge, in mm.
    """

    entities: NDArray[np.int32]
    nodes: FloatArray
    dofs: NDArray[np.int32]
    inside: FloatArray

    @classmethod
    def of(
        cls,
        V: fem.FunctionSpace,
        facet_tags: mesh.MeshTags,
        tag: int,
        side: NDArray[np.bool_] | None = None,
    ) -> "Face":
        """Collect the edges with a facet tag, of cells on one side of them if there are two."""
        domain = V.mesh
        domain.topology.create_connectivity(1, 2)
        domain.topology.create_connectivity(2, 1)
        facet_to_cell = domain.topology.connectivity(1, 2)
        cell_to_facet = domain.topology.connectivity(2, 1)
        owned = domain.topology.index_map(2).size_local
        pairs = []
        for facet in facet_tags.find(tag):
            for cell in facet_to_cell.links(facet):
                if cell < owned and (side is None or side[cell]):
                    pairs.append((cell, np.flatnonzero(cell_to_facet.links(cell) == facet)[0]))
        entities = np.array(pairs, dtype=np.int32).reshape(-1, 2)
        cells, local = entities[:, 0], entities[:, 1]
        # Order-2 geometry: nodes 0-2 are the vertices, 3-5 the mid-sides opposite to them.
        local_nodes = np.column_stack([_EDGE_VERTICES[local], 3 + local])
        geometry_nodes = np.take_along_axis(cell_nodes(domain)[cells], local_nodes, axis=1)
        layouts = [V.sub(0).sub(c).dofmap.dof_layout for c in range(2)]
        closure = np.array(
            [
                [[layout.entity_dofs(0, v)[0] for layout in layouts] for v in _EDGE_VERTICES[facet]]
                + [[layout.entity_dofs(1, facet)[0] for layout in layouts]]
                for facet in range(3)
            ]
        )
        dofs = np.stack(
            [
                np.take_along_axis(V.sub(0).sub(c).dofmap.list[cells], closure[local, :, c], axis=1)
                for c in range(2)
            ],
            axis=2,
        )
        nodes = np.asarray(domain.geometry.x[geometry_nodes][:, :, :2], dtype=np.float64)
        # The vertex opposite to an edge has the edge's local number.
        opposite = cell_nodes(domain)[cells, local]
        inside = np.asarray(domain.geometry.x[opposite, :2], dtype=np.float64)
        return cls(entities, nodes, dofs, inside.reshape(-1, 2))


@dataclass(frozen=True)
class ContactTangent:
    """Derivative of the contact residual, a block a skin point.

    Rows are the displacements of the nodes of the point's skin edge, and then of the socket's
    edge that it is at, two components each; so are the columns of `by_motion`.

    Attributes
    ----------
    edge : (n,)
        The socket's edge along its chain.
    by_motion : (n, 12, 12)
        By those displacements, at a fixed nominal traction T of the skin.
    by_traction : (n, 12, 2)
        By T.
    d_traction : (n, 2, k)
        T by the k unknowns of the skin's cell.
    """

    edge: IntArray
    by_motion: FloatArray
    by_traction: FloatArray
    d_traction: FloatArray


class ContactInterface:
    """Frictional contact between skin and socket, on the communicator of the mesh.

    Every rank has the skin points of its own cells and a copy of the whole socket face, which is
    a curve of some hundred edges.

    It is made from the mixed unknowns `w`, whose sub-space 0 is the displacement in mm, the mesh
    with both boundaries, and the law of each region; one kind alone meets the skin's surface.

    Attributes
    ----------
    load : float
        Share of the overclosure that is released, 0 to 1.
    skin, socket : Face
        Edges of the skin's surface and of the socket's inner face, those of cells of this rank.
    edge_parameters : (parameters.gauss_points,)
        Quadrature points of a skin edge in its own parameter, -1 to 1.
    converged_arc : (n,)
        Place of each skin point's partner along the socket from which slip counts, in mm.
    active_set : ActiveSet
        Keeps points from going to and fro while Newton's method iterates.
    """

    def __init__(
        self,
        w: fem.Function,
        section: SectionMesh,
        laws: Mapping[str, Law],
        fields: LawFields,
        pair: "ContactPair",
    ) -> None:
        V = w.function_space
        domain = V.mesh
        self._region, self.skin, socket = self._sides(V, section, laws, pair)
        self._fields = fields
        self.load = 0.0
        self.parameters = parameters = pair.parameters
        self.edge_parameters, self._edge_weights = np.polynomial.legendre.leggauss(
            parameters.gauss_points
        )
        self.comm = domain.comm
        self._w = w
        self._mesh = domain
        self._set_up_socket(socket)

        self._on_edge = 0.5 * (self.edge_parameters + 1)[:, None]
        self._compile_stress()
        self.points, self._normal = self._skin_points(self._on_edge)
        dofs = _global(V.dofmap.index_map, self.skin.dofs).reshape(-1, 6)
        self._skin_dofs = np.repeat(dofs, parameters.gauss_points, axis=0)

        position = self.deformed_points()
        self._projected: tuple[FloatArray, FloatArray, Projection] | None = None
        start = self._project(position, self.socket_displacement())
        gap = np.sum((position - start.point) * start.normal, axis=1)
        self._initial_overclosure = np.minimum(gap, 0.0)
        self._initial_arc = start.arc
        self.converged_arc = self._earlier_arc = self._initial_arc
        self._begin_active_set()

    def _begin_active_set(self) -> None:
        self.active_set = ActiveSet(self.comm, free=self.parameters.friction == 0.0)
        self.active_set.line_up(self._initial_arc, self.parameters.gauss_points)

    def restart(self, parameters: Contact) -> None:
        """Go back to load 0 and the undeformed bodies, with other parameters (collective).

        The unknowns are zero already.

        Raises
        ------
        ValueError
            For another number of quadrature points.
        """
        if parameters.gauss_points != self.parameters.gauss_points:
            raise ValueError("contact: other quadrature points need another interface")
        self.parameters = parameters
        self.load = 0.0
        self._begin_active_set()
        self.converged_arc = self._earlier_arc = self._initial_arc

    def _sides(
        self,
        V: fem.FunctionSpace,
        section: SectionMesh,
        laws: Mapping[str, Law],
        pair: "ContactPair",
    ) -> tuple[str, Face, Face]:
        """Return a region of the skin's side, and the faces of both sides (collective)."""
        skin, socket = (
            Face.of(V, section.facet_tags, section.boundaries[name])
            for name in (pair.skin, pair.socket)
        )
        return surface_region(section, laws, pair.skin), skin, socket

    def _compile_stress(self) -> None:
        """Make the nominal stress of the skin and its derivative (collective)."""
        self._material = material = self._fields.of_region(self._region)
        u, p_dof = ufl.split(self._w)
        du, dp_dof = ufl.TrialFunctions(self._w.function_space)
        F = deformation_gradient(u)
        p, dp = (mixed.pressure(q, material.pressure_scale) for q in (p_dof, dp_dof))
        stress = mixed.first_piola(material, F, p)
        d_stress = mixed.first_piola_increment(material, F, p, ufl.grad(du), dp)
        self._stress = fem.Expression(stress, self._on_edge, comm=self.comm)
        self._d_stress = fem.Expression(d_stress, self._on_edge, comm=self.comm)

    # -- geometry -------------------------------------------------------------------------------

    def _set_up_socket(self, face: Face) -> None:
        """Share the socket's edges with all ranks and string them to one chain."""
        nodes, inside = (
            np.concatenate(self.comm.allgather(part)) for part in (face.nodes, face.inside)
        )
        self._chain_order = order_chain(nodes, inside)
        self.chain = EdgeChain.from_edges(along_chain(nodes, *self._chain_order))
        self.socket = face
        index_map = self._w.function_space.dofmap.index_map
        self._socket_dofs = self.along_socket(_global(index_map, face.dofs))

    def along_socket(self, values: NDArray[Any]) -> NDArray[Any]:
        """Gather values at the nodes of `socket` along its chain, on every rank; (n_edges, 6)."""
        everywhere = np.concatenate(self.comm.allgather(values))
        return along_chain(everywhere, *self._chain_order).reshape(-1, 6)

    def socket_displacement(self) -> FloatArray:
        """Displacement of the chain's nodes on every rank, in mm; (n_edges, 3, 2)."""
        mine = np.ascontiguousarray(self._w.x.array[self.socket.dofs])
        counts = np.array(self.comm.allgather(mine.size))
        everyone = np.empty(counts.sum())
        self.comm.Allgatherv(mine, [everyone, counts])
        return along_chain(everyone.reshape(-1, 3, 2), *self._chain_order)

    def _skin_points(self, on_edge: FloatArray) -> tuple[SkinPoints, FloatArray]:
        """Quadrature points of this rank's skin and their outward normals (n, 2)."""
        domain, entities = self._mesh, self.skin.entities
        n_points = self.parameters.gauss_points

        def at_points(expression: Any) -> FloatArray:
            return self._evaluate(fem.Expression(expression, on_edge, comm=self.comm))

        reference = at_points(ufl.SpatialCoordinate(domain)).reshape(-1, 2)
        jacobian = at_points(ufl.Jacobian(domain)).reshape(-1, 2, 2)
        direction = np.repeat(_EDGE_DIRECTION[entities[:, 1]], n_points, axis=0)
        along = np.einsum("ncd,nd->nc", jacobian, direction)
        length = np.linalg.norm(along, axis=1)
        values = shape_functions(self.edge_parameters)[0]
        shape = np.einsum("qa,cd->qcad", values, np.eye(2)).reshape(n_points, 2, 6)
        points = SkinPoints(
            reference=reference,
            weight=np.tile(0.5 * self._edge_weights, len(entities)) * length,
            shape=np.tile(shape, (len(entities), 1, 1)),
        )
        normal = np.stack([along[:, 1], -along[:, 0]], axis=1) / length[:, None]
        # Which side is out depends on the facet and on the cell's orientation.
        inside = np.repeat(self.skin.inside, n_points, axis=0)
        inward = np.sum(normal * (inside - reference), axis=1) > 0
        return points, np.where(inward[:, None], -normal, normal)

    def deformed_points(self) -> FloatArray:
        """Deformed skin points of this rank, in mm; (n, 2)."""
        values = shape_functions(self.edge_parameters)[0]
        moved = np.einsum("qa,mac->mqc", values, self._w.x.array[self.skin.dofs])
        return self.points.reference + moved.reshape(-1, 2)

    def _evaluate(self, expression: fem.Expression) -> FloatArray:
        """Evaluate on the skin's edges; one row an edge."""
        return evaluate(expression, self._mesh, self.skin.entities)

    # -- contact --------------------------------------------------------------------------------

    def nominal_traction(self) -> FloatArray:
        """T = P N of the skin at its points, in MPa; (n, 2)."""
        if self._fields.stress_free.tensor is not self._material.stress_free:
            self._compile_stress()
        stress = self._evaluate(self._stress).reshape(-1, 2, 2)
        return np.einsum("ncd,nd->nc", stress, self._normal)

    def nominal_traction_variation(self) -> FloatArray:
        """Return its derivative by the k unknowns of each point's cell; (n, 2, k)."""
        n, k = len(self.points.weight), self._w.function_space.element.space_dimension
        d_stress = self._evaluate(self._d_stress).reshape(n, 2, 2, k)
        return np.einsum("ncdk,nd->nck", d_stress, self._normal)

    def closing(self) -> FloatArray:
        """Part of each point's gap that is taken off, in mm, <= 0; (n,)."""
        return (1.0 - self.load) * self._initial_overclosure

    def slip(self, arc: FloatArray) -> FloatArray:
        """Slip at a point's `arc` that its friction resists, in mm; (n,)."""
        return self.chain.slip(arc, self.converged_arc)

    def state(self, nominal_traction: FloatArray | None = None) -> ContactState:
        """Contact at the present unknowns and load (collective)."""
        if nominal_traction is None:
            nominal_traction = self.nominal_traction()
        position = self.deformed_points()
        displacement = self.socket_displacement()
        projection = self._project(position, displacement)
        stay, beyond = self.active_set.returning(projection.edge)
        projection = self.chain.stay(projection, position, displacement, stay, beyond)
        return nitsche.contact_state(
            position,
            nominal_traction,
            projection,
            self.closing(),
            self.slip(projection.arc),
            self.parameters,
            self.active_set,
        )

    def _project(self, position: FloatArray, displacement: FloatArray) -> Projection:
        """Project skin points; a tangent is asked for where the residual has just been."""
        last = self._projected
        if last is None or not (
            np.array_equal(position, last[0]) and np.array_equal(displacement, last[1])
        ):
            last = position, displacement, self.chain.project(position, displacement)
            self._projected = last
        return last[2]

    def largest_gap(self) -> float:
        """Largest |gap| in mm where there is contact, the released share counted (collective)."""
        state = self.state()
        closed = state.traction.pressure > 0
        mine = np.abs(state.reduced_gap[closed]).max(initial=0.0)
        return float(self.comm.allreduce(mine, op=MPI.MAX))

    def accept(self) -> None:
        """Take the slip so far as done; tractions stay what they are (collective)."""
        self._earlier_arc = self.converged_arc
        self.active_set.leave()  # so that it does not matter whether the run was interrupted here
        state = self.state()
        self.active_set.equilibrium = state.traction.branch
        self.converged_arc = self.settled_arc(state)

    def settled_arc(self, state: ContactState | None = None) -> FloatArray:
        """Place along the socket from which slip will count after this state, in mm; (n,)."""
        state = state or self.state()
        return state.projection.arc - nitsche.settled_slip(state, self.parameters)

    def revert(self) -> None:
        """Take the last `accept` back."""
        self.converged_arc = self._earlier_arc

    def force(self, state: ContactState) -> tuple[FloatArray, float]:
        """Force on the skin, N/mm, and the integral of contact pressure over it (collective)."""
        traction, pressure = nitsche.traction_vector(state), state.traction.pressure
        weight = self.points.weight
        total = self.comm.allreduce(np.array([*(weight @ traction), weight @ pressure]))
        return total[:2], float(total[2])

    # -- assembly -------------------------------------------------------------------------------

    def add_residual(self, b: PETSc.Vec) -> ContactState:
        """Add the contact residual to an assembled vector (collective)."""
        with CONTACT_RESIDUAL:
            state = self.state()
            skin, socket = nitsche.residual(self.points, state)
            # Constrained unknowns, too: their residual is the force that holds them.
            b.setValues(self._skin_dofs, skin, addv=PETSc.InsertMode.ADD_VALUES)
            b.setValues(
                self._socket_dofs[state.projection.edge], socket, addv=PETSc.InsertMode.ADD_VALUES
            )
            b.assemble()
        return state

    def tangent(self) -> ContactTangent:
        """Contact tangent at the present unknowns and load (collective)."""
        with CONTACT_TANGENT:
            nominal = self.nominal_traction()
            state = self.state(nominal)
            gamma, gamma_t = self.parameters.gamma, self.parameters.gamma_t
            self.active_set.linearised(state.traction.branch, state.projection.edge)
            blocks = nitsche.tangent(self.points, state, nominal, gamma, gamma_t)
            return ContactTangent(state.projection.edge, *blocks, self.nominal_traction_variation())

    def constraint_tangent(self) -> ContactTangent:
        """Return contact as a constraint, as `tangent`, to count negative modes (collective)."""
        state = self.state()
        by_motion = nitsche.constraint_tangent(self.points, state, CONSTRAINT_STIFFNESS)
        k = self._w.function_space.element.space_dimension
        n, rows, _ = by_motion.shape
        return ContactTangent(
            state.projection.edge, by_motion, np.zeros((n, rows, 2)), np.zeros((n, 2, k))
        )

    def edges_ahead(self) -> IntArray:
        """Socket edges within `PATTERN_REACH` of slip, a row a skin edge (collective)."""
        edge = self.state().projection.edge.reshape(-1, self.parameters.gauss_points)
        ahead = int(np.ceil(PATTERN_REACH * len(self.chain.start) / self.chain.length))
        near = self.chain.around(edge.ravel(), ahead)
        return near.reshape(len(edge), near.shape[1] * self.parameters.gauss_points)


@dataclass(frozen=True)
class ContactPair:
    """Two boundaries that may touch, as a problem takes them.

    Attributes
    ----------
    skin, socket : str
        Names of the boundary that is integrated over, that of the softer body, and of the one that
        it is projected on.
    parameters : Contact
        Friction and Nitsche stiffness.
    kind : callable
        Makes the interface, with the arguments of `ContactInterface`: another one may come to full
        load in another way.
    """

    skin: str
    socket: str
    parameters: Contact = field(default_factory=Contact)
    kind: Callable[..., ContactInterface] = ContactInterface


def _global(index_map: Any, local: NDArray[np.int32]) -> NDArray[Any]:
    """Global indices of local ones, in the same shape, of PETSc's integer type."""
    return index_map.local_to_global(local.ravel()).reshape(local.shape).astype(PETSc.IntType)


def surface_region(section: SectionMesh, laws: Mapping[str, Law], boundary: str) -> str:
    """Region of the cells on a boundary, one of them where they have one law (collective).

    Raises
    ------
    InputError
        If laws of several kinds meet there.
    """
    topology = section.mesh.topology
    topology.create_connectivity(1, 2)
    facet_to_cell = topology.connectivity(1, 2)
    regions = section.cell_regions()
    facets = section.facet_tags.find(section.boundaries[boundary])
    mine = {int(regions[facet_to_cell.links(facet)[0]]) for facet in facets}
    names = {tag: name for name, tag in section.regions.items()}
    there = {names[tag] for part in section.mesh.comm.allgather(mine) for tag in part}
    if len({kind(laws[name]) for name in there}) != 1:
        found = sorted({laws[name].name for name in there})
        raise InputError(f"{boundary}: has the laws {found}; it must have one law")
    return min(there)
