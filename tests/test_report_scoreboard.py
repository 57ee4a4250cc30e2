"""The scoreboard: a function for every claim, and verdicts that follow the numbers."""

from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest

from calfsocket.contact.parameters import Contact
from calfsocket.report import comparison, published
from calfsocket.report.changes import magnitude_change
from calfsocket.report.claims.evidence import Evidence
from calfsocket.report.claims.registry import CHECKS, claim
from calfsocket.report.claims.tolerances import about, about_change
from calfsocket.report.damage import Thresholds
from calfsocket.report.results import Results, read_results
from calfsocket.report.scoreboard import (
    FAILS,
    HOLDS,
    UNCHECKED,
    VERDICTS,
    counts,
    scoreboard,
    table,
)
from calfsocket.simulation.case import Settings
from report_results import ALL, limb_study, write_results


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Results:
    """Six cases of a round limb."""
    return read_results(write_results(tmp_path_factory.mktemp("six"), limb_study()))


@pytest.fixture(scope="module")
def board(results: Results) -> pd.DataFrame:
    return scoreboard(results).set_index("id")


def changed(results: Results, key: tuple[str, str], tissue: str, outcome: str, value: float):
    """Results with one value of the summary replaced."""
    summary = results.summary.copy()
    row = (
        (summary.socket == key[0])
        & (summary.material_set == key[1])
        & (summary.tissue == tissue)
        & (summary.outcome == outcome)
    )
    assert row.sum() == 1
    summary.loc[row, "value"] = value
    return replace(results, summary=summary)


# --- every claim


def test_every_claim_has_a_function_and_every_function_a_claim():
    assert set(CHECKS) == set(published.claims().id)
    assert len(CHECKS) == 105


def test_a_claim_has_one_function_only():
    with pytest.raises(ValueError, match="C001 has two functions"):
        claim("C001")(lambda e: None)


def test_every_claim_gets_a_verdict_with_numbers_or_a_reason(board):
    assert set(board.verdict) <= set(VERDICTS)
    checked = board[board.verdict != UNCHECKED]
    assert (checked.ours != "").all() and (checked.paper != "").all()
    assert (board.why[board.verdict != HOLDS] != "").all()
    assert (board.why[board.verdict == HOLDS] == "").all()
    assert sum(counts(board).values()) == len(board) == 105
    for text in (*board.ours, *board.why):
        assert "nan" not in text.split() and "\n" not in text


def test_scoreboard_as_a_table(results):
    made = table(scoreboard(results))
    assert made.shown.paper["C064"].endswith("(its own tables disagree)")
    assert "disagree" not in made.shown.paper["C065"]
    n = counts(made.data)
    tally = f"{n[HOLDS]} hold, {n[FAILS]} do not hold, {n[UNCHECKED]} cannot be checked"
    assert f"Of 105 claims of the paper: {tally}." in made.caption


def test_six_runs_alone_leave_the_calibration_unchecked(board):
    unchecked = board[board.verdict == UNCHECKED]
    assert unchecked.index.tolist() == ["C033", "C034", "C035", "C036", "C037"]


# --- the paper itself in the place of our results


@pytest.fixture(scope="module")
def paper(results: Results) -> Evidence:
    """Tables 2 to 5 and the contact pressures of the text as if they were our results."""
    summary = published.maxima().rename(columns={"printed": "value"})
    lateral = (summary.tissue == "muscle") & (summary.outcome == "shear_log_strain")
    region = lateral.map({True: "gastrocnemius_lateral_head", False: ""})
    contact = published.pressure()
    contact = contact[contact.outcome == "contact_pressure_max"]
    summary = pd.concat(
        [
            summary.assign(region=region, x_mm=0.0, y_mm=0.0),
            *(
                contact.assign(material_set=name, value=10 + (name == "combined") * 0.1 * rise)
                for name, rise in (("separate", 0), ("combined", contact.printed))
            ),
            *(
                contact.assign(material_set=name, value=5.0, outcome="contact_pressure_mean")
                for name in ("separate", "combined")
            ),
        ],
        ignore_index=True,
    )
    evidence = Evidence(replace(results, summary=summary))
    at = published.maxima().set_index(["tissue", "outcome", "socket", "material_set"]).printed
    rows = published.changes().rename(columns={"printed": "relative_change_pct"})
    cells = list(zip(rows.tissue, rows.outcome, rows.socket, strict=True))
    rows["separate"] = [at[(*cell, "separate")] for cell in cells]
    rows["combined"] = [at[(*cell, "combined")] for cell in cells]
    rows["magnitude_change_pct"] = [
        magnitude_change(*pair) for pair in zip(rows.separate, rows.combined, strict=True)
    ]
    evidence.__dict__["changes"] = rows.assign(region="")
    evidence.__dict__["maxima"] = comparison.maxima(evidence.results)
    return evidence


HOLD_IN_ITS_TABLES = (
    *(f"C{n:03d}" for n in (3, 6, 52, 70, 78, 79, 80, 81, 85, 86, 103)),
    *(f"C{n:03d}" for n in range(53, 64)),
    *(f"C{n:03d}" for n in (65, 66, 67, 68, 69, 71, 72, 73, 74, 75, 87, 88)),
    *(f"C{n:03d}" for n in (90, 91, 92, 94, 95, 96, 97)),
)


@pytest.mark.parametrize("identifier", HOLD_IN_ITS_TABLES)
def test_the_papers_tables_bear_out_its_text(paper, identifier):
    finding = CHECKS[identifier](paper)
    assert finding.holds, finding


@pytest.mark.parametrize("identifier", ["C064", "C089"])
def test_the_papers_tables_contradict_its_text_here(paper, identifier):
    finding = CHECKS[identifier](paper)
    assert not finding.holds
    assert "muscle is number 4, 9.44 %" in finding.why
    assert published.claims().set_index("id").own_tables[identifier].startswith("NO")


# --- verdicts follow numbers


def test_largest_tissue(results):
    key = ("TSB", "combined")
    up = changed(results, key, "skin", "effective_stress", 1e4)
    assert CHECKS["C056"](Evidence(up)).holds
    down = changed(results, key, "skin", "effective_stress", 1e-4)
    finding = CHECKS["C056"](Evidence(down))
    assert not finding.holds and "skin is number 5" in finding.why


def test_pressure_rises_or_falls(results):
    # pressures of the round limb: 1.5 times as high with Combined
    assert CHECKS["C071"](Evidence(results)).holds
    assert CHECKS["C073"](Evidence(results)).holds and not CHECKS["C072"](Evidence(results)).holds
    falls = changed(results, ("HS", "combined"), "skin", "contact_pressure_max", 14.0)
    finding = CHECKS["C071"](Evidence(falls))
    assert not finding.holds and "in HS the mean rises, the largest falls" in finding.why


def test_a_tie_is_no_ranking(results):
    # all pressures of the round limb rise by half
    assert not CHECKS["C075"](Evidence(results)).holds
    one = changed(results, ("TC", "combined"), "skin", "contact_pressure_max", 20.0)
    two = changed(one, ("HS", "combined"), "skin", "contact_pressure_max", 16.0)
    assert CHECKS["C075"](Evidence(two)).holds
    three = changed(two, ("TSB", "combined"), "skin", "contact_pressure_max", 20.0)
    assert "TSB > TC > HS" in CHECKS["C075"](Evidence(three)).why


def test_parameters_other_than_table_1_are_named(tmp_path):
    keys = (("TC", "separate"),)
    study = write_results(tmp_path, limb_study(keys), Settings(size="coarse", fascia_c10="tables"))
    board = scoreboard(read_results(study)).set_index("id")
    assert board.verdict["C024"] == FAILS and board.verdict["C023"] == HOLDS
    assert "C10 is 0.491 MPa" in board.why["C024"]


def test_other_choices_are_named(tmp_path):
    frictionless = Contact(friction=0.0)
    settings = Settings(contact=frictionless, ogden_form="as-printed")
    study = write_results(tmp_path, limb_study((("TC", "separate"),)), settings)
    board = scoreboard(read_results(study)).set_index("id")
    assert board.verdict["C002"] == board.verdict["C044"] == FAILS
    # the paper's tables refute its equation (1) whichever form is solved
    assert board.verdict["C038"] == FAILS and board.ours["C038"].startswith("form solved: as-print")
    assert board.verdict["C021"] == HOLDS


def test_muscle_beyond_its_threshold_in_one_socket_only(results):
    assert not CHECKS["C091"](Evidence(results)).holds  # in none
    key = ("HS", "separate")
    one = changed(results, key, "muscle", "shear_log_strain", -60.0)
    assert CHECKS["C091"](Evidence(one)).holds
    both = changed(one, ("TC", "separate"), "muscle", "shear_log_strain", 51.0)
    assert "above 50 %: TC, HS" in CHECKS["C091"](Evidence(both)).why


def test_own_thresholds_change_the_verdicts_on_damage(results):
    strict = Evidence(results, Thresholds(muscle_shear_pct=1.0, fascia_strain_pct=1.0))
    assert not CHECKS["C007"](strict).holds and not CHECKS["C093"](strict).holds
    assert CHECKS["C007"](Evidence(results)).holds


@pytest.mark.parametrize(
    "keys", [ALL[:1], ALL[:2], ALL[::2], ALL[1::2], ALL[4:]], ids=lambda keys: str(len(keys))
)
def test_fewer_runs_still_get_a_scoreboard(keys, tmp_path):
    results = read_results(write_results(tmp_path, limb_study(keys)))
    board = scoreboard(results).set_index("id")
    assert board.verdict["C048"] == UNCHECKED and board.why["C048"].startswith("needs ")
    assert board.verdict["C021"] == HOLDS
    case = {("TC", "separate"): "C053", ("HS", "combined"): "C058", ("HS", "separate"): "C057"}
    for key, identifier in case.items():
        assert (board.verdict[identifier] == UNCHECKED) == (key not in keys)


def test_the_limb_has_to_be_the_same_in_all_runs(tmp_path):
    cases = limb_study(ALL[:2])
    fields, line = cases["TC", "combined"]
    cases["TC", "combined"] = (replace(fields, points=1.001 * fields.points), line)
    finding = CHECKS["C102"](Evidence(read_results(write_results(tmp_path, cases))))
    assert not finding.holds and "TC_combined" in finding.why


def test_what_about_means():
    assert about(-80, 100) and about(125, 100) and not about(79, 100) and not about(126, 100)
    assert about_change(10, 24) and not about_change(10, 26)
    assert about_change(500, 459) and not about_change(-599, 599)


@pytest.mark.slow
def test_a_coarse_study(tmp_path):
    """The real thing: what must hold of the inputs does, and nothing is left without a verdict."""
    from calfsocket import cli

    out: Path = tmp_path / "results"
    words = ["--size", "coarse", "--sockets", "TSB", "--no-pictures", "--out", str(out)]
    assert cli.main(words) == 0
    board = scoreboard(read_results(out)).set_index("id")
    inputs = board[board.kind == "model-input"]
    assert set(inputs.index[inputs.verdict == FAILS]) == {"C009", "C015", "C016", "C038"}
    assert board.verdict["C050"] == board.verdict["C100"] == board.verdict["C055"] == HOLDS
