"""fields.vtu: the fields of one case for ParaView, and read back without loss."""

from pathlib import Path
from typing import Any

import numpy as np

from calfsocket.io.files import replacing
from calfsocket.postprocess.fields import TISSUES, SectionFields
from calfsocket.postprocess.quantities import UNITS, Quantities

FIELDS_FILE = "fields.vtu"

_ELASTIC = "gauss_elastic_gradient"
_REGION, _TISSUE = "region ", "tissue "
"""Start of the names of arrays that stand for the name of a region or tissue."""


def write_fields(folder: Path, quantities: Quantities, load: float) -> Path:
    """Write fields.vtu of one case, for ParaView, meshio and `read_fields`.

    Nodes are doubled where regions meet, so that stresses may jump there. Point data are for
    looking at (displacement, and the quantities averaged within each tissue); cell data hold what
    was computed, at the Gauss points. All values are numbers, because few readers know VTK's texts:
    names are those of arrays in the field data. "region NAME" is a region's number and that of its
    tissue, "tissue NAME" a tissue's number, and "load" the load of this equilibrium, 0 to 1.
    """
    import pyvista  # takes a second, which only this function needs
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridWriter

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
    if fields.elastic_gradient is not None:
        grid.cell_data[_ELASTIC] = fields.elastic_gradient.reshape(n_cells, 12)
    for number, name in sorted(fields.region_names.items()):
        tissue = TISSUES.index(fields.region_tissues[number])
        grid.field_data[_REGION + name] = np.array([number, tissue])
    for number, name in enumerate(TISSUES):
        grid.field_data[_TISSUE + name] = np.array([number])
    grid.field_data["load"] = np.array([load])
    path = Path(folder) / FIELDS_FILE
    with replacing(path) as temporary:
        temporary.write_text(xml_text(vtkXMLUnstructuredGridWriter(), grid), encoding="ascii")
    return path


def xml_text(writer: Any, data: Any) -> str:
    """Text of a file of VTK's. Its writer must not write it itself: on a full disk it crashes."""
    writer.SetInputData(data)
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
    regions = {
        name.removeprefix(_REGION): values
        for name, values in grid.field_data.items()
        if name.startswith(_REGION)
    }
    tissue_names = {
        int(values[0]): name.removeprefix(_TISSUE)
        for name, values in grid.field_data.items()
        if name.startswith(_TISSUE)
    }
    gauss = (grid.n_cells, 3)
    elastic = grid.cell_data[_ELASTIC] if _ELASTIC in grid.cell_data else None
    return SectionFields(
        points=points,
        cells=node[grid.cells_dict[pyvista.CellType.QUADRATIC_TRIANGLE]],
        region=np.asarray(grid.cell_data["region"]),
        region_names={int(number): name for name, (number, _) in regions.items()},
        region_tissues={
            int(number): tissue_names[int(tissue)] for number, tissue in regions.values()
        },
        displacement=displacement,
        stress=np.reshape(grid.cell_data["gauss_stress_kPa"], (*gauss, 4)),
        deformation_gradient=np.reshape(
            grid.cell_data["gauss_deformation_gradient"], (*gauss, 2, 2)
        ),
        pressure=np.asarray(grid.cell_data["gauss_pressure_kPa"]),
        elastic_gradient=None if elastic is None else np.reshape(elastic, (*gauss, 2, 2)),
    )
