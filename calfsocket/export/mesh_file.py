"""A mesh alone, with the names of its regions and boundaries: gmsh's files, and XDMF."""

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calfsocket.meshes.triangles import TriangleMesh


def write_msh(path: Path, mesh: TriangleMesh) -> None:
    """Write a gmsh file of version 2.2, which most programs read, with named physical groups."""
    import meshio  # that no other format needs

    of_cells = [mesh.facet_tags, mesh.cell_tags]
    names = {name: np.array([tag, 1]) for name, tag in mesh.boundaries.items()}
    names |= {name: np.array([tag, 2]) for name, tag in mesh.regions.items()}
    meshio.Mesh(
        np.pad(mesh.points, ((0, 0), (0, 1))),
        [("line3", mesh.facets), ("triangle6", mesh.cells)],
        cell_data={"gmsh:physical": of_cells, "gmsh:geometrical": of_cells},
        field_data=names,
    ).write(path, file_format="gmsh22", binary=False)


def xdmf(mesh: TriangleMesh) -> str:
    """Return the text of an XDMF file, its numbers in it.

    XDMF has no names: each cell has the number of its region, each node that of its boundary (0
    where it is on none), and the names stand in the file as meshio writes and reads them.
    """
    root = ET.Element("Xdmf", Version="3.0")
    grid = ET.SubElement(ET.SubElement(root, "Domain"), "Grid", Name="section")
    shape = ET.SubElement(
        grid,
        "Topology",
        TopologyType="Triangle_6",
        NumberOfElements=str(len(mesh.cells)),
        NodesPerElement="6",
    )
    _numbers(shape, mesh.cells, "Int", "8")
    geometry = ET.SubElement(grid, "Geometry", GeometryType="XYZ")
    _numbers(geometry, np.pad(mesh.points, ((0, 0), (0, 1))), "Float", "8")
    at_nodes = np.zeros(len(mesh.points), dtype=np.int32)
    at_nodes[mesh.facets] = mesh.facet_tags[:, None]
    for name, centre, values in (
        ("region", "Cell", mesh.cell_tags),
        ("boundary", "Node", at_nodes),
    ):
        data = ET.SubElement(grid, "Attribute", Name=name, AttributeType="Scalar", Center=centre)
        _numbers(data, values, "Int", "4")
    names = ET.Element("main")
    for dim, of_names in ((1, mesh.boundaries), (2, mesh.regions)):
        for name, tag in of_names.items():
            ET.SubElement(names, "map", key=name, dim=str(dim)).text = str(tag)
    information = ET.SubElement(grid, "Information", Name="Information", Value=str(len(names)))
    information.text = ET.tostring(names, encoding="unicode")
    ET.indent(root)
    return '<?xml version="1.0"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def _numbers(parent: ET.Element, values: NDArray[np.generic], kind: str, precision: str) -> None:
    item = ET.SubElement(
        parent,
        "DataItem",
        DataType=kind,
        Dimensions=" ".join(map(str, values.shape)),
        Format="XML",
        Precision=precision,
    )
    rows = values.reshape(len(values), -1).tolist()
    item.text = "\n" + "\n".join(" ".join(map(repr, row)) for row in rows) + "\n"
