"""Results as types: computed once, written, read back, distinguished."""

import json
from pathlib import Path

import matplotlib
import numpy as np
import pandas as pd
import pytest

from calfsocket.io.errors import InputError
from calfsocket.postprocess.quantities import SUMMARY_COLUMNS, Quantities
from calfsocket.postprocess.thresholds import Threshold
from calfsocket.report.write import write_report
from calfsocket.simulation.result import Result
from calfsocket.simulation.results import load_results
from conftest import write_small_report
from report_results import contact_on, contact_on_plate, limb, plate, result, write_results

TC, HS = ("TC", "separate"), ("HS", "separate")


def plate_result(key: tuple[str, str], pressure: float = 10.0, **about) -> Result:
    return result(key, plate(), contact_on_plate(lambda arc: pressure + 0 * arc), **about)


@pytest.fixture(scope="module")
def solved() -> Result:
    fields = limb(shear=0.1)
    return result(("HS", "separate"), fields, contact_on(fields, 1 / 3))


def test_a_result_is_read_back_without_loss(solved, tmp_path):
    assert solved.save(tmp_path / "mine") == tmp_path / "mine"
    again = Result.load(tmp_path / "mine")
    assert again.record == solved.record and again.checks == solved.checks
    pd.testing.assert_frame_equal(again.steps, solved.steps, check_dtype=False)
    for mine, theirs in ((again.fields, solved.fields), (again.line, solved.line)):
        for name in type(mine).__dataclass_fields__:
            np.testing.assert_array_equal(getattr(mine, name), getattr(theirs, name))
    pd.testing.assert_frame_equal(again.summary(), solved.summary(), rtol=0, atol=0)


def test_what_a_result_contains(solved):
    assert tuple(solved.summary().columns) == SUMMARY_COLUMNS
    assert (solved.contact.pressure_kPa == 1 / 3).all() and "weight_mm" in solved.contact
    assert solved.checks.load == 1.0


def test_a_summary_that_is_changed_does_not_change_the_result(solved):
    solved.summary()["value"] = 0.0
    assert (solved.summary().value != 0).any()


def test_quantities_are_computed_once(solved, monkeypatch):
    count = []
    of = Quantities.of
    monkeypatch.setattr(Quantities, "of", lambda fields: count.append(1) or of(fields))
    fresh = Result(solved.record, solved.fields, solved.line, solved.steps)
    for _ in range(2):
        fresh.summary(), fresh.quantities.maximum("skin", "shear_stress")
    assert len(count) == 1


def test_plotting_leaves_the_backend_alone(solved):
    before = matplotlib.get_backend()
    figure = solved.plot()
    assert figure.axes and matplotlib.get_backend() == before


def test_results_of_a_study(tmp_path):
    cases = {HS: plate_result(HS, 12.0), TC: plate_result(TC)}
    failed = {("TSB", "separate"): "load 0.5 and no further"}
    results = load_results(write_results(tmp_path, cases, failed=failed))
    assert list(results) == [TC, HS]  # in the order of the study
    assert results.sockets == ("TC", "HS") and results.material_sets == ("separate",)
    assert results.left_out == {"TSB_separate": "load 0.5 and no further"}
    assert results[HS] is results[HS]
    assert results.value(*HS, "skin", "contact_pressure_mean") == pytest.approx(12)
    assert np.isnan(results.value(*HS, "skin", "no such"))
    assert list(results.summary.columns) == ["socket", "material_set", *SUMMARY_COLUMNS]
    assert results.summary.socket.unique().tolist() == ["TC", "HS"]
    assert len(results.steps) == 4 and len(results.contact) == 2 * len(results[TC].contact)
    with pytest.raises(KeyError, match="no solved case TSB_separate"):
        results["TSB", "separate"]
    only = results.only([HS])
    assert list(only) == [HS] and set(only.summary.socket) == {"HS"} and only[HS] is results[HS]


def test_single_results_in_one_folder(tmp_path):
    """As a notebook leaves them: no run.json, folders of any name, tables from the results."""
    plate_result(TC).save(tmp_path / "first")
    plate_result(HS, 12.0).save(tmp_path / "second")
    results = load_results(tmp_path)
    assert list(results) == [TC, HS]
    assert results.value(*HS, "skin", "contact_pressure_mean") == pytest.approx(12)
    assert set(results.contact.socket) == {"TC", "HS"} and len(results.steps) == 4


def test_a_report_of_single_results_knows_no_paper(tmp_path, solved):
    """They may have been made of anything; what made them is not in their files."""
    solved.save(tmp_path / "mine")
    page = write_small_report(tmp_path) / "report.html"
    text = page.read_text()
    assert 'id="scoreboard"' not in text and 'id="laws"' not in text and "run.json" not in text
    assert 'id="maxima"' in text and "Read with care" not in text


def test_cases_of_a_sweep_have_the_names_of_the_base(tmp_path):
    changed = ("TC@friction=0", "separate")
    cases = {TC: plate_result(TC), changed: plate_result(changed, 20, changes={"friction": 0.0})}
    results = load_results(write_results(tmp_path, cases))
    base, other = results.select({}), results.select({"friction": 0.0})
    assert list(base) == list(other) == [TC]
    assert base[TC] is results[TC] and other[TC] is results[changed]
    assert other.value(*TC, "skin", "contact_pressure_mean") == pytest.approx(20)
    assert other.summary.socket.unique().tolist() == ["TC"]
    assert not results.select({"friction": 0.1})


def test_shares_beyond_thresholds_are_in_the_summary_of_a_study(tmp_path):
    threshold = Threshold("contact_pressure", "skin", 9.0)
    results = load_results(write_results(tmp_path, {TC: plate_result(TC)}, thresholds=[threshold]))
    assert results.value(*TC, "skin", threshold.name) == 100
    assert threshold.name not in set(results[TC].summary().quantity)


def lose(name: str):
    return lambda folder: (folder / name).unlink()


def write(name: str, text: str):
    return lambda folder: (folder / name).write_text(text)


def read_everything(folder: Path) -> None:
    results = load_results(folder)
    for case in results.values():
        case.summary()
    assert len(results.summary) and len(results.contact) and len(results.steps)


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (write("run.json", "{"), "run.json: "),
        (write("run.json", "{}"), "run.json: is not the run.json of a study"),
        (write("contact.csv", ""), "contact.csv: cannot be read"),
        (write("steps.csv", "a\n1\n"), "no column 'socket'"),
        (write("summary.csv", "socket,material_set\nHS,separate\n"), "no rows of TC_separate"),
        (lose("HS_separate/fields.vtu"), "fields.vtu: cannot be read"),
        (lose("HS_separate/contact.csv"), "HS_separate/contact.csv: cannot be read"),
        (write("HS_separate/contact.csv", "a\n1\n"), "HS_separate/contact.csv: cannot be read"),
    ],
)
@pytest.mark.filterwarnings("ignore:The VTK reader")
def test_spoilt_results_are_refused_in_one_line(spoil, says, tmp_path):
    write_results(tmp_path, {TC: plate_result(TC), HS: plate_result(HS)})
    read_everything(tmp_path)
    spoil(tmp_path)
    with pytest.raises(InputError, match=says) as error:
        read_everything(tmp_path)
    assert str(error.value).startswith(str(tmp_path)) and "\n" not in str(error.value)


def test_a_folder_without_results_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"contains neither a run\.json nor a case's result\.json"):
        load_results(tmp_path)
    write_results(tmp_path, {TC: plate_result(TC)})
    run = json.loads((tmp_path / "run.json").read_text())
    run["cases"]["TC_separate"] |= {"status": "running"}
    (tmp_path / "run.json").write_text(json.dumps(run))
    results = load_results(tmp_path)
    assert len(results) == 0 and results.left_out == {"TC_separate": "not finished"}
    with pytest.raises(InputError, match=r"no case reached its full load .TC_separate: not finish"):
        write_report(results)
