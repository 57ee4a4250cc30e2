"""Input of FEBio 4 (`febio_spec` 4.0): a slab one element thick, held in its thickness.

FEBio has no means of its own to let an overlap go by little and little. The socket is therefore put
on as a hand would do it, in three steps: its nodes are moved outward until it is clear of the limb,
back to where they belong, with contact, and then set free.
"""

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

import calfsocket
from calfsocket.export.case import SIDES, ExportedCase, LoadStep, Material, rows
from calfsocket.export.laws import Converted, Invariant, Linear, Series, converted
from calfsocket.mechanics.carrier import COMPONENTS
from calfsocket.meshes import tags

THICKNESS = 1.0
"""Of the slab, mm, so that forces are those for each mm of the limb's length."""

PENALTY = 10.0
"""Of the contact, MPa/mm: at a pressure of 10 kPa the surfaces overlap by 0.001 mm."""

REACH = 10.0
"""Distance to which the other surface is looked for, mm: more than any overlap."""

INCREMENTS = 20
"""Steps of each part of donning."""

MOST_RETRIES = 10
"""Times that a step that fails is cut back."""

ABAQUS_PRESSURE = "Abaqus"
"""Name of the volumetric energy K/2 (J - 1)^2 among FEBio's."""

BODY, ALL = "socket_body", "all_nodes"
"""Sets of nodes: those that move with the socket, and all."""

_SHARES, _INSIDE = (1 / 6, 1 / 2), 2 / 3
"""Shares of a force that nodes at the slab's faces have, at corners and between them, and the node
in the middle of its thickness."""

WIDEN, CLOSE, FREE = "widen", "close", "donned"

DONNED = 3.0
"""Time at the end of these three steps, of 1 each."""


def deck(case: ExportedCase) -> tuple[str, list[str]]:
    """Return the input file of a case and the remarks in its head, on what differs."""
    writer = _Writer(case)
    root = writer.root()
    ET.indent(root)
    remarks = writer.remarks
    head = [
        case.title,
        f"Written by calfsocket {calfsocket.__version__} for FEBio 4. mm, N, MPa.",
        "What differs from calfsocket:",
        *(f"- {remark}" for remark in remarks),
    ]
    comment = "\n".join(line.replace("--", "- -") for line in head)  # XML has no -- in comments
    text = ET.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n<!--\n{comment}\n-->\n{text}\n', remarks


class _Writer:
    """Makes the elements of the file, and collects what has to be said."""

    def __init__(self, case: ExportedCase) -> None:
        self.case = case
        self.remarks: list[str] = []
        mesh = case.mesh
        self._n = len(mesh.points)
        self._corners = np.unique(mesh.cells[:, :3])
        self._middle = np.full(self._n, -1)
        self._middle[self._corners] = 2 * self._n + np.arange(len(self._corners))
        self._curves: list[list[tuple[float, float]]] = []
        self._data: list[ET.Element] = []
        self._force, self._place = np.zeros((2, COMPONENTS))

    def root(self) -> ET.Element:
        """Return the root of the file."""
        case = self.case
        root = ET.Element("febio_spec", version="4.0")
        _add(root, "Module", type="solid")
        constants = _add(_add(root, "Globals"), "Constants")
        for name in ("T", "P", "R", "Fc"):
            _add(constants, name, "0")
        self._materials(_add(root, "Material"))
        mesh = _add(root, "Mesh")
        self._mesh(mesh)
        domains = _add(root, "MeshDomains")
        for material in case.materials:
            for region in material.regions:
                _add(domains, "SolidDomain", name=region, mat=material.name, type="elastic-solid")
        data = _add(root, "MeshData")
        self._fixed(_add(root, "Boundary"))
        self._contact(_add(root, "Contact"))
        steps = _add(root, "Step")
        self._donning(steps)
        for step in case.steps:
            self._loading(steps, step)
        self._load_data(_add(root, "LoadData"))
        self._output(_add(root, "Output"))
        data.extend(self._data)
        if case.moves_socket:
            self.remarks.append(
                "loads: a displacement moves the outer face as one body by a small angle's rule; a"
                " force and a moment are spread evenly over it, a frame too, and keep their"
                " directions"
            )
        self.remarks.append(
            f"donning: FEBio lets no overlap go by little and little; the socket's nodes are moved"
            f" outward by {100 * case.swelling:.3g} % of their distance from its middle, back with"
            " contact, and set free. Shear and the skin's stress depend on that path: compare with"
            ' donning = "expanded"'
        )
        return root

    # -- model ----------------------------------------------------------------------------------

    def _materials(self, parent: ET.Element) -> None:
        for number, material in enumerate(self.case.materials, 1):
            law, remarks = converted(material.name, material.law, mixed=False)
            self.remarks += remarks
            states = self._stress_free(material)
            name = {"id": str(number), "name": material.name}
            if states is None:
                self._law(_add(parent, "material", **name, type=_kind(law)), law)
            else:
                made = _add(parent, "material", **name, type="prestrain elastic")
                self._law(_add(made, "elastic", type=_kind(law)), law)
                self._prestrain(made, *states)
            if isinstance(law.form, Linear):
                self.remarks.append(
                    f"{material.name}: Hencky's law has U = K/2 ln^2 J in FEBio's natural"
                    " neo-Hookean material; at a change of volume of 0.1 % its pressure differs by"
                    " 0.15 %"
                )

    def _stress_free(
        self, material: Material
    ) -> tuple[str | NDArray[np.float64], list[tuple[float, float]]] | None:
        """Return the gradient from a material's stress-free state, or its map, and its way there.

        A material point has the gradient I + r (F0 - I) before any displacement. At times of full
        stages r is such that this is the inverse of the tensor G of `materials.stress_free`.
        """
        case, tissue = self.case, self.case.tissues[material.regions[0]]
        if case.undersize and material.regions == (tags.LINER,):
            return self._around(), [(0.0, 0.0), (1.0, 0.0), (2.0, 1.0), (1e6, 1.0)]
        ratios = [step.volume.get(tissue, 0.0) + 1.0 for step in case.steps]
        gains = [ratio**-0.5 - 1.0 for ratio in ratios]
        most = max(gains, key=abs, default=0.0)
        if most == 0.0:
            return None
        ends = [(DONNED + number, gain / most) for number, gain in enumerate(gains, 1)]
        return np.diag([1.0 + most, 1.0 + most, 1.0]), [(0.0, 0.0), (DONNED, 0.0), *ends]

    def _around(self) -> str:
        """Map the stretch of a liner's fibres around the limb, which are short by its undersize."""
        case, name = self.case, "liner_undersize"
        members = f"tissue_{case.tissues[tags.LINER]}"
        data = ET.Element("ElementData", name=name, elem_set=members, data_type="mat3")
        longer = 1.0 / (1.0 - case.undersize) - 1.0
        for number, (x, y) in enumerate(rows(case.fibres), 1):
            along = np.array([x, y, 0.0])
            gradient = np.eye(3) + longer * np.outer(along, along)
            _add(data, "elem", _numbers(gradient), lid=str(number))
        self._data.append(data)
        return name

    def _prestrain(
        self,
        parent: ET.Element,
        gradient: str | NDArray[np.float64],
        way: list[tuple[float, float]],
    ) -> None:
        made = _add(parent, "prestrain", type="prestrain gradient")
        _add(made, "ramp", "1", lc=str(self._curve(way)))
        if isinstance(gradient, str):
            _add(made, "F0", gradient, type="map")
        else:
            _add(made, "F0", _numbers(gradient))

    def _law(self, parent: ET.Element, law: Converted) -> None:
        _add(parent, "density", "1e-09")  # t/mm^3, which statics does not use
        match law.form:
            case Series(mu, alpha):
                for number, (m, a) in enumerate(zip(mu, alpha, strict=True), 1):
                    _add(parent, f"c{number}", _number(2 * m))
                    _add(parent, f"m{number}", _number(a))
            case Invariant(c):
                for number, value in enumerate(c, 1):
                    _add(parent, f"c{number}", _number(value))
            case Linear(e, nu):
                _add(parent, "E", _number(e))
                _add(parent, "v", _number(nu))
                return
        _add(parent, "k", _number(law.bulk))
        _add(parent, "pressure_model", ABAQUS_PRESSURE)

    def _mesh(self, parent: ET.Element) -> None:
        case = self.case
        nodes = _add(parent, "Nodes", name="section")
        flat = rows(case.mesh.points)
        for number, (x, y, z) in enumerate(
            [
                *((x, y, 0.0) for x, y in flat),
                *((x, y, THICKNESS) for x, y in flat),
                *((x, y, 0.5 * THICKNESS) for x, y in rows(case.mesh.points[self._corners])),
            ],
            1,
        ):
            _add(nodes, "node", f"{x:.12g},{y:.12g},{z:g}", id=str(number))
        for region in case.mesh.regions:
            elements = _add(parent, "Elements", type="penta15", name=region)
            for cell in case.cells(region):
                _add(elements, "elem", _listed(self._prism(cell)), id=str(cell + 1))
        for tissue, regions in case.tissue_sets.items():
            members = np.concatenate([case.cells(region) for region in regions])
            _add(parent, "ElementSet", _listed(np.sort(members)), name=f"tissue_{tissue}")
        self._node_set(parent, ALL, np.arange(self._n))
        for boundary in case.mesh.boundaries:
            if len(case.facets(boundary)):
                self._node_set(parent, boundary, case.nodes(boundary))
                self._surface(parent, boundary)
        self._node_set(parent, BODY, self._body)
        pair = _add(parent, "SurfacePair", name="skin_on_socket")
        _add(pair, "primary", case.surfaces[0])
        _add(pair, "secondary", case.surfaces[1])

    @property
    def _body(self) -> NDArray[np.int64]:
        """Nodes of the section that move with the socket."""
        return np.unique(self.case.mesh.cells[self.case.socket_cells])

    def _through(self, nodes: NDArray[np.int64]) -> NDArray[np.int64]:
        """Nodes of the slab at nodes of the section: below, above and between."""
        between = self._middle[nodes]
        return np.concatenate([nodes, nodes + self._n, between[between >= 0]])

    def _node_set(self, parent: ET.Element, name: str, nodes: NDArray[np.int64]) -> None:
        _add(parent, "NodeSet", _listed(self._through(nodes)), name=name)

    def _prism(self, cell: int) -> list[int]:
        corners, middles = np.split(self.case.mesh.cells[cell], 2)
        above = self._n
        return [*corners, *(corners + above), *middles, *(middles + above), *self._middle[corners]]

    def _surface(self, parent: ET.Element, boundary: str) -> None:
        """Add the faces of a boundary, their normals outward."""
        surface, above = _add(parent, "Surface", name=boundary), self._n
        for number, (cell, side) in enumerate(self.case.sides(boundary), 1):
            nodes = self.case.mesh.cells[cell]
            a, b = nodes[list(SIDES[side])]
            m = nodes[3 + side]
            face = [a, b, b + above, a + above, m, self._middle[b], m + above, self._middle[a]]
            _add(surface, "quad8", _listed(face), id=str(number))

    def _fixed(self, parent: ET.Element) -> None:
        self._zero(parent, "plane strain", ALL, "z")
        self._zero(parent, "bone", tags.TIBIA_MEDULLARY, "xy")

    def _zero(self, parent: ET.Element, name: str, nodes: str, axes: str) -> None:
        bc = _add(parent, "bc", name=name, node_set=nodes, type="zero displacement")
        for axis in "xyz":
            _add(bc, f"{axis}_dof", str(int(axis in axes)))

    def _contact(self, parent: ET.Element) -> None:
        contact = _add(
            parent,
            "contact",
            name="skin on socket",
            type="sliding-elastic",
            surface_pair="skin_on_socket",
        )
        # Off while the socket is moved outward.
        curve = self._curve([(0.0, 0.0), (0.999, 0.0), (1.0, 1.0), (1e6, 1.0)])
        for name, value in (
            ("laugon", "PENALTY"),
            ("two_pass", "0"),
            ("auto_penalty", "0"),
            ("symmetric_stiffness", "0"),
            ("search_radius", _number(REACH)),
            ("fric_coeff", _number(self.case.contact.friction)),
        ):
            _add(contact, name, value)
        _add(contact, "penalty", _number(PENALTY), lc=str(curve))
        self.remarks.append(f"contact: by a penalty of {PENALTY:g} MPa/mm; calfsocket has none")

    # -- steps ----------------------------------------------------------------------------------

    def _step(self, parent: ET.Element, name: str, increments: int) -> ET.Element:
        step = _add(parent, "step", id=str(len(parent) + 1), name=name)
        control = _add(step, "Control")
        for key, value in (
            ("analysis", "STATIC"),
            ("time_steps", str(increments)),
            ("step_size", _number(1.0 / increments)),
            ("plot_level", "PLOT_MAJOR_ITRS"),
        ):
            _add(control, key, value)
        stepper = _add(control, "time_stepper", type="default")
        _add(stepper, "max_retries", str(MOST_RETRIES))
        _add(stepper, "dtmax", _number(1.0 / increments))
        solver = _add(control, "solver", type="solid")
        _add(solver, "symmetric_stiffness", "non-symmetric")
        _add(solver, "qn_method", type="full Newton")
        return step

    def _donning(self, steps: ET.Element) -> None:
        case = self.case
        arms = case.mesh.points[self._body] - case.inner_middle
        curve = self._curve([(0.0, 0.0), (1.0, 1.0), (2.0, 0.0)])
        for name in (WIDEN, CLOSE):
            boundary = _add(self._step(steps, name, INCREMENTS), "Boundary")
            for axis, label in enumerate("xy"):
                self._prescribed(
                    boundary, f"{name} {label}", BODY, label, case.swelling * arms[:, axis], curve
                )
        self._released(self._step(steps, FREE, INCREMENTS))

    def _released(self, step: ET.Element) -> None:
        if self.case.is_fixed:
            self._zero(_add(step, "Boundary"), "outer face", tags.SOCKET_OUTER, "xy")

    def _prescribed(
        self,
        parent: ET.Element,
        name: str,
        nodes: str,
        axis: str,
        values: Sequence[float] | NDArray[np.float64],
        curve: int,
        relative: bool = False,
    ) -> None:
        """Prescribe displacements of a set; values are those of its nodes in the section."""
        bc = _add(parent, "bc", name=name, node_set=nodes, type="prescribed displacement")
        _add(bc, "dof", axis)
        _add(bc, "value", self._map(name, nodes, values), lc=str(curve), type="map")
        _add(bc, "relative", str(int(relative)))

    def _map(
        self,
        name: str,
        nodes: str,
        values: Sequence[float] | NDArray[np.float64],
        shared: bool = False,
    ) -> str:
        """Add values at the nodes of a set; return the name of the map.

        They are the same through the slab, or shared by the nodes through it: forces are.
        """
        of_set = {BODY: self._body}.get(nodes)
        section = self.case.nodes(nodes) if of_set is None else of_set
        at = np.zeros(self._n)
        at[section] = values
        word = name.replace(" ", "_")
        data = ET.Element("NodeData", name=word, node_set=nodes)
        middles = self._middle[section] >= 0
        outside = np.where(middles, *_SHARES) if shared else 1.0
        inside = _INSIDE if shared else 1.0
        at_ends = outside * at[section]
        through = np.concatenate([at_ends, at_ends, inside * at[section[middles]]])
        for number, value in enumerate(through, 1):
            _add(data, "node", _number(value), lid=str(number))
        self._data.append(data)
        return word

    def _loading(self, steps: ET.Element, step: LoadStep) -> None:
        """Add a way of a stage of loading, over the next unit of time."""
        case = self.case
        made = self._step(steps, step.name, step.increments)
        start = float(len(steps) - 1)
        curve = self._curve([(0.0, 0.0), (start, 0.0), (start + 1.0, 1.0), (1e6, 1.0)])
        if not case.moves_socket:
            self._released(made)
        else:
            self._carry(made, step, curve, start)
        self._force, self._place = np.where(step.held, 0.0, step.force), step.place

    def _carry(self, made: ET.Element, step: LoadStep, curve: int, start: float) -> None:
        """Add forces on the outer face, and displacements from where it was."""
        case, face = self.case, tags.SOCKET_OUTER
        moved = step.place - self._place
        if step.held.any():
            boundary = _add(made, "Boundary")
            arms = case.outer_arms
            for axis, label in enumerate("xy"):
                if step.held[axis] or step.held[2]:
                    lever = (-arms[:, 1], arms[:, 0])[axis] * (moved[2] if step.held[2] else 0.0)
                    values = lever + (moved[axis] if step.held[axis] else 0.0)
                    name = f"{step.name} {label}"
                    self._prescribed(boundary, name, face, label, values, curve, relative=True)
        before = self._curve([(0.0, 1.0), (start, 1.0), (start + 1.0, 0.0), (1e6, 0.0)])
        force = np.where(step.held, 0.0, step.force)
        if not (force.any() or self._force.any()):
            return
        loads = _add(made, "Loads")
        # From the force of the stage before to that of this one.
        for what, values, by in (("from", self._force, before), ("to", force, curve)):
            for axis, label in enumerate("xy"):
                name = f"{step.name} force {what} {label}"
                at_nodes = case.even_forces(values)[:, axis]
                load = _add(loads, "nodal_load", name=name, node_set=face, type="nodal_load")
                _add(load, "dof", label)
                _add(load, "scale", self._map(name, face, at_nodes, True), lc=str(by), type="map")

    def _curve(self, points: list[tuple[float, float]]) -> int:
        """Add a curve over time; return its number."""
        self._curves.append(points)
        return len(self._curves)

    def _load_data(self, parent: ET.Element) -> None:
        for number, points in enumerate(self._curves, 1):
            controller = _add(parent, "load_controller", id=str(number), type="loadcurve")
            _add(controller, "interpolate", "LINEAR")
            _add(controller, "extend", "CONSTANT")
            listed = _add(controller, "points")
            for time, value in points:
                _add(listed, "pt", f"{time:g},{_number(value)}")

    def _output(self, parent: ET.Element) -> None:
        plot = _add(parent, "plotfile", type="febio")
        for variable in (
            "displacement", "stress", "relative volume", "reaction forces",
            "contact pressure", "contact traction", "contact gap",
        ):  # fmt: skip
            _add(plot, "var", type=variable)


def _kind(law: Converted) -> str:
    match law.form:
        case Series():
            return "Ogden"
        case Invariant():
            return "Yeoh"
        case Linear():
            return "natural neo-Hookean"


def _add(parent: ET.Element, tag: str, text: str | None = None, **attributes: str) -> ET.Element:
    element = ET.SubElement(parent, tag, attributes)
    element.text = text
    return element


def _number(value: float) -> str:
    return f"{value:.12g}"


def _numbers(tensor: NDArray[np.float64]) -> str:
    """Write a tensor row by row."""
    return ",".join(map(_number, tensor.ravel().tolist()))


def _listed(nodes: Iterable[int]) -> str:
    return ",".join(str(int(node) + 1) for node in nodes)
