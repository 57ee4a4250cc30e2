"""A study beside its variants: what depends on a choice, and which claims do."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from report_text import written

from calfsocket.materials.material_set import MaterialSet
from calfsocket.paper import choices
from calfsocket.paper.scoreboard import HOLDS, UNCHECKED
from calfsocket.report import variants
from calfsocket.report.findings import Findings
from calfsocket.simulation.record import CaseRecord
from calfsocket.simulation.results import Results
from report_results import ALL, contact_on, limb, limb_study, result, results_of, with_second

HELD = {"model.socket_support": "outer-fixed"}
NO_FRICTION = {"model.friction": 0.0}


@pytest.fixture(scope="module")
def study() -> Results:
    """TC as base; without friction twice the stress in muscle; fixed, with one case alone."""
    base = limb_study(ALL[:2])
    cases = dict(base)
    for (socket, name), (fields, line) in base.items():
        muscle = np.where(fields.region == 2, 2.0, 1.0)[:, None, None]
        doubled = replace(fields, stress=muscle * fields.stress)
        key = (f"{socket}@frictionless", name)
        cases[key] = result(key, doubled, line, changes=NO_FRICTION)
    key = ("TC@socket-fixed", "separate")
    cases[key] = result(key, *base["TC", "separate"], changes=HELD)
    results = results_of(cases)
    other = MaterialSet.paper("separate", "tables")  # with another law of fascia, too
    laws = {"TC@frictionless_separate": other.tissue_laws()}
    results.run = results.run.model_copy(update={"laws": results.run.laws | laws})
    return results


def test_variants_by_name_the_base_first(study):
    found = variants.variants(study)
    assert list(found) == ["base", "frictionless", "socket-fixed"]
    assert [list(each) for each in found.values()] == [list(ALL[:2]), list(ALL[:2]), [ALL[0]]]
    assert variants.variants(study.only(ALL[:2])) == {}  # nothing beside the base
    others = [key for key in study if "@" in key[0]]
    assert variants.variants(study.only(others)) == {}  # a sweep without a base


def test_cases_are_shown_of_the_base_alone(study):
    assert list(Findings(study).results) == list(ALL[:2])


def test_a_variant_without_labels_is_named_by_its_changes(study):
    record = study.records["TC@socket-fixed", "separate"]
    plain = record.model_copy(update={"socket": "TC", "changes": HELD | NO_FRICTION})
    assert variants.name(plain) == "model.socket_support = outer-fixed, model.friction = 0.0"


@pytest.fixture(scope="module")
def tables(study) -> dict[str, pd.DataFrame]:
    made = [*variants.tables(study), *choices.tables(Findings(study))]
    return {table.name: table.data for table in made}


def test_what_is_changed_and_solved(tables):
    rows = tables["variants"].set_index("variant")
    assert rows.changes.tolist() == [
        "",
        "model.friction = 0.0",
        "model.socket_support = outer-fixed",
    ]
    assert rows.cases.tolist() == [2, 2, 1] and (rows.unstable_cases == 0).all()


def test_dependence_on_a_choice(tables):
    rows = tables["dependence"].set_index(["tissue", "quantity", "material_set", "variant"])
    muscle = rows.loc[("muscle", "effective_stress", "combined", "frictionless")]
    assert muscle["median"] == pytest.approx(2) and not muscle.robust
    assert muscle.low == pytest.approx(2) and muscle.high == pytest.approx(2)
    skin = rows.loc[("skin", "effective_stress", "separate", "frictionless")]
    assert skin["median"] == pytest.approx(1) and skin.robust
    assert "base" not in rows.index.get_level_values("variant")


def test_a_ratio_has_the_mesh_error_of_its_own_change():
    """Twice the stress without friction, 2.1 times on a mesh of twice as many elements."""
    base, other = ("TC", "separate"), ("TC@frictionless", "separate")
    cases = {}
    for key, factors in ((base, (1.0, 1.1)), (other, (2.0, 2.31))):
        about = {"changes": NO_FRICTION} if key == other else {}
        fields = [limb(factor) for factor in factors]
        pair = [result(key, each, contact_on(each, 10.0), **about) for each in fields]
        cases[key] = with_second(*pair)
    table = variants.tables(results_of(cases))[1]
    rows = table.data.set_index(["tissue", "quantity"])
    for quantity in ("effective_stress", "effective_stress_below_99.9"):
        row = rows.loc[("muscle", quantity)]
        assert row["median"] == pytest.approx(2) and not row.robust
        assert row.median_mesh_error == pytest.approx(4 * 0.1)
    text = table.markdown().replace("\N{NO-BREAK SPACE}", " ")
    said = "×2.00 ± 0.40* (2.00 ± 0.40* to 2.00 ± 0.40*) ↕"  # noqa: RUF001
    assert f"| muscle, effective stress, Separate | {said} |" in text
    # one without a second mesh
    cases[base] = replace(cases[base], second=None)
    assert "median_mesh_error" not in variants.tables(results_of(cases))[1].data


def test_the_ratio_of_a_level_counts_with_the_next_one():
    """Without friction 0.9 % of the muscle have 100 kPa more, and on the second mesh 1.1 %."""
    base, other = ("TC", "separate"), ("TC@frictionless", "separate")
    cases = {}
    for key, shares in ((base, (0.0, 0.0)), (other, (0.9, 1.1))):
        about = {"changes": NO_FRICTION} if key == other else {}
        pair = []
        for share in shares:
            fields = limb(1.0)
            muscle = fields.cells_of("muscle")
            area = fields.gauss_area[muscle].sum(axis=1)
            more = muscle[100 * np.cumsum(area) <= share * area.sum()]
            stress = fields.stress.copy()
            stress[more, :, 0] += 100
            pair.append(
                result(key, replace(fields, stress=stress), contact_on(fields, 10.0), **about)
            )
        cases[key] = with_second(*pair)
    rows = variants.quantities(variants.variants(results_of(cases)))
    rows = rows[rows.variant != "base"].set_index(["tissue", "quantity"])
    assert rows.ratio_mesh_error["muscle", "effective_stress_below_99.9"] > 1
    assert not any(name.endswith("_99") for _, name in rows.index)


def test_a_median_of_ratios_moves_no_more_than_its_ratios():
    rows = {"tissue": "fat", "quantity": "q", "material_set": "m", "variant": "v"}
    table = pd.DataFrame({**rows, "ratio": [1.0, 1.3], "ratio_mesh_error": [0.2, 0.1]})
    found = variants.dependence(table).iloc[0]
    assert found["median_mesh_error"] == pytest.approx(0.15)
    assert found["low_mesh_error"] == pytest.approx(0.2)
    assert found["high_mesh_error"] == pytest.approx(0.1)
    table.loc[0, "ratio_mesh_error"] = np.nan
    assert np.isnan(variants.dependence(table).iloc[0]["median_mesh_error"])


def test_claims_under_each_variant(tables):
    counted = tables["verdicts_by_variant"].set_index("variant")
    assert counted.index.tolist() == ["base", "frictionless", "socket-fixed"]
    assert (counted.sum(axis=1) == 53).all()
    rows = tables["claims_by_variant"].set_index("id")
    assert len(rows) == 105
    # friction is an input of the study, and is as the variant has it
    assert rows.loc["C044", ["base", "frictionless"]].tolist() == [HOLDS, "does not hold"]
    assert not rows.same["C044"] and rows.same["C023"]
    # so are its laws: C10 of fascia
    assert rows.loc["C024", ["base", "frictionless"]].tolist() == [HOLDS, "does not hold"]
    assert rows["socket-fixed"]["C054"] == UNCHECKED


def test_tables_as_they_are_read(study):
    made = {
        table.name: table for table in [*variants.tables(study), *choices.tables(Findings(study))]
    }
    assert "C023" not in made["claims_by_variant"].markdown()
    assert "×2.00 (2.00 to 2.00) ↕" in made["dependence"].markdown()  # noqa: RUF001


def test_the_page_counts_all_cases_and_says_what_is_left_out(study, tmp_path):
    """The base is shown, its variants are summed up; one that failed is in no number."""
    key = ("TC@socket-fixed", "combined")
    failed = CaseRecord(
        socket=key[0], material_set=key[1], of=ALL[1], changes=HELD, status="failed", message="why"
    )
    run = study.run.model_copy(update={"cases": study.run.cases | {failed.name: failed}})
    records = {**study.records, key: failed}
    report = written(Results(tmp_path, run, records, lambda record: study[record.key]))
    for sentence in (
        "TC Separate and Combined. Mesh size coarse",
        "TC@socket-fixed_combined is left out: why",
        "Cases: those that reached their full load.",
        "Of the base; variants change some.",
        "Magnitude under the variant over that of the base; of tissues, of what 99.9 % of the area",
        "↕: it moves by more than 10 %. The CSV file",
        "Every result is a stable equilibrium",
    ):
        assert sentence in report.text, sentence
    # friction is no choice of the paper alone, as these two variants are not all of its own
    assert "None of these choices" not in report.text and "16 studies" not in report.text
