"""A solved section as an xarray dataset: labelled arrays with units, written as netCDF."""

from typing import TYPE_CHECKING, Any

from calfsocket.postprocess.contact_line import ContactLine
from calfsocket.postprocess.fields import TISSUES
from calfsocket.postprocess.quantities import UNITS, Quantities

if TYPE_CHECKING:
    import xarray

DIRECTIONS = ("x", "y")
COMPONENTS = ("11", "22", "33", "12")
_PLANE = ("row", "column")
_UNITS = {"kPa": "kPa", "mm": "mm", "mm2": "mm2", "percent": "percent", "deg": "degree"}
_SHARES = ("deformation_gradient", "elastic_gradient")
_AT_GAUSS = ("cell", "gauss_point")

CONTACT = {
    "pressure_kPa": "contact pressure on the skin, positive in compression",
    "shear_kPa": "friction traction along the skin, in the direction of increasing arc length",
    "gap_mm": "normal gap",
    "x_mm": "deformed position of the skin",
    "y_mm": "deformed position of the skin",
    "status": "open, stick or slip",
}
"""Arrays of `ContactLine` that differ from state to state, and what they are."""


def dataset(quantities: Quantities, line: ContactLine) -> "xarray.Dataset":
    """Return fields and contact of a section as labelled arrays.

    Returns
    -------
    xarray.Dataset
        Over `node`: displacement. Over `cell` and its six `corner` nodes (`nodes_of_cell`, in
        VTK's order): the quantities, averaged at nodes within each tissue. Over `cell` and
        `gauss_point`: Cauchy stress, deformation gradient and pressure as they were computed. Over
        `skin_point`: contact. Coordinates are those of the undeformed section; units are in the
        names, and in the attribute `units`.
    """
    import xarray  # half a second, which only this function needs

    fields = quantities.fields
    variables: dict[str, tuple[Any, ...]] = {
        "displacement_mm": (("node", "direction"), fields.displacement, "displacement"),
        "stress_kPa": ((*_AT_GAUSS, "component"), fields.stress, "Cauchy stress"),
        "deformation_gradient": (
            (*_AT_GAUSS, *_PLANE),
            fields.deformation_gradient,
            "deformation gradient in the plane",
        ),
        "mixed_pressure_kPa": (
            _AT_GAUSS,
            fields.pressure,
            "pressure of the mixed field, positive in compression",
        ),
        "gauss_area_mm2": (_AT_GAUSS, fields.gauss_area, "undeformed area of the Gauss point"),
    }
    if fields.elastic_gradient is not None:
        variables["elastic_gradient"] = (
            (*_AT_GAUSS, *_PLANE),
            fields.elastic_gradient,
            "deformation gradient from the stress-free state",
        )
    for name, unit in UNITS.items():
        column = f"{name}_{'kPa' if unit == 'kPa' else 'percent'}"
        text = f"{name.replace('_', ' ')}, averaged at nodes within each tissue"
        variables[column] = (("cell", "corner"), quantities.nodal[name], text)
    for name, text in CONTACT.items():
        variables[f"contact_{name}"] = ("skin_point", getattr(line, name), text)
    region = [fields.region_names[int(number)] for number in fields.region]
    tissue = [TISSUES[number] for number in fields.tissue]
    coordinates: dict[str, tuple[Any, ...]] = {
        "node_x_mm": ("node", fields.points[:, 0], "undeformed position, lateral or medial"),
        "node_y_mm": ("node", fields.points[:, 1], "undeformed position, anterior"),
        "nodes_of_cell": (("cell", "corner"), fields.cells, "three corners, mid-sides 01, 12, 20"),
        "region": ("cell", region, "region of the section"),
        "tissue": ("cell", tissue, "tissue of the region"),
        "direction": ("direction", list(DIRECTIONS), "axis of the section"),
        "component": ("component", list(COMPONENTS), "of the stress; 3 is along the limb"),
        "arc_mm": ("skin_point", line.arc_mm, "arc length along the undeformed skin"),
        "angle_deg": ("skin_point", line.angle_deg, "about the origin, counter-clockwise from +x"),
        "weight_mm": ("skin_point", line.weight_mm, "length that the point stands for"),
    }
    return xarray.Dataset(_with_attributes(variables), _with_attributes(coordinates))


def _with_attributes(arrays: dict[str, tuple[Any, ...]]) -> dict[str, tuple[Any, ...]]:
    """Replace each array's text by its attributes; its unit is the last word of its name."""
    made: dict[str, tuple[Any, ...]] = {}
    for name, (dimensions, values, text) in arrays.items():
        unit = "1" if name in _SHARES else _UNITS.get(name.rpartition("_")[2])
        attributes = {"long_name": text} | ({"units": unit} if unit else {})
        made[name] = (dimensions, values, attributes)
    return made
