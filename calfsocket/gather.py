"""A solved model as plain arrays on rank 0, in an order that does not depend on the partition."""

from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from numpy.typing import NDArray

from calfsocket.contact.friction import STATUS_NAMES
from calfsocket.contact.interface import GAUSS_POINTS as POINTS_PER_EDGE
from calfsocket.contact.interface import edge_parameters
from calfsocket.contact.projection import EdgeChain, order_chain
from calfsocket.contact_line import ContactLine
from calfsocket.forms import mixed
from calfsocket.forms.kinematics import deformation_gradient
from calfsocket.model import Model
from calfsocket.section_fields import GAUSS_POINTS, SectionFields

KILOPASCAL = 1000.0
"""kPa in a MPa."""

# dolfinx numbers mid-side nodes by the opposite vertex, VTK along the boundary.
_VTK_ORDER = [0, 1, 2, 5, 3, 4]


def section_fields(model: Model, region_tissues: dict[str, str]) -> SectionFields | None:
    """Displacement, stress and strain of the whole section; on rank 0 (collective).

    Parameters
    ----------
    model : Model
        With the state of interest in its unknowns.
    region_tissues : dict
        Tissue of each region name.
    """
    domain = model.section.mesh
    n_cells = domain.topology.index_map(2).size_local
    cells = np.arange(n_cells, dtype=np.int32)
    nodes = domain.geometry.dofmap[:n_cells][:, _VTK_ORDER]
    F, P, p = _stress(model, cells)
    gathered = model.comm.gather(
        (
            domain.topology.original_cell_index[:n_cells],
            domain.geometry.input_global_indices[nodes],
            domain.geometry.x[nodes][:, :, :2],
            _nodal_displacement(model, cells)[:, _VTK_ORDER],
            model.region_ids()[:n_cells],
            F,
            P,
            p,
        ),
        root=0,
    )
    if gathered is None:
        return None
    number, *parts = (np.concatenate(part) for part in zip(*gathered, strict=True))
    order = np.argsort(number)
    node, x, u, region, F, P, p = (part[order] for part in parts)
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
        stress=KILOPASCAL * _cauchy(F, P, p),
        deformation_gradient=F,
        pressure=-KILOPASCAL * p,
        gauss_points=GAUSS_POINTS,
    )


def contact_line(model: Model) -> ContactLine | None:
    """Contact along the skin; on rank 0 (collective)."""
    contact = model.contact
    state = contact.state()
    law = state.traction
    gathered = model.comm.gather(
        (
            contact.skin.nodes,
            contact.points.reference,
            contact.deformed_points(),
            contact.points.weight,
            law.pressure,
            law.shear,
            state.reduced_gap,
            law.status,
        ),
        root=0,
    )
    if gathered is None:
        return None
    nodes, reference, position, weight, pressure, shear, gap, status = (
        np.concatenate(part) for part in zip(*gathered, strict=True)
    )
    order, flipped = order_chain(nodes)
    chain = EdgeChain.from_edges(_turned(nodes[order], flipped))
    xi = np.where(flipped[:, None], -edge_parameters(), edge_parameters())
    arc = chain.arc(np.repeat(np.arange(len(order)), POINTS_PER_EDGE), xi.ravel())
    along = np.argsort(arc)
    pick = (POINTS_PER_EDGE * order[:, None] + np.arange(POINTS_PER_EDGE)).ravel()[along]
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
        circumference_mm=chain.circumference,
    )


def _turned(edges: NDArray[Any], flipped: NDArray[np.bool_]) -> NDArray[Any]:
    """Swap the two vertices of flipped edges, (n, 3, 2)."""
    node_order = np.where(flipped[:, None], [1, 0, 2], [0, 1, 2])
    return np.take_along_axis(edges, node_order[:, :, None], axis=1)


def _stress(model: Model, cells: NDArray[np.int32]) -> tuple[NDArray[np.float64], ...]:
    """F, first Piola stress (MPa) and p (MPa, > 0 in tension) at the Gauss points of cells."""
    domain = model.section.mesh
    u, p_dof = ufl.split(model.w)
    gradient = deformation_gradient(u)
    p = mixed.pressure(p_dof, model.fields)

    def at_points(expression: Any, where: NDArray[np.int32]) -> NDArray[np.float64]:
        return fem.Expression(expression, GAUSS_POINTS, comm=model.comm).eval(domain, where)

    stress = np.empty((len(cells), 3, 2, 2))
    for law, tag in mixed.LAW_IDS.items():
        mine = model.law_tags.find(tag)
        mine = mine[mine < len(cells)]
        piola = at_points(mixed.first_piola(law, gradient, p, model.fields), mine)
        stress[mine] = piola.reshape(-1, 3, 2, 2)
    F = at_points(gradient, cells).reshape(-1, 3, 2, 2)
    return F, stress, at_points(p, cells)


def _cauchy(
    F: NDArray[np.float64], P: NDArray[np.float64], p: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Cauchy stress s11, s22, s33, s12: P F^T / J in the plane; the mean of all three is p."""
    J = np.linalg.det(F)
    in_plane = np.einsum("cqij,cqkj->cqik", P, F) / J[..., None, None]
    s11, s22, s12 = in_plane[..., 0, 0], in_plane[..., 1, 1], in_plane[..., 0, 1]
    return np.stack([s11, s22, 3.0 * p - s11 - s22, s12], axis=-1)


def _nodal_displacement(model: Model, cells: NDArray[np.int32]) -> NDArray[np.float64]:
    """Displacement at each cell's six nodes in dolfinx's order, mm; (n, 6, 2)."""
    result = np.empty((len(cells), 6, 2))
    for component in range(2):
        dofmap = model.V.sub(0).sub(component).dofmap
        layout = dofmap.dof_layout
        at = [layout.entity_dofs(0, i)[0] for i in range(3)]
        at += [layout.entity_dofs(1, i)[0] for i in range(3)]
        dofs = np.array([dofmap.cell_dofs(c)[at] for c in cells], dtype=np.int32).reshape(-1, 6)
        result[:, :, component] = model.w.x.array[dofs]
    return result
