"""The calibration beside the paper's study: verdicts and table by hand, and what is broken."""

import json
import logging
from pathlib import Path

import pandas as pd
import pytest

from calfsocket.calibration.names import LABELS
from calfsocket.io.errors import InputError
from calfsocket.paper import calibration
from calfsocket.paper.calibration import NoCalibration, read_calibration
from calfsocket.paper.evidence import Evidence
from calfsocket.paper.guest import guest
from calfsocket.paper.scoreboard import FAILS, HOLDS, UNCHECKED, check
from calfsocket.report.findings import Findings
from report_calibration import FORCE, write_calibration
from report_results import limb_study, results_of

CLAIMS = ["C033", "C034", "C035", "C036"]
ONE = limb_study((("TC", "separate"),))


def findings(folder: Path) -> Findings:
    """Findings of a study of one case in a folder."""
    return Findings(results_of(ONE, folder=folder))


def board(folder: Path) -> pd.DataFrame:
    evidence = Evidence(results_of(ONE, folder=folder))
    return pd.DataFrame({name: check(name, evidence) for name in [*CLAIMS, "C037"]}).T


def test_what_a_calibration_says_of_the_claims(tmp_path):
    write_calibration(tmp_path / "calibration")
    found = board(tmp_path)
    assert found.verdict.tolist() == [HOLDS] * 4 + [UNCHECKED]
    # Table 1's: 36/30 and 48/40 at most; fitted: 44/40; ignored: 5/10 to 10/40, 10/48, 10/44
    assert "Table 1's combined law 1.00 to 1.20 times Separate's" in found.ours["C033"]
    assert "(mu 11.0 kPa, alpha 9.00) 1.00 to 1.10" in found.ours["C033"]
    assert "0.250 to 0.500 times Separate's" in found.ours["C034"]
    assert "0.208 to 0.500 times Combined's" in found.ours["C034"]
    assert "0.227 to 0.500 with the fitted one" in found.ours["C034"]
    # sqrt((25 + 144 + 441 + 900)/4)/40, sqrt((36 + 64)/4)/40, sqrt(16/4)/40
    assert "fascia ignored 48.6 %, Combined 12.5 % (Table 1), 5.00 % (fitted)" in found.ours["C035"]
    assert "plate of 30.0 mm, flat over 20.0 mm, pressed 4.00 mm" in found.ours["C036"]
    assert "Pavan" in found.why["C037"] and "docs/materials.md" in found.why["C037"]


@pytest.mark.parametrize(
    ("identifier", "changed", "why"),
    [
        ("C033", {"force": {"combined_table1": (10, 20, 30, 50.5)}}, "at 3 of 4 displacements"),
        ("C033", {"force": {"combined_table1": (7.9, 20, 30, 40)}}, "at 3 of 4 displacements"),
        ("C034", {"force": {"fascia_ignored": (10.0, 8, 9, 10)}}, "not at every displacement"),
        ("C034", {"force": {"combined_fitted": (10, 20, 8.9, 40)}}, "not at every displacement"),
        ("C034", {"force": {"combined_table1": (4.9, 20, 30, 40)}}, "not at every displacement"),
        ("C035", {"force": {"combined_table1": (10, 20, 30, 80)}}, "Table 1's law is as far off"),
        ("C035", {"force": {"combined_fitted": (10, 20, 30, 80)}}, "even the fitted law"),
        ("C036", {"inputs": {"plate": {"width": 30, "edge_radius": 7.6, "thickness": 8}}},
         "wider than its face"),
    ],
)  # fmt: skip
def test_verdicts_follow_the_curves(tmp_path, identifier, changed, why):
    write_calibration(tmp_path / "calibration", **changed)
    found = board(tmp_path).loc[identifier]
    assert found.verdict == FAILS
    assert why in found.why


def test_a_fitted_law_far_from_the_curve_does_not_decide_on_the_papers(tmp_path):
    write_calibration(tmp_path / "calibration", force={"combined_fitted": (99, 99, 99, 99)})
    assert board(tmp_path).verdict["C033"] == HOLDS


def test_the_table(tmp_path):
    found = read_calibration(write_calibration(tmp_path / "calibration").parent)
    laws = found.record.inputs.laws
    table = calibration.table(found, laws)
    fitted = table.shown.loc["Combined, fitted"].str.replace("\N{NO-BREAK SPACE}", " ")
    assert fitted.tolist() == [
        "11.0 ± 2 %", "9.00 ± 15 %", "1.83", "5.00", "44.0"
    ]  # fmt: skip
    assert table.shown.loc["Combined, Table 1"].tolist() == ["12.0", "14.0", "1.67", "12.5", "48.0"]
    assert table.shown.loc["fascia ignored"].tolist() == ["1.91", "4.60", "10.5", "48.6", "10.0"]
    assert table.shown.loc["Separate"].tolist() == ["", "", "", "0", "40.0"]
    assert table.notes == ()


def test_the_table_says_what_the_fit_is_worth(tmp_path):
    folder = write_calibration(
        tmp_path / "calibration",
        fit={"alpha": 0.5, "alpha_at_limit": True, "relative_covariance": [[0, 0], [0, 4.0]]},
    )
    path = folder / "calibration.json"
    content = json.loads(path.read_text())
    content["curves"]["separate"]["negative_modes"] = [0, 0, 1, 0]
    path.write_text(json.dumps(content))
    found = read_calibration(tmp_path)
    laws = found.record.inputs.laws | {"fascia": {"law": "yeoh", "c10": 0.491}}
    table = calibration.table(found, laws)
    assert table.shown["alpha"]["Combined, fitted"] == "0.500 (not determined)"
    limit, unstable, others = table.notes
    assert "alpha is at a limit of its range (0.500)" in limit
    assert unstable == "Unstable at some displacement: Separate."
    assert others == "Calibrated with other laws than this study's: fascia."


def test_figure_3_stands_in_its_place(tmp_path):
    write_calibration(tmp_path / "calibration")
    added = guest(findings(tmp_path))
    assert added.numbers["calibration"] == "3"
    png, pdf = added.made["calibration"]
    assert png.is_file() and pdf.is_file()
    assert added.tables["calibration"].name == "calibration"
    assert added.warnings == () and not added.values["missing"]


def test_without_a_calibration_the_page_says_how_to_get_one(tmp_path, caplog):
    added = guest(findings(tmp_path))
    how = "python3 -m calfsocket calibrate --out FOLDER/calibration"
    missing = added.values["missing"]
    assert missing.startswith("Figure 3 needs ") and how in missing
    assert "calibration" not in {**added.made, **added.tables}
    assert added.warnings == () and caplog.records == []
    found = board(tmp_path)
    assert (found.verdict == UNCHECKED).all() and found.why[CLAIMS].str.contains(how).all()
    with pytest.raises(NoCalibration):
        read_calibration(tmp_path)


def broken_json(folder: Path) -> None:
    (folder / "calibration.json").write_text('{"program": ')


def foreign(folder: Path) -> None:
    (folder / "calibration.json").write_text('{"program": "another"}')


def no_fit(folder: Path) -> None:
    content = json.loads((folder / "calibration.json").read_text())
    (folder / "calibration.json").write_text(json.dumps(content | {"fits": []}))


def covariance(folder: Path, rows: list[list[float]]) -> None:
    content = json.loads((folder / "calibration.json").read_text())
    content["fits"][0]["relative_covariance"] = rows
    (folder / "calibration.json").write_text(json.dumps(content))


def odd_covariance(folder: Path) -> None:
    covariance(folder, [[1.0], [0.0, 1.0]])


def negative_variance(folder: Path) -> None:
    covariance(folder, [[1.0, 0.0], [0.0, -1.0]])


def no_curve(folder: Path) -> None:
    curves = pd.read_csv(folder / "curves.csv")
    curves.drop(columns="separate_N_per_m").to_csv(folder / "curves.csv", index=False)


def hole_in_a_curve(folder: Path) -> None:
    text = (folder / "curves.csv").read_text()
    (folder / "curves.csv").write_text(text.replace("36.0", ""))


def no_points(folder: Path) -> None:
    text = (folder / "curves.csv").read_text()
    (folder / "curves.csv").write_text(text.splitlines()[0] + "\n")


def half_a_picture(folder: Path) -> None:
    content = (folder / "figure3.png").read_bytes()
    (folder / "figure3.png").write_bytes(content[: len(content) // 2])


def no_picture(folder: Path) -> None:
    (folder / "figure3.png").write_text("no picture")


def no_pdf(folder: Path) -> None:
    (folder / "figure3.pdf").unlink()


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (broken_json, ["calibration.json", "Expecting value"]),
        (foreign, ["calibration.json", "program", "'calfsocket calibrate'"]),
        (no_fit, ["calibration.json", "fits"]),
        (odd_covariance, ["calibration.json", "relative_covariance", "square"]),
        (negative_variance, ["calibration.json", "relative_covariance", "negative"]),
        (no_curve, ["curves.csv", "no column 'separate_N_per_m'"]),
        (hole_in_a_curve, ["curves.csv", "'combined_table1_N_per_m'", "above 0"]),
        (no_points, ["curves.csv", "above 0"]),
        (half_a_picture, ["figure3.png", "cannot be read"]),
        (no_picture, ["figure3.png", "cannot be read"]),
        (no_pdf, ["figure3.pdf", "missing"]),
    ],
)
def test_a_broken_calibration_gets_one_line(spoil, says, tmp_path):
    spoil(write_calibration(tmp_path / "calibration"))
    with pytest.raises(InputError) as error:
        read_calibration(tmp_path)
    assert not isinstance(error.value, NoCalibration)
    assert "\n" not in str(error.value)
    for word in says:
        assert word in str(error.value)


def test_the_report_is_made_without_a_broken_calibration(tmp_path, caplog):
    broken_json(write_calibration(tmp_path / "calibration"))
    with caplog.at_level(logging.WARNING):
        missing = (added := guest(findings(tmp_path))).values["missing"]
    (record,) = caplog.records
    assert record.getMessage().startswith("the calibration is left out: ")
    assert missing.startswith("The calibration, figure 3, is left out: ")
    assert added.warnings == (missing,)
    assert board(tmp_path).why[CLAIMS].str.contains(r"calibration\.json").all()


def test_the_hand_made_curves_have_the_names_of_the_files():
    assert set(FORCE) == set(LABELS)
