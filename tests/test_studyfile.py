"""Study files as people write them: what they mean, and what tools make of them."""

import json
import re
import tomllib
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from calfsocket import cli
from calfsocket.commands import study as paper_command
from calfsocket.materials.hencky import Hencky
from calfsocket.materials.ogden import Ogden
from calfsocket.materials.tissues import FAT, MUSCLE_AND_FASCIA, SOCKET
from calfsocket.meshes import curves, limb
from calfsocket.meshes.drawn import OutlineFile
from calfsocket.meshes.limb import Limb, limb_curves
from calfsocket.meshes.outline import ReadOutline
from calfsocket.meshes.socket import NormalOffset, Socket, reference_sockets, resolved
from calfsocket.study import document
from calfsocket.study.cases import Plan
from calfsocket.study.files import Files
from calfsocket.study.study import Study, example, variants

STUDIES = Path(document.__file__).parent / "data"
PLANE = {"origin": (0, 0, 80), "normal": (0, 0, 1), "anterior": (0, 1, 0)}
RING = tuple((55 * np.cos(t), 55 * np.sin(t)) for t in np.arange(0, 6, 0.5))
SECTIONS = {
    "sections": [PLANE | {"points": RING, "wall_mm": 4.0}],
    "source": {
        **{"file": "scan.stl", "sha256": "0", "registration": "none"},
        **{"rotation": ((1, 0, 0), (0, 1, 0), (0, 0, 1)), "shift": (0, 0, 0)},
        **{"gap_mm": 1.2, "gap_error_mm": 0.1, "rms_mm": 0.1, "largest_mm": 0.4},
        **{"covered": 1.0, "tolerance_mm": 0.2, "program": "calfsocket"},
    },
}
"""As `socket` writes it."""


@pytest.fixture
def plan(tmp_path):
    """Plan a study file given as text."""

    def make(text: str) -> Plan:
        path = tmp_path / "study.toml"
        path.write_text(text)
        return Study.read(path).plan

    return make


def names(plan: Plan) -> list[str]:
    return [case.name for case in plan.cases]


# ----- the paper's study


def test_the_papers_study_is_its_six_runs_with_the_defaults():
    plan = Study.paper().plan
    pairs = [(socket, name) for socket in ("TC", "TSB", "HS") for name in ("separate", "combined")]
    assert [case.key for case in plan.cases] == [case.of for case in plan.cases] == pairs
    assert plan.document.model == document.ModelTable()
    assert all(case.socket == Socket.reference(case.of[0]) for case in plan.cases)
    assert plan.thresholds == () and plan.parameters == ()


def test_the_bare_command_runs_that_file_as_its_options_change_it(tmp_path):
    law = tmp_path / "fat.toml"
    law.write_text('law = "hencky"\ne = "3 kPa"\nnu = 0.4\n')
    words = ["--size", "coarse", "--sockets", "hs", "--friction", "0.3", "--material", f"fat={law}"]
    parser = cli._parser(paper_command.study)
    study = paper_command.asked_for(parser.parse_all(words))
    assert [case.name for case in study.plan.to_solve] == ["HS_separate", "HS_combined"]
    assert len(study.cases) == 6
    simulation = study.plan.to_solve[0].simulation()
    assert simulation.mesh_size.name == "coarse" and simulation.contact.friction == 0.3
    assert simulation.region_laws["subcutaneous_fat"] == Hencky(e=0.003, nu=0.4)
    assert study.plan.source.content["model"]["friction"] == 0.3
    assert study.plan.source.files[str(law)]["content"]["nu"] == 0.4


def test_variants_are_a_sweep_of_named_changes(tmp_path):
    parser = cli._parser(paper_command.study)
    words = ["--variants", "--sockets", "HS", "--materials", "separate"]
    study = paper_command.asked_for(parser.parse_all(words))
    labels = ["", *(f"@{name}" for name in variants())]
    assert [case.name for case in study.plan.to_solve] == [f"HS{x}_separate" for x in labels]
    assert {case.of for case in study.plan.to_solve} == {("HS", "separate")}
    fixed = study.plan.to_solve[1]
    assert fixed.changes == {"model.socket_support": "outer-fixed"}
    assert fixed.simulation().support == "outer-fixed"
    assert len(study.plan.cases) == 6 * (1 + len(variants()))


# ----- the example, and what editors use


def test_the_example_passes_check_and_states_the_defaults(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["new", "my.toml"]) == 0
    assert cli.main(["check", "my.toml"]) == 0
    assert "4 cases" in capsys.readouterr().out
    content = tomllib.loads(example())
    checked = Study.read("my.toml").plan.document
    assert content["model"].keys() | {
        "gamma",
        "gamma_t",
    } == document.ModelTable.model_fields.keys() - {"gauss_points"}
    assert content["steps"].keys() <= document.LoadSteps.model_fields.keys()
    assert checked.model == document.ModelTable() and checked.steps == document.LoadSteps()


def test_every_remark_of_the_example_can_be_used():
    lines = []
    for line in example().splitlines():
        remark = re.fullmatch(r"# (\[.*|[a-z_.]+ = .*|    \{.*|\](?: .*)?)", line)
        lines.append(remark[1] if remark else line)
    content = tomllib.loads("\n".join(lines))
    assert content.keys() == document.Document.model_fields.keys()
    assert content["sockets"].keys() == {"mine", "drawn", "scanned", "offset", "round"}
    assert content["materials"]["soft-fat"].keys() >= {"skin", "fascia", "vessel", "muscle"}
    tables = {
        name: resolved(table, reference_sockets(), lambda *_: ReadOutline(RING), lambda _: SECTIONS)
        for name, table in content["sockets"].items()
    }
    jsonschema.validate(content, json.loads(document.schema_text()))
    for other in ("sweep", "uncertainty"):  # a file has one of the two
        one = {name: table for name, table in content.items() if name != other}
        document.Document.model_validate(one | {"sockets": tables})


def _meaning(schema: str) -> object:
    """Return a schema without what is so by default, which some releases of pydantic write."""

    def without(pairs):
        return {k: v for k, v in pairs if not (k == "additionalProperties" and v is True)}

    return json.loads(schema, object_pairs_hook=without)


def test_the_schema_that_is_shipped_is_that_of_the_models(capsys):
    assert cli.main(["schema"]) == 0
    printed = capsys.readouterr().out
    shipped = (STUDIES / document.SCHEMA_FILE).read_text(encoding="utf-8")
    assert _meaning(printed) == _meaning(shipped)
    jsonschema.Draft202012Validator.check_schema(json.loads(printed))


@pytest.mark.parametrize("name", ["paper.toml", "example.toml"])
def test_the_studies_fit_the_schema_and_a_typing_error_does_not(name):
    content = tomllib.loads((STUDIES / name).read_text(encoding="utf-8"))
    validator = jsonschema.Draft202012Validator(json.loads(document.schema_text()))
    assert list(validator.iter_errors(content)) == []
    content["model"]["frictoin"] = 0.4
    assert [error.validator for error in validator.iter_errors(content)] == ["additionalProperties"]


def test_the_schema_knows_units():
    validator = jsonschema.Draft202012Validator(json.loads(document.schema_text()))

    def errors(wall):
        content = {"sockets": {"mine": {"like": "TC", "wall_thickness": wall}}}
        return list(validator.iter_errors(content))

    assert errors("4.5 mm") == []
    assert errors("4.5 kPa") and errors(4.5)


# ----- sockets


def test_numbers_with_units_reach_the_socket(plan):
    made = plan(
        """
        [study]
        sockets = ["a"]
        materials = ["separate"]
        [sockets.a]
        law = "normal_offset"
        base = "0.05 cm"
        wall_thickness = "0.003 m"
        modulus = "2.2 GPa"
        bumps = [{ center = "3.141592653589793 rad", width = "10 deg", amplitude = "500 um" }]
        """
    )
    (case,) = made.cases
    socket = case.socket
    assert isinstance(socket, NormalOffset) and socket.name == "a"
    assert (socket.base, socket.wall_thickness, socket.bumps[0].amplitude) == (0.5, 3.0, 0.5)
    assert socket.bumps[0].center == pytest.approx(180)
    assert case.simulation().region_laws["socket"] == Hencky(e=2200.0, nu=SOCKET.nu)
    # The whole skin is moved inward by 0.5 mm or more.
    assert case.placement.touching == 1
    assert case.placement.largest_overlap == pytest.approx(1.0, abs=0.02)


def test_a_socket_like_another_keeps_what_is_not_named(plan):
    made = plan(
        '[study]\nsockets = ["mine", "TSB"]\nmaterials = ["combined"]\n'
        '[sockets.mine]\nlike = "HS"\narea_reduction = "3 %"\n'
    )
    mine, tsb = made.cases
    changes = {"name": "mine", "area_reduction": 0.03}
    assert mine.socket == Socket.reference("HS").model_copy(update=changes)
    assert mine.placement.area_reduction == pytest.approx(0.03, abs=1e-6)
    assert tsb.socket == Socket.reference("TSB")


def test_an_outline_is_read_from_beside_the_study(tmp_path):
    calf = Limb.reference()
    skin = limb_curves(calf)[calf.contact_boundary]
    inner = curves.offset(skin, lambda points: np.full(len(points), -1.0))
    rows = [f"{x:.6f}, {y:.6f}" for x, y in inner.evaluate(inner.sample(4.0))]
    (tmp_path / "inner.csv").write_text("x, y\n" + "\n".join(rows))
    path = tmp_path / "study.toml"
    path.write_text(
        '[study]\nsockets = ["a"]\nmaterials = ["combined"]\n'
        '[sockets.a]\noutline = "inner.csv"\nshift = ["0.3 mm", "-0.2 mm"]\nrotation = "1 deg"\n'
    )
    (case,) = Study.read(path).cases
    shape = case.socket
    assert [f"{x:.6f}, {y:.6f}" for x, y in shape.points] == rows
    assert shape.shift == (0.3, -0.2) and shape.rotation == 1
    # 1 mm off all round takes 1 mm of the perimeter; turned and moved it encloses the same.
    lost = skin.perimeter / skin.area
    assert case.placement.area_reduction == pytest.approx(lost, rel=0.02)
    assert not Study.read(path).plan.notices
    record = Study.read(path).plan.source.files["inner.csv"]
    assert len(record["content"]["points"]) == len(rows) and len(record["sha256"]) == 64


def test_two_curves_of_one_drawing_are_two_sockets_and_are_read_again_from_the_record(tmp_path):
    random = np.random.default_rng(0)
    calf = Limb.reference()

    def polygon(handle: str, by: float, noise: float) -> str:
        inner = curves.offset(calf.skin, lambda points: np.full(len(points), -by))
        points = inner.evaluate(inner.sample(0.5))
        points += random.normal(0, noise, points.shape)
        return f'<polygon id="{handle}" points="{" ".join(f"{x},{-y}" for x, y in points)}"/>'

    (tmp_path / "two.svg").write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" width="9mm" viewBox="0 0 9 9">'
        f"{polygon('tight', 1.0, 0.0)}{polygon('scanned', 0.5, 0.05)}</svg>"
    )
    path = tmp_path / "study.toml"
    path.write_text(
        '[study]\nsockets = ["a", "b"]\nmaterials = ["combined"]\n'
        '[sockets.a]\noutline = "two.svg"\ncurve = "tight"\n'
        '[sockets.b]\noutline = "two.svg"\ncurve = "scanned"\n'
    )
    made = Study.read(path).plan
    tight, scanned = made.cases
    assert tight.placement.mean_overlap == pytest.approx(1.0, abs=0.01)
    assert scanned.placement.mean_overlap == pytest.approx(0.5, abs=0.02)
    assert tight.socket.deviation == 0 < scanned.socket.deviation < 0.2
    notice = (
        f"sockets.b: the outline was smoothed; the curve is up to {scanned.socket.deviation:.2f} mm"
    )
    assert [line.startswith(notice) for line in made.notices] == [True]
    assert made.source.files.keys() == {"two.svg (curve = tight)", "two.svg (curve = scanned)"}
    again = Files(tmp_path / "elsewhere", json.loads(json.dumps(made.source.files)))
    assert again.outline("two.svg", OutlineFile(curve="scanned")).points == scanned.socket.points


# ----- materials


def test_laws_by_tissue_and_by_region(plan):
    made = plan(
        """
        [study]
        sockets = ["TC"]
        materials = ["custom", "shared", "combined"]
        [materials.custom]
        fat = { law = "neo-hookean", mu = "2 kPa", d1 = "10 1/MPa" }
        soleus = { law = "hencky", e = "30 kPa", nu = 0.45 }
        [materials.shared]
        like = "combined"
        combined = { law = "ogden", mu = ["5 kPa", "7 kPa"], alpha = [14, 2], nu = 0.495 }
        [laws]
        vessel = { law = "hencky", e = "12 kPa", nu = 0.49 }
        """
    )
    custom, shared, paper = (case.simulation().region_laws for case in made.cases)
    assert custom["subcutaneous_fat"] == Ogden(mu=(0.002,), alpha=(2.0,), d1=10.0)
    assert custom["soleus"] == Hencky(e=0.03, nu=0.45) != custom["tibialis_anterior"]
    assert shared["soleus"] == shared["deep_fascia"] and shared["soleus"].mu == (0.005, 0.007)
    assert paper["soleus"] == MUSCLE_AND_FASCIA and shared["subcutaneous_fat"] == FAT
    vein = "small_saphenous_vein"
    assert custom[vein] == shared[vein] == Hencky(e=0.012, nu=0.49)


def test_a_set_like_combined_takes_the_steps_of_the_combined_set(plan):
    made = plan(
        '[study]\nsockets = ["TC"]\nmaterials = ["a", "b"]\n'
        '[materials.a]\nlike = "combined"\n[materials.b]\n'
    )
    assert [case.simulation().steps.extrapolate for case in made.cases] == [True, "smooth"]


def test_another_limb_is_read_from_beside_the_study(tmp_path):
    calf = json.loads(Path(limb.__file__).with_name("calf.json").read_text())
    calf["title"] = "another"
    (tmp_path / "limb.json").write_text(json.dumps(calf))
    path = tmp_path / "study.toml"
    path.write_text(BASE.replace("[study]", '[study]\nlimb = "limb.json"'))
    study = Study.read(path)
    assert study.plan.limb.title == "another"
    assert study.plan.source.sha256.keys() == {"study.toml", "limb.json"}


# ----- cases and sweeps

BASE = """
[study]
sockets = ["TC", "mine"]
materials = ["separate", "soft"]
[sockets.mine]
like = "HS"
[materials.soft]
fat = { law = "ogden", mu = ["1 kPa"], alpha = [26], nu = 0.495 }
"""


def test_cases_are_all_combinations_in_the_order_of_the_file(plan):
    assert names(plan(BASE)) == ["TC_separate", "TC_soft", "mine_separate", "mine_soft"]


def test_a_grid_makes_a_case_of_each_combination_that_affects_it(plan):
    made = plan(
        BASE + "[sweep.grid]\nmodel.friction = [0.2, 0.4]\n"
        'sockets.mine.wall_thickness = ["3 mm", "5 mm"]\n'
    )
    frictions = [f"friction={value}" for value in (0.2, 0.4)]
    walls = ["3mm", "5mm"]
    mine = [f"mine@{f},wall_thickness={w}" for f in frictions for w in walls]
    wanted = [f"TC@{f}_{s}" for s in ("separate", "soft") for f in frictions]
    wanted += [f"{socket}_{s}" for s in ("separate", "soft") for socket in mine]
    assert names(made) == wanted
    assert made.parameters == ("model.friction", "sockets.mine.wall_thickness")
    walls = {case.socket.wall_thickness for case in made.cases if "thickness=5mm" in case.name}
    assert walls == {5.0}
    slippery = [case for case in made.cases if "friction=0.2" in case.name]
    assert {case.simulation().contact.friction for case in slippery} == {0.2}


def test_a_list_takes_values_together(plan):
    made = plan(BASE + "[sweep.list]\nmodel.friction = [0.2, 0.4]\nsteps.largest = [0.25, 0.5]\n")
    assert names(made)[:2] == [
        "TC@friction=0.2,largest=0.25_separate",
        "TC@friction=0.4,largest=0.5_separate",
    ]
    assert len(made.cases) == 8
    assert made.cases[1].simulation().steps.largest == 0.5


def test_a_sweep_over_a_law_shows_in_the_name_of_the_set(plan):
    made = plan(BASE + '[sweep.grid]\nmaterials.soft.fat.mu = [["1 kPa"], ["2 kPa"]]\n')
    assert names(made) == [
        "TC_separate", "TC_soft@mu=1kPa", "TC_soft@mu=2kPa",
        "mine_separate", "mine_soft@mu=1kPa", "mine_soft@mu=2kPa",
    ]  # fmt: skip
    soft = made.cases[2]
    assert soft.simulation().region_laws["subcutaneous_fat"].mu == (0.002,)
    assert soft.of == ("TC", "soft") and soft.materials.base == "separate"


def test_values_that_make_no_word_are_counted(plan):
    laws = [{"law": "hencky", "e": "3 kPa", "nu": nu} for nu in (0.4, 0.45)]
    tables = ", ".join(f'{{ law = "hencky", e = "3 kPa", nu = {law["nu"]} }}' for law in laws)
    made = plan(BASE + f"[sweep.grid]\nmaterials.soft.fat = [{tables}]\n")
    assert names(made)[1:3] == ["TC_soft@fat=value-1", "TC_soft@fat=value-2"]
    assert made.cases[2].materials.tissue_laws()["fat"] == Hencky(e=0.003, nu=0.45)


def test_parameters_of_one_name_are_distinguished(plan):
    made = plan(
        BASE + "[materials.soft.vessel]\nlaw = 'hencky'\ne = '10 kPa'\nnu = 0.49\n"
        "[sweep.grid]\nmaterials.soft.fat.nu = [0.49]\nmaterials.soft.vessel.nu = [0.48]\n"
    )
    assert names(made)[1] == "TC_soft@fat.nu=0.49,vessel.nu=0.48"


def test_cases_one_by_one_with_custom_parameters(plan):
    made = plan(
        """
        [[cases]]
        socket = "HS"
        materials = "separate"
        [[cases]]
        socket = "HS"
        materials = "separate"
        set.model = { friction = 0.1, socket_support = "outer-fixed" }
        label = "fixed"
        [[cases]]
        socket = "HS"
        materials = "separate"
        set.model.friction = 0.2
        """
    )
    assert names(made) == ["HS_separate", "HS@fixed_separate", "HS@friction=0.2_separate"]
    assert [dict(case.changes) for case in made.cases] == [
        {}, {"model.friction": 0.1, "model.socket_support": "outer-fixed"}, {"model.friction": 0.2}
    ]  # fmt: skip
    assert made.cases[1].simulation().support == "outer-fixed"


def test_names_reach_into_lists(plan):
    made = plan(
        BASE.replace('like = "HS"', 'law = "normal_offset"\nbase = "1 mm"\n'
        'bumps = [{ center = "0 deg", width = "20 deg", amplitude = "1 mm" }]')
        + '[sweep.grid]\nsockets.mine.bumps.0.amplitude = ["1 mm", "2 mm"]\n'
    )  # fmt: skip
    swept = {case.socket.name: case.socket for case in made.cases}
    assert swept["mine@amplitude=2mm"].bumps[0].amplitude == 2.0


# ----- check and show


def test_check_lists_cases_and_solves_nothing(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("calfsocket.study.runner.Runner", lambda *_: pytest.fail("solved"))
    path = tmp_path / "study.toml"
    path.write_text(BASE)
    assert cli.main(["check", str(path)]) == 0
    heading, columns, *cases = capsys.readouterr().out.splitlines()
    assert heading == f"{path}: 4 cases, mesh paper"
    assert "area lost" in columns
    assert [line.split()[0] for line in cases] == [
        "TC_separate", "TC_soft", "mine_separate", "mine_soft"
    ]  # fmt: skip
    assert [line.split()[1] for line in cases] == ["3.15", "3.15", "5.00", "5.00"]
    assert [each.name for each in tmp_path.iterdir()] == ["study.toml"]


def test_check_names_what_the_file_says_in_vain(tmp_path, capsys):
    text = """
    [study]
    sockets = ["TC"]
    materials = ["separate"]
    quantities = ["contact_share"]
    [sockets.pressure]
    like = "HS"
    [materials.liner]
    """
    (tmp_path / "study.toml").write_text(text)
    assert cli.main(["check", str(tmp_path / "study.toml")]) == 0
    said = "not used: sockets.pressure (no case), materials.liner (no case), study.quantities (no"
    assert said in capsys.readouterr().out


def test_show_draws_vectors(tmp_path):
    path = tmp_path / "study.toml"
    path.write_text(BASE)
    assert cli.main(["show", str(path), "--out", str(tmp_path / "shown.pdf")]) == 0
    assert (tmp_path / "shown.pdf").read_bytes().startswith(b"%PDF")


def test_show_draws(tmp_path, capsys):
    import matplotlib.image

    path, picture = tmp_path / "study.toml", tmp_path / "shown.png"
    path.write_text(BASE)
    assert cli.main(["show", str(path), "--out", str(picture)]) == 0
    assert capsys.readouterr().out == f"{picture}\n"
    image = matplotlib.image.imread(picture)
    assert min(image.shape[:2]) > 800
    overlap = np.array([0xD5, 0x5E, 0x00]) / 255
    assert (np.abs(image[..., :3] - overlap).max(axis=-1) < 0.01).sum() > 1000
