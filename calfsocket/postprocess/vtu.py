"""fields.vtu: the fields of one case for ParaView, and read back without loss."""

from pathlib import Path
from typing import Any

import numpy as np

from calfsocket.io.files import replacing
from calfsocket.postprocess.fields import TISSUES, SectionFields
from calfsocket.postprocess.quantities import UNITS, Quantities

FIELDS_FILE = "fields.vtu"


def write_fields(folder: Path, quantities: Quantities, socket: str, material_set: str) -> Path:
    """Write fields.vtu of one case, for ParaView and for `read_fields`.

    Nodes are doubled where regions meet, so that stresses may jump there. Point data are for
    looking at (displacement, and the quantities averaged within each tissue); cell data hold what
    was computed, at the Gauss points; names of regions and tissues are in the field data, indexed
    by `region_ids` and by tissue.
    """
    import pyvista  # takes a second, which only this function needs

    fields = quantities.fields
    n_nodes = len(fields.points)
    node_of_region = fields.region[:, None] * n_nodes + fields.cells
    copies, cells = np.unique(node_of_region, return_inverse=True)
    cells = cells.reshape(fields.cells.shape)
    node = copies % n_nodes
    pad = ((0, 0), (0, 1))
    grid = pyvista.UnstructuredGrid(
        {pyvista.CellType.QUADRATIC_TRIANGLE: cells}, np.pad(fields.points[node], pad)
    )
    grid.point_data["displacement"] = np.pad(fields.displacement[node], pad)
    unit_names = {"kPa": "kPa", "%": "percent"}
    for name, unit in UNITS.items():
        at_node = np.empty(len(node))
        at_node[cells] = quantities.nodal[name]
        grid.point_data[f"{name}_{unit_names[unit]}"] = at_node
    grid.point_data["node"] = node
    grid.cell_data["region"] = fields.region
    grid.cell_data["tissue"] = fields.tissue
    n_cells = len(cells)
    grid.cell_data["gauss_stress_kPa"] = fields.stress.reshape(n_cells, 12)
    grid.cell_data["gauss_deformation_gradient"] = fields.deformation_gradient.reshape(n_cells, 12)
    grid.cell_data["gauss_pressure_kPa"] = fields.pressure
    ids = sorted(fields.region_names)
    grid.field_data["region_ids"] = np.array(ids)
    grid.field_data["region_names"] = [fields.region_names[i] for i in ids]
    grid.field_data["region_tissues"] = [fields.region_tissues[i] for i in ids]
    grid.field_data["tissue_names"] = list(TISSUES)
    grid.field_data["socket"] = [socket]
    grid.field_data["material_set"] = [material_set]
    path = Path(folder) / FIELDS_FILE
    with replacing(path) as temporary:
        temporary.write_text(_vtu(grid), encoding="ascii")
    return path


def _vtu(grid: Any) -> str:
    """Text of a grid's file. VTK itself must not write it: on a full disk it crashes."""
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridWriter

    writer = vtkXMLUnstructuredGridWriter()
    writer.SetInputData(grid)
    writer.SetDataModeToBinary()
    writer.WriteToOutputStringOn()
    writer.Write()
    text: str = writer.GetOutputString()
    return text


def read_fields(folder: Path) -> SectionFields:
    """Read back what `write_fields` wrote, without loss."""
    import pyvista

    grid = pyvista.read(Path(folder) / FIELDS_FILE)
    node = np.asarray(grid.point_data["node"])
    n_nodes = int(node.max()) + 1
    points, displacement = np.zeros((n_nodes, 2)), np.zeros((n_nodes, 2))
    points[node] = grid.points[:, :2]
    displacement[node] = grid.point_data["displacement"][:, :2]
    ids = [int(i) for i in grid.field_data["region_ids"]]
    gauss = (grid.n_cells, 3)
    return SectionFields(
        points=points,
        cells=node[grid.cells_dict[pyvista.CellType.QUADRATIC_TRIANGLE]],
        region=np.asarray(grid.cell_data["region"]),
        region_names=dict(zip(ids, map(str, grid.field_data["region_names"]), strict=True)),
        region_tissues=dict(zip(ids, map(str, grid.field_data["region_tissues"]), strict=True)),
        displacement=displacement,
        stress=np.reshape(grid.cell_data["gauss_stress_kPa"], (*gauss, 4)),
        deformation_gradient=np.reshape(
            grid.cell_data["gauss_deformation_gradient"], (*gauss, 2, 2)
        ),
        pressure=np.asarray(grid.cell_data["gauss_pressure_kPa"]),
    )
