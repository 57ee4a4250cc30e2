"""Damage and tables of any study: by hand, and read back from what is written."""

import re
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest

from calfsocket.io.errors import InputError
from calfsocket.report import tables
from calfsocket.report.damage import DamageThresholds, damage
from calfsocket.report.findings import Findings
from calfsocket.report.table import Table, spread
from calfsocket.report.words import TOGETHER, change, measured, number
from report_results import contact_on_plate, plate, result, results_of, with_second

# --- damage


def sheared(x_max: float, shear: float):
    """Muscle and fascia in simple shear left of x_max, at rest elsewhere."""
    fields = plate()
    f = np.tile(np.eye(2), (len(fields.cells), 3, 1, 1))
    f[fields.points[fields.cells].mean(axis=1)[:, 0] < x_max, :, 0, 1] = shear
    tissues = {1: "muscle", 2: "fascia", 3: "skin"}
    region = np.where(np.arange(len(fields.cells)) == len(fields.cells) - 1, 3, fields.region)
    return replace(
        fields,
        deformation_gradient=f,
        region=region,
        region_names={1: "soleus", 2: "deep_fascia", 3: "skin"},
        region_tissues=tissues,
    )


def test_damage_area():
    """Simple shear by 0.6: stretches exp(+-asinh 0.3), so that e1 = 29.6 %.

    LE12 is the engineering shear 2 e1 / sqrt(1 + 0.3^2) = 56.6 %. 4 of 12 mm, 3 mm high.
    """
    line = contact_on_plate(lambda arc: 10 + 0 * arc)
    study = results_of({("HS", "separate"): (sheared(4, 0.6), line)})
    rows = damage(study, DamageThresholds()).set_index(["tissue", "quantity"])
    e1 = 100 * np.arcsinh(0.3)
    assert rows.level_pct["muscle", "shear_log_strain"] == pytest.approx(2 * e1 / np.sqrt(1.09))
    for strain in ("amp_log_strain", "tensile_log_strain"):
        assert rows.level_pct["fascia", strain] == pytest.approx(e1)
        assert rows["below_99.9_pct"]["fascia", strain] == pytest.approx(e1)
    assert rows.area_mm2.tolist() == pytest.approx([12, 12, 12, 12])
    assert rows.area_share_pct["muscle", "shear_log_strain"] == pytest.approx(100 / 3)
    assert (rows.region == ["soleus", *["deep_fascia"] * 3]).all()
    higher = damage(study, DamageThresholds(57.0, 57.0))
    assert (higher.area_mm2 == 0).all()


def test_damage_has_mesh_errors_by_the_second_mesh():
    """A shear of 0.57 on a second mesh of twice as many elements: changes count fourfold."""
    key = ("HS", "separate")
    line = contact_on_plate(lambda arc: 10 + 0 * arc)
    case = with_second(result(key, sheared(4, 0.6), line), result(key, sheared(5, 0.57), line))
    found = damage(results_of({key: case}), DamageThresholds(40.0))
    rows = found.set_index(["tissue", "quantity"])
    e1, other = (100 * np.arcsinh(shear / 2) for shear in (0.6, 0.57))
    for column in ("level_pct", "below_99.9_pct"):
        error = rows[f"{column}_mesh_error"]["fascia", "amp_log_strain"]
        assert error == pytest.approx(4 * (e1 - other))
    # 4 and 5 of 12 mm
    muscle = rows.loc[("muscle", "shear_log_strain")]
    assert muscle.area_share_pct_mesh_error == pytest.approx(4 * 100 / 12)
    assert muscle.area_mm2_mesh_error == pytest.approx(4 * 3)
    text = tables.damage(found).markdown().replace(TOGETHER, " ")
    assert "(12.0 ± 12.0* mm², 33.3 ± 33.3* %)" in text


@pytest.mark.parametrize("value", [0.0, -1.0, float("nan")])
def test_thresholds_are_checked(value):
    with pytest.raises(InputError, match=r"muscle_shear_pct is .*above 0"):
        DamageThresholds(muscle_shear_pct=value)


# --- tables


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (1120.0, "1120"),
        (17.0, "17.0"),
        (-0.0213, "\N{MINUS SIGN}0.0213"),
        (0.0, "0"),
        (-3.8e6, "\N{MINUS SIGN}3.8·10⁶"),
        (2e-5, "2.0·10⁻⁵"),
        (99.96, "100"),
        (float("nan"), ""),
    ],
)
def test_numbers_as_people_read_them(value, text):
    assert number(value) == text


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (18.6, 9e-6, "18.6 ± <0.05"),
        (5.25, 0.019, "5.25 ± 0.02"),
        (0.816, 0.03, "0.816 ± 0.030*"),
        (1755.0, 12.3, "1755 ± 12"),
        (1755.0, 0.2, "1755 ± <0.5"),
        (2e-5, 3e-7, "2.0·10⁻⁵ ± 3.0·10⁻⁷"),
        (17.0, float("nan"), "17.0"),
    ],
)
def test_mesh_errors_have_the_decimals_of_their_numbers(value, error, text):
    assert measured(value, error).replace(TOGETHER, " ") == text


def test_a_change_has_settled_where_its_error_is_small_beside_the_larger_number():
    pairs = [(34.2, 2.6), (34.2, 2.8), (-98.0, 0.1), (-98.0, 3.0), (3.4e5, 400.0), (0.0, 0.3)]
    texts = [change(*pair).replace(TOGETHER, " ") for pair in pairs]
    assert texts == ["+34 ± 3", "+34 ± 3*", "−98 ± <0.5", "−98 ± 3*", "+3.4·10⁵ ± 400", "0.0 ± 0.3"]  # noqa: RUF001


def test_changes_as_people_read_them():
    texts = [change(value) for value in (134.2, -5.04, -0.01, 0.0, 3.4e5, np.nan)]
    assert texts == ["+134", "\N{MINUS SIGN}5.0", "0.0", "0.0", "+3.4·10⁵", ""]


def test_spread_keeps_the_order_of_first_appearance():
    cells = pd.DataFrame({"row": ["b", "b", "a"], "column": ["z", "y", "z"]})
    wide = spread(cells, ["row"], ["column"], pd.Series(["1", "2", "3"]))
    assert wide.index.tolist() == ["b", "a"] and wide.columns.tolist() == ["z", "y"]
    assert wide.to_numpy().tolist() == [["1", "2"], ["3", ""]]


def test_tables_are_written_in_three_forms(six_results, tmp_path):
    made = [
        tables.laws(Findings(six_results).laws),
        tables.maxima(six_results),
        tables.damage(damage(six_results, DamageThresholds())),
    ]
    for table in made:
        table.write(tmp_path)
        assert len(pd.read_csv(tmp_path / f"{table.name}.csv")) == len(table.data)
        root = ElementTree.fromstring((tmp_path / f"{table.name}.html").read_text())
        assert root.tag == "figure" and "style" not in ElementTree.tostring(root, "unicode")
        body = root.find(".//tbody")
        assert body is not None and len(body.findall("tr")) == len(table.shown)
        lines = [
            x for x in (tmp_path / f"{table.name}.md").read_text().splitlines() if x[:1] == "|"
        ]
        assert len(lines) == 2 + len(table.shown)
        assert len({len(re.findall(r"(?<!\\)\|", line)) for line in lines}) == 1


def test_a_sweep_shows_what_settles_with_mesh_errors_and_has_the_rest_in_its_file(tmp_path):
    fields = plate()
    line = contact_on_plate(lambda arc: 10 + 0 * arc)
    key = ("A@f=0.2", "m")
    study = results_of({key: (fields, line)}, folder=tmp_path)
    columns = {"case": "A@f=0.2_m", "socket": key[0], "material_set": key[1], "model.friction": 0.2}
    numbers = {
        "contact_pressure_max_kPa": 12.5,
        "skin_effective_stress_below_99.9_kPa": 7.25,
        "skin_effective_stress_kPa": 9.0,
        "skin_share_of_contact_pressure_above_40_kPa_in_percent": 3.0,
        "skin_effective_stress_below_99.9_kPa_stance": 8.5,
    }
    errors = {f"{name}_mesh_error": 0.03 * value + 0.01 for name, value in numbers.items()}
    row = pd.DataFrame([columns | numbers | errors]).assign(status="solved")
    row.to_csv(tmp_path / "sweep.csv", index=False)
    table = tables.sweep(study)
    assert table.shown.columns.tolist() == [
        "model.friction",
        "largest contact pressure, kPa",
        "skin: effective stress, kPa",
        "skin: beyond 40 kPa contact pressure, %",
        "skin: effective stress, kPa, stance",
    ]
    shown = [text.replace(TOGETHER, " ") for text in table.shown.iloc[0]]
    assert shown[:3] == ["0.2", "12.5 ± 0.4*", "7.25 ± 0.23*"]
    assert table.data["skin_effective_stress_kPa_mesh_error"].tolist() == [0.28]


def test_html_is_escaped():
    data = pd.DataFrame({"a": ["x"]})
    shown = pd.DataFrame({"<b>": ["<i>&"]}, index=["1 < 2"])
    html = Table("t", data, shown, ("<note>",), "a < b", "c & d").html
    assert "<b>" not in html and "<i>" not in html and "<note>" not in html
    assert "a &lt; b" in html and "c &amp; d" in html
