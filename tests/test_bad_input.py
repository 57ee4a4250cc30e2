"""Study files that cannot be used: each gets one line, exit code 2, and nothing is written."""

import json
import os
from collections.abc import Callable, Sequence
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path

import pytest

import reliability
from calfsocket import cli
from calfsocket.meshes.limb import Limb
from calfsocket.simulation.record import CaseRecord
from calfsocket.study.record import Recorder
from calfsocket.study.study import Study
from reliability import Trial

TITLE = "Study files"
INTRO = "`check`, `run` and `show` give the same message for a study file that cannot be used."

GOOD = """
[study]
sockets = ["TC", "mine"]
materials = ["separate", "soft"]
[model]
size = "coarse"
[sockets.mine]
like = "HS"
area_reduction = "4 %"
[materials.soft]
fat = { law = "ogden", mu = ["1 kPa"], alpha = [26], nu = 0.495 }
"""
STAGE = '[[loads]]\nname = "push"\n'
TWO_LISTS = '[study]\nsockets = ["TC"]\nmaterials = ["separate"]\n'
INCOMPRESSIBLE = "\n".join(
    f'{tissue} = {{ law = "yeoh", c10 = "1 kPa" }}'
    for tissue in ("skin", "fat", "muscle", "fascia", "vessel")
)

RECORD = CaseRecord(socket="HX", material_set="separate", of=("HX", "separate"))

Make = Callable[[Path], Sequence[str]]
"""Makes a trial in a folder; returns the words of its command line."""


def edited(old: str, new: str) -> str:
    """Return the good file with one thing changed."""
    assert GOOD.count(old) == 1
    return GOOD.replace(old, new)


def socket(text: str) -> str:
    """Return a file with one custom socket."""
    return f'[study]\nsockets = ["mine"]\nmaterials = ["separate"]\n[sockets.mine]\n{text}\n'


def liner(text: str) -> str:
    """Return the table of a liner with other values."""
    lines = {"thickness": 'thickness = "6 mm"', "law": 'law = "silicone"'}
    lines |= {line.split(" ")[0]: line for line in text.splitlines()}
    return "[liner]\n" + "\n".join(lines.values()) + "\n"


def fat(text: str) -> str:
    """Return the good file with another law of fat."""
    return edited('{ law = "ogden", mu = ["1 kPa"], alpha = [26], nu = 0.495 }', text)


def a_folder(folder: Path) -> Sequence[str]:
    return ["check", str(folder)]


def a_pipe(folder: Path) -> Sequence[str]:
    os.mkfifo(folder / "study.toml")  # to read it would wait for ever
    return ["check", str(folder / "study.toml")]


def a_device(folder: Path) -> Sequence[str]:
    return ["check", "/dev/zero"]


def a_huge_file(folder: Path) -> Sequence[str]:
    path = folder / "study.toml"
    with path.open("wb") as file:
        file.truncate(10**9)
    return ["check", str(path)]


def a_pipe_for_a_material(folder: Path) -> Sequence[str]:
    os.mkfifo(folder / "fat.toml")
    return written(folder, fat('{ file = "fat.toml" }'))


def a_binary_material(folder: Path) -> Sequence[str]:
    (folder / "fat.toml").write_bytes(bytes(range(256)))
    return written(folder, fat('{ file = "fat.toml" }'))


def a_material_with_a_wrong_unit(folder: Path) -> Sequence[str]:
    (folder / "fat.toml").write_text('law = "hencky"\ne = "3 kilo"\nnu = 0.4\n')
    return written(folder, fat('{ file = "fat.toml" }'))


def an_outline_that_is_not_a_drawing(folder: Path) -> Sequence[str]:
    (folder / "inner.pdf").write_text("%PDF")
    return written(folder, socket('outline = "inner.pdf"'))


def a_limb_that_is_a_scan(folder: Path) -> Sequence[str]:
    (folder / "limb.stl").write_bytes(b"\0" * 84)
    return written(folder, edited("[study]", '[study]\nlimb = "limb.stl"'))


def an_outline_on_a_page(folder: Path) -> Sequence[str]:
    (folder / "inner.svg").write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" width="210mm" viewBox="0 0 210 297">'
        '<circle cx="105" cy="148.5" r="54"/></svg>'
    )
    return written(folder, socket('outline = "inner.svg"'))


def a_liner_in_an_outline(folder: Path, of: str = 'thickness = "25 mm"') -> Sequence[str]:
    words = a_socket_as_large_as_the_limb(folder)
    with (folder / "study.toml").open("a") as file:
        file.write(liner(of))
    return words


def a_liner_inside_an_outline(folder: Path) -> Sequence[str]:
    return a_liner_in_an_outline(folder, 'thickness = "40 mm"\nbonded = "socket"')


def a_socket_as_large_as_the_limb(folder: Path) -> Sequence[str]:
    skin = Limb.reference().skin
    rows = [f"{x:.3f}, {y:.3f}\n" for x, y in skin.evaluate(skin.sample(3.0))]
    (folder / "inner.csv").write_text("x, y\n" + "".join(rows))
    return written(folder, socket('outline = "inner.csv"\nshift = ["3 mm", "0 mm"]'))


def a_broken_run(folder: Path) -> Sequence[str]:
    (folder / "run.json").write_text('{"program": "calfsocket", ')
    return ["run", str(folder / "run.json")]


def another_json(folder: Path) -> Sequence[str]:
    (folder / "run.json").write_text(json.dumps({"cases": []}))
    return ["run", str(folder / "run.json")]


def a_run_of_changed_cases(folder: Path) -> Sequence[str]:
    return rerun(folder, cases={"HX_separate": RECORD.model_dump(mode="json")})


def a_run_whose_petsc_writes(folder: Path) -> Sequence[str]:
    return rerun(folder, petsc_options={"calfsocket_ksp_view_mat": "binary:/etc/x"})


def rerun(folder: Path, **changed: object) -> Sequence[str]:
    """Write a run.json of TC_separate with something changed; return how to run it again."""
    plan = Study.paper().changed(chosen=["TC_separate"]).plan
    Recorder(plan, folder, ranks=1)
    path = folder / "run.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | changed))
    return ["run", str(path)]


def a_folder_that_cannot_be_made(folder: Path) -> Sequence[str]:
    written(folder, TWO_LISTS)
    return ["run", str(folder / "study.toml"), "--out", "/proc/calfsocket"]


def a_file_in_the_place_of_the_folder(folder: Path) -> Sequence[str]:
    written(folder, TWO_LISTS)
    (folder / "results").write_text("")
    return ["run", str(folder / "study.toml"), "--out", str(folder / "results")]


def into_results_with(content: bytes) -> Make:
    """Return what runs a study into a folder with a run.json."""

    def made(folder: Path) -> Sequence[str]:
        results = folder / "results"
        results.mkdir()
        (results / ".running").touch()
        (results / "run.json").write_bytes(content)
        words = written(folder, TWO_LISTS)
        return ["run", words[-1], "--out", str(results)]

    return made


def a_case_that_stopped(folder: Path) -> Sequence[str]:
    """Return how to report on a study whose only case did not reach its load."""
    words = rerun(folder, finished=True)
    run = json.loads(Path(words[-1]).read_text())
    run["cases"]["TC_separate"] |= {"status": "failed", "message": "no equilibrium beyond 0.37"}
    Path(words[-1]).write_text(json.dumps(run))
    return ["report", str(folder)]


def a_new_file_over_an_old_one(folder: Path) -> Sequence[str]:
    (folder / "study.toml").write_text("")
    return ["new", str(folder / "study.toml")]


def a_new_file_with_another_extension(folder: Path) -> Sequence[str]:
    return ["new", str(folder / "study.txt")]


def a_picture_with_another_extension(folder: Path) -> Sequence[str]:
    written(folder, TWO_LISTS)
    return ["show", str(folder / "study.toml"), "--out", str(folder / "study.jpg")]


TRIALS = (
    # The file as a whole
    Trial("no such file", lambda folder: ["check", str(folder / "no.toml")],
          ("no.toml", "No such")),
    Trial("a folder", a_folder, ("is not a regular file",)),
    Trial("a pipe that nobody writes to", a_pipe, ("study.toml", "is not a regular file")),
    Trial("a device without an end", a_device, ("/dev/zero", "is not a regular file")),
    Trial("a file of 1 GB", a_huge_file, ("is 1000 MB; files up to",)),
    Trial("an empty file", "", ("is empty", "`new`")),
    Trial("a binary file", bytes(range(256)), ("UTF-8",)),
    Trial("text that is not TOML", "sockets: [TC]", ("study.toml: Expected", "line 1")),
    Trial("a key twice", TWO_LISTS + "sockets = []\n", ("study.toml: Cannot overwrite", "line 4")),
    Trial("tables nested 10 000 deep", "a = " + "[" * 10000, ("levels of nesting",)),
    Trial("a number of 10 000 digits", "a = " + "9" * 10000, ("4300 digits",)),
    # Keys
    Trial("an unknown table", GOOD + "[modle]\n", ("unknown key 'modle'", "'model'")),
    Trial("an unknown key", edited("size", "sise"), ("model: unknown key 'sise'", "'size'")),
    Trial("a limb above the tables", 'limb = "limb.json"\n' + TWO_LISTS,
          ("study.toml: limb: belongs in the table [study]; move it",)),
    Trial("friction in the wrong table", TWO_LISTS + "friction = 0.3\n",
          ("study.toml: study.friction: belongs in the table [model]; move it",)),
    Trial("thresholds in a table", TWO_LISTS + "thresholds = []\n",
          ("study.toml: study.thresholds: belongs in a table of its own; move it",)),
    Trial("a side of the body", TWO_LISTS + 'side = "left"\n',
          ("study.toml: study.side: belongs in the limb's own file",)),
    Trial("a number with a decimal comma", fat('{ law = "neo-hookean", mu = "4,5 kPa", nu = 0.4 }'),
          ("materials.soft.fat.mu: '4,5 kPa' is not a number with a unit; write e.g. \"1.2 Pa\"",)),
    Trial("loads that are no stages", GOOD + "[loads]\naxial = \"800 N\"\n",
          ("study.toml: loads.axial: loads on the socket after donning are stages", "[[loads]]")),
    Trial("a stage without a load", GOOD + STAGE + "steps = 3\n",
          ("loads.0: loads nothing; give force, moment, displacement, rotation or volume",)),
    Trial("a stage in no steps", GOOD + STAGE + 'moment = "1 N mm/mm"\nsteps = 0\n',
          ("loads.0.steps: is 0; it must be greater than or equal to 1",)),
    Trial("a force without its length", GOOD + STAGE + 'force.anterior = "20 N"\n',
          ("loads.0.force.anterior: unit 'N' is unknown; use N/mm",)),
    Trial("a force on a socket that has no frame",
          GOOD.replace('"coarse"', '"coarse"\nsocket_support = "outer-fixed"')
          + STAGE + 'force.anterior = "1 N/mm"\n',
          ("loads.0 (push): a socket that is fixed at its outer face cannot be loaded",)),
    Trial("a displacement of a face that is loaded evenly",
          GOOD.replace('"coarse"', '"coarse"\nsocket_carried = "evenly"')
          + STAGE + 'displacement.anterior = "1 mm"\n',
          ("model.socket_carried: stage push: displacement: an outer face loaded evenly",)),
    Trial("an unknown way to carry the socket",
          GOOD.replace('"coarse"', '"coarse"\nsocket_carried = "springs"'),
          ("model.socket_carried: is 'springs'; it must be 'frame' or 'evenly'",)),
    Trial("a force to two opposite sides",
          GOOD + STAGE + 'force = { anterior = "1 N/mm", posterior = "1 N/mm" }\n',
          ("loads.0: anterior and posterior: lie along one line",)),
    Trial("moment and rotation at once",
          GOOD + STAGE + 'moment = "1 N mm/mm"\nrotation = "1 deg"\n',
          ("loads.0: moment and rotation: one follows from the other",)),
    Trial("a muscle that loses all of its volume", GOOD + STAGE + 'volume.muscle = "-100 %"\n',
          ("loads.0: volume.muscle: is -100 %; it must be more than -100 %",)),
    Trial("a tissue that does not swell", GOOD + STAGE + 'volume.bone = "3 %"\n',
          ("loads.0.volume.bone", "muscle")),
    Trial("two stages of one name",
          GOOD + 2 * (STAGE + 'moment = "1 N mm/mm"\n'),
          ("loads: two stages have the name 'push'",)),
    Trial("a stage named as the state before it",
          GOOD + STAGE.replace("push", "donned") + 'moment = "1 N mm/mm"\n',
          ("loads.0: name: 'donned' is the state before all stages",)),
    Trial("a stage named as a folder of the case",
          GOOD + STAGE.replace("push", "second_mesh") + 'moment = "1 N mm/mm"\n',
          ("loads.0: name: 'second_mesh' is another folder of a case",)),
    Trial("a mesh error that is not asked for by true or false",
          GOOD.replace("[study]", '[study]\nmesh_error = "5 %"', 1),
          ("study.mesh_error", "true or false")),
    Trial("stages without a socket",
          '[study]\nmaterials = ["separate"]\n' + STAGE + 'moment = "1 N mm/mm"\n',
          ("study.sockets: is empty, so there are no cases",)),
    Trial("an unknown way to put a socket on",
          GOOD.replace('"coarse"', '"coarse"\ndonning = "push"'),
          ("model.donning: is 'push'; it must be 'gap' or 'expanded'",)),
    Trial("a body's weight", edited("[model]", '[model]\nweight = "80 kg"'),
          ("study.toml: model.weight: loads on the socket after donning are stages",)),
    Trial("a liner", socket('like = "TC"\nliner = "3 mm"'),
          ("sockets.mine.liner: a liner has a table of its own, [liner]", "thickness")),
    Trial("a layer without a unit", GOOD + "[layers]\nfat_thickness = 3\n",
          ("study.toml: layers.fat_thickness: is 3", "text in quotes")),
    Trial("a layer in kPa", GOOD + '[layers]\nfat_thickness = "3 kPa"\n',
          ("layers.fat_thickness: '3 kPa' is neither a length nor a share", "'120 %'")),
    Trial("a layer of no thickness", GOOD + '[layers]\nskin_thickness = "0 mm"\n',
          ("layers.skin_thickness: is '0 mm'; it must be above 0",)),
    Trial("a layer of ten times its thickness", GOOD + '[layers]\nskin_thickness = "16 mm"\n',
          ("layers: skin_thickness: is 16 mm; it must be 50 % to 200 % of the limb's own",
           "0.80 mm to 3.20 mm")),
    Trial("layers that leave no room",
          GOOD + '[layers]\nskin_thickness = "200 %"\nfat_thickness = "200 %"\n',
          ("layers: skin and fat so thick leave no room: curves.", "keep curves 0.1 mm apart")),
    Trial("an unknown layer", GOOD + '[layers]\nfascia_thickness = "1 mm"\n',
          ("layers: unknown key 'fascia_thickness'; did you mean 'fat_thickness'?",)),
    Trial("a liner without a thickness", GOOD + "[liner]\nlaw = \"gel\"\n",
          ("study.toml: liner.thickness: is missing; add it",)),
    Trial("a liner without a law", GOOD + "[liner]\nthickness = \"6 mm\"\n",
          ("study.toml: liner.law: is missing; add it",)),
    Trial("a liner without a unit", GOOD + liner('thickness = 6'),
          ("study.toml: liner.thickness: 6 is not a number with a unit", "mm")),
    Trial("a liner of no thickness", GOOD + liner('thickness = "0 mm"'),
          ("study.toml: liner.thickness: is '0 mm'; it must be greater than 0",)),
    Trial("a liner of an unknown material", GOOD + liner('law = "silicon"'),
          ("study.toml: liner.law: no liner law 'silicon'; did you mean 'silicone'?",)),
    Trial("a liner's law with a wrong unit",
          GOOD + liner('law = { law = "neo-hookean", mu = "4 mm", nu = 0.49 }'),
          ("study.toml: liner.law: mu: unit 'mm' is unknown", "kPa")),
    Trial("a liner's law in no file", GOOD + liner('law = { file = "mine.toml" }'),
          ("mine.toml: cannot be read (No such file",)),
    Trial("a liner bonded to nothing", GOOD + liner('bonded = "skin"'),
          ("study.toml: liner.bonded: is 'skin'; it must be 'limb' or 'socket'",)),
    Trial("a liner half as large as the limb", GOOD + liner('undersize = "50 %"'),
          ("study.toml: liner.undersize: is '50 %'; it must be less than 50 %",)),
    Trial("a liner that is larger than the limb", GOOD + liner('undersize = "-5 %"'),
          ("study.toml: liner.undersize: is '-5 %'; it must be greater than or equal to 0",)),
    Trial("a liner that folds over inside the socket", a_liner_inside_an_outline,
          ("sockets.mine: liner: a liner of 40 mm folds over where the socket's inner face is "
           "convex", "make the liner thinner")),
    Trial("a liner that an outline leaves no room for", a_liner_in_an_outline,
          ("sockets.mine: leaves soft tissue and a liner of 25 mm", "make the liner thinner or")),
    Trial("a liner's thickness in a sweep without a liner",
          GOOD + '[sweep.grid]\nliner.thickness = ["3 mm", "6 mm"]\n',
          ("study.toml: sweep: with liner.thickness = '3 mm': the study has no [liner] to vary",
           "with thickness and law")),
    Trial("a pressure on the skin", GOOD + "[pressure]\nskin = \"5 kPa\"\n",
          ("study.toml: pressure: prescribed pressures are not implemented",)),
    Trial("a time of the steps", edited("[model]", '[steps]\ntime = "2 s"\n[model]'),
          ("steps.time: time is not implemented", "equilibrium")),
    Trial("a sweep over loads",
          TWO_LISTS + "[sweep.grid]\nloads.axial = [1, 2]\n",
          ("sweep: loads.axial: the file has no stages of loading; add [[loads]]",)),
    Trial(
        "an unknown key that is near to none",
        GOOD + "[zebra]\n",
        ("unknown key 'zebra'; allowed: cases, laws, layers, liner, loads, materials",),
    ),
    Trial(
        "an unknown key of a socket",
        edited("area_reduction", "area_reducton"),
        ("sockets.mine: unknown key 'area_reducton'", "'area_reduction'"),
    ),
    Trial(
        "an unknown key of a law",
        fat('{ law = "hencky", e = "1 kPa", nu = 0.4, K = 3 }'),
        ("materials.soft.fat: unknown key 'K'", "nu"),
    ),
    Trial("a table where a number belongs", GOOD.replace('"coarse"', "{ a = 1 }"),
          ("model.size: is {'a': 1}",)),
    Trial("a value where a table belongs", 'study = "mine"',
          ("study: is 'mine'; it must be a table",)),
    # Cases
    Trial("no case", "[study]\n", ("study.sockets: is empty", "TC, TSB, HS")),
    Trial("no material set", '[study]\nsockets = ["TC"]\n', ("study.materials", "separate")),
    Trial("an empty list of cases", "cases = []\n", ("study.sockets: is empty",)),
    Trial("a socket twice", edited('["TC", "mine"]', '["TC", "TC"]'), ("study.sockets", "twice")),
    Trial("an unknown socket", edited('["TC",', '["TCB",'), ("no socket 'TCB'", "'TC'")),
    Trial("an unknown material set", edited('"soft"]', '"sofd"]'), ("'sofd'", "'soft'")),
    Trial(
        "cases in both ways",
        TWO_LISTS + '[[cases]]\nsocket = "HS"\nmaterials = "separate"\n',
        ("cases: give either [[cases]], or study.sockets",),
    ),
    Trial(
        "two cases of one name",
        '[[cases]]\nsocket = "HS"\nmaterials = "separate"\n' * 2,
        ("cases.1", "HS_separate", "label"),
    ),
    Trial(
        "two cases with one folder",
        '[study]\nsockets = ["a_b", "a"]\nmaterials = ["b_c", "c"]\n[sockets.a]\nlike = "TC"\n'
        '[sockets.a_b]\nlike = "TC"\n[materials.c]\n[materials.b_c]\n',
        ("share the folder a_b_c", "rename"),
    ),
    Trial(
        "a case that changes what does not exist",
        '[[cases]]\nsocket = "HS"\nmaterials = "separate"\nset.modell.friction = 1\n',
        ("cases.0: modell.friction: unknown parameter", "'model'"),
    ),
    Trial(
        "a case that changes an unknown key",
        '[[cases]]\nsocket = "HS"\nmaterials = "separate"\nset.model.fricton = 1\n',
        ("cases.0", "unknown key 'fricton'", "'friction'"),
    ),
    # Names and paths
    Trial("a name that is a path", edited("[sockets.mine]", '[sockets."../x"]'), ("'../x'",)),
    Trial("a name with markup", edited("[sockets.mine]", '[sockets."<b>"]'), ("<b>", "letters")),
    Trial("a name that is a formula", edited("[sockets.mine]", '[sockets."=1+1"]'), ("'=1+1'",)),
    Trial("a name of 41 letters", edited("[sockets.mine]", f"[sockets.{'a' * 41}]"),
          ("up to 40",)),
    Trial(
        "a socket named like a reference socket",
        edited("[sockets.mine]", "[sockets.HS]"),
        ("sockets: 'HS' is a reference socket", "like = 'HS'"),
    ),
    Trial(
        "a set named like one of the paper",
        edited("[materials.soft]", "[materials.combined]"),
        ("materials: 'combined' is a set of the paper",),
    ),
    Trial("results above the folder", TWO_LISTS + 'out = "../x"', ("study.out", "--out")),
    Trial("results at an absolute path", TWO_LISTS + 'out = "/etc/x"', ("study.out", "--out")),
    Trial("results at home", TWO_LISTS + 'out = "~/x"', ("study.out", "--out")),
    # Numbers and units
    Trial("a negative friction", edited("[model]", "[model]\nfriction = -0.1"),
          ("friction: is -0.1",)),
    Trial("a friction that is not a number", edited("[model]", "[model]\nfriction = nan"),
          ("finite",)),
    Trial("an infinite friction", edited("[model]", "[model]\nfriction = inf"), ("finite",)),
    Trial("a friction as text", edited("[model]", '[model]\nfriction = "0.4"'),
          ("without quotes",)),
    Trial("a friction that is true", edited("[model]", "[model]\nfriction = true"), ("is True",)),
    Trial("an unknown mesh size", edited('"coarse"', '"tiny"'), ("model.size", "coarse, medium")),
    Trial("a mesh of no triangles", edited('"coarse"', "0"), ("model.size: 0 triangles", "7000")),
    Trial("an adaptive mesh of too few triangles", edited('"coarse"', '"adaptive-9000"'),
          ("model.size: adaptive-9000: 9000 triangles", "20000")),
    Trial("an unknown support", edited("[model]", '[model]\nsocket_support = "glued"'),
          ("model.socket_support: is 'glued'", "floating")),
    Trial("a wall without a unit", socket('like = "TC"\nwall_thickness = 4.5'),
          ("sockets.mine.wall_thickness: 4.5 is not a number with a unit", "mm")),
    Trial("a wall in kPa", socket('like = "TC"\nwall_thickness = "4.5 kPa"'),
          ("sockets.mine.wall_thickness: unit 'kPa'", "mm, cm, m")),
    Trial("a wall of -1 mm", socket('like = "TC"\nwall_thickness = "-1 mm"'),
          ("sockets.mine.wall_thickness", "greater than 0 mm")),
    Trial("a wall of nan mm", socket('like = "TC"\nwall_thickness = "nan mm"'),
          ("sockets.mine.wall_thickness: 'nan mm' is not a number with a unit",)),
    Trial("a modulus in mPa", socket('like = "TC"\nmodulus = "459 mPa"'),
          ("sockets.mine.modulus: unit 'mPa'", "MPa")),
    Trial("a negative modulus of a wall", socket('like = "TC"\nmodulus = "-1 GPa"'),
          ("sockets.mine.modulus: is '-1 GPa'", "greater than 0 GPa")),
    Trial("a wall with Poisson's ratio 0.5", socket('like = "TC"\npoisson = 0.5'),
          ("sockets.mine.poisson: is 0.5", "less than 0.5")),
    # Sockets
    Trial("a socket of no kind", socket('title = "x"'), ("mine: is not a socket", "outline")),
    Trial("a socket of two kinds", socket('like = "TC"\nlaw = "circle_blend"'), ("not a socket",)),
    Trial("a socket of an unknown law", socket('law = "cone"'), ("not a socket", "circle_blend")),
    Trial("a socket like an unknown one", socket('like = "PTB"'),
          ("sockets.mine: like: no socket 'PTB'", "TSB")),
    Trial("a base for a circle blend", socket('like = "HS"\nbase = "1 mm"'),
          ("sockets.mine: HS", "circle_blend", "no key 'base'")),
    Trial("an area reduced by 100 %", socket('like = "HS"\narea_reduction = "100 %"'),
          ("sockets.mine.area_reduction", "less than 100 %")),
    Trial("an area reduced by a length", socket('like = "HS"\narea_reduction = "1 mm"'),
          ("sockets.mine.area_reduction: unit 'mm'",)),
    Trial("a bump without width", socket(
        'law = "normal_offset"\nbase = "1 mm"\nbumps = [{ center = "0 deg", amplitude = "1 mm" }]'),
          ("sockets.mine.bumps.0.width: is missing",)),
    Trial("an outline that is not there", socket('outline = "no.csv"'), ("no.csv", "No such")),
    Trial("an outline as PDF", an_outline_that_is_not_a_drawing, ("inner.pdf", ".csv")),
    Trial("a limb as STL", a_limb_that_is_a_scan, ("limb.stl: is a surface mesh (STL)",)),
    Trial("an outline on a page of A4", an_outline_on_a_page,
          ("sockets.mine: lies beside the limb", "shift = ['-105 mm', '148.5 mm'] centres it")),
    Trial("a socket as large as the limb", a_socket_as_large_as_the_limb,
          ("sockets.mine: is not smaller than the limb (area lost 0.00 %)", "only moves away")),
    Trial("a socket larger than the limb", socket('law = "normal_offset"\nbase = "-2 mm"'),
          ("sockets.mine", "does not press on the limb")),
    # Materials
    Trial("a tissue that does not exist", edited("fat =", "fad ="),
          ("materials.soft.fad", "'fat'")),
    Trial("a law of an unknown name", fat('{ law = "hooke" }'),
          ("materials.soft.fat: law is 'hooke'", "hencky")),
    Trial("a law as a number", fat("3"), ("materials.soft.fat: is not a law", "hencky")),
    Trial("a law that lacks a parameter", fat('{ law = "hencky", nu = 0.3 }'),
          ("materials.soft.fat.e: is missing",)),
    Trial("neither d1 nor nu", fat('{ law = "ogden", mu = ["1 kPa"], alpha = [2] }'),
          ("materials.soft.fat: give one of d1, k and nu",)),
    Trial("three parameters of the bulk",
          fat('{ law = "neo-hookean", mu = "1 kPa", nu = 0.4, k = "1 MPa", d1 = "1 1/MPa" }'),
          ("materials.soft.fat: give one of d1, k and nu; d1 and k and nu are given",)),
    Trial("a bulk modulus by two names",
          fat('{ law = "ogden", mu = ["1 kPa"], alpha = [2], k = "1 MPa", kappa = "1 MPa" }'),
          ("materials.soft.fat: kappa and k are the same",)),
    Trial("a bulk modulus of 0", fat('{ law = "neo-hookean", mu = "1 kPa", k = "0 Pa" }'),
          ("materials.soft.fat.k: is '0 Pa'; it must be greater than 0 Pa",)),
    Trial("a compliance in a unit of stress",
          fat('{ law = "mooney-rivlin", c10 = "1 kPa", c01 = "1 kPa", d1 = "1e-5 Pa" }'),
          ("materials.soft.fat.d1: unit 'Pa' is unknown; use 1/Pa", "MPa^-1")),
    Trial("a Mooney-Rivlin law without C01",
          fat('{ law = "mooney-rivlin", c10 = "1 kPa", nu = 0.4 }'),
          ("materials.soft.fat.c01: is missing; add it",)),
    Trial("a Mooney-Rivlin law that is unstable without load",
          fat('{ law = "mooney-rivlin", c10 = "1 kPa", c01 = "-2 kPa", nu = 0.4 }'),
          ("materials.soft.fat: initial shear modulus is -2 kPa", "greater than 0")),
    Trial("a neo-Hookean law by mu and C10",
          fat('{ law = "neo-hookean", mu = "2 kPa", c10 = "1 kPa", nu = 0.4 }'),
          ("materials.soft.fat: give one of mu, c10, and e with nu; mu and c10 are given",)),
    Trial("a neo-Hookean law by E and k",
          fat('{ law = "neo-hookean", e = "2 kPa", k = "1 MPa" }'),
          ("materials.soft.fat: e needs Poisson's ratio; give nu",)),
    Trial("a linear elastic law of nu = 0.51",
          fat('{ law = "linear-elastic", e = "2 kPa", nu = 0.51 }'),
          ("materials.soft.fat.nu: is 0.51", "0.5")),
    Trial("FEBio's constants in Abaqus's form",
          fat('{ law = "ogden", c = ["1 kPa"], m = [2], form = "abaqus", k = "1 MPa" }'),
          ("materials.soft.fat: c and m go together, in FEBio's form only",)),
    Trial("FEBio's c without m", fat('{ law = "ogden", c1 = "1 kPa", k = "1 MPa" }'),
          ("materials.soft.fat: c and m go together",)),
    Trial("an unknown form",
          fat('{ law = "ogden", mu = ["1 kPa"], alpha = [2], form = "ansys", k = "1 MPa" }'),
          ("materials.soft.fat.form: is 'ansys'", "textbook")),
    Trial("moduli that are negative in Abaqus's form alone",
          fat('{ law = "ogden", mu = ["-1 kPa"], alpha = [-2], nu = 0.4 }'),
          ("materials.soft.fat: initial shear modulus is -1 kPa",
           '1 kPa with form = "textbook"')),
    Trial("a Yeoh law with D1", fat('{ law = "yeoh", c10 = "1 kPa", d1 = "1e-5 1/Pa" }'),
          ("materials.soft.fat: Yeoh's law is taken as incompressible; remove d1",)),
    Trial("more mu than alpha",
          fat('{ law = "ogden", mu = ["1 kPa", "2 kPa"], alpha = [2], nu = 0.4 }'),
          ("materials.soft.fat", "mu has length 2, alpha 1")),
    Trial("a negative modulus", fat('{ law = "hencky", e = "-1 kPa", nu = 0.3 }'),
          ("materials.soft.fat.e: is '-1 kPa'", "greater than 0 kPa")),
    Trial("Poisson's ratio 0.51", fat('{ law = "hencky", e = "1 kPa", nu = 0.51 }'),
          ("materials.soft.fat.nu: is 0.51", "0.5")),
    Trial("a Yeoh law that softens to nothing",
          fat('{ law = "yeoh", c10 = "1 kPa", c30 = "-1 kPa" }'),
          ("materials.soft.fat", "C30 >= 0")),
    Trial("a limb that cannot lose area", edited(
        'fat = { law = "ogden", mu = ["1 kPa"], alpha = [26], nu = 0.495 }', INCOMPRESSIBLE),
          ("materials.soft", "incompressible", "nu < 0.5")),
    Trial("muscle apart in a combined set", edited("[materials.soft]\nfat",
          '[materials.soft]\nlike = "combined"\nmuscle'), ("materials.soft.muscle", "combined")),
    Trial("a law for all sets that none of them has",
          TWO_LISTS + '[laws]\ncombined = { law = "hencky", e = "1 kPa", nu = 0.4 }\n',
          ("laws.combined: no tissue or region 'combined'", "muscle")),
    Trial("a material file that is not there", fat('{ file = "no.toml" }'), ("no.toml", "No such")),
    Trial("a pipe as material file", a_pipe_for_a_material, ("fat.toml", "is not a regular file")),
    Trial("a binary material file", a_binary_material, ("fat.toml", "UTF-8")),
    Trial("a material file with a wrong unit", a_material_with_a_wrong_unit, ("fat.toml", "kilo")),
    # Thresholds, steps, sweep
    Trial("a threshold of an unknown quantity",
          GOOD + '[[thresholds]]\nquantity = "pain"\nvalue = "1 kPa"\n',
          ("thresholds.0.quantity: is 'pain'", "contact_pressure")),
    Trial("a threshold of contact in fat",
          GOOD + '[[thresholds]]\nquantity = "contact_pressure"\ntissue = "fat"\nvalue = "1 kPa"\n',
          ("thresholds.0", "tissue is 'fat'", "skin")),
    Trial("a threshold of strain in kPa",
          GOOD + '[[thresholds]]\nquantity = "shear_log_strain"\nvalue = "1 kPa"\n',
          ("thresholds.0", "unit 'kPa'", "%")),
    Trial("a threshold of 0 kPa", GOOD + '[[thresholds]]\nquantity = "pressure"\nvalue = "0 kPa"\n',
          ("thresholds.0", "above 0")),
    Trial("steps in the wrong order", GOOD + "[steps]\nfirst = 0.5\n", ("steps", "largest 0.25")),
    Trial("a first step of 0", GOOD + "[steps]\nfirst = 0\n", ("steps.first: is 0", "greater")),
    Trial("a sweep without parameters", GOOD + "[sweep.grid]\n", ("sweep.grid: is empty",)),
    Trial("a sweep in no way", GOOD + "[sweep]\n", ("sweep: give one of grid, list and variants",)),
    Trial("a sweep over one value", GOOD + "[sweep.grid]\nmodel.friction = 0.2\n",
          ("sweep.grid.model.friction: is 0.2", "list of values")),
    Trial("a sweep with a value twice", GOOD + "[sweep.grid]\nmodel.friction = [0.2, 0.2]\n",
          ("sweep.grid.model.friction", "twice")),
    Trial("a sweep over an unknown parameter", GOOD + "[sweep.grid]\nmodel.fricton = [0.2]\n",
          ("sweep", "unknown key 'fricton'", "'friction'")),
    Trial("a sweep over another socket's wall",
          GOOD + '[sweep.grid]\nsockets.min.base = ["1 mm"]\n',
          ("sweep: sockets.min.base: the file does not define 'min'", "'mine'")),
    Trial("a sweep that affects no case", TWO_LISTS + '[sockets.mine]\nlike = "TC"\n[sweep.grid]\n'
          'sockets.mine.base = ["1 mm"]\n', ("sweep: sockets.mine.base affects no case",)),
    Trial("a sweep over a title", GOOD + '[sweep.grid]\nstudy.title = ["a"]\n',
          ("sweep: study.title: unknown parameter", "model")),
    Trial("a sweep to a bad value", GOOD + "[sweep.list]\nmodel.friction = [0.2, -1]\n",
          ("sweep: with model.friction = -1", "greater than or equal to 0")),
    Trial("a sweep with lists of two lengths",
          GOOD + "[sweep.list]\nmodel.friction = [0.2, 0.4]\nmodel.gamma = [1.0]\n",
          ("sweep.list", "model.gamma has length 1", "sweep.grid")),
    Trial("a sweep of a million points",
          GOOD + f"[sweep.grid]\nmodel.friction = {[i / 1000 for i in range(1000)]}\n"
          f"model.gamma = {[1 + i / 1000 for i in range(1000)]}\n",
          ("sweep.grid: more than 1000 points",)),
    # Other commands
    Trial("half of a run.json", a_broken_run, ("run.json: is not JSON",)),
    Trial("another file called run.json", another_json,
          ("run.json: is not the run.json of a study",)),
    Trial("a run.json whose cases were changed", a_run_of_changed_cases,
          ("HX_separate", "edited")),
    Trial("a run.json that lets PETSc write a file", a_run_whose_petsc_writes,
          ("petsc_options.calfsocket_ksp_view_mat: is 'binary:/etc/x'", "command line")),
    Trial("results where no folder can be made", a_folder_that_cannot_be_made,
          ("/proc/calfsocket",)),
    Trial("a file in the place of the results", a_file_in_the_place_of_the_folder,
          ("--out", "results")),
    Trial("a run.json whose versions are a list",
          lambda folder: rerun(folder, format=1, versions=["0.1"]),
          ("run.json: was written by another version",)),
    Trial("a run.json that lacks its cases", lambda folder: rerun(folder, cases="none"),
          ("run.json: cannot be used (cases: is 'none'; it must be a table)",)),
    Trial("results with half of a run.json", into_results_with(b'{"program": "calf'),
          ("run.json: is not JSON", "; name another folder, or add --overwrite")),
    Trial("results with a binary run.json", into_results_with(bytes(range(256))),
          ("run.json: cannot be used (is not UTF-8", "; name another folder, or add --overwrite")),
    Trial("results of something else", into_results_with(b"{}"),
          ("run.json: is not the run.json of a study; name another folder, or",)),
    Trial("the picture of a folder without a case", lambda folder: ["picture", str(folder)],
          ("contains no result.json", "name the folder of a case")),
    Trial("a report without a case that reached its load", a_case_that_stopped,
          ("no case reached its full load", "no equilibrium beyond 0.37")),
    Trial("an example over a study", a_new_file_over_an_old_one,
          ("already exists; choose another name",)),
    Trial("an example that is not a TOML file", a_new_file_with_another_extension, (".toml",)),
    Trial("a picture of another format", a_picture_with_another_extension, ("study.jpg", ".svg")),
)  # fmt: skip


def written(folder: Path, text: str | bytes) -> Sequence[str]:
    """Write a study file; return the command line that checks it."""
    path = folder / "study.toml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return ["check", str(path)]


def words_of(trial: Trial, folder: Path) -> Sequence[str]:
    """Make a trial."""
    return trial.given(folder) if callable(trial.given) else written(folder, trial.given)


def refused(words: Sequence[str]) -> str:
    """Return the one line that a refused command line gives."""
    output, errors = StringIO(), StringIO()
    with redirect_stdout(output), redirect_stderr(errors):
        code = cli.main(words)
    assert code == 2
    assert output.getvalue() == ""
    (line,) = errors.getvalue().splitlines()
    assert line.startswith("calfsocket: ")
    return line.removeprefix("calfsocket: ")


def said(trial: Trial, folder: Path) -> str:
    """Return what a trial gives, without the folder's path."""
    return shortened(refused(words_of(trial, folder)), folder)


def shortened(line: str, folder: Path) -> str:
    return line.replace(f"{folder}/", "").replace(str(folder), "FOLDER")


def check_trial(trial: Trial, said, folder: Path, monkeypatch, longest: int) -> None:
    """Check the line that a trial gives, that the page has it, and that nothing is written."""
    work, given = folder / "work", folder / "given"
    work.mkdir()
    given.mkdir()
    monkeypatch.chdir(work)
    line = said(trial, given)
    for part in trial.says:
        assert part in line
    assert len(line) < longest
    assert reliability.row(trial, line) in reliability.rows()
    assert list(work.iterdir()) == []


@pytest.mark.parametrize("trial", TRIALS, ids=str)
def test_bad_input_gets_one_line(trial, tmp_path, monkeypatch):
    work = tmp_path / "work"
    work.mkdir()
    monkeypatch.chdir(work)
    given = tmp_path / "given"
    given.mkdir()
    words = words_of(trial, given)
    before = {path: path.stat().st_size for path in given.iterdir()}
    line = refused(words)
    for part in trial.says:
        assert part in line
    assert len(line) < 600
    assert reliability.row(trial, shortened(line, given)) in reliability.rows()
    assert list(work.iterdir()) == []
    assert {path: path.stat().st_size for path in given.iterdir()} == before


def test_names_of_trials_are_unique():
    names = [trial.name for trial in TRIALS]
    assert len(set(names)) == len(names) > 60


@pytest.mark.parametrize("command", ["run", "show"])
def test_every_command_says_the_same(command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    _, path = written(tmp_path, edited("size", "sise"))
    assert refused([command, path]) == refused(["check", path])
    assert [each.name for each in tmp_path.iterdir()] == ["study.toml"]


def test_the_good_file_is_good(tmp_path, capsys):
    """Or else the trials would show nothing."""
    assert cli.main(written(tmp_path, GOOD)) == 0
    assert "4 cases" in capsys.readouterr().out


def test_it_is_said_once_under_mpirun(mpirun, tmp_path):
    words = ["-m", "calfsocket", "run", str(written(tmp_path, edited("size", "sise"))[1])]
    assert mpirun(2, words, timeout=120, code=2) == ""
    assert [each.name for each in tmp_path.iterdir()] == ["study.toml"]
