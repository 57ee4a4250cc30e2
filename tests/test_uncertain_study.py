"""A study with uncertain inputs from its file to its report: solved, resumed, on two ranks."""

import json
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from report_text import write_small

from calfsocket import cli
from calfsocket.io.errors import InputError, SolveError
from calfsocket.simulation.results import load_results
from calfsocket.simulation.uncertain import EVALUATED, numbers
from calfsocket.study import runner
from calfsocket.study.study import Study
from tiny_study import tiny_limb

STUDY = """
[study]
limb = "limb.json"
sockets = ["A"]
materials = ["combined"]
[model]
size = "coarse"
[sockets.A]
law = "normal_offset"
base = "0.15 mm"
wall_thickness = "2 mm"
bumps = [{ center = "40 deg", width = "25 deg", amplitude = "0.15 mm" }]
[laws]
combined = { law = "ogden", mu = ["12 kPa"], alpha = [14], nu = 0.495 }
skin = { law = "ogden", mu = ["220 kPa"], alpha = [12], nu = 0.495 }
[uncertainty]
cases = 8
[uncertainty.inputs]
model.friction = { distribution = "uniform", low = 0.2, high = 0.6 }
[uncertainty.inputs.tissues]
distribution = "uniform"
low = 0.7
high = 1.3
title = "stiffness of tissues"
scales = ["laws.combined.mu.0", "laws.skin.mu.0"]
source = "assumed"
"""
PRESSURE = ("A", "combined", "skin", "contact_pressure_mean")


@pytest.fixture(scope="module")
def given(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("uncertain")
    (folder / "limb.json").write_text(tiny_limb().model_dump_json(exclude_none=True))
    (folder / "study.toml").write_text(STUDY)
    return folder / "study.toml"


@pytest.fixture(scope="module")
def results(given: Path) -> Path:
    folder = given.parent / "results"
    Study.read(given).run(out=folder, pictures=False)
    return folder


def row_of(table: pd.DataFrame, *key: str) -> pd.Series:
    columns = ["socket", "material_set", "tissue", "quantity"]
    (row,) = table[(table[columns] == list(key)).all(axis=1)].to_dict("records")
    return pd.Series(row)


def test_the_design_is_what_was_solved(given, results):
    design = pd.read_csv(results / "design.csv")
    assert list(design.columns) == [
        "case", "socket", "material_set", "model.friction", "tissues", "status"
    ]  # fmt: skip
    assert (design.status == "solved").all() and len(design) == 8
    drawn = Study.read(given).plan.document.uncertainty.drawn
    assert design[["model.friction", "tissues"]].to_numpy() == pytest.approx(drawn)
    run = json.loads((results / "run.json").read_text())
    for row in design.itertuples():
        changes = run["cases"][row.case]["changes"]
        assert changes["model.friction"] == row[4]
        muscle, skin = (changes[f"laws.{name}.mu.0"].split() for name in ("combined", "skin"))
        assert (muscle[1], skin[1]) == ("kPa", "kPa")
        assert float(muscle[0]) == pytest.approx(12 * row.tissues, rel=1e-5)
        assert float(skin[0]) == pytest.approx(220 * row.tissues, rel=1e-5)
    assert run["cases"]["A_combined"]["changes"] == {}


def test_pressure_follows_the_stiffness_of_all_tissues(results):
    found = load_results(results).uncertainty
    pressure = row_of(found.table, *PRESSURE)
    assert pressure.trusted and pressure.q2 > 0.95 and pressure.cases == 8
    # everything but bone is as much stiffer: the mean is nearly that of the file's own values
    assert pressure["mean"] == pytest.approx(pressure.nominal, rel=0.02)
    assert pressure.sd / pressure["mean"] == pytest.approx(0.6 / np.sqrt(12), abs=0.02)
    assert pressure.low < pressure.nominal < pressure.high
    shares = found.shares[found.shares.quantity == "contact_pressure_mean"]
    assert shares.set_index("input").total["tissues"] > 0.98
    around = found.pressure
    assert len(around) == 180 and (around.low_kPa < around.nominal_kPa).all()
    assert (around.nominal_kPa < around.high_kPa).all()


def test_two_ranks_give_the_same_tables(given, results, mpirun, tmp_path):
    words = ["-m", "calfsocket", "run", given, "--out", "two", "--no-report", "--no-pictures"]
    mpirun(2, words)
    for name in ("design.csv", *EVALUATED):
        assert (tmp_path / "two" / name).read_bytes() == (results / name).read_bytes(), name


def test_a_case_that_fails_is_counted_and_a_resumed_study_has_it_again(
    given, results, tmp_path, monkeypatch, capsys
):
    folder = tmp_path / "results"
    shutil.copytree(results, folder)
    name = "A@u003_combined"
    (folder / name / "contact.csv").unlink()
    solve = runner._CaseRunner._solve

    def failing(self, resume):
        if self._case.name == name:
            raise SolveError("no equilibrium beyond load 0.3")
        return solve(self, resume)

    with monkeypatch.context() as patch:
        patch.setattr(runner._CaseRunner, "_solve", failing)
        broken = Study.read(given).run(out=folder, pictures=False, resume=True)
    assert list(broken.left_out) == [name]
    row = row_of(broken.uncertainty.table, *PRESSURE)
    assert (row.cases, row.failed, row.unfinished) == (7, 1, 0)
    assert row.failures == "too few to tell whether random"
    page = write_small(broken).read_text()
    assert f"Failed, and in no number here: {name}." in page
    assert "8 cases were drawn" in page and "7 of them were solved" in page
    again = Study.read(given).run(out=folder, pictures=False, resume=True)
    assert not again.left_out
    for each in ("design.csv", *EVALUATED):
        assert (folder / each).read_bytes() == (results / each).read_bytes(), each


def test_too_few_solved_cases_have_no_bands(results, tmp_path):
    folder = tmp_path / "results"
    shutil.copytree(results, folder)
    run = json.loads((folder / "run.json").read_text())
    for number in (1, 2, 3):
        run["cases"][f"A@u00{number}_combined"].update(status="failed", message="stopped")
    (folder / "run.json").write_text(json.dumps(run))
    for name in EVALUATED:
        (folder / name).unlink()
    found = load_results(folder).uncertainty
    row = row_of(found.table, *PRESSURE)
    assert np.isnan(row["mean"]) and not row.trusted and row.cases == 5
    assert row.mean_of_cases > 0 and found.shares.empty and found.pressure.empty
    page = write_small(load_results(folder)).read_text()
    assert "These are too few for a chaos in so many inputs" in page


def test_the_report_shows_bands_and_what_matters(results, tmp_path):
    folder = tmp_path / "results"
    shutil.copytree(results, folder)
    (folder / EVALUATED[0]).unlink()
    page = write_small(load_results(folder)).read_text()
    assert (folder / EVALUATED[0]).read_bytes() == (results / EVALUATED[0]).read_bytes()
    assert "2 inputs have a distribution in the place of a value" in page
    assert "all of them were solved" in page
    assert "stiffness of tissues 100 %" in page or "stiffness of tissues 99 %" in page
    assert "uniform, 0.7 to 1.3" in page and "assumed" in page
    assert {path.stem.split("_", 1)[1] for path in (folder / "figures").glob("*.png")} >= {
        "shares", "pressure_band"
    }  # fmt: skip
    assert all(f'href="{name}"' in page for name in ("design.csv", *EVALUATED))
    table = pd.read_csv(folder / "tables" / "uncertainty.csv")
    assert set(table.tissue) == {"skin", "muscle"}


def test_a_design_that_is_missing_is_named(results, tmp_path):
    folder = tmp_path / "results"
    shutil.copytree(results, folder)
    for name in ("design.csv", *EVALUATED):
        (folder / name).unlink()
    with pytest.raises(InputError, match=r"design\.csv: cannot be read .* with --resume"):
        _ = load_results(folder).uncertainty


def test_another_seed_is_another_study(given, results, tmp_path, capsys):
    path = given.parent / "seed.toml"
    path.write_text(STUDY.replace("cases = 8", "cases = 8\nseed = 2"))
    assert cli.main(["run", str(path), "--out", str(results), "--resume"]) == 2
    assert "contains results of other inputs (case A@u001_combined" in capsys.readouterr().err


def test_the_shipped_study_can_be_run():
    examples = Path(__file__).resolve().parent.parent / "examples"
    plan = Study.read(examples / "calf_uncertain.toml").plan
    uncertain = plan.document.uncertainty
    assert len(plan.cases) == 1 + uncertain.cases and len(uncertain.inputs) == 10
    assert all(each.source for each in uncertain.inputs.values())
    paper = Study.paper().cases
    (own,) = (case for case in paper if case.key == ("HS", "separate"))
    ours = plan.cases[0].materials.tissue_laws()
    for tissue, law in own.materials.tissue_laws().items():
        # D1 of the paper is printed with three digits
        assert ours[tissue].initial_shear_modulus == pytest.approx(law.initial_shear_modulus)
    assert len({case.geometry for case in plan.cases}) == 1


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_200_direct_cases_have_the_band_that_40_predict(given):
    """What the chaos of one design says of 200 cases that are drawn at random and solved."""
    inputs = """
    [uncertainty]
    cases = {cases}
    design = "{design}"
    seed = {seed}
    [uncertainty.inputs]
    model.friction = {{ distribution = "uniform", low = 0.2, high = 0.6 }}
    laws.combined.mu.0 = {{ distribution = "lognormal", mean = "12 kPa", cv = "30 %" }}
    laws.skin.mu.0 = {{ distribution = "lognormal", mean = "220 kPa", cv = "50 %" }}
    sockets.A.modulus = {{ distribution = "triangular", low = "100 MPa", mode = "459 MPa", high = "1 GPa" }}
    """  # noqa: E501
    base = STUDY.partition("[uncertainty]")[0]
    found = {}
    for design, cases, seed in (("sobol", 40, 1), ("random", 200, 7)):
        path = given.parent / f"{design}.toml"
        path.write_text(base + inputs.format(design=design, cases=cases, seed=seed))
        found[design] = Study.read(path).run(out=given.parent / design, pictures=False)
    assert not found["sobol"].left_out and not found["random"].left_out
    table = found["sobol"].uncertainty.table
    trusted = table[table.trusted & (table.sd > 1e-3 * table["mean"])]
    assert len(trusted) >= 10
    cases = numbers(found["random"].summary, found["random"].levels)
    cases = cases[cases.socket != "A"].assign(value=cases.value.abs())
    for row in trusted.itertuples():
        values = cases[(cases.tissue == row.tissue) & (cases.quantity == row.quantity)].value
        error = row.sd / np.sqrt(200)
        assert values.mean() == pytest.approx(row.mean, abs=3.5 * error), row
        assert values.std() == pytest.approx(row.sd, rel=0.3), row
        # 190 of 200 expected inside: chance takes 12 of these, and the ends of a band from 40 cases
        assert values.between(row.low, row.high).sum() >= 170, row
