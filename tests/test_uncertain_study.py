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
from calfsocket.report.figures.uncertain import pressure_band
from calfsocket.simulation.design import EVALUATED
from calfsocket.simulation.results import load_results
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


def row_of(table: pd.DataFrame, *key: str, state: str = "donned") -> pd.Series:
    columns = ["socket", "material_set", "tissue", "quantity", "state"]
    (row,) = table[(table[columns] == [*key, state]).all(axis=1)].to_dict("records")
    return pd.Series(row)


def test_the_design_is_what_was_solved(given, results):
    design = pd.read_csv(results / "design.csv")
    assert list(design.columns) == [
        "case", "socket", "material_set", "purpose", "model.friction", "tissues", "status"
    ]  # fmt: skip
    assert (design.status == "solved").all() and len(design) == 8 and set(design.purpose) == {"fit"}
    drawn = Study.read(given).plan.document.uncertainty.drawn
    assert design[["model.friction", "tissues"]].to_numpy() == pytest.approx(drawn)
    run = json.loads((results / "run.json").read_text())
    for row in design.itertuples():
        changes = run["cases"][row.case]["changes"]
        assert changes["model.friction"] == row[5]
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
    for number in (1, 2, 3, 4):
        run["cases"][f"A@u00{number}_combined"]["checks"]["negative_modes"] = 1
    (folder / "run.json").write_text(json.dumps(run))
    for name in EVALUATED:
        (folder / name).unlink()
    found = load_results(folder).uncertainty
    row = row_of(found.table, *PRESSURE)
    assert np.isnan(row["mean"]) and not row.trusted and row.cases == 5
    assert row.mean_of_cases > 0 and found.shares.empty and found.pressure.empty
    page = write_small(load_results(folder)).read_text()
    assert "These are too few for a chaos in so many inputs" in page
    assert "1 of 8 cases of the design: unstable equilibrium" in page  # not those that failed


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


LOADED = """
[[loads]]
name = "evening"
volume = { soft = "-2 %" }
steps = 2
[[loads]]
name = "walk"
force = { x = "0.02 N/mm" }
steps = 2
[uncertainty]
cases = 12
check = 10
[uncertainty.inputs]
layers.skin_thickness = { distribution = "uniform", low = "1.2 mm", high = "1.8 mm" }
laws.combined.mu.0 = { distribution = "choice", values = ["12 kPa", "7 kPa"], weights = [3, 1] }
"""
"""Stages of loading, a layer's thickness, a value or another one, and cases that check the fit."""


@pytest.fixture(scope="module")
def loaded(given: Path) -> Path:
    path, folder = given.parent / "loaded.toml", given.parent / "loaded"
    path.write_text(STUDY.partition("[uncertainty]")[0] + LOADED)
    Study.read(path).run(out=folder, pictures=False)
    return folder


def test_cases_beside_the_design_check_it(loaded):
    results = load_results(loaded)
    design = pd.read_csv(loaded / "design.csv", index_col="case")
    checks = design[design.purpose == "check"]
    summary = pd.read_csv(loaded / "summary.csv")
    assert list(checks.index) == [f"A@c{n:03d}_combined" for n in range(1, 11)]
    for state in ("donned", "evening", "walk"):
        rows = summary[(summary.state == state) & (summary.quantity == PRESSURE[-1])]
        values = rows.set_index("socket").value
        ours = values[[name.partition("_")[0] for name in checks.index]]
        row = row_of(results.uncertainty.table, *PRESSURE, state=state)
        assert (row.cases, row.check_cases, row.check_failed) == (12, 10, 0)
        assert row.nominal == pytest.approx(values["A"])
        assert row.check_mean == pytest.approx(ours.mean(), rel=1e-6)
        assert row.check_sd == pytest.approx(ours.std(ddof=0), rel=1e-6)
        inside = 100 * ours.between(row.low, row.high).mean()
        assert row.check_inside_pct == pytest.approx(inside) and inside >= 70
        assert row.check_q2 > 0.97 and row.q2 > 0.97 and row.trusted
    around = results.uncertainty.pressure
    assert list(around.state.unique()) == ["donned", "evening", "walk"] and len(around) == 3 * 180
    assert (around.check_q2 > 0.9).all() and (around.check_inside_pct > 60).all()


def test_a_value_or_another_one_is_drawn_by_its_weight_and_explains_what_it_does(loaded):
    results = load_results(loaded)
    design = pd.read_csv(loaded / "design.csv")
    fitted = design[design.purpose == "fit"]
    assert (fitted["laws.combined.mu.0"] == "7 kPa").sum() == 3
    values = results.summary[results.summary.quantity == "contact_pressure_mean"]
    values = values.set_index("socket").value[[name.partition("_")[0] for name in fitted.case]]
    soft = (fitted["laws.combined.mu.0"] == "7 kPa").to_numpy()
    # of muscle's modulus the pressure keeps some two thirds: the skin bears a part
    step = values[soft].mean() / values[~soft].mean()
    assert 7 / 12 < step < 0.95
    shares = results.uncertainty.shares
    mine = shares[(shares.quantity == "contact_pressure_mean") & (shares.state == "evening")]
    mine = mine.set_index("input")
    assert mine["rank"]["laws.combined.mu.0"] == 1 and mine.total["laws.combined.mu.0"] > 0.6
    row = row_of(results.uncertainty.table, *PRESSURE)
    means = np.array([values[~soft].mean(), values[soft].mean()])
    assert row["mean"] == pytest.approx(means @ [0.75, 0.25], rel=0.02)


def test_each_case_has_the_skin_that_was_drawn(loaded):
    design = pd.read_csv(loaded / "design.csv", index_col="case")
    shares = load_results(loaded).uncertainty.shares
    assert design["layers.skin_thickness [mm]"].nunique() == 22
    mine = shares[(shares.tissue == "skin") & (shares.quantity == "effective_stress_below_99.9")]
    assert (mine.set_index("input").total["layers.skin_thickness"] > 0.02).all()
    for name in ("A@u001_combined", "A@c001_combined"):
        cells = load_results(loaded)[tuple(name.split("_"))].fields
        area = cells.gauss_area[cells.cells_of("skin")].sum()
        thickness = design["layers.skin_thickness [mm]"][name]
        # between ellipses whose semi-axes differ by the thickness
        a, b = 12.5, 12.0
        ring = np.pi * (a * b - (a - thickness) * (b - thickness))
        assert area == pytest.approx(ring, rel=0.01), name


def test_a_case_that_cannot_bear_a_load_is_in_no_number_of_its_end(loaded, tmp_path):
    folder = tmp_path / "results"
    shutil.copytree(loaded, folder)
    run = json.loads((folder / "run.json").read_text())
    for name in ("A@u004_combined", "A_combined"):
        run["cases"][name]["limited"] = ["walk"]
    (folder / "run.json").write_text(json.dumps(run))
    for name in EVALUATED:
        (folder / name).unlink()
    results = load_results(folder)
    table = results.uncertainty.table
    rows = {state: row_of(table, *PRESSURE, state=state) for state in ("donned", "evening", "walk")}
    assert [row.cases for row in rows.values()] == [12, 12, 11]
    assert [row.failed for row in rows.values()] == [0, 0, 1]
    assert [np.isnan(row.nominal) for row in rows.values()] == [False, False, True]
    page = write_small(results).read_text()
    assert "1 case cannot bear what stage walk asks for, and is left out" in page


def test_the_report_shows_the_last_state_and_what_checks_it(loaded, tmp_path):
    folder = tmp_path / "results"
    shutil.copytree(loaded, folder)
    page = write_small(load_results(folder)).read_text()
    assert "donned: mean contact pressure" in page and "walk: mean contact pressure" in page
    assert "evening: mean contact pressure" not in page
    assert "at the end of stage walk; the other stages are in uncertainty.csv" in page
    assert "10 more cases were drawn at random and all of them solved" in page
    table = pd.read_csv(folder / "tables" / "check.csv")
    assert set(table.state) == {"donned", "walk"} and (table.check_cases == 10).all()


def test_every_panel_shows_the_whole_band_of_pressure(loaded):
    results = load_results(loaded)
    table = results.uncertainty.pressure
    later = table.state != "donned"
    columns = ["low_kPa", "median_kPa", "high_kPa", "nominal_kPa"]
    table.loc[later, columns] *= 3.0  # far above the first panel
    frame = next(iter(results.records.values())).frame
    figure = pressure_band(table, frame)
    for axes in figure.axes:
        assert axes.get_ylim()[0] == 0 and axes.get_ylim()[1] > table.high_kPa.max()


def test_three_ranks_fit_the_same_numbers(loaded, mpirun, tmp_path):
    folder = tmp_path / "results"
    shutil.copytree(loaded, folder)
    for name in EVALUATED:
        (folder / name).unlink()
    task = (
        "from mpi4py import MPI; from calfsocket import load_results as read; "
        "read('results').write_uncertainty(MPI.COMM_WORLD)"
    )
    mpirun(3, ["-c", task])
    for name in EVALUATED:
        assert (folder / name).read_bytes() == (loaded / name).read_bytes(), name


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
    said = capsys.readouterr().err
    assert "contains results of other inputs (case A@u001_combined" in said
    assert "case A@u005_combined and 3 more changed)" in said and "u006" not in said


def test_cases_that_check_can_be_added_to_a_study_that_is_solved(given, results, tmp_path):
    folder = tmp_path / "results"
    shutil.copytree(results, folder)
    before = {path: path.stat().st_mtime_ns for path in folder.glob("A*/fields.vtu")}
    path = given.parent / "checked.toml"
    path.write_text(STUDY.replace("cases = 8", "cases = 8\ncheck = 10"))
    found = Study.read(path).run(out=folder, pictures=False, resume=True)
    assert len(before) == 9 and all(p.stat().st_mtime_ns == t for p, t in before.items())
    assert len(found) == 19 and not found.left_out
    row, own = (
        row_of(each.uncertainty.table, *PRESSURE) for each in (found, load_results(results))
    )
    same = ["nominal", "mean", "sd", "low", "high", "q2", "cases"]
    assert row[same].equals(own[same])
    assert row.check_cases == 10 and own.check_cases == 0 and row.check_q2 > 0.95


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
    """What the chaos of a design says of 200 cases that are drawn at random and solved."""
    inputs = """
    [uncertainty]
    cases = 40
    check = 200
    [uncertainty.inputs]
    model.friction = { distribution = "uniform", low = 0.2, high = 0.6 }
    laws.combined.mu.0 = { distribution = "lognormal", mean = "12 kPa", cv = "30 %" }
    laws.skin.mu.0 = { distribution = "lognormal", mean = "220 kPa", cv = "50 %" }
    sockets.A.modulus = { distribution = "triangular", low = "100 MPa", mode = "459 MPa", high = "1 GPa" }
    """  # noqa: E501
    path = given.parent / "direct.toml"
    path.write_text(STUDY.partition("[uncertainty]")[0] + inputs)
    results = Study.read(path).run(out=given.parent / "direct", pictures=False)
    assert not results.left_out
    table = results.uncertainty.table
    judged = table[table.trusted & (table.sd > 1e-3 * table["mean"])]
    assert len(judged) >= 10 and (judged.check_cases == 200).all()
    for row in judged.itertuples():
        assert row.check_mean == pytest.approx(row.mean, abs=3.5 * row.sd / np.sqrt(200)), row
        assert row.check_sd == pytest.approx(row.sd, rel=0.3), row
        # 190 of 200 expected inside: chance takes 12 of these, and the ends of a band from 40 cases
        assert row.check_inside_pct >= 85, row
        assert row.check_q2 == pytest.approx(row.q2, abs=0.1), row
