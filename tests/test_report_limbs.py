"""Reports of limbs that are not the calf: every sentence is about the limb and study at hand."""

import re
from pathlib import Path

import pandas as pd
import pytest
from other_limbs import FOREARM, STUMP, THIGH, study_of
from report_text import Report, written

from calfsocket.materials.laws import Hencky
from calfsocket.materials.material_set import MaterialSet
from calfsocket.paper.guest import papers_cases
from calfsocket.simulation.record import CaseRecord
from calfsocket.simulation.results import load_results
from report_results import ALL, checks, contact_on, limb_study, results_of
from tiny_study import tiny_study

OF_THE_CALF = (
    "calf", "calves", "marrow", "medullary", "by hand", "tibia", "fibula", "soleus", "leg",
    "weight", "generic",
)  # fmt: skip
OF_THE_PAPER = (
    "paper", "paper's", "scoreboard", "claim", "claims", "Table 1", "equation (3)", "TC", "TSB",
    "HS", "total contact", "hydrostatic", "merging", "merging and", "calibration", "printed",
)  # fmt: skip


def assert_silent(report: Report, *words: str) -> None:
    """Hold that neither the page nor a figure has one of some words."""
    text = report.everything.replace("calfsocket", "")
    for word in (*OF_THE_CALF, *OF_THE_PAPER, *words):
        found = re.search(rf".*\b{re.escape(word)}(?!\w).*", text, re.IGNORECASE)
        assert found is None, f"{word}: {found[0]}"


def assert_says(report: Report, *sentences: str) -> None:
    for sentence in sentences:
        assert sentence in report.text, sentence


# --- a left thigh of four tissues in one socket that is as large as it, one material set


@pytest.fixture(scope="module")
def thigh(tmp_path_factory) -> Report:
    soft = MaterialSet.paper("separate").replace(fat=Hencky(e=0.01, nu=0.45))
    sets = [MaterialSet("soft", "separate", soft.laws)]
    folder = tmp_path_factory.mktemp("thigh")
    return written(study_of(THIGH, {("brim", "soft"): 0.0}, sets, folder, gap=0.0))


def test_a_thigh_is_silent_on_what_it_has_not(thigh):
    lacks = ("fascia", "vessel", "vessels", "sockets", "Separate", "Combined", "AMP is", "runs")
    assert_silent(thigh, *lacks)


def test_a_thigh_says_what_it_is(thigh):
    assert_says(
        thigh,
        "What a socket does inside a limb\n",
        "brim soft. Mesh size coarse, socket floating, friction 0.4.\n",
        "Left thigh above the knee, in plane strain.",
        "It is fixed at the inner boundary of the femur.",
        "Every tissue has its own law.",
        "The unloaded section of a left limb, seen from above, with all regions",
        "Limb and socket before contact. The socket encloses no less area than the limb. PNG",
        "LE12 (engineering shear, +x medial and +y anterior)",
        "The run and its checks. The run raises the load",
    )
    assert thigh.answer == {
        "Contact pressure": "None: the socket does not press on the limb.",
        "Damage thresholds": "50 % shear strain in muscle is not exceeded.",
        "How far to trust it": "The result is a stable equilibrium (no negative modes).",
    }


def test_the_figures_of_a_thigh(thigh):
    for words in thigh.drawn.values():
        sides = [word for word in words if word in ("medial", "anterior", "lateral", "posterior")]
        assert sides == ["medial", "anterior", "lateral", "posterior"]  # +x, +y, -x, -y
    overlays = thigh.drawn["figure2_overlays"]
    assert "encloses as much area" in overlays and not any("overlap" in each for each in overlays)
    assert not any("lines of equal" in each for each in thigh.drawn["figure5_contact_pressure"])


# --- a forearm of one bone without fascia in two sockets, both material sets; a case has stopped


@pytest.fixture(scope="module")
def forearm(tmp_path_factory) -> Report:
    sets = [MaterialSet.paper("separate"), MaterialSet.paper("combined")]
    cases = {("A", "separate"): 1.0, ("A", "combined"): 1.2, ("B", "separate"): 2.0}
    fields = FOREARM.fields(1.0, FOREARM.radius - 1)
    reached = checks(fields, contact_on(fields, 1.0, FOREARM.radius))
    stopped = CaseRecord(
        socket="B",
        material_set="combined",
        of=("B", "combined"),
        status="failed",
        message="no equilibrium nearby",
        checks=reached.model_copy(update={"load": 0.4}),
    )
    failed = {("B", "combined"): stopped}
    folder = tmp_path_factory.mktemp("forearm")
    return written(study_of(FOREARM, cases, sets, folder, failed=failed, friction=0.0))


def test_a_forearm_is_silent_on_what_it_has_not(forearm):
    assert_silent(forearm, "fascia", "Coulomb", "friction against", "share a law")


def test_a_forearm_says_what_it_is(forearm):
    assert_says(
        forearm,
        "What sockets do inside a limb\n",
        "A Separate and Combined; B Separate. Mesh size coarse, socket floating, friction 0.\n",
        "Right forearm with one bone, in plane strain.",
        "It is fixed at the inner boundary of the radius.",
        "Every tissue has its own law.",
        "Every socket encloses less area than the limb. The overlap is released in small steps",
        "Nitsche contact without friction",
    )
    said = forearm.answer
    assert said["Vessels"].startswith(
        "Loaded most in B (Separate set): 99.9 % of their area stays below 4.52 kPa effective"
    )
    # what Combined changes is its muscle, in the one socket that has both sets
    change = "Changes the mean contact pressure by +20 % and the largest by +20 % in A."
    assert said["Combined instead of Separate"] == change
    tissues = said["Combined instead of Separate, in the tissues"]
    assert tissues.startswith(
        "What 99.9 % of a tissue's area stays below changes: in muscle stress by +20 %, shear"
        " strain by +21 %. Of all"
    )


def test_a_case_that_stopped_is_left_out_with_its_load_and_reason(forearm):
    line = "B_combined is left out, stopped at load 0.4 of 1: no equilibrium nearby"
    assert_says(forearm, line)
    assert "B Combined" not in forearm.text
    assert forearm.drawn["figure3_effective_stress"].count("stopped at load 0.4 of 1") == 1


# --- a limb of unknown axes with other names, no muscle, in six sockets


@pytest.fixture(scope="module")
def stump(tmp_path_factory) -> Report:
    own = MaterialSet.paper("separate").replace(fascia=Hencky(e=0.3, nu=0.45))
    law = {"padding": Hencky(e=0.02, nu=0.45)}
    sets = [MaterialSet("mine", "separate", own.laws, law)]
    cases = {(f"s{i}", "mine"): 0.5 + 0.25 * i for i in range(6)}
    return written(study_of(STUMP, cases, sets, tmp_path_factory.mktemp("stump")))


def test_a_stump_is_silent_on_what_it_has_not(stump):
    directions = ("lateral", "anterior", "medial", "posterior", "left", "right")
    assert_silent(stump, "muscle", "vessel", "Separate", "Combined", "damage risk", *directions)


def test_a_stump_says_what_it_is(stump):
    assert_says(
        stump,
        "\n6 cases. Mesh size coarse",
        "A limb whose axes nobody wrote down, in plane strain.",
        "It is fixed at the inner boundary of the shaft.",
        "Padding: a region with a law of its own.",
        "LE12 (engineering shear, in the section's x and y)",
    )
    said = stump.answer
    assert said["Contact pressure"].startswith("On average 5.00 kPa in s0 to 17.5 kPa in s5, of 6 ")
    assert "(highest: padding, +x +y side)" in said["Fat"]
    assert said["Damage thresholds"] == "27 % AMP strain in fascia is exceeded in no run."
    assert "+x" in stump.drawn["figure1_regions"]


# --- an oval limb that is really solved


@pytest.fixture(scope="module")
def solved(tmp_path_factory) -> Report:
    folder = tmp_path_factory.mktemp("oval") / "results"
    assert tiny_study(folder, ("B",)).run()
    return written(load_results(folder))


def test_a_solved_study_of_another_limb(solved):
    assert_silent(solved, "fascia", "vessel", "fat", "sockets")
    assert_says(
        solved,
        "An oval limb, in plane strain. It is fixed at the inner boundary of the bone.",
        "The socket encloses less area than the limb. The overlap",
    )
    found = re.fullmatch(
        r"On average ([\d.]+) kPa, at most ([\d.]+) kPa, \+x \+y side \(nothing but the socket "
        r"loads the limb\)\.",
        solved.answer["Contact pressure"],
    )  # socket B presses at 40 degrees
    assert found and 0 < float(found[1]) < float(found[2])
    assert set(solved.answer) == {
        "Contact pressure", "Skin", "Muscle", "Damage thresholds", "How far to trust it"
    }  # fmt: skip


# --- the paper


def test_the_paper_is_that_of_its_limb_sockets_and_sets():
    cases = limb_study(ALL[:2])
    of_paper = results_of(cases)
    assert papers_cases(of_paper) == list(ALL[:2])
    run = of_paper.run

    def changed(**what) -> list:
        of_paper.run = run.model_copy(update=what)
        return papers_cases(of_paper)

    assert changed(limb=THIGH.limb) == []
    mine = run.sockets | {"TC": run.sockets["TC"].model_copy(update={"base": 0.6})}
    assert changed(sockets=mine) == []
    soft = run.laws["separate"] | {"fat": Hencky(e=0.01, nu=0.45)}
    assert changed(laws=run.laws | {"separate": soft}) == [ALL[1]]
    tables = MaterialSet.paper("separate", "tables", "as-printed").tissue_laws()
    assert changed(laws=run.laws | {"separate": tables}) == list(ALL[:2])  # left open by the paper


def test_one_of_its_sockets_has_no_order(tmp_path):
    report = written(results_of(limb_study(ALL[:1]), folder=tmp_path))
    assert_says(
        report, "the socket was shaped by hand.", "What a prosthetic socket does inside a calf"
    )
    assert "order of the sockets" not in report.text


@pytest.mark.parametrize(("name", "other"), [("separate", "Combined"), ("combined", "Separate")])
def test_one_of_its_material_sets_has_a_report(name, other, tmp_path):
    """Its run.json has the laws of that set alone."""
    results = results_of(limb_study([key for key in ALL if key[1] == name]), folder=tmp_path)
    results.run = results.run.model_copy(update={"laws": {name: results.run.laws[name]}})
    report = written(results)
    assert f"needs the {other} set, which is not in this study" in report.text
    table = pd.read_csv(tmp_path / "tables" / "table1.csv")
    own = {"muscle", "fascia"} if name == "separate" else {"muscle and fascia, combined"}
    common = {"skin", "fat", "vessel", "bone", "socket"}
    assert set(table.material) == own | common and table.ours.notna().all()
    assert other not in "".join(report.answer.values())


def test_the_words_that_are_missed_are_in_the_papers_report(six_runs):
    """The list above would find them."""
    text = Path(six_runs / "report.html").read_text(encoding="utf-8")
    for word in ("calf", "by hand", "tibia", "fibula", "soleus", "paper", "scoreboard", "fascia"):
        assert word in text
