"""A custom study solved on the coarse mesh, and solved again from its run.json alone."""

import json
import shutil
from pathlib import Path

import pandas as pd
import pytest

from calfsocket import cli
from calfsocket.io.errors import InputError
from calfsocket.meshes.limb import Limb
from calfsocket.study.cases import Plan
from calfsocket.study.record import Recorder, results_folder
from calfsocket.study.study import Study

STUDY = """
[study]
sockets = ["mine"]
materials = ["soft"]
quantities = ["contact_pressure_mean", "contact_share"]
[model]
size = "coarse"
[sockets.mine]
like = "TSB"
modulus = "2.2 GPa"
[materials.soft]
like = "combined"
combined = { file = "both.toml" }
soleus = { law = "ogden", mu = ["20 kPa"], alpha = [14], nu = 0.495 }
[[thresholds]]
quantity = "contact_pressure"
value = "11 kPa"
[sweep.list]
model.friction = [0.3]
"""
MATERIAL = 'law = "ogden"\nmu = ["12 kPa"]\nalpha = [14]\nd1 = "1.67e-6 1/Pa"\n'
NAME = "mine@friction=0.3_soft"


def write_study(folder: Path, text: str = STUDY) -> Path:
    folder.mkdir(exist_ok=True)
    (folder / "both.toml").write_text(MATERIAL)
    (folder / "study.toml").write_text(text)
    return folder / "study.toml"


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("custom")
    path = write_study(folder / "given")
    assert cli.main(["run", str(path), "--out", str(folder / "results"), "--no-report"]) == 0
    return folder / "results"


def test_the_case_is_solved_with_what_the_file_says(results):
    run = json.loads((results / "run.json").read_text())
    assert list(run["cases"]) == [NAME]
    entry = run["cases"][NAME]
    assert entry["status"] == "solved" and entry["checks"]["negative_modes"] == 0
    assert entry["changes"] == {"model.friction": 0.3} and entry["base_set"] == "combined"
    assert entry["of"] == ["mine", "soft"]
    assert run["laws"]["soft"]["soleus"]["mu"] == [0.02]
    assert run["laws"]["soft"]["muscle"]["d1"] == pytest.approx(1.67)
    contact = pd.read_csv(results / "contact.csv")
    # Ten digits of each are written.
    assert (contact.shear_kPa.abs() <= 0.3 * contact.pressure_kPa * (1 + 1e-9)).all()
    assert (results / NAME / "picture.png").is_file()


def test_contact_pressure_is_that_of_the_lost_area(results):
    """As in test_study, with the bulk modulus that soleus has here: 2/D1 by nu = 0.495."""
    of_soleus = 2 * 0.020 * 1.495 / (3 * 0.01)  # MPa; muscle and fascia else 2/1.67
    fat, skin, vessel = 2 / 11.8, 2 / 0.0912, 0.010 / 0.06
    bulk = {"skin": skin, "fat": fat, "muscle": 2 / 1.67, "fascia": 2 / 1.67, "vessel": vessel}
    regions = [region for region in Limb.reference().regions if region.tissue != "bone"]
    compliance = sum(
        region.area / (of_soleus if region.name == "soleus" else bulk[region.tissue])
        for region in regions
    )
    estimate = 1000 * 0.0164 * 10177 / compliance
    summary = pd.read_csv(results / "summary.csv").set_index(["tissue", "quantity"]).value
    assert summary["skin", "contact_pressure_mean"] == pytest.approx(estimate, rel=0.1)


def test_summary_and_sweep_have_the_threshold(results):
    summary = pd.read_csv(results / "summary.csv").set_index(["tissue", "quantity"]).value
    share = summary["skin", "share_of_contact_pressure_above_11_kPa"]
    assert 0 < share < 100
    (row,) = pd.read_csv(results / "sweep.csv").to_dict("records")
    assert row == {
        "case": NAME,
        "socket": "mine@friction=0.3",
        "material_set": "soft",
        "model.friction": 0.3,
        "contact_pressure_mean_kPa": summary["skin", "contact_pressure_mean"],
        "contact_share_percent": summary["skin", "contact_share"],
        "skin_share_of_contact_pressure_above_11_kPa_in_percent": share,
        "status": "solved",
    }


def test_run_json_alone_repeats_the_run(results, tmp_path, monkeypatch):
    """The study and its files are gone: what they contained is in run.json, to the last bit."""
    monkeypatch.chdir(tmp_path)
    shutil.copy(results / "run.json", "run.json")
    given = results.parent / "given"
    given.rename(given.with_name("away"))
    try:
        words = ["run", "run.json", "--out", "again", "--no-report", "--no-pictures"]
        assert cli.main(words) == 0
    finally:
        given.with_name("away").rename(given)
    for name in ("summary.csv", "levels.csv", "contact.csv", "sweep.csv"):
        assert (tmp_path / "again" / name).read_bytes() == (results / name).read_bytes()
    before, now = (
        json.loads((folder / "run.json").read_text()) for folder in (results, tmp_path / "again")
    )
    for key in ("inputs", "laws", "limb", "sockets"):
        assert now[key] == before[key]
    for key in ("content", "files"):
        assert now["study"][key] == before["study"][key]
    assert now["study"]["sha256"].items() > before["study"]["sha256"].items()
    assert set(before["study"]["sha256"]) == {"study.toml"}
    assert len(before["study"]["files"]["both.toml"]["sha256"]) == 64


def plan_of(path: Path) -> Plan:
    return Study.read(path).plan


def check_folder(folder: Path, plan: Plan) -> None:
    with results_folder(folder, plan):
        pass


def test_results_of_another_study_are_not_mixed_in(results, tmp_path):
    check_folder(results, plan_of(write_study(tmp_path)))
    more = plan_of(write_study(tmp_path, STUDY.replace("[0.3]", "[0.3, 0.5]")))
    check_folder(results, more)  # adds a case, and leaves the other as it is
    assert len(more.cases) == 2
    stiffer = plan_of(write_study(tmp_path, STUDY.replace("2.2 GPa", "2.3 GPa")))
    with pytest.raises(InputError, match=rf"other inputs \(case {NAME} changed\)"):
        check_folder(results, stiffer)
    limit = plan_of(write_study(tmp_path, STUDY.replace("11 kPa", "9 kPa")))
    with pytest.raises(InputError, match=r"other inputs \(thresholds changed\)"):
        check_folder(results, limit)


def test_a_run_of_another_version_is_refused_in_one_line(results, tmp_path, capsys):
    run = json.loads((results / "run.json").read_text())
    del run["format"]  # as calfsocket 0.1 wrote it
    run["versions"]["calfsocket"] = "0.1.0"
    (tmp_path / "run.json").write_text(json.dumps(run))
    assert cli.main(["run", str(tmp_path / "run.json")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "was written by calfsocket 0.1.0" in line and "solve the study file again" in line


def test_petsc_options_of_the_run_are_its_inputs_too(results, tmp_path):
    run = json.loads((results / "run.json").read_text())
    run["petsc_options"] = {"calfsocket_snes_max_it": "7"}
    (tmp_path / "run.json").write_text(json.dumps(run))
    from petsc4py import PETSc

    from calfsocket.commands.study import set_options

    study = Study.read(tmp_path / "run.json")
    known = PETSc.Options()
    try:
        set_options(study.petsc_options)
        assert known.getString("calfsocket_snes_max_it") == "7"
        set_options({"calfsocket_snes_max_it": "9"})  # given already
        assert known.getString("calfsocket_snes_max_it") == "7"
        set_options({"malloc_dump": "1"})
        assert not known.hasName("malloc_dump")
    finally:
        known.delValue("calfsocket_snes_max_it")


def test_an_option_that_stands_alone_is_text_in_run_json():
    from petsc4py import PETSc

    from calfsocket.io.petsc_options import given

    known = PETSc.Options()
    known.setValue("calfsocket_snes_monitor", None)
    try:
        assert given()["calfsocket_snes_monitor"] == ""
    finally:
        known.delValue("calfsocket_snes_monitor")


def test_a_run_of_some_cases_repeats_those(tmp_path):
    """The bare command's choice of cases is in run.json, too."""
    study = Study.paper().changed(chosen=["HS_combined", "TC_separate"])
    Recorder(study.plan, tmp_path, ranks=1)
    again = Study.read(tmp_path / "run.json")
    assert set(again.chosen) == {"HS_combined", "TC_separate"}
    assert again.cases == study.cases
    assert again.plan.fingerprints == study.plan.fingerprints


def test_a_folder_of_results_is_resumed_where_it_is(results, tmp_path, capsys):
    """`run --resume DIR`: what is solved stays as it is, to the byte; what is missing is solved."""
    out = tmp_path / "results"
    shutil.copytree(results, out)
    before = {path: path.read_bytes() for path in out.rglob("*.csv")}
    assert cli.main(["run", "--resume", str(out), "--no-report"]) == 0
    assert {path: path.read_bytes() for path in out.rglob("*.csv")} == before
    assert set(tmp_path.iterdir()) == {out}
    (out / NAME / "fields.vtu").unlink()
    assert cli.main(["run", "--resume", str(out), "--no-report", "--no-pictures"]) == 0
    assert (out / NAME / "fields.vtu").exists()
    for path, content in before.items():
        if path.name != "steps.csv":  # has seconds
            assert path.read_bytes() == content, path
