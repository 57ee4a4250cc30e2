"""The error of numbers by a second mesh: against orders known by hand, and in a study."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from mpi4py import MPI
from report_text import written

from calfsocket.io.errors import ConvergenceError, InputError
from calfsocket.meshes import sizing
from calfsocket.meshes.sizing import any_size, mesh_size
from calfsocket.postprocess.levels import STATISTICS
from calfsocket.postprocess.mesh_error import (
    TOGETHER,
    error_of,
    of_levels,
    of_maxima,
    settled,
    times_change,
    with_error,
    with_levels,
)
from calfsocket.report import tables as report_tables
from calfsocket.report.loads import stages_of
from calfsocket.report.words import measured
from calfsocket.simulation.result import Result
from calfsocket.simulation.results import load_results
from calfsocket.simulation.simulation import Simulation
from calfsocket.study.document import Document
from report_results import contact_on, limb, result, results_of, with_second
from tiny_study import tiny_study

TABLES = ("summary.csv", "levels.csv")


# --- the index


def test_a_change_counts_threefold_where_the_second_mesh_has_half_as_many_elements():
    """3/(2 - 1); where it has twice as many the change itself comes on top of that."""
    assert times_change(20_000, 10_000) == 3
    assert times_change(10_000, 20_000) == 4
    assert times_change(40_000, 10_000) == 1  # r = 2, r^2 - 1 = 3
    with pytest.raises(InputError, match="too nearly as many"):
        times_change(10_000, 9_000)


def test_an_error_has_the_decimals_of_its_number_and_a_star_where_that_has_not_settled():
    def said(*words: object) -> str:
        return with_error(*words).replace("\N{NO-BREAK SPACE}", " ")

    assert said("18.6", 18.6, 0.04) == "18.6 ± <0.05" and said("18.6", 18.6, 0.4) == "18.6 ± 0.4*"
    assert said("0", 0.0, 0.0) == "0" and said("0.0", 0.0, 0.3) == "0.0 ± 0.3*"
    assert said("5", 5.0, float("nan")) == "5"
    # +10 % is 1.1 times, which has settled with 0.02
    assert said("+10", 10.0, 2.0, "", 100.0) == "+10 ± 2"


@pytest.mark.parametrize("order", [1.0, 1.5, 2.0, 3.0])
def test_it_covers_the_error_of_numbers_that_converge_with_an_order(order):
    """1 + h^order, from either side, whatever the order is from 1 on: 3 > 1/(sqrt 2 - 1)."""
    for sign in (1.0, -1.0):
        fine, coarse = (1 + sign * 0.1 * h**order for h in (1.0, np.sqrt(2)))
        change = abs(fine - coarse)
        assert abs(fine - 1) <= times_change(2000, 1000) * change
        assert abs(coarse - 1) <= times_change(1000, 2000) * change


def levels_of(**rows: list[float]) -> pd.DataFrame:
    """Rows of a table of levels; each has rms, then numbers that all its columns have."""
    parts = [
        {"tissue": "skin", "region": "", "quantity": name, **dict.fromkeys(STATISTICS, value)}
        | {"rms": rms}
        for name, (rms, value) in rows.items()
    ]
    return pd.DataFrame(parts)


def test_a_level_has_the_largest_change_among_itself_and_its_neighbours():
    first = levels_of(effective_stress=[4.0, 10.0], shear_stress=[2.0, 0.0])
    second = first.copy()
    second.loc[0, "below_99"] = 9.0  # by 10 %
    second.loc[1, "lower_99.9"] = -0.5  # a quarter of the rms
    errors = of_levels(first, second, 3.0)
    for name in ("below_95", "below_99", "below_99.9"):
        assert errors.loc[0, error_of(name)] == pytest.approx(3.0)
    for name in ("mean", "rms", "below_50", "upper_99"):
        assert errors.loc[0, error_of(name)] == 0
    for name in ("lower_99", "lower_99.9"):
        assert errors.loc[1, error_of(name)] == pytest.approx(1.5)
    assert errors.loc[1, error_of("lower_95")] == errors.loc[1, error_of("upper_99.9")] == 0


def test_levels_of_whole_tissues_stand_behind_the_rows_of_a_summary():
    summary = pd.DataFrame(
        {"tissue": ["skin"], "quantity": ["x"], "value": [2.0], "unit": "kPa", "x_mm": 1.0}
    ).assign(mesh_error=0.2)
    levels = levels_of(effective_stress=[4.0, 10.0]).assign(unit="kPa")
    parts = pd.concat([levels, levels.assign(region="skin"), levels.assign(region=np.nan)])
    found = with_levels(summary, of_levels(parts, parts.iloc[:2], 3.0))
    assert found["quantity"].tolist() == ["x", *["effective_stress_below_99.9"] * 2]
    assert found.value.tolist() == [2, 10, 10] and found.x_mm.isna().tolist() == [False, True, True]
    assert list(found.columns) == list(summary.columns)


def test_maxima_count_by_magnitude_where_a_sign_is_a_direction():
    def rows(*values: float) -> pd.DataFrame:
        quantities = ["effective_stress", "shear_stress", "contact_pressure_mean"]
        return pd.DataFrame({"tissue": "skin", "quantity": quantities, "value": values})

    found = of_maxima(rows(10.0, -5.0, 3.0), rows(11.0, 4.0, 3.0), 3.0)
    assert found.mesh_error.tolist() == pytest.approx([3, 3, 0])
    less = of_maxima(rows(10.0, -5.0, 3.0), rows(11.0, 4.0, 3.0).iloc[:1], 3.0)
    assert less.mesh_error.isna().tolist() == [False, True, True]
    assert settled(-5.0, 0.1) and not settled(5.0, 0.11) and not settled(5.0, float("nan"))


def test_the_second_mesh_has_the_shape_of_the_first():
    paper = mesh_size("paper")
    half = paper.second(32_000)
    assert half == replace(paper.scaled(2**0.5), name="half the triangles of paper")
    coarse = mesh_size("coarse")
    assert coarse.second(7_100).largest == pytest.approx(coarse.largest / 2**0.5)
    assert mesh_size("40000").second(40_100).triangles == 20_000
    assert mesh_size("9000").second(9_100).triangles == 18_000


# --- in a study


@pytest.fixture(scope="module")
def plain(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("plain")
    assert tiny_study(out, ("A",)).run()
    return out


@pytest.fixture(scope="module")
def solved(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("solved")
    assert tiny_study(out, ("A",), mesh_error=True).run()
    return out


def same(out: Path, other: Path) -> bool:
    return all((out / name).read_bytes() == (other / name).read_bytes() for name in TABLES)


def test_numbers_are_those_without_it_and_have_an_error_beside_them(plain, solved):
    for name in TABLES:
        with_error, without = (pd.read_csv(folder / name) for folder in (solved, plain))
        pd.testing.assert_frame_equal(with_error[without.columns], without)
        more = with_error.columns.difference(without.columns)
        assert len(more) == (1 if name == "summary.csv" else len(STATISTICS))
    summary = pd.read_csv(solved / "summary.csv").set_index(["tissue", "quantity"])
    mine, second = (Result.load(solved / "A_combined" / name) for name in ("", "second_mesh"))
    times = times_change(mine.checks.cells, second.checks.cells)
    change = second.contact_levels["contact_pressure_mean"].value
    change -= mine.contact_levels["contact_pressure_mean"].value
    error = summary.mesh_error["skin", "contact_pressure_mean"]
    assert error == pytest.approx(times * abs(change)) and error > 0
    assert second.checks.cells == pytest.approx(2 * mine.checks.cells, rel=0.2)


def test_results_have_it_in_python(solved):
    results = load_results(solved)
    (result,) = results.values()
    assert result.record.second_mesh.cells == result.second.checks.cells
    summary = result.summary()
    file = results.summary[summary.columns].fillna({"region": ""})
    pd.testing.assert_frame_equal(file, summary, check_dtype=False, rtol=1e-9)
    levels = result.levels()
    assert (levels["below_99.9_mesh_error"] >= 0).all()
    file = results.levels[levels.columns]
    pd.testing.assert_frame_equal(file, levels, check_dtype=False, rtol=1e-9)


def sizes_solved(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Return a list to which each simulation adds the name of its mesh size when it is solved."""
    sizes: list[str] = []
    solve = Simulation.solve

    def noted(self: Simulation, *words: object, **named: object) -> Result:
        sizes.append(self.mesh_size.name)
        return solve(self, *words, **named)

    monkeypatch.setattr(Simulation, "solve", noted)
    return sizes


def test_resume_adds_it_to_results_that_are_there(solved, tmp_path, monkeypatch):
    out = tmp_path / "results"
    assert tiny_study(out, ("A",)).run()
    sizes = sizes_solved(monkeypatch)
    for _ in range(2):  # and the second time nothing is left to do
        assert tiny_study(out, ("A",), mesh_error=True).run(resume=True)
        assert same(out, solved)
        assert sizes == ["twice the triangles of coarse"]


def test_two_refined_meshes_follow_from_one_first_solution(tmp_path, monkeypatch):
    sizes = sizes_solved(monkeypatch)
    monkeypatch.setattr(sizing, "FEWEST_ADAPTIVE", 2000)
    study = tiny_study(tmp_path, ("A",), mesh_error=True, size="adaptive-2000")
    assert study.run()
    twice = "twice the triangles of adaptive-2000"
    assert sorted(sizes) == ["adaptive-2000", "medium", twice]
    (result,) = load_results(tmp_path).values()
    assert result.second.checks.cells == pytest.approx(2 * result.checks.cells, rel=0.1)
    finer = any_size("adaptive-2000").second(0)
    alone = study.plan.cases[0].simulation(MPI.COMM_SELF, finer).solve()
    np.testing.assert_array_equal(result.second.fields.points, alone.fields.points)


def test_a_second_mesh_that_fails_is_said_and_tried_again(solved, tmp_path, monkeypatch):
    out = tmp_path / "results"
    study = tiny_study(out, ("A",), mesh_error=True)
    solve = Simulation.solve

    def fail(self: Simulation, *words: object, **named: object) -> Result:
        if "triangles of" in self.mesh_size.name:
            raise ConvergenceError("no equilibrium nearby", None)
        return solve(self, *words, **named)

    with monkeypatch.context() as patch:
        patch.setattr(Simulation, "solve", fail)
        assert study.run()  # its own results are there
    record = json.loads((out / "run.json").read_text())["cases"]["A_combined"]
    assert record["status"] == "solved"
    cases = pd.read_csv(out / "cases.csv")
    why = "no mesh error: the second mesh (twice the triangles of coarse): no equilibrium nearby"
    assert cases.warnings.tolist() == [why]
    assert "mesh_error" not in pd.read_csv(out / "summary.csv")
    assert load_results(out)["A", "combined"].second is None
    assert study.run(resume=True) and same(out, solved)


def test_states_of_loads_have_it_as_well(tmp_path):
    load = {"name": "turned", "moment": "1 N mm/mm", "steps": 2}
    study = tiny_study(tmp_path, ("A",), mesh_error=True)
    tables = {"study": {"mesh_error": True}, "model": {"size": "coarse"}, "loads": [load]}
    document = Document.model_validate(tables)
    case = replace(study.plan.cases[0], document=document)
    study = replace(study, plan=replace(study.plan, document=document, cases=(case,)))
    assert study.run()
    summary = pd.read_csv(tmp_path / "summary.csv")
    errors = summary[summary["quantity"] == "effective_stress"].groupby("state").mesh_error.min()
    assert sorted(errors.index) == ["donned", "turned"] and errors.min() > 0
    (result,) = load_results(tmp_path).values()
    state = result.states["turned"]
    assert state.second.record.state.stage == "turned" and not state.second.states
    results = load_results(tmp_path)
    assert "mesh_error" in results.states
    stages = {stage.name: stage for stage in stages_of(result)}
    error = summary.query("state == 'turned' and quantity == 'contact_pressure_max'").mesh_error
    assert stages["turned"].largest == measured(stages["turned"].largest_kPa, error.item())
    work = [each.curve.dissipated_N_mm_per_mm.iloc[-1] for each in (result, result.second)]
    assert stages["turned"].dissipated == measured(
        work[0], result.times_change * abs(work[0] - work[1])
    )
    shown = report_tables.states(results)
    assert list(shown.shown.columns.get_level_values("state")) == ["donned", "turned"]
    (row,) = shown.data.query(
        "tissue == 'skin' and quantity == 'effective_stress_below_99.9' and state == 'turned'"
    ).itertuples()
    text = shown.shown.loc[("skin", "effective stress, kPa")].iloc[1]
    assert text == measured(row.value, row.mesh_error) == stages["turned"].skin and "±" in text


def test_two_ranks_that_solve_a_case_together_give_the_same(solved, tmp_path, mpirun):
    how = {"out": "two", "study": {"sockets": ["A"], "mesh_error": True}, "ranks_per_case": 2}
    mpirun(2, [Path(__file__).with_name("tiny_study.py"), json.dumps(how)])
    two, one = (pd.read_csv(folder / "summary.csv") for folder in (tmp_path / "two", solved))
    np.testing.assert_allclose(two.mesh_error, one.mesh_error, atol=1e-6 * one.value.abs().max())


def test_two_meshes_with_as_many_elements_give_no_error(solved):
    result = Result.load(solved / "A_combined")
    with pytest.raises(InputError, match="too nearly as many"):
        replace(result, second=None).on_second_mesh(result)


# --- in a report


def test_a_report_has_it_behind_its_numbers_and_marks_what_has_not_settled(tmp_path):
    """Stress changes by 1 % to a mesh of twice as many elements, pressure by 0.3 %: 4 and 1.2 %."""
    key = ("TC", "separate")
    fields, finer = limb(2.0), limb(2.02)
    first = result(key, fields, contact_on(fields, 10.0))
    second = result(key, finer, contact_on(finer, 10.03))
    both = with_second(first, second)
    report = written(results_of({key: both}, folder=tmp_path))
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert TOGETHER.join(["10.0", "±", "0.1", "kPa, at most"]) in page
    said = report.answer
    assert said["Contact pressure"].startswith("On average 10.0 ± 0.1 kPa, at most 10.0 ± 0.1 kPa")
    level = both.levels().set_index(["tissue", "region", "quantity"])["below_99.9"]
    stress = level["muscle", "", "effective_stress"]
    shown = measured(stress, 0.04 * stress).replace("\N{NO-BREAK SPACE}", " ")
    assert f"stays below {shown} kPa effective stress" in said["Muscle"]
    assert "* marks what has not settled within 2 %." in said["How far to trust it"]
    assert "solved again on a mesh of twice the triangles of coarse" in report.text
    assert "the change itself is added. A level has" in report.text
    table = pd.read_csv(tmp_path / "tables" / "levels.csv")
    assert table["below_99.9_mesh_error"].max() > 0
    assert shown.endswith("*")
    assert f"{shown} (rms" in (tmp_path / "tables/levels.md").read_text(encoding="utf-8").replace(
        "\N{NO-BREAK SPACE}", " "
    )


def test_a_report_without_it_does_not_speak_of_it(tmp_path):
    fields = limb(2.0)
    case = {("TC", "separate"): (fields, contact_on(fields, 10.0))}
    text = written(results_of(case, folder=tmp_path)).text
    assert "Behind ±" not in text and "second mesh" not in text
