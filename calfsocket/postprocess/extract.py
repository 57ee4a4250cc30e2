"""A solved model as plain arrays on rank 0, in an order that does not depend on the partition."""

from typing import Any

import numpy as np
import ufl
from numpy.typing import NDArray

from calfsocket.contact.bonded import BondedSkin
from calfsocket.contact.friction import STATUS_NAMES, STICK
from calfsocket.contact.interface import ContactInterface
from calfsocket.contact.projection import EdgeChain, along_chain, order_chain
from calfsocket.forms import mixed
from calfsocket.forms.kinematics import deformation_gradient
from calfsocket.forms.measures import cauchy_stress
from calfsocket.io.fenics import cell_nodes
from calfsocket.mechanics.limb_problem import bonded_to_limb
from calfsocket.mechanics.problem import Problem
from calfsocket.postprocess.contact_line import ContactLine
from calfsocket.postprocess.fields import GAUSS_POINTS, SectionFields

KILOPASCAL = 1000.0
"""kPa in a MPa."""

# dolfinx numbers mid-side nodes by the opposite vertex, VTK along the boundary.
_VTK_ORDER = [0, 1, 2, 5, 3, 4]


def section_fields(model: Problem, region_tissues: dict[str, str]) -> SectionFields | None:
    """Displacement, stress and strain of the whole section; on rank 0 (collective).

    The model has the state of interest in its unknowns; tissues are given by names of regions.
    """
    domain = model.section.mesh
    n_cells = domain.topology.index_map(2).size_local
    nodes = cell_nodes(domain)[:n_cells][:, _VTK_ORDER]
    F, stress, p = _at_gauss_points(model, n_cells)
    state = model.fields.stress_free
    G = np.tile(np.eye(2), (n_cells, 3, 1, 1)) if state.tensor is None else state.at(GAUSS_POINTS)
    collected = model.comm.gather(
        (
            domain.topology.original_cell_index[:n_cells],
            domain.geometry.input_global_indices[nodes],
            domain.geometry.x[nodes][:, :, :2],
            _nodal_displacement(model, n_cells)[:, _VTK_ORDER],
            model.section.cell_regions()[:n_cells],
            F,
            stress,
            p,
            G,
        ),
        root=0,
    )
    if collected is None:
        return None
    number, *parts = (np.concatenate(part) for part in zip(*collected, strict=True))
    order = np.argsort(number)
    node, x, u, region, F, stress, p, G = (part[order] for part in parts)
    points = np.zeros((node.max() + 1, 2))
    displacement = np.zeros_like(points)
    points[node] = x
    displacement[node] = u
    names = {tag: name for name, tag in model.section.regions.items()}
    return SectionFields(
        points=points,
        cells=node.astype(np.int64),
        region=region.astype(np.int64),
        region_names=names,
        region_tissues={tag: region_tissues[name] for tag, name in names.items()},
        displacement=displacement,
        stress=KILOPASCAL * stress,
        deformation_gradient=F,
        pressure=-KILOPASCAL * p,
        elastic_gradient=None if state.tensor is None else F @ np.linalg.inv(G),
    )


def contact_line(model: Problem) -> ContactLine | None:
    """Contact along the limb's side: skin, or a liner that is bonded to it (collective).

    Returned on rank 0.
    """
    contact = model.contact
    state = contact.state()
    law = state.traction
    return _line(contact, law.pressure, law.shear, state.reduced_gap, law.status)


def skin_line(model: Problem) -> ContactLine | None:
    """Contact along the skin; on rank 0 (collective).

    Under a liner that is bonded to it that is the traction between the two, which sticks
    everywhere; its pressure is negative where the liner pulls.
    """
    if not bonded_to_limb(model.section):
        return contact_line(model)
    skin = BondedSkin(model.w, model.section, model.region_laws, model.fields)
    traction = skin.traction()
    n = len(traction.pressure)
    return _line(skin, traction.pressure, traction.shear, np.zeros(n), np.full(n, STICK))


def _line(
    contact: ContactInterface,
    pressure: NDArray[np.float64],
    shear: NDArray[np.float64],
    gap: NDArray[np.float64],
    status: NDArray[np.int64],
) -> ContactLine | None:
    """Collect values at the points of an interface along its skin; on rank 0 (collective)."""
    collected = contact.comm.gather(
        (
            contact.skin.nodes,
            contact.points.reference,
            contact.deformed_points(),
            contact.points.weight,
            pressure,
            shear,
            gap,
            status,
        ),
        root=0,
    )
    if collected is None:
        return None
    nodes, reference, position, weight, pressure, shear, gap, status = (
        np.concatenate(part) for part in zip(*collected, strict=True)
    )
    order, flipped = order_chain(nodes)
    chain = EdgeChain.from_edges(along_chain(nodes, order, flipped))
    on_edge = contact.edge_parameters
    n_points = len(on_edge)
    xi = np.where(flipped[:, None], -on_edge, on_edge)
    arc = chain.arc(np.repeat(np.arange(len(order)), n_points), xi.ravel())
    along = np.argsort(arc)
    if not np.isclose(weight.sum(), chain.length, rtol=1e-3):
        raise ValueError(
            f"the contact points stand for {weight.sum():.6g} mm of skin, whose outline is "
            f"{chain.length:.6g} mm long"
        )
    pick = (n_points * order[:, None] + np.arange(n_points)).ravel()[along]
    return ContactLine(
        arc_mm=arc[along],
        angle_deg=np.degrees(np.arctan2(reference[pick, 1], reference[pick, 0])) % 360.0,
        x_mm=position[pick, 0],
        y_mm=position[pick, 1],
        pressure_kPa=KILOPASCAL * pressure[pick],
        shear_kPa=KILOPASCAL * shear[pick],
        gap_mm=gap[pick],
        weight_mm=weight[pick],
        status=np.array(STATUS_NAMES)[status[pick]],
    )


def _at_gauss_points(model: Problem, n_cells: int) -> tuple[NDArray[np.float64], ...]:
    """F, Cauchy stress s11, s22, s33, s12 and p (both MPa, > 0 in tension) of the first cells."""
    fields = model.fields
    u, p_dof = ufl.split(model.w)
    F, p = deformation_gradient(u), mixed.pressure(p_dof, fields.pressure_scale)
    stress = np.empty((n_cells, 3, 4))
    for tag, material in fields.materials.items():
        cells = fields.tags.find(tag)
        cells = cells[cells < n_cells]

        def make(material: mixed.Material = material) -> Any:
            return cauchy_stress(material, F, p)

        values = model.evaluate(f"Cauchy stress {tag}", make, GAUSS_POINTS, cells, material)
        stress[cells] = values.reshape(-1, 3, 4)
    every = np.arange(n_cells, dtype=np.int32)
    gradients = model.evaluate("F at Gauss points", lambda: F, GAUSS_POINTS, every)
    pressure = model.evaluate("pressure", lambda: p, GAUSS_POINTS, every)
    return gradients.reshape(-1, 3, 2, 2), stress, pressure


def _nodal_displacement(model: Problem, n_cells: int) -> NDArray[np.float64]:
    """Displacement at the six nodes of the first cells, in dolfinx's order, mm; (n, 6, 2)."""
    result = np.empty((n_cells, 6, 2))
    for component in range(2):
        dofmap = model.V.sub(0).sub(component).dofmap
        layout = dofmap.dof_layout
        at = [layout.entity_dofs(0, i)[0] for i in range(3)]
        at += [layout.entity_dofs(1, i)[0] for i in range(3)]
        result[:, :, component] = model.w.x.array[dofmap.list[:n_cells, at]]
    return result
