"""The scoreboard: every claim has a check, and verdicts follow the numbers."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from jinja2 import meta

from calfsocket.paper import published
from calfsocket.paper.claims import found, given
from calfsocket.paper.claims.rules import (
    ENVIRONMENT,
    INPUT,
    PAPER,
    RESULT,
    RULES,
    holds,
    in_words,
)
from calfsocket.paper.claims.tolerances import about, about_change
from calfsocket.paper.evidence import Evidence
from calfsocket.paper.scoreboard import (
    FACTS,
    FAILS,
    HOLDS,
    UNCHECKED,
    VERDICTS,
    check,
    counts,
    parts,
    scoreboard,
    table,
)
from calfsocket.report.changes import magnitude_change
from calfsocket.report.damage import DamageThresholds
from calfsocket.simulation.results import Results, load_results
from calfsocket.study.document import ModelTable
from report_results import ALL, limb_study, results_of, with_summary, with_value


def evidence(results: Results, thresholds: DamageThresholds | None = None) -> Evidence:
    return Evidence(results, thresholds or DamageThresholds())


@pytest.fixture(scope="module")
def board(six_results) -> pd.DataFrame:
    return scoreboard(evidence(six_results)).set_index("id")


def verdict(identifier: str, results: Results) -> str:
    return check(identifier, evidence(results))["verdict"]


# --- every claim


def test_every_claim_has_a_check_and_every_fact_a_claim():
    checks = published.checks()
    assert checks.index.tolist() == published.claims().id.tolist() and len(checks) == 105
    assert set(checks.rule) == set(RULES)
    templates = [*checks.ours, *checks.why, *(f"{{{{ {fact} }}}}" for fact in checks.fact)]
    used = {
        name
        for text in templates
        for name in meta.find_undeclared_variables(ENVIRONMENT.parse(text))
    }
    assert set(FACTS) <= used
    facts = [
        name
        for module in (found, given)
        for name, each in vars(module).items()
        if name in FACTS and each.__module__ == module.__name__
    ]
    assert len(facts) == len(FACTS)  # none has two functions


def test_what_claims_judge():
    """Claims that restate an input or the paper's own numbers say why they are counted apart."""
    checks = published.checks()
    assert checks.judges.value_counts().to_dict() == {RESULT: 53, INPUT: 49, PAPER: 3}
    assert ((checks.given == "") == (checks.judges == RESULT)).all()
    kind = published.claims().set_index("id").kind
    # what the paper itself calls an input of its model, and three more: two thresholds and an area
    assert set(checks.index[checks.judges == INPUT]) == {
        *kind.index[kind == "model-input"], "C007", "C032", "C093"
    }  # fmt: skip


def test_every_claim_gets_a_verdict_with_numbers_or_a_reason(board):
    assert set(board.verdict) <= set(VERDICTS) and len(board) == 105
    checked = board[board.verdict != UNCHECKED]
    assert (checked.ours != "").all() and (checked.paper != "").all()
    assert (board.why[board.verdict != HOLDS] != "").all()
    assert (board.why[board.verdict == HOLDS] == "").all()
    for text in (*board.ours, *board.why):
        assert "nan" not in text.split() and "\n" not in text


def test_scoreboard_as_a_table_counts_results_first(six_results):
    board = scoreboard(evidence(six_results))
    made, said = table(board), parts(board)
    assert made.shown.paper["C064"].endswith("(its own tables disagree)")
    assert "disagree" not in made.shown.paper["C065"]
    n = counts(made.data)
    assert sum(n.values()) == 53
    tally = f"{n[HOLDS]} hold, {n[FAILS]} do not hold and {n[UNCHECKED]} cannot be checked"
    assert said[0] == f"53 claims on results ({tally})"
    assert said[1].startswith("49 claims that only restate an input (")
    assert said[2] == "3 claims that the paper's own numbers decide (3 hold)"


def test_six_runs_alone_leave_the_calibration_unchecked(board):
    unchecked = board[board.verdict == UNCHECKED]
    assert unchecked.index.tolist() == ["C033", "C034", "C035", "C036", "C037"]


@pytest.mark.parametrize(
    ("rule", "value", "expected", "agrees"),
    [
        ("same", 0.4 * (1 + 1e-7), "0.4", True), ("same", 0.4001, "0.4", False),
        ("about", (-80.0, 125.0), "100", True), ("about", (100.0, 79.0), "100", False),
        ("about", np.nan, "100", False), ("between", 0.03, "0.03 0.06", True),
        ("between", 0.061, "0.03 0.06", False), ("below", (1.0, 50.0), "50", False),
        ("is", 6, "6", True), ("none", [], "", True), ("none", ["x"], "", False),
        ("true", False, "", False), ("about, a change", -599, "599", False),
        ("above", {"a": 1.0, "b": 2.0}, "0.5", True), ("above", [1.0, 0.0], "0.5", False),
    ],
)  # fmt: skip
def test_rules(rule, value, expected, agrees):
    assert holds(rule, value, expected) is agrees


def test_facts_in_words():
    known = {
        "value": 3.14159,
        "each": {"TC": -5.04, "HS": 134.2},
        "wrong": ["a", "b"],
        "no": [],
        "nested": {"TC": {"x": 1.0}, "HS": {"x": 2.0}},
        "force": np.array([0.5, 0.25]),
    }
    text = in_words(
        "{{ value | f('n') }} mm; {{ each | f('c %') }}; {{ wrong }}; {{ no }}; "
        "{{ nested | f('n') }}; {{ force | f('r') }} N; {{ value | f('.1f') }}",
        known,
    )
    assert text == (
        "3.14 mm; TC \N{MINUS SIGN}5.0 %, HS +134 %; a, b; none; TC: x 1.00; HS: x 2.00; "
        "0.250 to 0.500 N; 3.1"
    )


def test_what_about_means():
    assert about(-80, 100) and about(125, 100) and not about(79, 100) and not about(126, 100)
    assert about_change(10, 24) and not about_change(10, 26)
    assert about_change(500, 459) and not about_change(-599, 599)


# --- the paper itself in the place of our results


@pytest.fixture(scope="module")
def paper(six_results) -> Evidence:
    """Tables 2 to 5 and the contact pressures of the text as if they were our results."""
    summary = published.maxima().rename(columns={"printed": "value"})
    lateral = (summary.tissue == "muscle") & (summary.quantity == "shear_log_strain")
    region = lateral.map({True: "gastrocnemius_lateral_head", False: ""})
    contact = published.pressure()
    contact = contact[contact.quantity == "contact_pressure_max"]
    summary = pd.concat(
        [
            summary.assign(region=region, x_mm=0.0, y_mm=0.0),
            *(
                contact.assign(material_set=name, value=10 + (name == "combined") * 0.1 * rise)
                for name, rise in (("separate", 0), ("combined", contact.printed))
            ),
            *(
                contact.assign(material_set=name, value=5.0, quantity="contact_pressure_mean")
                for name in ("separate", "combined")
            ),
        ],
        ignore_index=True,
    )
    made = evidence(with_summary(six_results, summary))
    at = published.maximum()
    rows = published.changes().rename(columns={"printed": "relative_change_pct"})
    cells = list(zip(rows.tissue, rows.quantity, rows.socket, strict=True))
    rows["separate"] = [at[(*cell, "separate")] for cell in cells]
    rows["combined"] = [at[(*cell, "combined")] for cell in cells]
    rows["magnitude_change_pct"] = [
        magnitude_change(*pair) for pair in zip(rows.separate, rows.combined, strict=True)
    ]
    made.__dict__["changes"] = rows.assign(region="")  # which are computed once
    return made


HOLD_IN_ITS_TABLES = (
    *(f"C{n:03d}" for n in (3, 6, 52, 70, 78, 79, 80, 81, 85, 86, 103)),
    *(f"C{n:03d}" for n in range(53, 64)),
    *(f"C{n:03d}" for n in (65, 66, 67, 68, 69, 71, 72, 73, 74, 75, 87, 88)),
    *(f"C{n:03d}" for n in (90, 91, 92, 94, 95, 96, 97)),
)


@pytest.mark.parametrize("identifier", HOLD_IN_ITS_TABLES)
def test_the_papers_tables_bear_out_its_text(paper, identifier):
    found = check(identifier, paper)
    assert found["verdict"] == HOLDS, found


@pytest.mark.parametrize("identifier", ["C064", "C089"])
def test_the_papers_tables_contradict_its_text_here(paper, identifier):
    found = check(identifier, paper)
    assert found["verdict"] == FAILS
    assert "muscle is number 4, 9.44 %" in found["why"]
    assert published.claims().set_index("id").paper_tables[identifier].startswith("NO")


# --- verdicts follow numbers


def test_largest_tissue(six_results):
    key = ("TSB", "combined")
    up = with_value(six_results, key, "skin", "effective_stress", 1e4)
    assert verdict("C056", up) == HOLDS
    down = with_value(six_results, key, "skin", "effective_stress", 1e-4)
    found = check("C056", evidence(down))
    assert found["verdict"] == FAILS and "skin is number 5" in found["why"]


def test_pressure_rises_or_falls(six_results):
    # pressures of the round limb: 1.5 times as high with Combined
    verdicts = [verdict(name, six_results) for name in ("C071", "C073", "C072")]
    assert verdicts == [HOLDS, HOLDS, FAILS]
    falls = with_value(six_results, ("HS", "combined"), "skin", "contact_pressure_max", 14.0)
    found = check("C071", evidence(falls))
    assert found["verdict"] == FAILS
    assert "in HS the mean rises, the largest falls" in found["why"]


def test_a_tie_is_no_ranking(six_results):
    # all pressures of the round limb rise by half
    assert verdict("C075", six_results) == FAILS
    one = with_value(six_results, ("TC", "combined"), "skin", "contact_pressure_max", 20.0)
    two = with_value(one, ("HS", "combined"), "skin", "contact_pressure_max", 16.0)
    assert verdict("C075", two) == HOLDS
    three = with_value(two, ("TSB", "combined"), "skin", "contact_pressure_max", 20.0)
    assert "TSB > TC > HS" in check("C075", evidence(three))["why"]


def test_choices_of_the_study_are_named():
    model = ModelTable(fascia_c10="tables", ogden_form="as-printed", friction=0.0)
    board = scoreboard(evidence(results_of(limb_study(ALL[:1]), model))).set_index("id")
    assert board.verdict["C024"] == FAILS and board.verdict["C023"] == HOLDS
    assert "C10 is 0.491 MPa" in board.why["C024"]
    assert board.verdict["C002"] == board.verdict["C044"] == FAILS
    # the paper's tables refute its equation (1) whichever form is solved
    assert board.verdict["C038"] == FAILS and board.ours["C038"].startswith("form solved: as-print")
    assert board.verdict["C021"] == HOLDS


def test_a_study_with_loads_after_donning_is_judged_without_them(six_results):
    assert check("C008", evidence(six_results))["ours"].startswith("mid-calf; no input of the")
    loaded = six_results.only(six_results)
    loaded.records = {
        key: record.model_copy(update={"states": ("push", "night")})
        for key, record in six_results.records.items()
    }
    found = check("C008", evidence(loaded))
    assert found["verdict"] == HOLDS
    assert found["ours"] == "mid-calf; the donned socket, before its loads (push, night)"


def test_muscle_beyond_its_threshold_in_one_socket_only(six_results):
    assert verdict("C091", six_results) == FAILS  # in none
    one = with_value(six_results, ("HS", "separate"), "muscle", "shear_log_strain", -60.0)
    assert verdict("C091", one) == HOLDS
    both = with_value(one, ("TC", "separate"), "muscle", "shear_log_strain", 51.0)
    assert "above 50 %: TC, HS" in check("C091", evidence(both))["why"]


def test_other_thresholds_change_the_verdicts_on_damage(six_results):
    strict = evidence(six_results, DamageThresholds(muscle_shear_pct=1.0, fascia_strain_pct=1.0))
    assert check("C007", strict)["verdict"] == check("C093", strict)["verdict"] == FAILS
    assert verdict("C007", six_results) == HOLDS


@pytest.mark.parametrize(
    "keys", [ALL[:1], ALL[:2], ALL[::2], ALL[1::2], ALL[4:]], ids=lambda keys: str(len(keys))
)
def test_fewer_runs_still_get_a_scoreboard(keys, six_results):
    board = scoreboard(evidence(six_results.only(keys))).set_index("id")
    assert board.verdict["C048"] == UNCHECKED and board.why["C048"].startswith("needs ")
    assert board.verdict["C021"] == HOLDS
    case = {("TC", "separate"): "C053", ("HS", "combined"): "C058", ("HS", "separate"): "C057"}
    for key, identifier in case.items():
        assert (board.verdict[identifier] == UNCHECKED) == (key not in keys)


def test_the_limb_has_to_be_the_same_in_all_runs():
    cases = limb_study(ALL[:2])
    fields, line = cases["TC", "combined"]
    cases["TC", "combined"] = (replace(fields, points=1.001 * fields.points), line)
    found = check("C102", evidence(results_of(cases)))
    assert found["verdict"] == FAILS and "TC_combined" in found["why"]


@pytest.mark.slow
def test_a_coarse_study(tmp_path):
    """The real thing: what must hold of the inputs does, and nothing is left without a verdict."""
    from calfsocket import cli

    out = tmp_path / "results"
    words = ["--size", "coarse", "--sockets", "TSB", "--no-pictures", "--no-report"]
    assert cli.main([*words, "--out", str(out)]) == 0
    board = scoreboard(evidence(load_results(out))).set_index("id")
    inputs = board[board.judges == INPUT]
    assert set(inputs.index[inputs.verdict == FAILS]) == {"C009", "C015", "C016", "C038"}
    assert board.verdict["C050"] == board.verdict["C100"] == board.verdict["C055"] == HOLDS
