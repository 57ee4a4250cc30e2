"""Decks of other programs: complete, by their grammar, with the laws that the case has."""

import re
import sys
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Literal

import decks
import numpy as np
import pytest

from calfsocket import (
    Contact,
    Hencky,
    Liner,
    Loading,
    MaterialSet,
    Ogden,
    Simulation,
    Stage,
    Yeoh,
    cli,
)
from calfsocket.export import febio, keywords
from calfsocket.export.case import ExportedCase
from calfsocket.export.laws import Series, converted
from calfsocket.io.errors import InputError
from calfsocket.materials.law import Law
from calfsocket.materials.tissues import FASCIA, VESSEL
from calfsocket.meshes import tags
from calfsocket.meshes.quality import areas
from calfsocket.simulation.prepared import Prepared
from calfsocket.simulation.simulation import Monitor
from tiny_study import tiny_limb, tiny_socket

DIALECTS = {"abaqus": keywords.ABAQUS, "calculix": keywords.CALCULIX}
STAGES = Loading(
    stages=(
        Stage(name="push", force={"x": 0.1}, moment=2.0, steps=4),
        Stage(name="turn", displacement={"x": 0.5}, rotation=1.0, steps=2, cycles=1),
        Stage(name="shrink", volume={"muscle": -0.03}),
    )
)
EVEN = Loading(stages=(Stage(name="push", force={"y": -0.2}),), carried="evenly")


#: Fascia's law in the place of muscle's, and a vessel's in that of skin: all kinds of laws.
MATERIALS = MaterialSet.paper("separate").replace(muscle=FASCIA, skin=VESSEL)


def exported(**changes: object) -> ExportedCase:
    arguments = {"materials": MATERIALS, "mesh_size": "coarse", **changes}
    case = Simulation(tiny_limb(), tiny_socket("C"), **arguments)  # type: ignore[arg-type]
    return case._exported(*case._refined(Monitor(), Prepared()))


@pytest.fixture(scope="module")
def plain() -> ExportedCase:
    return exported()


@pytest.fixture(scope="module")
def lined() -> ExportedCase:
    return exported(liner=Liner(thickness=2.0, bonded="socket", law="gel", undersize=0.05))


@pytest.fixture(scope="module")
def cases(plain: ExportedCase, lined: ExportedCase) -> dict[str, ExportedCase]:
    return {
        "plain": plain,
        "lined": lined,
        "held": replace(plain, support="outer-fixed"),
        "frictionless": replace(plain, contact=Contact(friction=0.0)),
        "expanded": replace(plain, donning="expanded"),
        "held, expanded": replace(plain, donning="expanded", support="outer-fixed"),
        "loaded": replace(plain, loading=STAGES),
        "loaded evenly": replace(plain, loading=EVEN),
    }


CASES = (
    "plain", "lined", "held", "frictionless", "expanded", "held, expanded", "loaded",
    "loaded evenly",
)  # fmt: skip


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("program", DIALECTS)
def test_deck_is_what_its_program_reads(cases, program, name):
    case = cases[name]
    text, remarks = keywords.deck(case, DIALECTS[program])
    deck = decks.read(text, program)
    assert len(deck.of("STEP")) == len(deck.of("END STEP"))
    head = text.partition("*HEADING")[0]
    assert all(remark in head for remark in remarks)
    # Regions and boundaries have their names, and all of their elements and nodes.
    for region in case.mesh.regions:
        assert len(deck.element_sets[region.upper()]) == len(case.cells(region))
    for boundary in case.mesh.boundaries:
        nodes = np.array(deck.node_sets[boundary.upper()])
        assert np.array_equal(nodes - 1, case.nodes(boundary))
        assert len(deck.surfaces[boundary.upper()]) == len(case.facets(boundary))
    corners = np.array([deck.elements[i + 1] for i in range(len(case.mesh.cells))])
    x = np.array([deck.nodes[number] for number in corners.ravel()]).reshape(-1, 6, 2)
    assert areas(x).sum() == pytest.approx(areas(case.mesh.coordinates).sum(), rel=1e-10)


@pytest.mark.parametrize("name", CASES)
def test_febio_file_is_what_febio_reads(cases, name):
    case = cases[name]
    text, remarks = febio.deck(case)
    root = decks.read_febio(text)
    assert all(remark in text.partition("-->")[0] for remark in remarks)
    regions = {group.get("name") for group in root.find("Mesh").findall("Elements")}
    assert regions == set(case.mesh.regions)
    assert len(root.find("Step")) == 3 + len(case.steps)
    # Faces look away from the body: skin outward, the socket's face inward.
    nodes = root.find("Mesh").iter("node")
    points = np.array([[float(v) for v in node.text.split(",")] for node in nodes])
    for boundary, sign in zip(case.surfaces, (1, -1), strict=True):
        (surface,) = (s for s in root.find("Mesh").iter("Surface") if s.get("name") == boundary)
        face = np.array([[int(v) - 1 for v in quad.text.split(",")] for quad in surface])
        x = points[face]
        normal = np.cross(x[:, 1] - x[:, 0], x[:, 3] - x[:, 0])
        outward = np.sum(normal * (x.mean(axis=1) - points[face].mean(axis=(0, 1))), axis=1)
        assert (sign * outward > 0).all()


BREAK = {
    "unknown keyword": ("*STATIC", "*STATICS"),
    "unknown parameter": ("*MATERIAL, NAME=skin", "*MATERIAL, NAME=skin, COLOUR=RED"),
    "material that is not there": ("MATERIAL=skin", "MATERIAL=skyn"),
    "set that is not there": ("tibia_medullary, 1, 2", "tibia_medulary, 1, 2"),
    "no end": ("*END STEP", ""),
    "one constant too many": ("\n4.91, 13.59", "\n1., 4.91, 13.59"),
    "a side of a quadrilateral": (", S3", ", S4"),
    "a node that is not there": ("\n1, 12", "\n1, 912"),
    "contact without its interaction": ("INTERACTION=SKIN", "INTERACTION=SKYN"),
    "no law": ("*ELASTIC\n11800., 0.394", ""),
    "no section": ("*SOLID SECTION, ELSET=bone, MATERIAL=bone\n1.\n", ""),
    "a step's keyword in the model": ("*BOUNDARY\n", "*CLOAD\n"),
}


@pytest.mark.parametrize("name", BREAK)
def test_reader_refuses_a_broken_deck(plain, name):
    text, _ = keywords.deck(plain, keywords.ABAQUS)
    old, new = BREAK[name]
    if name == "a node that is not there":
        start = text.index("*ELEMENT")
        line = text[start:].splitlines()[1]
        old, new = line, line + "9999"
    assert old in text
    with pytest.raises(decks.DeckError):
        decks.read(text.replace(old, new), "abaqus")


BREAK_FEBIO = {
    "material that is not there": ('mat="skin"', 'mat="skyn"'),
    "law without its modulus": ("<k>", "<kappa>"),
    "set that is not there": ('node_set="tibia_medullary"', 'node_set="tibia"'),
    "pair that is not there": ('surface_pair="skin_on_socket"', 'surface_pair="skin"'),
    "another version": ('version="4.0"', 'version="3.0"'),
    "curve that is not there": ('lc="2"', 'lc="9"'),
    "map that is not there": ('type="map">widen_x', 'type="map">widen'),
    "other elements": ('type="penta15"', 'type="penta6"'),
    "no contact": ("<Contact>", "<Contacts>"),
    "capitals in a name": ('type="full Newton"', 'type="Full Newton"'),
}


@pytest.mark.parametrize("name", BREAK_FEBIO)
def test_reader_refuses_a_broken_febio_file(plain, name):
    text, _ = febio.deck(plain)
    old, new = BREAK_FEBIO[name]
    assert old in text
    text = text.replace(old, new).replace(f"</{old[1:-1]}>", f"</{new[1:-1]}>")
    with pytest.raises(decks.DeckError):
        decks.read_febio(text)


def test_reader_refuses_prisms_in_another_order(plain):
    root = ET.fromstring(febio.deck(plain)[0])
    for element in root.iter("elem"):
        nodes = (element.text or "").split(",")
        element.text = ",".join([*nodes[3:6], *nodes[:3], *nodes[6:]])
    with pytest.raises(decks.DeckError, match="inside out"):
        decks.read_febio(ET.tostring(root, encoding="unicode"))


def test_calculix_refuses_what_is_incompressible(plain):
    """Its D1 is 0 for Abaqus's hybrid elements alone."""
    abaqus, _ = keywords.deck(plain, keywords.ABAQUS)
    calculix, remarks = keywords.deck(plain, keywords.CALCULIX)
    assert "*HYPERELASTIC, YEOH\n4.91, 13.59, 18.97, 0., 0., 0.\n" in abaqus
    assert "*HYPERELASTIC, YEOH\n4.91, 13.59, 18.97, 0.00203665987" in calculix
    assert any("muscle: incompressible" in r and "982 MPa" in r for r in remarks)
    with pytest.raises(decks.DeckError, match="D of 0"):
        decks.read(re.sub(r"18.97, 0.002\d+", "18.97, 0.", calculix), "calculix")


# -- laws ------------------------------------------------------------

STRETCHES = np.array([[2.0, 1.3, 0.9], [0.6, 1.0, 1.2], [1.0, 0.8, 1.1]])


def test_ogden_keeps_its_energy_in_every_deck(plain):
    law = Ogden(mu=(0.01, 0.02), alpha=(4.0, -3.0), nu=0.49, form="abaqus")
    case = replace(plain, laws={**plain.laws, "muscle": law})
    lb = STRETCHES / np.prod(STRETCHES, axis=0) ** (1 / 3)

    def energy(factors, exponents):
        pairs = zip(factors, exponents, strict=True)
        return sum(f * (np.sum(lb**a, axis=0) - 3) for f, a in pairs)

    for program, dialect in DIALECTS.items():
        deck = decks.read(keywords.deck(case, dialect)[0], program)
        (block,) = (b for b in deck.materials["MUSCLE"] if b.keyword == "HYPERELASTIC")
        numbers = [float(word) for word in block.data[0]]
        mu, alpha = np.array(numbers[:4:2]), np.array(numbers[1:4:2])
        assert energy(2 * mu / alpha**2, alpha) == pytest.approx(law.energy(STRETCHES), rel=1e-9)
        assert 2 / numbers[4] == pytest.approx(law.bulk_modulus)
    root = decks.read_febio(febio.deck(case)[0])
    (made,) = (m for m in root.find("Material") if m.get("name") == "muscle")
    c, m = (np.array([float(made.findtext(f"{x}{i}")) for i in (1, 2)]) for x in "cm")
    assert energy(c / m**2, m) == pytest.approx(law.energy(STRETCHES), rel=1e-9)
    assert float(made.findtext("k")) == pytest.approx(law.bulk_modulus)


def test_soft_hencky_becomes_ogden_to_the_digits_that_are_said():
    law = Hencky(e=0.01, nu=0.49)
    other, remarks = converted("vessel", law, mixed=True)
    assert isinstance(other.form, Series)
    ogden = Ogden(mu=other.form.mu, alpha=other.form.alpha, d1=2 / other.bulk, form="abaqus")
    stretches = np.array([[2.0], [0.9], [0.5]])
    error = np.abs(ogden.kirchhoff(stretches) / law.kirchhoff(stretches) - 1)[[0, 2]]
    assert 1e-6 < error.max() < 1e-5
    assert ogden.bulk_modulus == pytest.approx(law.bulk_modulus)
    assert "to 1e-5 at a stretch of 2" in remarks[0]


def test_a_law_of_a_script_is_refused():
    class Mine(Yeoh):
        law: Literal["mine"] = "mine"  # type: ignore[assignment]

    class Other(Law):
        law: Literal["mine"] = "mine"

        @property
        def initial_shear_modulus(self) -> float:
            return 1.0

        def coefficients(self) -> tuple[float, ...]:
            return ()

        energy_form = energy = staticmethod(lambda *_: None)  # type: ignore[assignment]

    with pytest.raises(InputError, match="fat: the law mine is one of a script's own"):
        converted("fat", Other(), mixed=True)
    with pytest.raises(InputError, match="the law mine"):  # its energy may be another one
        converted("fat", Mine(c10=1.0), mixed=True)


# -- steps ------------------------------------------------------------


def test_forces_on_the_outer_face_add_up(plain):
    force = np.array([0.3, -0.2, 5.0])
    nodal = plain.even_forces(force)
    x = plain.mesh.points[plain.nodes(tags.SOCKET_OUTER)]
    weight = plain.outer_weights[:, None]
    middle = (weight * x).sum(axis=0) / weight.sum()
    (dx, dy), (fx, fy) = (x - middle).T, nodal.T
    moment = (dx * fy - dy * fx).sum()
    assert [*nodal.sum(axis=0), moment] == pytest.approx(force, rel=1e-9)
    circumference = plain.outer_weights.sum()
    assert 2 * np.pi * 13 < circumference < 2 * np.pi * 15


def test_socket_is_clear_of_the_limb_when_it_has_swollen(plain):
    """As the program's own expanded socket, which measures at the quadrature points."""
    from mpi4py import MPI

    from calfsocket.mechanics.limb_problem import limb_problem
    from calfsocket.meshes.distributed import distribute

    section = distribute(MPI.COMM_SELF, lambda: plain.mesh)
    problem = limb_problem(section, plain.laws, donning="expanded")
    assert plain.swelling == pytest.approx(problem.contact.swelling, rel=0.01)


def test_socket_is_wide_at_the_first_temperature_and_itself_at_the_next(cases):
    """Held along the limb, an elastic wall grows in the plane by 1 + nu times its free strain."""
    case = cases["held, expanded"]
    deck = decks.read(keywords.deck(case, keywords.ABAQUS)[0], "abaqus")
    assert sizes(deck, "SOCKET", at=1.0) * (1 + case.laws[tags.SOCKET].nu) == pytest.approx(
        case.swelling, rel=1e-6
    )
    assert not sizes(deck, "SOCKET", at=2.0).any()
    # Its outer face is moved with it, and back.
    moves = [block.data for block in deck.of("BOUNDARY")[1:]]
    x = case.mesh.points[case.nodes(tags.SOCKET_OUTER)] - case.inner_middle
    there, home = (np.array([float(line[-1]) for line in data]).reshape(-1, 2) for data in moves)
    assert there == pytest.approx(case.swelling * x, abs=1e-9)
    assert not home.any()
    assert [b.parameters for b in deck.of("MODEL CHANGE")] == [
        {"TYPE": "CONTACT PAIR", "REMOVE": None}, {"TYPE": "CONTACT PAIR", "ADD": None}
    ]  # fmt: skip


def test_an_expanded_socket_with_friction_is_said_not_to_end_in_calculix(cases):
    _, remarks = keywords.deck(cases["expanded"], keywords.CALCULIX)
    assert any("with friction, CalculiX did not bring an expanded socket" in r for r in remarks)
    smooth = replace(cases["expanded"], contact=Contact(friction=0.0))
    assert not any("did not bring" in r for r in keywords.deck(smooth, keywords.CALCULIX)[1])


def test_stages_become_steps(cases):
    steps = cases["loaded"].steps
    assert [s.name for s in steps] == ["push", "turn-1", "turn-2", "turn-3", "shrink"]
    assert [s.held.tolist() for s in steps[:2]] == [[False] * 3, [True, False, True]]
    assert steps[2].place == pytest.approx([-0.5, 0.0, -np.pi / 180])
    assert steps[4].volume == {"muscle": -0.03}
    text, _ = keywords.deck(cases["loaded"], keywords.ABAQUS)
    deck = decks.read(text, "abaqus")
    frame = deck.node_sets["FRAME"]
    loads = [block.data for block in deck.of("CLOAD")]
    assert loads[0] == [
        [str(frame[0]), "1", "0.1"],
        [str(frame[0]), "2", "0."],
        [str(frame[1]), "1", "2."],
    ]
    # Each equation moves a node of the outer face with the frame.
    shift, turn = np.array([0.3, -0.1]), 0.02
    for (terms,), line in zip(*[iter(deck.of("EQUATION")[0].data)] * 2, strict=True):
        assert terms == "4"
        node, axis = int(line[0]), int(line[1])
        x, y = np.array(deck.nodes[node]) - np.array(deck.nodes[frame[0]])
        expected = shift[axis - 1] + turn * (-y if axis == 1 else x)
        values = [expected, 0.0, shift[axis - 1], turn]
        factors = [float(word) for word in line[2::3]]
        assert np.dot(factors, values) == pytest.approx(0.0, abs=1e-9)


def test_volumes_are_reached_at_the_temperature_of_their_step(cases):
    text, remarks = keywords.deck(cases["loaded"], keywords.CALCULIX)
    deck = decks.read(text, "calculix")
    assert not sizes(deck, "MUSCLE", at=5.0).any()
    # In the plane alone, as calfsocket has it; in Abaqus in all directions.
    shrunk = sizes(deck, "MUSCLE", at=6.0)
    assert 1 + shrunk == pytest.approx([0.97**0.5, 0.97**0.5, 1.0], rel=1e-9)
    assert any("up to 3 % of their pressure" in remark for remark in remarks)
    abaqus, remarks = keywords.deck(cases["loaded"], keywords.ABAQUS)
    assert any("by up to 1 %" in remark for remark in remarks)
    alike = sizes(decks.read(abaqus, "abaqus"), "MUSCLE", at=6.0)
    assert (1 + alike) ** 3 == pytest.approx(0.97, rel=1e-9)
    assert [block.data[0][1] for block in deck.of("TEMPERATURE")] == [f"{k}." for k in range(1, 7)]
    assert any("by up to 1 %" in remark for remark in remarks)


def test_febio_reaches_volumes_by_the_gradient_from_the_stress_free_state(cases):
    root = decks.read_febio(febio.deck(cases["loaded"])[0])
    (muscle,) = (m for m in root.find("Material") if m.get("name") == "muscle")
    f0, way = prestrain(root, muscle)
    assert np.linalg.det(f0) == pytest.approx(1 / 0.97) and f0[2, 2] == 1.0
    # The last of five steps of 1 after donning, which takes 3.
    assert way(7.0) == 0.0 and way(8.0) == 1.0
    back = replace(cases["loaded"], loading=Loading(stages=(
        Stage(name="grow", volume={"muscle": 0.04}), Stage(name="shrink", volume={"muscle": -0.03})
    )))  # fmt: skip
    root = decks.read_febio(febio.deck(back)[0])
    (muscle,) = (m for m in root.find("Material") if m.get("name") == "muscle")
    f0, way = prestrain(root, muscle)
    for time, ratio in ((3.0, 1.0), (4.0, 1.04), (5.0, 0.97)):
        gradient = np.eye(3) + way(time) * (f0 - np.eye(3))
        assert np.linalg.det(gradient) == pytest.approx(1 / ratio, rel=1e-9)


def test_a_liner_is_shorter_around_the_limb(lined):
    """By its undersize, along the tangent of the socket's face that it is bonded to."""
    middle = lined.mesh.points[lined.mesh.cells[lined.cells("liner"), :3]].mean(axis=1)
    deck = decks.read(keywords.deck(lined, keywords.CALCULIX)[0], "calculix")
    assert sizes(deck, "LINER", at=1.0) == pytest.approx([-0.05, 0.0, 0.0], rel=1e-9)
    assert not sizes(deck, "LINER", at=0.0).any()
    axes = np.array([line[1:] for line in deck.directions["FIBRES"]], dtype=float)
    around = np.column_stack([-middle[:, 1], middle[:, 0]])
    around /= np.linalg.norm(around, axis=1)[:, None]
    assert np.abs(np.sum(axes[:, :2] * around, axis=1)).min() > 0.99  # nearly a circle
    assert np.sum(axes[:, :3] * axes[:, 3:], axis=1) == pytest.approx(0.0, abs=1e-9)

    root = decks.read_febio(febio.deck(lined)[0])
    (liner,) = (m for m in root.find("Material") if m.get("name") == "liner")
    f0, way = prestrain(root, liner)
    assert [way(time) for time in (1.0, 2.0, 9.0)] == [0.0, 1.0, 1.0]
    t = axes[:, :3]
    stretch = np.einsum("ni,nij,nj->n", t, f0, t)
    assert stretch == pytest.approx(1 / 0.95, rel=1e-6)
    assert np.linalg.det(f0) == pytest.approx(stretch, rel=1e-6)

    _, remarks = keywords.deck(lined, keywords.ABAQUS)
    assert any("its undersize of 5 % is left out" in remark for remark in remarks)


def sizes(deck, material, at):
    """Strains without stress at a temperature."""
    (table,) = (b for b in deck.materials[material] if b.keyword == "EXPANSION")
    zero = float(table.parameters["ZERO"])
    (row,) = (line for line in np.array(table.data, dtype=float) if line[-1] == at)
    return row[:-1] * (at - zero)


def prestrain(root, material):
    """Return the full gradient, or those of the elements, and the way there over time."""
    f0, ramp = material.find("prestrain/F0"), material.find("prestrain/ramp")
    (curve,) = (c for c in root.find("LoadData") if c.get("id") == ramp.get("lc"))
    points = np.array([p.text.split(",") for p in curve.iter("pt")], dtype=float)
    if f0.get("type") == "map":
        (data,) = (m for m in root.find("MeshData") if m.get("name") == f0.text)
        values = [each.text.split(",") for each in data]
    else:
        values = [f0.text.split(",")]
    tensors = np.array(values, dtype=float).reshape(-1, 3, 3)
    return tensors.squeeze(), lambda time: float(np.interp(time, *points.T))


def test_names_begin_with_a_letter_and_have_no_points(plain):
    """As regions and stages need not."""

    def renamed(table):
        return {"2nd_skin" if name == "skin" else name: each for name, each in table.items()}

    mesh = replace(plain.mesh, regions=renamed(plain.mesh.regions))
    stage = Stage(name="1.5_kN+x", force={"x": 0.1})
    case = replace(plain, mesh=mesh, tissues=renamed(plain.tissues), laws=renamed(plain.laws),
                   loading=Loading(stages=(stage,)))  # fmt: skip
    for program, dialect in DIALECTS.items():
        deck = decks.read(keywords.deck(case, dialect)[0], program)
        assert len(deck.element_sets["N_2ND_SKIN"]) == len(plain.cells("skin"))
    assert (
        "*STEP, NLGEOM=YES, INC=1000, NAME=N_1_5_kN_x, UNSYMM=YES"
        in keywords.deck(case, keywords.ABAQUS)[0]
    )


def test_steps_of_stages_with_like_names_have_names_of_their_own(plain):
    """Abaqus takes no points, and no capitals for other letters."""
    stages = tuple(Stage(name=name, force={"x": 0.1}) for name in ("push.x", "PUSH_X"))
    case = replace(plain, loading=Loading(stages=stages))
    text = keywords.deck(case, keywords.ABAQUS)[0]
    decks.read(text, "abaqus")
    names = re.findall(r"^\*STEP.*NAME=([^,]+)", text, re.MULTILINE)
    assert names[-2:] == ["push_x", "PUSH_X-2"]


# -- files ------------------------------------------------------------

STUDY = '[study]\nsockets = ["TSB", "HS"]\nmaterials = ["combined"]\n[model]\nsize = "coarse"\n'


@pytest.fixture(scope="module")
def simulation() -> Simulation:
    return Simulation(tiny_limb(), tiny_socket("C"), MATERIALS, "coarse")


def test_meshio_reads_back_what_is_written(simulation, plain, tmp_path, monkeypatch):
    import meshio

    # It imports h5py for every XDMF file, and does not use it for numbers in the file.
    monkeypatch.setitem(sys.modules, "h5py", ModuleType("h5py"))
    cells, points = plain.mesh.cells, plain.mesh.points
    for name, format, kind in (
        ("a.msh", "msh", "gmsh"), ("a.xdmf", "xdmf", "xdmf"), ("a.inp", "calculix", "abaqus"),
    ):  # fmt: skip
        simulation.export(tmp_path / name, format)
        mesh = meshio.read(tmp_path / name, kind)
        assert mesh.points[:, :2] == pytest.approx(points, abs=1e-9)
        found = np.concatenate([b.data for b in mesh.cells if b.type == "triangle6"])
        assert sorted(map(tuple, found)) == sorted(map(tuple, cells))
        names = mesh.field_data or mesh.cell_sets
        assert {name.upper() for name in plain.mesh.regions} <= {n.upper() for n in names}


def test_the_same_case_gives_the_same_bytes(simulation, tmp_path):
    for format in ("calculix", "febio", "msh"):
        files = [tmp_path / f"{format}{i}" for i in range(2)]
        for file in files:
            simulation.export(file, format)
        assert files[0].read_bytes() == files[1].read_bytes()


def run(*words: object) -> int:
    return cli.main([str(word) for word in words])


def test_command_writes_a_case_and_says_what_differs(tmp_path, capsys):
    study, out = tmp_path / "study.toml", tmp_path / "tsb.inp"
    study.write_text(STUDY)
    assert run("export", study, "--case", "TSB_combined", "--format", "calculix", "--out", out) == 0
    shown = capsys.readouterr().out
    assert str(out) in shown and "vessel: Hencky's law is Ogden's" in shown
    decks.read(out.read_text(), "calculix")


def test_formats_of_the_command_are_those_there_are(simulation):
    from calfsocket.commands.export import FORMATS
    from calfsocket.export.write import FORMATS as THERE

    assert FORMATS == THERE
    with pytest.raises(InputError, match="did you mean 'abaqus'"):
        simulation.export(Path("a"), "abacus")  # type: ignore[arg-type]
