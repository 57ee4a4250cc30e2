"""Readers of decks that refuse what the programs' manuals do not allow.

Keywords and parameters are those of Abaqus's keywords manual as CalculiX's manual has them, too,
where the programs share them; elements and attributes of FEBio's file those of its user manual and
its source.
"""

import re
import xml.etree.ElementTree as ET
from dataclasses import dataclass, field

import numpy as np

ABAQUS, CALCULIX = "abaqus", "calculix"
BOTH = (ABAQUS, CALCULIX)

NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
LABEL = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,79}")
LONGEST_LINE, LONGEST_NUMBER, MOST_ENTRIES = 132, 20, 16


@dataclass(frozen=True)
class Keyword:
    """Where a keyword may stand and what it takes.

    Parameters have the values they may have: None where there is none, "" for any label.
    """

    programs: tuple[str, ...] = BOTH
    in_step: bool = False
    in_model: bool = True
    needs: tuple[str, ...] = ()
    takes: dict[str, tuple[str, ...] | None] = field(default_factory=dict)
    data: tuple[int, int] = (0, 10**9)  # fewest and most data lines


ELEMENTS = {"CPE6H": 6, "CPE6": 6, "SPRING1": 1}
OF_PROGRAM = {ABAQUS: "CPE6H", CALCULIX: "CPE6"}

KEYWORDS = {
    "HEADING": Keyword(data=(1, 10)),
    "NODE": Keyword(needs=("NSET",), takes={"NSET": ()}, data=(1, 10**9)),
    "ELEMENT": Keyword(
        needs=("TYPE", "ELSET"), takes={"TYPE": tuple(ELEMENTS), "ELSET": ()}, data=(1, 10**9)
    ),
    "ELSET": Keyword(needs=("ELSET",), takes={"ELSET": ()}, data=(1, 10**9)),
    "NSET": Keyword(needs=("NSET",), takes={"NSET": ()}, data=(1, 10**9)),
    "SURFACE": Keyword(
        needs=("NAME", "TYPE"), takes={"NAME": (), "TYPE": ("ELEMENT",)}, data=(1, 10**9)
    ),
    "MATERIAL": Keyword(needs=("NAME",), takes={"NAME": ()}, data=(0, 0)),
    "HYPERELASTIC": Keyword(
        takes={"OGDEN": None, "YEOH": None, "N": ("1", "2", "3", "4", "5", "6")}, data=(1, 2)
    ),
    "ELASTIC": Keyword(data=(1, 1)),
    # In Abaqus orthotropic expansion is not for hyperelastic materials.
    "EXPANSION": Keyword(needs=("ZERO",), takes={"ZERO": (), "TYPE": ("ORTHO",)}),
    "DISTRIBUTION": Keyword((CALCULIX,), needs=("NAME",), takes={"NAME": ()}, data=(2, 10**9)),
    "ORIENTATION": Keyword((CALCULIX,), needs=("NAME",), takes={"NAME": ()}, data=(1, 1)),
    "SOLID SECTION": Keyword(
        needs=("ELSET", "MATERIAL"),
        takes={"ELSET": (), "MATERIAL": (), "ORIENTATION": ()},
        data=(1, 1),
    ),
    "SURFACE INTERACTION": Keyword(needs=("NAME",), takes={"NAME": ()}, data=(0, 1)),
    "SURFACE BEHAVIOR": Keyword(
        needs=("PRESSURE-OVERCLOSURE",),
        takes={"PRESSURE-OVERCLOSURE": ("HARD", "LINEAR")},
        data=(0, 1),
    ),
    "FRICTION": Keyword(data=(1, 1)),
    "CONTACT PAIR": Keyword(
        needs=("INTERACTION", "TYPE"),
        takes={"INTERACTION": (), "TYPE": ("SURFACE TO SURFACE",)},
        data=(1, 1),
    ),
    "EQUATION": Keyword(data=(2, 10**9)),
    "SPRING": Keyword(needs=("ELSET",), takes={"ELSET": ()}, data=(2, 2)),
    "INITIAL CONDITIONS": Keyword(needs=("TYPE",), takes={"TYPE": ("TEMPERATURE",)}, data=(1, 1)),
    "BOUNDARY": Keyword(in_step=True, takes={"OP": ("NEW", "MOD"), "FIXED": None}, data=(1, 10**9)),
    "STEP": Keyword(
        in_model=True,
        needs=("NLGEOM", "INC"),
        takes={"NLGEOM": ("YES",), "INC": (), "NAME": (), "UNSYMM": ("YES",)},
        data=(0, 0),
    ),
    "STATIC": Keyword(in_step=True, in_model=False, data=(1, 1)),
    "CONTACT INTERFERENCE": Keyword(
        (ABAQUS,), True, False, ("SHRINK",), {"SHRINK": None}, data=(1, 1)
    ),
    "MODEL CHANGE": Keyword(
        in_step=True,
        in_model=False,
        needs=("TYPE",),
        takes={"TYPE": ("CONTACT PAIR",), "ADD": None, "REMOVE": None},
        data=(1, 1),
    ),
    "CLOAD": Keyword(in_step=True, in_model=False, data=(1, 10**9)),
    "TEMPERATURE": Keyword(in_step=True, in_model=False, data=(1, 1)),
    "OUTPUT": Keyword((ABAQUS,), True, False, (), {"FIELD": None, "HISTORY": None}, (0, 0)),
    "NODE OUTPUT": Keyword((ABAQUS,), True, False, (), {"NSET": ()}, (1, 1)),
    "ELEMENT OUTPUT": Keyword((ABAQUS,), True, False, (), {}, (1, 1)),
    "CONTACT OUTPUT": Keyword((ABAQUS,), True, False, (), {}, (1, 1)),
    "NODE FILE": Keyword((CALCULIX,), True, False, (), {"OUTPUT": ("2D",)}, (1, 1)),
    "EL FILE": Keyword((CALCULIX,), True, False, (), {"OUTPUT": ("2D",)}, (1, 1)),
    "CONTACT FILE": Keyword((CALCULIX,), True, False, (), {}, (1, 1)),
    "NODE PRINT": Keyword(
        (CALCULIX,), True, False, ("NSET",), {"NSET": (), "TOTALS": ("ONLY",)}, (1, 1)
    ),
    "END STEP": Keyword(in_step=True, in_model=False, data=(0, 0)),
}


@dataclass
class Block:
    """A keyword with its parameters and data lines."""

    keyword: str
    parameters: dict[str, str | None]
    data: list[list[str]] = field(default_factory=list)


@dataclass
class Deck:
    """What a deck defines: names in capitals, as the programs have them."""

    blocks: list[Block]
    nodes: dict[int, tuple[float, float]] = field(default_factory=dict)
    elements: dict[int, list[int]] = field(default_factory=dict)
    node_sets: dict[str, list[int]] = field(default_factory=dict)
    element_sets: dict[str, list[int]] = field(default_factory=dict)
    surfaces: dict[str, list[tuple[int, str]]] = field(default_factory=dict)
    materials: dict[str, list[Block]] = field(default_factory=dict)
    sections: dict[str, str] = field(default_factory=dict)
    directions: dict[str, list[list[str]]] = field(default_factory=dict)
    axes: dict[str, str] = field(default_factory=dict)

    def of(self, keyword: str) -> list[Block]:
        """Blocks of a keyword."""
        return [block for block in self.blocks if block.keyword == keyword]


class DeckError(ValueError):
    """A deck that a program would refuse, or read as something else."""


def _need(condition: object, text: str) -> None:
    if not condition:
        raise DeckError(text)


def parse(text: str) -> list[Block]:
    """Split a deck into its blocks."""
    blocks: list[Block] = []
    for number, line in enumerate(text.splitlines(), 1):
        if line.startswith("**") or not line.strip():
            continue
        _need(len(line) <= LONGEST_LINE, f"line {number}: longer than {LONGEST_LINE}")
        words = [word.strip() for word in line.split(",")]
        if not line.startswith("*"):
            _need(blocks, f"line {number}: data before any keyword")
            blocks[-1].data.append(words)
            continue
        parameters: dict[str, str | None] = {}
        for word in words[1:]:
            name, equals, value = word.partition("=")
            parameters[name.strip().upper()] = value.strip() if equals else None
        blocks.append(Block(words[0][1:].upper(), parameters))
    return blocks


def read(text: str, program: str) -> Deck:
    """Read a deck as a program does; a DeckError says what it could not."""
    deck = Deck(parse(text))
    inside = False
    for block in deck.blocks:
        inside = _check_keyword(block, program, inside)
        _take(deck, block, program)
    _need(not inside, "the last step has no end")
    _need(deck.of("STEP"), "no step")
    covered = {element for name in deck.sections for element in deck.element_sets[name]}
    plane = {number for number, nodes in deck.elements.items() if len(nodes) == 6}
    _need(plane == covered, f"{len(plane - covered)} elements without a section")
    for name, material in deck.sections.items():
        laws = [b.keyword for b in deck.materials[material]]
        _need({"HYPERELASTIC", "ELASTIC"} & set(laws), f"{name}: {material} has no law")
    return deck


def _check_keyword(block: Block, program: str, inside: bool) -> bool:
    known = KEYWORDS.get(block.keyword)
    _need(known, f"*{block.keyword}: no such keyword")
    assert known is not None
    _need(program in known.programs, f"*{block.keyword}: not a keyword of {program}")
    allowed = known.in_step if inside else known.in_model
    _need(allowed, f"*{block.keyword}: not allowed {'in a step' if inside else 'in the model'}")
    for name in known.needs:
        _need(name in block.parameters, f"*{block.keyword}: needs {name}")
    for name, value in block.parameters.items():
        _need(name in known.takes, f"*{block.keyword}: no parameter {name}")
        values = known.takes[name]
        if values is None:
            _need(value is None, f"*{block.keyword}, {name}: takes no value")
        elif values:
            bare = (block.keyword, name) == ("STEP", "NLGEOM") and value is None
            _need(bare or value in values, f"*{block.keyword}, {name}={value}: not allowed")
        else:
            _need(value, f"*{block.keyword}, {name}: needs a value")
    fewest, most = known.data
    _need(fewest <= len(block.data) <= most, f"*{block.keyword}: {len(block.data)} data lines")
    for line in block.data:
        _need(len(line) <= MOST_ENTRIES, f"*{block.keyword}: more than {MOST_ENTRIES} entries")
    if block.keyword == "STEP":
        if "NAME" in block.parameters:
            _label(block, "NAME")
        _need(not inside, "a step within a step")
        return True
    return inside and block.keyword != "END STEP"


def _numbers(block: Block) -> list[float]:
    found = []
    for line in block.data:
        for word in line:
            _need(NUMBER.fullmatch(word), f"*{block.keyword}: '{word}' is no number")
            _need(len(word) <= LONGEST_NUMBER, f"*{block.keyword}: '{word}' is too long")
            found.append(float(word))
    return found


def _label(block: Block, name: str) -> str:
    value = block.parameters[name] or ""
    _need(LABEL.fullmatch(value), f"*{block.keyword}, {name}={value}: no label")
    return value.upper()


def _take(deck: Deck, block: Block, program: str) -> None:
    """Take in what a block defines, and check what it refers to."""
    match block.keyword:
        case "NODE":
            members = deck.node_sets.setdefault(_label(block, "NSET"), [])
            for number, x, y, *_ in block.data:
                _need(int(number) not in deck.nodes, f"node {number} twice")
                deck.nodes[int(number)] = float(x), float(y)
                members.append(int(number))
        case "ELEMENT":
            kind = block.parameters["TYPE"] or ""
            _need(kind in (OF_PROGRAM[program], "SPRING1"), f"{kind}: not for {program}")
            members = deck.element_sets.setdefault(_label(block, "ELSET"), [])
            for number, *nodes in block.data:
                _need(len(nodes) == ELEMENTS[kind], f"element {number}: {len(nodes)} nodes")
                _need(int(number) not in deck.elements, f"element {number} twice")
                _need({int(n) for n in nodes} <= deck.nodes.keys(), f"element {number}: no node")
                deck.elements[int(number)] = [int(node) for node in nodes]
                members.append(int(number))
        case "ELSET":
            found = [name.upper() for line in block.data for name in line]
            _need(set(found) <= deck.element_sets.keys(), f"*ELSET of {found}: no such set")
            deck.element_sets[_label(block, "ELSET")] = [
                element for name in found for element in deck.element_sets[name]
            ]
        case "NSET":
            nodes = [int(word) for line in block.data for word in line]
            _need(set(nodes) <= deck.nodes.keys(), "*NSET: no such node")
            deck.node_sets[_label(block, "NSET")] = nodes
        case "SURFACE":
            sides = [(int(element), side) for element, side in block.data]
            for element, side in sides:
                _need(element in deck.elements, f"*SURFACE: no element {element}")
                _need(side in ("S1", "S2", "S3"), f"*SURFACE: no side {side}")
            deck.surfaces[_label(block, "NAME")] = sides
        case "MATERIAL":
            deck.materials[_label(block, "NAME")] = []
        case "HYPERELASTIC" | "ELASTIC" | "EXPANSION":
            _need(deck.materials, f"*{block.keyword}: no material")
            list(deck.materials.values())[-1].append(block)
            _check_constants(block, program)
        case "SOLID SECTION":
            elements, material = _label(block, "ELSET"), _label(block, "MATERIAL")
            _need(elements in deck.element_sets, f"*SOLID SECTION: no set {elements}")
            _need(material in deck.materials, f"*SOLID SECTION: no material {material}")
            deck.sections[elements] = material
            if "ORIENTATION" in block.parameters:
                axes = _label(block, "ORIENTATION")
                _need(axes in deck.axes, f"*SOLID SECTION: no orientation {axes}")
                given = {int(line[0]) for line in deck.directions[deck.axes[axes]]}
                _need(given == set(deck.element_sets[elements]), f"{axes}: not of {elements}")
        case "DISTRIBUTION":
            first, *lines = block.data
            _need(first[0] == "" and len(first) == 7, "*DISTRIBUTION: no default")
            for number, *axes in lines:
                _need(int(number) in deck.elements, f"*DISTRIBUTION: no element {number}")
                _need(len(axes) == 6, f"*DISTRIBUTION: {len(axes)} coordinates")
            deck.directions[_label(block, "NAME")] = lines
        case "ORIENTATION":
            (name,) = block.data[0]
            _need(name.upper() in deck.directions, f"*ORIENTATION: no distribution {name}")
            deck.axes[_label(block, "NAME")] = name.upper()
        case "CONTACT PAIR" | "CONTACT INTERFERENCE" | "MODEL CHANGE":
            for name in block.data[0]:
                _need(name in deck.surfaces, f"*{block.keyword}: no surface {name}")
            if block.keyword == "CONTACT PAIR":
                names = [_label(each, "NAME") for each in deck.of("SURFACE INTERACTION")]
                _need(_label(block, "INTERACTION") in names, "*CONTACT PAIR: no interaction")
        case "BOUNDARY" | "CLOAD" | "TEMPERATURE":
            for node, *values in block.data:
                known = node.upper() in deck.node_sets or (
                    node.isdigit() and int(node) in deck.nodes
                )
                _need(known, f"*{block.keyword}: no node or set {node}")
                _numbers(Block(block.keyword, {}, [values]))
        case "EQUATION":
            rows = iter(block.data)
            for (terms,) in rows:
                line = next(rows, None)
                _need(line and len(line) == 4 * 0 + 3 * int(terms), "*EQUATION: wrong terms")
                assert line is not None
                for node in line[::3]:
                    _need(int(node) in deck.nodes, f"*EQUATION: no node {node}")
        case "FRICTION" | "STATIC" | "SPRING":
            _numbers(block)


def _check_constants(block: Block, program: str) -> None:
    values = _numbers(block)
    if block.keyword == "EXPANSION":
        ortho = "TYPE" in block.parameters
        _need(not (ortho and program == ABAQUS), "*EXPANSION: not of a hyperelastic material")
        size = 4 if ortho else 2
        _need(all(len(line) == size for line in block.data), "*EXPANSION: wrong constants")
        at = [float(line[-1]) for line in block.data]
        _need(at == sorted(set(at)), "*EXPANSION: temperatures do not rise")
        return
    if block.keyword == "ELASTIC":
        _need(len(values) == 2 and values[0] > 0 and -1 < values[1] <= 0.5, "*ELASTIC: wrong")
        return
    terms = 2 if "YEOH" in block.parameters else int(block.parameters.get("N") or 0)
    _need(terms, "*HYPERELASTIC: no number of terms")
    if program == CALCULIX:
        _need(terms <= 3, f"*HYPERELASTIC: {terms} terms are too many for CalculiX")
    _need(len(values) == 3 * terms, f"*HYPERELASTIC: {len(values)} constants")
    full = all(len(line) == 8 for line in block.data[:-1])
    _need(full and len(block.data[-1]) <= 8, "*HYPERELASTIC: lines are not full")
    compliances = values[3:] if "YEOH" in block.parameters else values[2 * terms :]
    if program == CALCULIX:
        _need(min(compliances) > 0, "*HYPERELASTIC: CalculiX replaces a D of 0")


# -- FEBio ------------------------------------------------------------

SECTIONS = (
    "Module", "Globals", "Material", "Mesh", "MeshDomains", "MeshData", "Boundary", "Contact",
    "Step", "LoadData", "Output",
)  # fmt: skip
MATERIALS = {
    "Ogden": ({"c1", "m1", "k", "pressure_model"}, {f"{x}{i}" for x in "cm" for i in range(2, 7)}),
    "Yeoh": ({"c1", "k", "pressure_model"}, {f"c{i}" for i in range(2, 7)}),
    "natural neo-Hookean": ({"E", "v"}, set()),
}
CONTACT = {
    "laugon", "two_pass", "auto_penalty", "symmetric_stiffness", "search_radius", "fric_coeff",
    "penalty",
}  # fmt: skip
"""Some of the parameters of sliding-elastic."""
BOUNDARIES = {
    "zero displacement": {"x_dof", "y_dof", "z_dof"},
    "prescribed displacement": {"dof", "value", "relative"},
}

QN_METHODS = {"BFGS", "Broyden", "JFNK", "modified Newton", "full Newton"}
"""Names with which FEBio's source registers them, which it compares letter by letter."""


def read_febio(text: str) -> ET.Element:
    """Read an input file of FEBio; a DeckError says what FEBio would refuse."""
    root = ET.fromstring(text)
    _need(root.tag == "febio_spec" and root.get("version") == "4.0", "not febio_spec 4.0")
    _need([part.tag for part in root] == list(SECTIONS), f"sections: {[p.tag for p in root]}")
    part = {each.tag: each for each in root}
    _need(part["Module"].get("type") == "solid", "module")
    materials = _febio_materials(part["Material"])
    sets, surfaces = _febio_mesh(part["Mesh"])
    domains = {each.get("name"): each.get("mat") for each in part["MeshDomains"]}
    elements = {each.get("name") for each in part["Mesh"].findall("Elements")}
    _need(domains.keys() == elements, "domains are not those of the elements")
    _need(set(domains.values()) <= materials, "a domain without a material")
    curves = {each.get("id") for each in part["LoadData"]}
    maps = {}
    groups = {e.get("name"): len(_ids(e, None, 10**9)) for e in part["Mesh"].findall("ElementSet")}
    for data in part["MeshData"]:
        if data.tag == "ElementData":
            _need(data.get("data_type") == "mat3", f"map {data.get('name')}: no tensors")
            _need(len(data) == groups.get(data.get("elem_set")), f"map {data.get('name')}: length")
            sizes = {len((each.text or "").split(",")) for each in data}
            _need(sizes == {9}, f"map {data.get('name')}: {sizes} numbers")
            maps[data.get("name")] = data.get("elem_set")
            continue
        _need(data.get("node_set") in sets, f"map of no set {data.get('node_set')}")
        _need(len(data) == len(sets[data.get("node_set")]), f"map {data.get('name')}: length")
        maps[data.get("name")] = data.get("node_set")
    for pair in part["Mesh"].findall("SurfacePair"):
        for side in ("primary", "secondary"):
            _need(pair.findtext(side) in surfaces, f"pair: no surface {pair.findtext(side)}")
    pairs = {each.get("name") for each in part["Mesh"].findall("SurfacePair")}
    for contact in part["Contact"]:
        _need(contact.get("type") == "sliding-elastic", "contact")
        _need(contact.get("surface_pair") in pairs, "contact: no surface pair")
        _need({each.tag for each in contact} <= CONTACT, "contact: unknown parameter")
    for number, step in enumerate(part["Step"], 1):
        _need(step.get("id") == str(number), "steps are not numbered")
        control = step.find("Control")
        _need(control is not None, f"step {number}: no control")
        assert control is not None
        time = int(control.findtext("time_steps", "0")) * float(control.findtext("step_size", "0"))
        _need(abs(time - 1.0) < 1e-9, f"step {number}: lasts {time}")
        method = control.find("solver/qn_method")
        _need(method is not None and method.get("type") in QN_METHODS, f"step {number}: qn_method")
    for bc in root.iter("bc"):
        kind = bc.get("type")
        _need(kind in BOUNDARIES, f"bc: {kind}")
        _need({each.tag for each in bc} == BOUNDARIES[kind or ""], f"bc {bc.get('name')}")
        _need(bc.get("node_set") in sets, f"bc: no set {bc.get('node_set')}")
    for load in root.iter("nodal_load"):
        _need(load.get("node_set") in sets, f"load: no set {load.get('node_set')}")
        _need({each.tag for each in load} == {"dof", "scale"}, "load")
    for each in root.iter():
        if each.get("lc"):
            _need(each.get("lc") in curves, f"{each.tag}: no curve {each.get('lc')}")
        if each.get("type") == "map":
            _need(each.text in maps, f"{each.tag}: no map {each.text}")
    return root


def _febio_materials(part: ET.Element) -> set[str | None]:
    for number, material in enumerate(part, 1):
        _need(material.get("id") == str(number), "materials are not numbered")
        name = material.get("name")
        if material.get("type") == "prestrain elastic":
            _need([each.tag for each in material] == ["elastic", "prestrain"], f"material {name}")
            made, material = material.find("prestrain"), material.find("elastic")
            assert made is not None and material is not None
            _need(made.get("type") == "prestrain gradient", f"prestrain {made.get('type')}")
            _need([each.tag for each in made] == ["ramp", "F0"], f"prestrain of {name}")
        kind = material.get("type") or ""
        _need(kind in MATERIALS, f"material {kind}")
        needed, more = MATERIALS[kind]
        given = {each.tag for each in material} - {"density"}
        _need(needed <= given <= needed | more, f"material {name}: {given}")
    return {each.get("name") for each in part}


def _febio_mesh(part: ET.Element) -> tuple[dict[str | None, list[int]], set[str | None]]:
    found = {
        int(node.get("id") or 0): [float(x) for x in (node.text or "").split(",")]
        for node in part.iter("node")
    }
    _need(list(found) == list(range(1, len(found) + 1)), "nodes are not numbered")
    points = np.array(list(found.values()))
    numbers = [int(e.get("id") or 0) for group in part.findall("Elements") for e in group]
    _need(len(set(numbers)) == len(numbers), "an element twice")
    for group in part.findall("Elements"):
        _need(group.get("type") == "penta15", f"elements {group.get('type')}")
        nodes = np.array([_ids(e, 15, len(found)) for e in group])
        _check_prisms(points[nodes - 1])
    surfaces = {}
    for surface in part.findall("Surface"):
        faces = np.array([_ids(face, 8, len(found)) for face in surface.findall("quad8")])
        _need(len(faces), f"surface {surface.get('name')} is empty")
        surfaces[surface.get("name")] = faces
    return {
        each.get("name"): _ids(each, None, len(found)) for each in part.findall("NodeSet")
    }, set(surfaces)


def _ids(element: ET.Element, count: int | None, most: int) -> list[int]:
    nodes = [int(word) for word in (element.text or "").split(",")]
    _need(count is None or len(nodes) == count, f"{element.tag}: {len(nodes)} nodes")
    _need(1 <= min(nodes) and max(nodes) <= most, f"{element.tag}: no such node")
    return nodes


def _check_prisms(x: np.ndarray) -> None:
    """Check the order of the nodes of prisms, (n, 15, 3): corners, then those between them."""
    a, b, c, d = (x[:, i] for i in (0, 1, 2, 3))
    volume = np.einsum("nk,nk->n", np.cross(b - a, c - a), d - a)
    _need(volume.min() > 0, "an element is inside out")
    between = [(0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)]
    for place, (i, j) in enumerate(between, 6):
        chord = x[:, j] - x[:, i]
        off = x[:, place] - 0.5 * (x[:, i] + x[:, j])
        bound = 0.3 * np.linalg.norm(chord, axis=1)
        _need((np.linalg.norm(off, axis=1) <= bound).all(), f"node {place + 1} is not between")
