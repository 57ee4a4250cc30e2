"""A case that stops below its full load: kept with its load, and never taken for a result."""

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import pyvista
from mpi4py import MPI

from calfsocket import cli
from calfsocket.io.errors import ConvergenceError, InputError, SolveError
from calfsocket.materials import material_set
from calfsocket.materials.laws import Ogden
from calfsocket.report.write import write_report
from calfsocket.simulation.result import Result
from calfsocket.simulation.results import load_results
from calfsocket.simulation.simulation import Monitor, Simulation
from calfsocket.study.document import Document
from tiny_study import TinyStudy, tiny_study

# Softens under compression: the tiny limb bears two thirds of socket C's load with it.
SOFTENING = Ogden(mu=(-0.0157, 0.017), alpha=(-3.3, 5.1), nu=0.495)
FEW_STEPS = {"first": 0.5, "largest": 0.5, "smallest": 0.3}


@pytest.fixture(scope="module", autouse=True)
def unstable_laws() -> Iterator[None]:
    """Let laws be used that lose stability at small strain: with them, a solution surely fails."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(material_set, "refusal", lambda law: "")
        yield


def softened(study: TinyStudy, name: str) -> TinyStudy:
    """Return a study in which a socket's limb softens."""
    document = Document.model_validate({"model": {"size": "coarse"}, "steps": FEW_STEPS})
    cases = tuple(
        replace(case, materials=case.materials.replace(combined=SOFTENING), document=document)
        if case.socket.name == name
        else case
        for case in study.plan.cases
    )
    return replace(study, plan=replace(study.plan, cases=cases))


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results of two cases; C was solved there before, and has stopped at half of its load."""
    folder = tmp_path_factory.mktemp("stopped") / "results"
    assert tiny_study(folder, ("A", "C")).run()
    assert set(pd.read_csv(folder / "summary.csv").socket) == {"A", "C"}
    for name in ("run.json", "cases.csv"):  # as another version's, whose results may differ
        (folder / name).unlink()
    assert not softened(tiny_study(folder, ("A", "C"), pictures=True), "C").run()
    return folder


def test_tables_of_results_contain_solved_cases_alone(out):
    for name in ("summary.csv", "levels.csv", "contact.csv"):
        assert set(pd.read_csv(out / name).socket) == {"A"}
    cases = pd.read_csv(out / "cases.csv").set_index("case")
    assert cases.status.to_dict() == {"A_combined": "solved", "C_combined": "failed"}
    assert cases.load.to_dict() == {"A_combined": 1.0, "C_combined": 0.5}
    steps = pd.read_csv(out / "steps.csv")
    assert steps[steps.socket == "C"].load.tolist() == [0.5, 1.0]
    assert steps[steps.socket == "C"].converged.tolist() == [True, False]


def test_results_in_python_are_those_of_solved_cases_alone(out):
    results = load_results(out)
    assert list(results) == [("A", "combined")]
    for table in (results.summary, results.contact, results.steps):
        assert set(table.socket) == {"A"}
    assert np.isnan(results.value("C", "combined", "skin", "contact_pressure_max"))
    with pytest.raises(KeyError, match="no solved case C_combined: no equilibrium between load 0"):
        results["C", "combined"]
    (out / "run.json").rename(out / "run.kept")  # then folders of cases are looked at
    try:
        assert list(load_results(out)) == [("A", "combined")]
    finally:
        (out / "run.kept").rename(out / "run.json")


def test_files_of_the_case_say_at_which_load_it_stopped(out):
    folder = out / "C_combined"
    record = json.loads((folder / "result.json").read_text())
    assert record["status"] == "failed" and record["checks"]["load"] == 0.5
    assert pyvista.read(folder / "fields.vtu").field_data["load"].tolist() == [0.5]
    assert set(pd.read_csv(folder / "contact.csv").load) == {0.5}
    assert set(pd.read_csv(out / "A_combined" / "contact.csv").load) == {1.0}
    with pytest.raises(InputError, match=r"stopped at load 0\.5000 of 1, so that it has no resul"):
        Result.load(folder)
    stopped = Result.load(folder, stopped=True)
    assert not stopped.solved and stopped.checks.load == 0.5
    assert "stopped at load 0.500" in stopped.plot().texts[-1].get_text()
    assert Result.load(out / "A_combined").solved


def test_the_picture_of_a_stopped_case_can_be_drawn_again(out, capsys):
    picture = out / "C_combined" / "picture.png"
    before = picture.read_bytes()
    picture.unlink()
    assert cli.main(["picture", str(out / "C_combined")]) == 0
    assert picture.read_bytes() == before


def test_resume_starts_from_the_last_equilibrium_and_keeps_the_rule(out):
    assert not softened(tiny_study(out, ("A", "C")), "C").run(resume=True)
    assert set(pd.read_csv(out / "summary.csv").socket) == {"A"}
    assert load_results(out).run.cases["C_combined"].resumed_from_load == 0.5


def test_a_case_that_fails_when_it_is_solved_again_keeps_no_earlier_result(tmp_path, monkeypatch):
    assert tiny_study(tmp_path, ("A",), pictures=True).run()
    (tmp_path / "A_combined" / "notes.txt").write_text("mine")

    def refuse(*_: object) -> None:
        raise SolveError("no memory")

    monkeypatch.setattr(Simulation, "solve", refuse)
    assert not tiny_study(tmp_path, ("A",)).run()
    assert [path.name for path in (tmp_path / "A_combined").iterdir()] == ["notes.txt"]
    for name in ("summary.csv", "contact.csv", "steps.csv"):
        assert pd.read_csv(tmp_path / name).empty
    assert not load_results(tmp_path)


def test_the_error_has_the_last_equilibrium():
    study = softened(tiny_study(Path("unused"), ("C",)), "C")
    with pytest.raises(ConvergenceError) as caught:
        study.plan.cases[0].simulation(MPI.COMM_SELF).solve(Monitor())
    stopped = caught.value.result
    assert not stopped.solved and stopped.checks.load == 0.5


def test_a_study_without_a_solved_case_has_empty_tables(tmp_path):
    assert not softened(tiny_study(tmp_path, ("C",)), "C").run()
    results = load_results(tmp_path)
    assert results.summary.empty and "value" in results.summary
    assert results.contact.empty and "pressure_kPa" in results.contact and results.steps.empty
    with pytest.raises(InputError, match="no case reached its full load"):
        write_report(results)


def test_a_sweep_leaves_the_cells_of_a_stopped_case_empty(tmp_path):
    study = softened(tiny_study(tmp_path, ("A", "C")), "C")
    study = replace(study, plan=replace(study.plan, parameters=("steps.first",)))
    assert not study.run()
    sweep = pd.read_csv(tmp_path / "sweep.csv").set_index("case")
    assert sweep.status.to_dict() == {"A_combined": "solved", "C_combined": "failed"}
    found = sweep[["contact_pressure_max_kPa", "skin_effective_stress_kPa"]].notna()
    assert found.loc["A_combined"].all() and not found.loc["C_combined"].any()
