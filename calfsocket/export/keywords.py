"""Input decks of Abaqus and CalculiX, which share their keywords.

In both the limb's side of the contact is the secondary (slave) surface, and what it overlaps at the
start goes linearly to nothing over the first step: in Abaqus by *CONTACT INTERFERENCE, SHRINK, in
CalculiX of itself, as the face-to-face contact of its first step does.
"""

import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import count

import calfsocket
from calfsocket.export.case import ExportedCase, LoadStep, Material, rows
from calfsocket.export.laws import Converted, Form, Invariant, Linear, Series, converted
from calfsocket.meshes import tags

MOST_IN_LINE, LONGEST_LINE = 16, 120
"""Words and characters in a line of a set."""

MOST_CONSTANTS = 8
"""Constants in a line of a material."""

FIRST, SMALLEST, LARGEST = 0.1, 1e-5, 0.2
"""Increments of donning as shares of the step; they may be cut back to the smallest."""

SMALL, SMALL_AFTER = 0.02, 0.05
"""The first and the largest of them where the socket touches the limb point by point, and in
CalculiX where it floats: with larger ones its stiff friction did not converge (TSB Combined)."""

MOST_INCREMENTS = 1000

TERMLESS = 1e9
"""Coefficient D2, D3 of CalculiX, 1/MPa, that leaves a term of the volume's energy out: a zero
would be replaced."""

MOST_TERMS = {"abaqus": 6, "calculix": 3}
"""Terms of Ogden's law."""

NORMAL_STIFFNESS = 100.0
"""Penalty of CalculiX's contact, MPa/mm: at a pressure of 10 kPa the overlap is 1e-4 mm."""

STICK_SLOPE = 10.0
"""Tangential penalty of CalculiX's friction, MPa/mm. A soft one loses shear: with 0.1 MPa/mm a
quarter of it; at this one points that stick creep by 1e-4 mm at a shear of 1 kPa."""

LIMB_SIDE, SOCKET_SIDE = "LIMB_SIDE", "SOCKET_SIDE"
"""Names of the surfaces that meet."""

PAIR = f"{LIMB_SIDE}, {SOCKET_SIDE}"

FRAME, AS_DONNED = "FRAME", "AS_DONNED"
"""Names of the sets of the frame's nodes, and of those that keep the outer face as it is donned."""


FIBRES, AXES = "FIBRES", "AROUND"
"""Names of a liner's directions, and of the axes that they give."""

COLDEST = -1000.0
"""Temperature that coefficients of expansion count from; steps are at 1, 2, ..."""


@dataclass(frozen=True)
class Dialect:
    """What differs between the two programs."""

    name: str
    title: str
    element: str
    mixed: bool


ABAQUS = Dialect("abaqus", "Abaqus/Standard", "CPE6H", mixed=True)
CALCULIX = Dialect("calculix", "CalculiX 2.20", "CPE6", mixed=False)


def deck(case: ExportedCase, dialect: Dialect) -> tuple[str, list[str]]:
    """Return the input deck of a case and the remarks in its head, on what differs."""
    writer = _Writer(case, dialect)
    body = list(writer.lines())
    remarks = writer.remarks
    head = [
        f"** {case.title}",
        f"** Written by calfsocket {calfsocket.__version__} for {dialect.title}.",
        "** Plane strain, 1 mm thick: mm, N, MPa; forces are those for each mm of limb length.",
        "** What differs from calfsocket:",
        *(f"** - {remark}" for remark in remarks),
    ]
    return "\n".join([*head, *body]) + "\n", remarks


class _Writer:
    """Writes the lines of a deck, and collects what has to be said."""

    def __init__(self, case: ExportedCase, dialect: Dialect) -> None:
        self.case, self.dialect = case, dialect
        self.remarks: list[str] = []
        self._number = 0
        self._steps_of: Counter[str] = Counter()
        self._is_abaqus = dialect is ABAQUS

    def lines(self) -> Iterator[str]:
        """Yield the lines below the head."""
        yield from ["*HEADING", self.case.title]
        yield from self._mesh()
        yield from self._materials()
        yield from self._contact()
        yield from self._frame()
        yield from self._guide()
        yield from self._temperatures()
        yield from self._constraints()
        yield from self._donning()
        for step in self.case.steps:
            yield from self._loading(step)
        self._say_more()

    def _say_more(self) -> None:
        """Say what the stages and the liner have no equivalent of."""
        case = self.case
        if case.undersize:
            share = f"liner: its undersize of {100 * case.undersize:g} %"
            self.remarks.append(
                f"{share} is left out, for Abaqus's hyperelastic laws expand alike in all"
                " directions only; it is put on without stress"
                if self._is_abaqus
                else f"{share} is an expansion along its fibres; CalculiX 2.20 leaves a stress of"
                " twice that share of its pressure along them"
            )
        changes = [abs(value) for step in case.steps for value in step.volume.values()]
        if changes:
            most = 100 * max(changes)
            self.remarks.append(
                f"volume: tissues change alike in all three directions, by up to {most / 3:.2g} %"
                " of their length, in calfsocket in the plane alone: held along the limb they have"
                " that strain besides"
                if self._is_abaqus
                else "volume: tissues expand in the plane; CalculiX 2.20 leaves a stress of up to"
                f" {most:.2g} % of their pressure along the limb"
            )
        if case.moves_socket and not self._has_frame:
            self.remarks.append(
                "even load: the moment's forces keep their directions; in calfsocket they turn with"
                " the face"
            )
        if case.moves_socket:
            self.remarks.append(
                "loads: a force that the limb cannot bear ends the analysis; calfsocket finds the"
                " largest one"
            )

    # -- model ----------------------------------------------------------------------------------

    def _mesh(self) -> Iterator[str]:
        case = self.case
        mesh = case.mesh
        yield "*NODE, NSET=NODES"
        for number, (x, y) in enumerate(rows(mesh.points), 1):
            yield f"{number}, {x:.12g}, {y:.12g}, 0."
        for region in mesh.regions:
            yield f"*ELEMENT, TYPE={self.dialect.element}, ELSET={_label(region)}"
            for cell in case.cells(region):
                yield ", ".join(map(str, [cell + 1, *(mesh.cells[cell] + 1)]))
        for tissue, regions in case.tissue_sets.items():
            yield f"*ELSET, ELSET=TISSUE_{tissue}"
            yield from _listed(map(_label, regions))
        for boundary in self._boundaries:
            yield f"*NSET, NSET={boundary}"
            yield from _listed(case.nodes(boundary) + 1)
            yield f"*SURFACE, NAME={boundary}, TYPE=ELEMENT"
            yield from self._faces(boundary)
        for name, boundary in zip((LIMB_SIDE, SOCKET_SIDE), case.surfaces, strict=True):
            yield f"*SURFACE, NAME={name}, TYPE=ELEMENT"
            yield from self._faces(boundary)

    @property
    def _boundaries(self) -> list[str]:
        """Boundaries that the mesh has edges of."""
        case = self.case
        return [name for name in case.mesh.boundaries if len(case.facets(name))]

    def _faces(self, boundary: str) -> Iterator[str]:
        return (f"{cell + 1}, S{side + 1}" for cell, side in self.case.sides(boundary))

    def _materials(self) -> Iterator[str]:
        case = self.case
        yield from self._fibres()
        for material in case.materials:
            law, remarks = converted(material.name, material.law, self.dialect.mixed)
            self.remarks += remarks
            yield f"*MATERIAL, NAME={_label(material.name)}"
            yield from self._law(material.name, law)
            yield from self._expansion(material, law.form)
            for region in material.regions:
                axes = f", ORIENTATION={AXES}" if self._has_fibres(region) else ""
                of = f"ELSET={_label(region)}, MATERIAL={_label(material.name)}"
                yield f"*SOLID SECTION, {of}{axes}"
                yield "1."

    def _has_fibres(self, region: str) -> bool:
        """Whether a region is shorter around the limb, which CalculiX has an equivalent of."""
        return region == tags.LINER and self.case.undersize > 0.0 and not self._is_abaqus

    def _fibres(self) -> Iterator[str]:
        """Give the liner's elements axes of their own: around the limb, across, and along it."""
        case = self.case
        if tags.LINER not in case.mesh.regions or not self._has_fibres(tags.LINER):
            return
        yield f"*DISTRIBUTION, NAME={FIBRES}"
        yield ", 1., 0., 0., 0., 1., 0."
        for cell, (x, y) in zip(case.cells(tags.LINER), rows(case.fibres), strict=True):
            yield f"{cell + 1}, {x:.9f}, {y:.9f}, 0., {-y:.9f}, {x:.9f}, 0."
        yield f"*ORIENTATION, NAME={AXES}"
        yield FIBRES

    def _law(self, name: str, law: Converted) -> Iterator[str]:
        d1 = 0.0 if math.isinf(law.bulk) else 2.0 / law.bulk
        rest = 0.0 if self._is_abaqus else TERMLESS
        match law.form:
            case Series(mu, alpha):
                constants = [number for pair in zip(mu, alpha, strict=True) for number in pair]
                yield f"*HYPERELASTIC, OGDEN, N={len(mu)}"
                yield from _constants([*constants, d1, *[rest] * (len(mu) - 1)])
            case Invariant(c):
                yield "*HYPERELASTIC, YEOH"
                yield from _constants([*c, d1, rest, rest])
            case Linear(e, nu):
                yield "*ELASTIC"
                yield from _constants([e, nu])
                self._say_linear(name)

    def _say_linear(self, name: str) -> None:
        how = (
            "Abaqus's, in the logarithmic strain with p = K ln J in the place of K (J - 1)"
            if self._is_abaqus
            else "CalculiX's, in Green's strain"
        )
        self.remarks.append(
            f"{name}: linear elasticity is {how}; at a strain of 0.1 % stresses differ by 0.1 %"
        )

    def _contact(self) -> Iterator[str]:
        friction = self.case.contact.friction
        yield "*SURFACE INTERACTION, NAME=SKIN_ON_SOCKET"
        if self._is_abaqus:
            yield "1."
            yield "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=HARD"
            if friction:
                yield "*FRICTION"
                yield _number(friction)
            self.remarks.append(
                "contact: enforced as Abaqus does by default, friction with an elastic slip of"
                " 0.5 % of an edge's length; calfsocket has no such slip"
            )
        else:
            yield "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR"
            yield _number(NORMAL_STIFFNESS)
            if friction:
                yield "*FRICTION"
                yield f"{_number(friction)}, {_number(STICK_SLOPE)}"
            self.remarks.append(
                f"contact: by penalties of {NORMAL_STIFFNESS:g} MPa/mm and, while it sticks,"
                f" {STICK_SLOPE:g} MPa/mm; calfsocket has none"
            )
        yield "*CONTACT PAIR, INTERACTION=SKIN_ON_SOCKET, TYPE=SURFACE TO SURFACE"
        yield PAIR

    # -- what holds and carries the socket --------------------------------------------------------

    @property
    def _has_frame(self) -> bool:
        """Whether a rigid frame carries the outer face after donning."""
        loading = self.case.loading
        return loading is not None and loading.moves_socket and loading.carried == "frame"

    @property
    def _frame_nodes(self) -> tuple[int, int]:
        """Number of the node with the frame's translation, and of that with its turn (rad)."""
        last = len(self.case.mesh.points)
        return last + 1, last + 2

    def _frame(self) -> Iterator[str]:
        """Tie the outer face to a frame by equations, each with a node that is free in donning.

        With the displacement d of such a node, which keeps its value after donning, that of the
        outer face is u = d + t + theta e_z x X.
        """
        if not self._has_frame:
            return
        case, (moves, turns) = self.case, self._frame_nodes
        outer, middle = case.nodes(tags.SOCKET_OUTER) + 1, case.outer_middle
        yield f"*NODE, NSET={FRAME}"
        for number in (moves, turns):
            yield f"{number}, {middle[0]:.12g}, {middle[1]:.12g}, 0."
        yield f"*NODE, NSET={AS_DONNED}"
        for number, (x, y) in enumerate(rows(case.mesh.points[outer - 1]), turns + 1):
            yield f"{number}, {x:.12g}, {y:.12g}, 0."
        yield "*EQUATION"
        for number, node, (x, y) in zip(
            count(turns + 1), outer, rows(case.outer_arms), strict=False
        ):
            for axis, lever in ((1, y), (2, -x)):
                yield "4"
                yield (
                    f"{node}, {axis}, 1., {number}, {axis}, -1., {moves}, {axis}, -1., {turns}, 1,"
                    f" {_number(lever)}"
                )
        self.remarks.append(
            "frame: it turns the outer face by a small angle's rule; at 3 degrees the face grows by"
            " 0.14 %"
        )

    def _guide(self) -> Iterator[str]:
        """Hold a floating socket, that nothing else holds, by springs that it hardly feels."""
        case = self.case
        if not case.guide:
            return
        outer = case.nodes(tags.SOCKET_OUTER) + 1
        stiffness = case.guide / len(outer)
        number = len(case.mesh.cells)
        for axis in (1, 2):
            yield f"*ELEMENT, TYPE=SPRING1, ELSET=GUIDE_{axis}"
            for node in outer:
                number += 1
                yield f"{number}, {node}"
            yield f"*SPRING, ELSET=GUIDE_{axis}"
            yield str(axis)
            yield _number(stiffness)
        self.remarks.append(
            f"guide: springs of {case.guide:.2g} N/mm in all hold the floating socket where contact"
            " does not, for good; in calfsocket a foundation does, which fades out with the load"
            " where there is friction"
        )

    def _constraints(self) -> Iterator[str]:
        yield "*BOUNDARY"
        yield f"{tags.TIBIA_MEDULLARY}, 1, 2"
        if self.case.is_fixed and not self._is_widened:
            yield f"{tags.SOCKET_OUTER}, 1, 2"
        if self._has_frame:
            moves, turns = self._frame_nodes
            yield f"{moves}, 1, 2"
            yield f"{turns}, 1, 1"

    # -- changes of size by temperature -----------------------------------------------------------

    @property
    def _is_widened(self) -> bool:
        """Whether donning begins with a socket that is wide and clear of the limb."""
        return self.case.donning == "expanded" and self.case.swelling > 0.0

    @property
    def _has_temperature(self) -> bool:
        return any(self._stretches(material) for material in self.case.materials)

    def _stretches(self, material: Material) -> list[tuple[float, float]]:
        """Stretches around and across the limb without stress, at the end of each step.

        They are empty where a material keeps its size.
        """
        case, region = self.case, material.regions[0]
        wide = 1.0 + case.swelling if self._is_widened and region in case.socket_regions else 1.0
        around = 1.0 - case.undersize if self._has_fibres(region) else 1.0
        volumes = [0.0, *(step.volume.get(case.tissues[region], 0.0) for step in case.steps)]
        found = [(around * math.sqrt(1.0 + v), math.sqrt(1.0 + v)) for v in volumes]
        if self._is_widened:
            found = [(wide, wide), *found]
        return found if any(pair != (1.0, 1.0) for pair in found) else []

    def _expansion(self, material: Material, form: Form) -> Iterator[str]:
        """Give a material its size at the end of each step, whose number is its temperature.

        The coefficient is a table of temperature, so that materials change as they like. It counts
        from far below, so that the size, their product, changes linearly between its rows. Along
        the limb CalculiX's materials keep their length; Abaqus's hyperelastic laws expand alike in
        all directions only.
        """
        stretches = self._stretches(material)
        if not stretches:
            return
        kind = "" if self._is_abaqus else ", TYPE=ORTHO"
        yield f"*EXPANSION, ZERO={_number(COLDEST)}{kind}"
        for number, (around, across) in enumerate([(1.0, 1.0), *stretches]):
            strains = [around - 1.0, across - 1.0, 0.0]
            if self._is_abaqus:
                strains = [_alike(across, form)]
            words = [_number(strain / (number - COLDEST)) for strain in strains]
            yield ", ".join([*words, f"{number}."])

    def _temperatures(self) -> Iterator[str]:
        if self._has_temperature:
            yield "*INITIAL CONDITIONS, TYPE=TEMPERATURE"
            yield "NODES, 0."

    def _temperature(self) -> Iterator[str]:
        """Go to the temperature of the step."""
        self._number += 1
        if self._has_temperature:
            yield "*TEMPERATURE"
            yield f"NODES, {self._number}."

    # -- steps ----------------------------------------------------------------------------------

    def _step(self, name: str, increments: Sequence[float]) -> Iterator[str]:
        first, smallest, largest = increments
        options = f", NAME={self._step_name(name)}, UNSYMM=YES" if self._is_abaqus else ""
        nonlinear = "NLGEOM=YES" if self._is_abaqus else "NLGEOM"
        yield f"** step {name}"
        yield f"*STEP, {nonlinear}, INC={MOST_INCREMENTS}{options}"
        yield "*STATIC"
        yield ", ".join(map(_number, [first, 1.0, smallest, largest]))

    def _step_name(self, name: str) -> str:
        """Return a name that no other step has; capitals are no other letters for Abaqus."""
        label = _label(name)
        self._steps_of[label.upper()] += 1
        count = self._steps_of[label.upper()]
        return label if count == 1 else f"{label}-{count}"

    def _donning(self) -> Iterator[str]:
        if self._is_widened:
            yield from self._widening()
            yield from self._step("donning", self._increments)
            yield "*MODEL CHANGE, TYPE=CONTACT PAIR, ADD"
            yield PAIR
            yield from self._outer_face(0.0)
        else:
            yield from self._step("donning", self._increments)
            if self._is_abaqus:
                yield "*CONTACT INTERFERENCE, SHRINK"
                yield PAIR
        yield from self._temperature()
        yield from self._output()
        yield "*END STEP"

    @property
    def _increments(self) -> tuple[float, float, float]:
        """First, smallest and largest increment of donning."""
        floats = not (self._is_abaqus or self.case.is_fixed)
        if floats or self._is_widened:
            return SMALL, SMALLEST, SMALL_AFTER
        return FIRST, SMALLEST, LARGEST

    def _widening(self) -> Iterator[str]:
        """Make the socket wide, by a temperature, before it meets the limb."""
        swelling = self.case.swelling
        yield from self._step("widening", (1.0, SMALLEST, 1.0))
        yield "*MODEL CHANGE, TYPE=CONTACT PAIR, REMOVE"
        yield PAIR
        yield from self._outer_face(swelling)
        yield from self._temperature()
        yield from self._output()
        yield "*END STEP"
        self.remarks.append(
            f"donning: a temperature makes the socket wide, by {100 * swelling:.3g} %, without"
            " stress, in a first step; calfsocket begins with it there"
        )
        if not self._is_abaqus and self.case.contact.friction:
            self.remarks.append(
                "donning: with friction, CalculiX did not bring an expanded socket to the end where"
                ' that was tried; it does without, and with donning = "gap"'
            )

    def _outer_face(self, swelling: float) -> Iterator[str]:
        """Move a fixed outer face with a socket that is wide."""
        case = self.case
        if not case.is_fixed:
            return
        outer = case.nodes(tags.SOCKET_OUTER)
        yield "*BOUNDARY"
        shifts = swelling * (case.mesh.points[outer] - case.inner_middle)
        for node, shift in zip(outer, rows(shifts), strict=True):
            for axis, value in enumerate(shift, 1):
                yield f"{node + 1}, {axis}, {axis}, {_number(value)}"

    def _loading(self, step: LoadStep) -> Iterator[str]:
        size = 1.0 / step.increments
        yield from self._step(step.name, (size, SMALLEST * size, size))
        if self.case.moves_socket:
            yield from self._carried(step) if self._has_frame else self._evenly(step)
        yield from self._temperature()
        yield from self._output()
        yield "*END STEP"

    def _carried(self, step: LoadStep) -> Iterator[str]:
        moves, turns = self._frame_nodes
        places = ((moves, 1), (moves, 2), (turns, 1))
        yield "*BOUNDARY, OP=NEW"
        yield f"{tags.TIBIA_MEDULLARY}, 1, 2"
        for (node, axis), held, value in zip(places, step.held, step.place, strict=True):
            if held:
                yield f"{node}, {axis}, {axis}, {_number(value)}"
        yield "*BOUNDARY, OP=NEW, FIXED"
        yield f"{AS_DONNED}, 1, 2"
        yield "*CLOAD"
        for (node, axis), held, value in zip(places, step.held, step.force, strict=True):
            yield f"{node}, {axis}, {_number(0.0 if held else value)}"

    def _evenly(self, step: LoadStep) -> Iterator[str]:
        case = self.case
        yield "*CLOAD"
        forces = rows(case.even_forces(step.force))
        for node, force in zip(case.nodes(tags.SOCKET_OUTER), forces, strict=True):
            for axis, value in enumerate(force, 1):
                yield f"{node + 1}, {axis}, {_number(value)}"

    def _output(self) -> Iterator[str]:
        if self._is_abaqus:
            yield from [
                "*OUTPUT, FIELD",
                "*NODE OUTPUT",
                "U, RF",
                "*ELEMENT OUTPUT",
                "S, LE",
                "*CONTACT OUTPUT",
                "CSTRESS, CDISP",
                "*OUTPUT, HISTORY",
                f"*NODE OUTPUT, NSET={tags.TIBIA_MEDULLARY}",
                "RF",
            ]
            return
        yield from [
            "*NODE FILE, OUTPUT=2D",
            "U",
            "*EL FILE, OUTPUT=2D",
            "S, E",
            "*CONTACT FILE",
            "CDIS, CSTR",
            f"*NODE PRINT, NSET={tags.TIBIA_MEDULLARY}, TOTALS=ONLY",
            "RF",
        ]


def _alike(stretch: float, form: Form) -> float:
    """Return the strain in all directions by which a material is stretched in the plane.

    It has no stress in the plane then; along the limb it has, where it is held.
    """
    if isinstance(form, Linear):
        return (stretch - 1.0) / (1.0 + form.nu)
    return float(stretch ** (2 / 3) - 1.0)  # nearly incompressible


def _label(name: str) -> str:
    """Write a name as both programs take it: a letter first, no points or other signs."""
    word = re.sub(r"[^A-Za-z0-9_-]", "_", name)
    return word if word[0].isalpha() else f"N_{word}"


def _number(value: float) -> str:
    """Write a number as both programs read it, with a decimal point."""
    text = f"{value:.12g}"
    return text if "." in text or "e" in text or "n" in text else f"{text}."


def _constants(values: Sequence[float]) -> Iterator[str]:
    for start in range(0, len(values), MOST_CONSTANTS):
        yield ", ".join(map(_number, values[start : start + MOST_CONSTANTS]))


def _listed(values: Iterable[object]) -> Iterator[str]:
    """Write words in lines that both programs read whole."""
    line: list[str] = []
    for word in map(str, values):
        if len(line) == MOST_IN_LINE or len(", ".join([*line, word])) > LONGEST_LINE:
            yield ", ".join(line)
            line = []
        line.append(word)
    yield ", ".join(line)
