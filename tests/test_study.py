"""The study end to end, on the coarse mesh: files, checks, failures, ranks."""

import json
import os
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import pyvista

from calfsocket import cli
from calfsocket.io.errors import InputError
from calfsocket.io.files import occupied
from calfsocket.study.runner import Runner, longest_first
from calfsocket.study.study import Study

COLUMNS = [
    "socket", "material_set", "tissue", "quantity", "value", "unit", "x_mm", "y_mm", "region"
]  # fmt: skip
CONTACT_COLUMNS = [
    "socket", "material_set", "arc_mm", "angle_deg", "x_mm", "y_mm", "pressure_kPa", "shear_kPa",
    "gap_mm", "weight_mm", "status",
]  # fmt: skip


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """TSB Combined, the quickest case, by the command line."""
    out = tmp_path_factory.mktemp("study") / "results"
    words = ["--size", "coarse", "--sockets", "tsb", "--materials", "combined", "--out", str(out)]
    assert cli.main(words) == 0
    return out


@pytest.fixture(scope="module")
def summary(results: Path) -> pd.DataFrame:
    return pd.read_csv(results / "summary.csv")


def test_long_cases_are_given_out_first():
    """HS squeezes the limb most and TSB least; the calf's own tissues take longer than combined."""
    names = [case.name for case in longest_first(Study.paper().cases)]
    expected = [f"{socket}_{s}" for socket in ("HS", "TC", "TSB") for s in ("separate", "combined")]
    assert names == expected


def test_the_folder_is_kept_until_the_report_is_written(tmp_path, monkeypatch):
    """Another run would replace what the report is made of."""
    solved = SimpleNamespace(folder=tmp_path, write_maps=lambda _: [])
    monkeypatch.setattr(Runner, "run", lambda *_: True)
    monkeypatch.setattr("calfsocket.simulation.results.load_results", lambda *_: solved)
    made = []

    def report(results):
        with pytest.raises(InputError, match="is solving into this folder"), occupied(tmp_path):
            pass
        made.append(results)

    assert Study.paper().run(out=tmp_path, then=report) is solved
    assert made == [solved]
    with occupied(tmp_path):
        pass


def value(summary: pd.DataFrame, tissue: str, quantity: str) -> float:
    at = summary[(summary.tissue == tissue) & (summary.quantity == quantity)]
    assert len(at) == 1
    return float(at.value.iloc[0])


def test_summary_has_every_quantity_of_every_tissue(summary):
    assert list(summary.columns) == COLUMNS
    units = {"effective_stress": "kPa", "shear_stress": "kPa"}
    units |= {"amp_log_strain": "%", "shear_log_strain": "%"}
    for tissue in ("skin", "fat", "muscle", "fascia", "vessel"):
        for quantity, unit in units.items():
            row = summary[(summary.tissue == tissue) & (summary.quantity == quantity)]
            assert list(row.unit) == [unit]
            assert np.isfinite(row[["value", "x_mm", "y_mm"]].to_numpy(float)).all()
            assert row.region.notna().all()
        # What holds at every point holds for the maxima: |s12| <= Mises / sqrt 3.
        assert abs(value(summary, tissue, "shear_stress")) <= 1.02 * value(
            summary, tissue, "effective_stress"
        ) / np.sqrt(3)
    assert value(summary, "vessel", "pressure") > 0


def test_contact_pressure_is_that_of_the_lost_area(summary, results):
    """The area lost is taken up by the tissues' bulk moduli, in parallel (design estimate: 7 %)."""
    run = json.loads((results / "run.json").read_text())
    laws = run["laws"]["combined"]
    areas = {"skin": 567, "fat": 1633, "fascia": 769, "muscle": 6425, "vessel": 63}  # mm^2
    compliance = sum(area / bulk_modulus(laws[tissue]) for tissue, area in areas.items())
    lost = 0.0164 * 10177  # mm^2: the TSB socket encloses 1.64 % less than the limb
    estimate = 1000 * lost / compliance
    mean = value(summary, "skin", "contact_pressure_mean")
    assert mean == pytest.approx(estimate, rel=0.1)
    assert mean < value(summary, "skin", "contact_pressure_max") < 3 * mean


def bulk_modulus(law: dict) -> float:
    """In MPa, from the entries of run.json."""
    if law["law"] == "hencky":
        return law["e"] / 3 / (1 - 2 * law["nu"])
    return 2 / law["d1"]


def test_contact_line_is_in_equilibrium_and_closed(results):
    contact = pd.read_csv(results / "contact.csv")
    assert list(contact.columns) == CONTACT_COLUMNS
    assert contact.arc_mm.is_monotonic_increasing
    assert set(contact.status) <= {"open", "stick", "slip"}
    closed = contact[contact.status != "open"]
    assert (closed.pressure_kPa > 0).all()
    assert closed.gap_mm.abs().max() < 1e-2
    # Ten digits of each are written.
    assert (contact.shear_kPa.abs() <= 0.4 * contact.pressure_kPa * (1 + 1e-9)).all()


def test_checks_of_the_run(results):
    run = json.loads((results / "run.json").read_text())
    assert run["finished"]
    (case,) = run["cases"].values()
    assert case["status"] == "solved"
    checks = case["checks"]
    assert checks["load"] == 1.0
    assert checks["residual_N_per_mm"] < 1e-9
    assert checks["smallest_volume_ratio"] > 0
    assert checks["largest_gap_in_contact_mm"] < 1e-2
    assert checks["relative_force_imbalance"] < 1e-6
    assert checks["negative_modes"] == 0
    assert {"mesh", "setup", "solve", "quantities", "files", "picture"} <= case["seconds"].keys()
    assert run["versions"]["fenics-dolfinx"].startswith(("0.9", "0.11"))


def test_steps_reach_the_full_load(results):
    steps = pd.read_csv(results / "steps.csv")
    assert steps.load.iloc[-1] == 1.0
    done = steps[steps.converged]
    assert (done.residual_N_per_mm < 1e-9).all()
    assert done.negative_modes.iloc[-1] == 0


def test_fields_are_read_back_with_names(results):
    grid = pyvista.read(results / "TSB_combined" / "fields.vtu")
    assert grid.n_cells > 7000
    names = [name for name in grid.field_data.keys() if name.startswith("region ")]
    assert len(names) == 28
    assert "region gastrocnemius_medial_head" in names
    displacement = np.linalg.norm(grid.point_data["displacement"], axis=1)
    assert 0.1 < displacement.max() < 3
    for name in ("effective_stress_kPa", "shear_log_strain_percent"):
        assert np.isfinite(grid.point_data[name]).all()


def test_picture_is_drawn(results):
    picture = pyvista.read(results / "TSB_combined" / "picture.png")
    assert min(picture.dimensions[:2]) >= 1500


def test_report_is_written_at_the_end(results):
    assert (results / "report.html").read_text().count("<h2>") > 5
    assert (results / "tables" / "scoreboard.csv").is_file()
    assert (results / "figures" / "figure4_effective_stress.pdf").is_file()


def test_results_of_other_settings_are_not_overwritten(results, capsys):
    before = (results / "summary.csv").read_bytes()
    words = ["--size", "coarse", "--sockets", "TSB", "--friction", "0.3", "--out", str(results)]
    assert cli.main(words) == 2
    assert "model.friction" in capsys.readouterr().err
    assert (results / "summary.csv").read_bytes() == before


def test_a_case_that_fails_says_why_and_does_not_stop_the_others(mpirun, tmp_path):
    words = ["-m", "calfsocket", "--size", "coarse", "--sockets", "TC,TSB", "--no-pictures"]
    words += ["--no-report", "--materials", "combined", "-calfsocket_snes_max_it", "1"]
    mpirun(2, words, timeout=300, code=1)
    cases = json.loads((tmp_path / "results" / "run.json").read_text())["cases"]
    assert set(cases) == {"TC_combined", "TSB_combined"}
    for case in cases.values():
        assert case["status"] == "failed"
        assert "load 0.0000 and" in case["message"]
        assert "max_it" in case["message"]


@pytest.mark.parametrize("ranks", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_one_case_on_several_ranks_agrees(ranks, mpirun, tmp_path, summary):
    words = ["-m", "calfsocket", "--size", "coarse", "--sockets", "TSB", "--materials", "combined"]
    mpirun(
        ranks, [*words, "--ranks-per-case", str(ranks), "--no-pictures", "--no-report"], timeout=400
    )
    several = pd.read_csv(tmp_path / "results" / "summary.csv")
    same = ["socket", "material_set", "tissue", "quantity", "unit", "region"]
    pd.testing.assert_frame_equal(several[same], summary[same])
    np.testing.assert_allclose(several.value, summary.value, rtol=1e-6)


@pytest.mark.slow
def test_cases_side_by_side_are_exactly_those_one_after_another(mpirun, tmp_path):
    words = ["-m", "calfsocket", "--size", "coarse", "--sockets", "TSB,TC", "--materials"]
    words += ["combined", "--no-pictures", "--no-report"]
    for ranks in (1, 2):
        mpirun(ranks, [*words, "--out", f"on{ranks}"], timeout=900)
    for name in ("summary.csv", "levels.csv", "contact.csv"):
        assert (tmp_path / "on1" / name).read_bytes() == (tmp_path / "on2" / name).read_bytes()
    assert os.listdir(tmp_path / "on1") != []
