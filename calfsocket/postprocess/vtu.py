"""fields.vtu: the fields of one case for ParaView, and read back without loss."""

import zlib
from binascii import a2b_base64
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from calfsocket.io.files import replacing
from calfsocket.postprocess.fields import TISSUES, SectionFields
from calfsocket.postprocess.quantities import UNITS, Quantities

FIELDS_FILE = "fields.vtu"

_ARRAY = b"<DataArray"
_ELASTIC = "gauss_elastic_gradient"
_REGION, _TISSUE = "region ", "tissue "
"""Start of the names of arrays that stand for the name of a region or tissue."""

_LEVEL = 1
"""How hard zlib packs: VTK's own 5 takes half as long again, and saves half a percent."""


def write_fields(folder: Path, quantities: Quantities, load: float) -> Path:
    """Write fields.vtu of one case, for ParaView, meshio and `read_fields`.

    Nodes are doubled where regions meet, so that stresses may jump there. Point data are for
    looking at (displacement, and the quantities averaged within each tissue); cell data hold what
    was computed, at the Gauss points. All values are numbers, because few readers know VTK's texts:
    names are those of arrays in the field data. "region NAME" is a region's number and that of its
    tissue, "tissue NAME" a tissue's number, and "load" the load of this equilibrium, 0 to 1.
    """
    fields = quantities.fields
    n_nodes = len(fields.points)
    node_of_region = fields.region[:, None] * n_nodes + fields.cells
    copies, cells = np.unique(node_of_region, return_inverse=True)
    cells = cells.reshape(fields.cells.shape)
    node = copies % n_nodes
    pad = ((0, 0), (0, 1))
    at_nodes = {"displacement": np.pad(fields.displacement[node], pad)}
    unit_names = {"kPa": "kPa", "%": "percent"}
    for name, unit in UNITS.items():
        values = np.empty(len(node))
        values[cells] = quantities.nodal[name]
        at_nodes[f"{name}_{unit_names[unit]}"] = values
    at_nodes["node"] = node
    n_cells = len(cells)
    in_cells = {
        "region": fields.region,
        "tissue": fields.tissue,
        "gauss_stress_kPa": fields.stress.reshape(n_cells, 12),
        "gauss_deformation_gradient": fields.deformation_gradient.reshape(n_cells, 12),
        "gauss_pressure_kPa": fields.pressure,
    }
    if fields.elastic_gradient is not None:
        in_cells[_ELASTIC] = fields.elastic_gradient.reshape(n_cells, 12)
    of_all = {}
    for number, name in sorted(fields.region_names.items()):
        tissue = TISSUES.index(fields.region_tissues[number])
        of_all[_REGION + name] = np.array([number, tissue])
    of_all |= {_TISSUE + name: np.array([number]) for number, name in enumerate(TISSUES)}
    of_all["load"] = np.array([load])
    path = Path(folder) / FIELDS_FILE
    with replacing(path) as temporary:
        text = _text_of(np.pad(fields.points[node], pad), cells, at_nodes, in_cells, of_all)
        temporary.write_text(text, encoding="ascii")
    return path


def _text_of(
    points: NDArray[np.float64],
    cells: NDArray[np.int64],
    at_nodes: Mapping[str, NDArray[Any]],
    in_cells: Mapping[str, NDArray[Any]],
    of_all: Mapping[str, NDArray[Any]],
) -> str:
    """Text of a file of six-node cells (n, 6) on points (m, 3), with data at nodes and in cells.

    VTK itself takes a tenth of pyvista's time to load, which would load matplotlib, too.
    """
    from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import (
        VTK_QUADRATIC_TRIANGLE,
        vtkCellArray,
        vtkUnstructuredGrid,
    )
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridWriter

    grid, nodes, elements = vtkUnstructuredGrid(), vtkPoints(), vtkCellArray()
    nodes.SetData(numpy_to_vtk(points))
    grid.SetPoints(nodes)
    starts, connectivity = np.arange(0, cells.size + 1, cells.shape[1]), cells.ravel()
    elements.SetData(numpy_to_vtkIdTypeArray(starts), numpy_to_vtkIdTypeArray(connectivity))
    grid.SetCells(VTK_QUADRATIC_TRIANGLE, elements)
    for data, arrays in (
        (grid.GetPointData(), at_nodes),
        (grid.GetCellData(), in_cells),
        (grid.GetFieldData(), of_all),
    ):
        for name, values in arrays.items():
            array = numpy_to_vtk(np.ascontiguousarray(values))
            array.SetName(name)
            data.AddArray(array)
    grid.GetPointData().SetActiveScalars(next(iter(at_nodes)))  # what ParaView shows at first
    grid.GetCellData().SetActiveScalars(next(iter(in_cells)))
    return xml_text(vtkXMLUnstructuredGridWriter(), grid)


def xml_text(writer: Any, data: Any) -> str:
    """Text of a file of VTK's. Its writer must not write it itself: on a full disk it crashes."""
    writer.SetInputData(data)
    writer.SetDataModeToBinary()
    writer.SetCompressionLevel(_LEVEL)
    writer.WriteToOutputStringOn()
    writer.Write()
    text: str = writer.GetOutputString()
    return text


def read_fields(folder: Path) -> SectionFields:
    """Read back what `write_fields` wrote, without loss.

    VTK's own reader reads what is for looking at, too, and takes half a second to import; a parser
    of XML looks at every letter of the numbers.

    Raises
    ------
    OSError, ValueError, KeyError
        When the file cannot be read, is not such a file, or lacks an array.
    """
    head, *parts = (Path(folder) / FIELDS_FILE).read_bytes().split(_ARRAY)
    file = _attributes(head[head.index(b"<VTKFile") :])
    arrays = {_attributes(part)["Name"]: part for part in (_ARRAY + part for part in parts)}

    def read(name: str, *shape: int) -> NDArray[Any]:
        return _numbers(arrays[name], file).reshape(shape)

    node = read("node", -1)
    n_nodes = int(node.max()) + 1
    points, displacement = np.zeros((n_nodes, 2)), np.zeros((n_nodes, 2))
    points[node] = read("Points", -1, 3)[:, :2]
    displacement[node] = read("displacement", -1, 3)[:, :2]
    regions = {
        name.removeprefix(_REGION): read(name, 2) for name in arrays if name.startswith(_REGION)
    }
    tissue_names = {
        int(*read(name, 1)): name.removeprefix(_TISSUE)
        for name in arrays
        if name.startswith(_TISSUE)
    }
    return SectionFields(
        points=points,
        cells=node[read("connectivity", -1, 6)],
        region=read("region", -1),
        region_names={int(number): name for name, (number, _) in regions.items()},
        region_tissues={
            int(number): tissue_names[int(tissue)] for number, tissue in regions.values()
        },
        displacement=displacement,
        stress=read("gauss_stress_kPa", -1, 3, 4),
        deformation_gradient=read("gauss_deformation_gradient", -1, 3, 2, 2),
        pressure=read("gauss_pressure_kPa", -1, 3),
        elastic_gradient=read(_ELASTIC, -1, 3, 2, 2) if _ELASTIC in arrays else None,
    )


def _attributes(text: bytes) -> dict[str, str]:
    """Return the attributes of the element of XML that a text begins with."""
    try:
        return ElementTree.fromstring(text[: text.index(b">")].rstrip(b"/") + b"/>").attrib
    except ElementTree.ParseError as error:
        raise ValueError(str(error)) from None


def _numbers(array: bytes, file: Mapping[str, str]) -> NDArray[Any]:
    """Return the numbers of an array: blocks that are compressed, behind their sizes, as base64.

    `file` has the attributes of the file.
    """
    kind = _attributes(array)
    start = array.index(b">") + 1
    text = array[start : array.index(b"<", start)].strip()
    order = {"LittleEndian": "<", "BigEndian": ">"}[file["byte_order"]]
    word = np.dtype(order + {"UInt32": "u4", "UInt64": "u8"}[file["header_type"]])

    def words(n: int) -> tuple[NDArray[Any], int]:
        """Return the first words, and the number of letters that they take."""
        letters = 4 * -(-n * word.itemsize // 3)
        return np.frombuffer(a2b_base64(text[:letters]), word, n), letters

    n_blocks = int(words(1)[0][0])
    head, letters = words(3 + n_blocks)  # number and size of blocks, size of the last one
    packed = a2b_base64(text[letters:])
    ends = np.cumsum(head[3:]).tolist()
    try:
        blocks = [zlib.decompress(packed[a:b]) for a, b in pairwise([0, *ends])]
    except zlib.error as error:
        raise ValueError(f"{kind['Name']}: {error}") from None
    number = np.dtype(order + {"Int64": "i8", "Int32": "i4", "Float64": "f8"}[kind["type"]])
    return np.frombuffer(bytearray().join(blocks), number)
