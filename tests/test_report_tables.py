"""Damage, comparison and tables: by hand, and read back from what is written."""

import re
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest

from calfsocket.io.errors import InputError
from calfsocket.report import comparison, published, tables
from calfsocket.report.damage import Thresholds, damage, gauss_areas, tensile_strain
from calfsocket.report.results import Results, read_results
from calfsocket.report.table import Table, change, number, spread
from calfsocket.report.tables import TIMES, TOGETHER
from calfsocket.simulation.case import Settings
from report_results import ALL, contact_on_plate, limb_study, plate, write_results


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Results:
    return read_results(write_results(tmp_path_factory.mktemp("six"), limb_study()))


# --- damage


def sheared(fields, x_max: float, shear: float, tissue: str):
    """Simple shear left of x_max, nothing elsewhere; muscle may be renamed to another tissue."""
    f = np.tile(np.eye(2), (len(fields.cells), 3, 1, 1))
    f[fields.points[fields.cells].mean(axis=1)[:, 0] < x_max, :, 0, 1] = shear
    return replace(
        fields,
        deformation_gradient=f,
        region_tissues=fields.region_tissues | {1: tissue},
    )


@pytest.mark.parametrize(
    ("tissue", "outcome", "limit"),
    [
        ("muscle", "shear_log_strain", {"muscle_shear_pct": 50.0}),
        ("fascia", "amp_log_strain", {"fascia_strain_pct": 27.0}),
        ("fascia", "tensile_log_strain", {"fascia_strain_pct": 27.0}),
        ("fascia", "shear_log_strain", {"fascia_strain_pct": 27.0}),
    ],
)
def test_damage_area(tissue, outcome, limit, tmp_path):
    # simple shear by 0.6: stretches exp(+-asinh 0.3), so that e1 = 29.6 %, and LE12 is the
    # engineering shear 2 e1 / sqrt(1 + 0.3^2) = 56.6 %
    fields = sheared(plate(), 4, 0.6, tissue)
    line = contact_on_plate(lambda arc: 10 + 0 * arc)
    study = read_results(write_results(tmp_path, {("HS", "separate"): (fields, line)}))

    def row(thresholds: Thresholds) -> pd.Series:
        rows = damage(study, thresholds)
        return rows[(rows.tissue == tissue) & (rows.outcome == outcome)].iloc[0]

    held = row(Thresholds(**limit))
    e1 = 100 * np.arcsinh(0.3)
    level = 2 * e1 / np.sqrt(1.09) if outcome == "shear_log_strain" else e1
    assert held.level_pct == pytest.approx(level, rel=1e-9)
    # 4 of 12 mm, 3 mm high
    assert held.area_mm2 == pytest.approx(12) and held.area_share_pct == pytest.approx(100 / 3)
    ((key, _),) = limit.items()
    assert row(Thresholds(**{key: level + 0.1})).area_mm2 == 0


def test_compression_is_no_tension(tmp_path):
    squeezed = replace(
        plate(),
        deformation_gradient=np.tile(np.diag([0.7, 1.0]), (144, 3, 1, 1)),
        region_tissues={1: "fascia", 2: "skin"},
    )
    line = contact_on_plate(lambda arc: 10 + 0 * arc)
    study = read_results(write_results(tmp_path, {("HS", "separate"): (squeezed, line)}))
    rows = damage(study).set_index(["tissue", "outcome"])
    # e11 = ln 0.7 = -35.7 %, e22 = 0
    assert rows.level_pct["fascia", "amp_log_strain"] == pytest.approx(-100 * np.log(0.7))
    assert rows.area_share_pct["fascia", "amp_log_strain"] == 100
    assert rows.level_pct["fascia", "tensile_log_strain"] == pytest.approx(0, abs=1e-9)
    assert rows.area_share_pct["fascia", "tensile_log_strain"] == 0


def test_gauss_areas_add_up():
    assert gauss_areas(plate()).sum() == pytest.approx(72)
    assert tensile_strain(np.array([0.1, -0.3, 0.0])) == pytest.approx(0.1)


@pytest.mark.parametrize("value", [0.0, -1.0, float("nan")])
def test_thresholds_are_checked(value):
    with pytest.raises(InputError, match=r"muscle_shear_pct is .*above 0"):
        Thresholds(muscle_shear_pct=value)


# --- the paper's numbers


def test_printed_numbers_are_complete():
    assert [len(published.table(n)) for n in published.TABLES] == [21, 60, 90, 60, 90]
    at = published.maxima().set_index(["tissue", "outcome", "socket", "material_set"]).printed
    # spot checks against the tables of the text
    assert at["fascia", "effective_stress", "HS", "separate"] == 1120
    assert at["muscle", "shear_log_strain", "HS", "separate"] == -84.1
    assert at["vessel", "amp_log_strain", "HS", "combined"] == -37
    assert set(published.maxima().material_set) == {"separate", "combined"}
    # misprints stay as printed and have a note
    odd = published.table(3)
    odd = odd[odd.note != ""].set_index(["tissue", "outcome"]).printed
    assert odd["muscle", "effective_stress"] == 23 and odd["fascia", "shear_stress"] == -99


# --- comparison


def test_table_1_in_the_papers_units(results):
    rows = comparison.materials(results).set_index(["material", "symbol"])
    assert rows.ours["skin", "D1"] == pytest.approx(9.12e-8)
    assert rows.ours["bone", "E"] == pytest.approx(11.8)
    np.testing.assert_allclose(rows.ratio, 1, rtol=1e-9)


def test_table_1_of_other_choices(tmp_path):
    settings = Settings(fascia_c10="tables")
    study = read_results(write_results(tmp_path, limb_study(ALL[:1]), settings))
    rows = comparison.materials(study).set_index(["material", "symbol"])
    assert rows.ratio["fascia", "C10"] == pytest.approx(0.1)


def test_ratios_are_of_magnitudes(results):
    rows = comparison.maxima(results)
    assert len(rows) == 120
    np.testing.assert_allclose(rows.ratio, (rows.ours / rows.paper).abs())
    assert (rows.sign_flip == (rows.ours * rows.paper < 0)).all()
    nothing = comparison.compare(5.0, 0.0)
    assert np.isnan(nothing["ratio"]) and not nothing["sign_flip"]


def test_agreement_takes_the_farthest_from_one():
    cells = pd.DataFrame(
        {
            "tissue": "fat",
            "socket": ["TC", "TSB", "HS"],
            "outcome": "shear_stress",
            "ratio": [0.2, 1.0, 4.0],
            "sign_flip": [True, False, False],
        }
    )
    (row,) = comparison.agreement(cells, ["tissue"]).itertuples()
    # 1/0.2 = 5 is farther than 4
    assert (row.median_ratio, row.worst_ratio, row.worst_at) == (1.0, 0.2, "TC shear_stress")
    assert row.sign_flips == 1 and row.cells == 3


def test_change_of_magnitude_stands_beside_equation_3(results):
    rows = comparison.changes(results).set_index(["tissue", "outcome", "socket", "site"])
    assert len(rows) == 180
    vessels = rows.loc[("vessel", "shear_log_strain", "HS", "max_both")]
    # the paper: -8.0 to -28.2 %: "-253 %" is a rise by 252.5 %
    assert vessels.paper == -253 and vessels.paper_magnitude == pytest.approx(252.5)
    muscle = rows.loc[("muscle", "effective_stress", "HS", "max_both")]
    assert muscle.ours == pytest.approx(muscle.ours_magnitude) == pytest.approx(50, rel=1e-6)


# --- tables


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (1120.0, "1120"),
        (17.0, "17.0"),
        (-0.0213, "\N{MINUS SIGN}0.0213"),
        (0.0, "0"),
        (-3.8e6, "\N{MINUS SIGN}3.8·10^6"),
        (2e-5, "2.0·10^\N{MINUS SIGN}5"),
        (99.96, "100"),
        (float("nan"), ""),
    ],
)
def test_numbers_as_people_read_them(value, text):
    assert number(value) == text


def test_changes_as_people_read_them():
    texts = [change(value) for value in (134.2, -5.04, -0.01, 0.0, 3.4e5, np.nan)]
    assert texts == ["+134", "\N{MINUS SIGN}5.0", "0.0", "0.0", "+3.4·10^5", ""]


def test_spread_keeps_the_order_of_first_appearance():
    cells = pd.DataFrame({"row": ["b", "b", "a"], "column": ["z", "y", "z"]})
    wide = spread(cells, ["row"], ["column"], pd.Series(["1", "2", "3"]))
    assert wide.index.tolist() == ["b", "a"] and wide.columns.tolist() == ["z", "y"]
    assert wide.to_numpy().tolist() == [["1", "2"], ["3", ""]]


def test_tables_are_written_in_three_forms(results, tmp_path):
    made = tables.build(results)
    names = ["table1", "table2", "table3", "table4", "table5", "agreement", "pressure", "damage"]
    assert [table.name for table in made] == names
    folder = tables.write(replace(results, folder=tmp_path), made)
    assert folder == tmp_path / "tables"
    assert {path.name for path in folder.iterdir()} == {
        f"{name}.{ending}" for name in names for ending in ("csv", "md", "html")
    }
    for table in made:
        read = pd.read_csv(folder / f"{table.name}.csv")
        assert len(read) == len(table.data)
        root = ElementTree.fromstring((folder / f"{table.name}.html").read_text())
        assert root.tag == "figure" and "style" not in ElementTree.tostring(root, "unicode")
        body = root.find(".//tbody")
        assert body is not None and len(body.findall("tr")) == len(table.shown)
        lines = [x for x in table.markdown().splitlines() if x.startswith("|")]
        assert len(lines) == 2 + len(table.shown)
        assert len({len(re.findall(r"(?<!\\)\|", line)) for line in lines}) == 1


def test_the_cell_of_table_2(results):
    made = {table.name: table for table in tables.build(results)}
    cell = made["table2"].shown.loc[("fat", "shear stress"), ("HS", "Separate")]
    row = (
        made["table2"]
        .data.query(
            "tissue == 'fat' and outcome == 'shear_stress' and socket == 'HS' "
            "and material_set == 'separate'"
        )
        .iloc[0]
    )
    flip = "⇄" if row.sign_flip else ""
    assert (
        cell
        == f"{number(row.ours)} (\N{MINUS SIGN}40.0†,{TOGETHER}{TIMES}{number(row.ratio)}{flip})"
    )
    assert any("impossible" in note and "HS, Separate" in note for note in made["table2"].notes)


@pytest.mark.parametrize("keys", [ALL[:1], ALL[1::2], ALL[2:4]], ids=["one", "one set", "TSB"])
def test_tables_of_fewer_runs(keys, tmp_path: Path):
    study = read_results(write_results(tmp_path, limb_study(keys)))
    made = {table.name: table for table in tables.build(study)}
    assert len(made["table2"].data) == 10 * len(keys)
    assert ("table3" in made) == (keys == ALL[2:4])
    assert made["pressure"].markdown() and made["damage"].html()


def test_html_is_escaped():
    data = pd.DataFrame({"a": ["x"]})
    shown = pd.DataFrame({"<b>": ["<i>&"]}, index=["1 < 2"])
    html = Table("t", "a < b", "c & d", data, shown, ("<note>",)).html()
    assert "<b>" not in html and "<i>" not in html and "<note>" not in html
    assert "a &lt; b" in html and "c &amp; d" in html
