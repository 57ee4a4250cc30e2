"""The paper's numbers, Tables 1 to 5 and Figures 5, 6 and 8 beside ours."""

import numpy as np
import pandas as pd
import pytest
from matplotlib.patches import PathPatch

from calfsocket.paper import comparison, figures, published
from calfsocket.paper.evidence import STRAINS, Evidence
from calfsocket.paper.tables import tables
from calfsocket.report.words import TIMES, TOGETHER, measured, number
from calfsocket.study.document import ModelTable
from report_results import ALL, contact_on, limb, limb_study, result, results_of, with_second


@pytest.fixture(scope="module")
def evidence(six_results) -> Evidence:
    return Evidence(six_results)


# --- the paper's numbers


def test_printed_numbers_are_complete():
    assert [len(published.table(n)) for n in published.TABLES] == [21, 60, 90, 60, 90]
    at = published.maxima().set_index(["tissue", "quantity", "socket", "material_set"]).printed
    # spot checks against the tables of the text
    assert at["fascia", "effective_stress", "HS", "separate"] == 1120
    assert at["muscle", "shear_log_strain", "HS", "separate"] == -84.1
    assert at["vessel", "amp_log_strain", "HS", "combined"] == -37
    assert set(published.maxima().material_set) == {"separate", "combined"}
    # misprints stay as printed and have a note
    odd = published.table(3)
    odd = odd[odd.note != ""].set_index(["tissue", "quantity"]).printed
    assert odd["muscle", "effective_stress"] == 23 and odd["fascia", "shear_stress"] == -99


# --- comparison


def test_table_1_in_the_papers_units(evidence):
    rows = comparison.materials(evidence.parameters).set_index(["material", "symbol"])
    assert rows.ours["skin", "D1"] == pytest.approx(9.12e-8)
    assert rows.ours["bone", "E"] == pytest.approx(11.8)
    np.testing.assert_allclose(rows.ratio, 1, rtol=1e-9)


def test_table_1_of_other_choices():
    study = results_of(limb_study(ALL[:1]), ModelTable(fascia_c10="tables"))
    laws = Evidence(study).parameters
    rows = comparison.materials(laws).set_index(["material", "symbol"])
    assert rows.ratio["fascia", "C10"] == pytest.approx(0.1)


def test_ratios_are_of_magnitudes(evidence):
    rows = evidence.maxima
    assert len(rows) == 120
    np.testing.assert_allclose(rows.ratio, (rows.ours / rows.paper).abs())
    assert (rows.sign_flip == (rows.ours * rows.paper < 0)).all()
    cells = pd.DataFrame({"ours": [5.0, np.nan], "paper": [0.0, 1.0], "note": ""})
    nothing = comparison.compare(cells, [])
    assert nothing.ratio.isna().all() and not nothing.sign_flip.any()


def test_agreement_takes_the_farthest_from_one():
    cells = pd.DataFrame(
        {
            "tissue": "fat",
            "socket": ["TC", "TSB", "HS"],
            "quantity": "shear_stress",
            "ratio": [0.2, 1.0, 4.0],
            "sign_flip": [True, False, False],
        }
    )
    (row,) = comparison.agreement(cells, ["tissue"]).itertuples()
    # 1/0.2 = 5 is farther than 4
    assert (row.median_ratio, row.worst_ratio, row.worst_at) == (1.0, 0.2, "TC shear_stress")
    assert row.sign_flips == 1 and row.cells == 3


def test_the_papers_tables_have_mesh_errors(tmp_path):
    """Stress of TC: 2 kPa Separate, 3 Combined; on the second mesh 1 % and 3 % more."""
    cases = {}
    for name, factors in (("separate", (2.0, 2.02)), ("combined", (3.0, 3.09))):
        first, second = ((limb(each), contact_on(limb(each), 5 * each)) for each in factors)
        key = ("TC", name)
        cases[key] = with_second(result(key, *first), result(key, *second))
    evidence = Evidence(results_of(cases, folder=tmp_path))
    made = tables(evidence)
    row = made["table2"].data.query("tissue == 'fat' and quantity == 'effective_stress'")
    np.testing.assert_allclose(row.ours_mesh_error, row.ours * [0.04, 0.12])
    said = made["table2"].markdown().replace(TOGETHER, " ")
    assert f"{measured(row.ours.iloc[1], 0.12 * row.ours.iloc[1])} (".replace(TOGETHER, " ") in said
    change = made["table3"].data.query("tissue == 'fat' and site == 'max_both'")
    # 3/2 and 3.09/2.02
    error = 4 * 100 * (3.09 / 2.02 - 1.5)
    mises = change[change["quantity"] == "effective_stress"]
    np.testing.assert_allclose(mises.ours_mesh_error, error)
    np.testing.assert_allclose(mises.ours_magnitude_mesh_error, error)
    assert "| +50 ± 12* |" in made["pressure"].markdown().replace(TOGETHER, " ")
    agreement = made["agreement"].data.query("tissue == 'fat' and material_set == 'combined'")
    cells = made["table2"].data.query("tissue == 'fat' and material_set == 'combined'")
    assert 0 < agreement.median_ratio_mesh_error.item() <= (0.12 * cells.ratio).max()


def test_change_of_magnitude_stands_beside_equation_3(evidence):
    rows = evidence.compared_changes.set_index(["tissue", "quantity", "socket", "site"])
    assert len(rows) == 180
    vessels = rows.loc[("vessel", "shear_log_strain", "HS", "max_both")]
    # the paper: -8.0 to -28.2 %: "-253 %" is a rise by 252.5 %
    assert vessels.paper == -253 and vessels.paper_magnitude == pytest.approx(252.5)
    muscle = rows.loc[("muscle", "effective_stress", "HS", "max_both")]
    assert muscle.ours == pytest.approx(muscle.ours_magnitude) == pytest.approx(50, rel=1e-6)


# --- tables


@pytest.mark.parametrize(
    "keys", [ALL, ALL[:1], ALL[1::2], ALL[2:4]], ids=["all", "one", "set", "TSB"]
)
def test_tables_of_the_solved_cases(keys, six_results):
    made = tables(Evidence(six_results.only(keys)))
    both = {"table3", "table5"} if keys in (ALL, ALL[2:4]) else set()
    assert set(made) == {"table1", "table2", "table4", "agreement", "pressure", *both}
    assert len(made["table2"].data) == 10 * len(keys)
    for name, table in made.items():
        assert table.name == name and table.markdown() and table.html


def test_the_cell_of_table_2(evidence):
    made = tables(evidence)
    cell = made["table2"].shown.loc[("fat", "shear stress"), ("HS", "Separate")]
    row = (
        made["table2"]
        .data.query(
            "tissue == 'fat' and quantity == 'shear_stress' and socket == 'HS' "
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


# --- figures


def bars_and_marks(figure) -> tuple[list[float], list[float]]:
    paths = [bars for axes in figure.axes for bars in axes.patches if type(bars) is PathPatch]
    corners = [bars.get_path().vertices.reshape(-1, 5, 2) for bars in paths]  # of closed squares
    bars = [float(y) for corner in corners for y in corner[:, 1, 1]]
    marks = [
        mark
        for axes in figure.axes
        for line in axes.lines
        if line.get_marker() == "D"
        for mark in line.get_ydata()
    ]
    return bars, marks


def test_bars_are_ours_and_marks_are_the_papers(evidence):
    table, drawn = evidence.compared_changes, figures.figures(evidence)
    maxima = table[table.site == "max_both"]
    bars, marks = bars_and_marks(drawn["changes_of_maxima"]())
    assert sorted(bars) == pytest.approx(sorted(maxima.ours))
    assert sorted(marks) == pytest.approx(sorted(maxima.paper))
    assert max(marks) == 459  # the paper's largest: muscle, effective stress, TC
    assert min(marks) == -599
    sites = table[(table.site != "max_both") & table["quantity"].isin(STRAINS)]
    bars, marks = bars_and_marks(drawn["strain_at_sites"]())
    assert sorted(bars) == pytest.approx(sorted([*sites.ours, *sites.ours]))  # in two ranges
    assert min(marks) == -15900


def test_equation_3_and_the_change_of_magnitude_are_not_mixed_up():
    """Shear stress from -s to -1.5 s: equation (3) says -50 %, the magnitude rises by 50 %."""
    cases = {}
    for name, factor in (("separate", -1.0), ("combined", -1.5)):
        fields = limb(factor)
        cases["TC", name] = (fields, contact_on(fields, -10 * factor))
    drawn = figures.figures(Evidence(results_of(cases)))
    equation_3, _ = bars_and_marks(drawn["changes_of_maxima"]())
    magnitude, _ = bars_and_marks(drawn["changes_of_magnitude"]())
    assert np.count_nonzero(np.isclose(equation_3, -50)) == 5
    assert np.count_nonzero(np.isclose(magnitude, -50)) == 0
    assert np.count_nonzero(np.isclose(magnitude, 50)) == 10  # effective stress, too


def test_one_set_alone_has_no_figures(six_results):
    assert figures.figures(Evidence(six_results.only(ALL[1::2]))) == {}
