"""What users write is data: it is never run, and escaped where it is shown."""

import json
import re
from pathlib import Path

import pandas as pd
import pytest

from calfsocket.paper.guest import guest
from calfsocket.paper.scoreboard import counts
from calfsocket.postprocess.thresholds import Threshold
from calfsocket.report import tables
from calfsocket.report.findings import Findings
from calfsocket.simulation.results import load_results
from conftest import write_small_report
from report_results import contact_on, limb, result, results_of, write_results

SOURCES = Path(__file__).resolve().parent.parent
TITLE = 'Walls <script>alert("1")</script> & more'
OWN = (("mine@friction=0.2", "soft"), ("mine@friction=0.4", "soft"))


def test_nothing_of_the_program_runs_or_unpickles_what_it_reads():
    """No eval, exec, pickle, marshal, shelve, yaml or allow_pickle in the sources."""
    word = re.compile(
        r"(?<![.\w])(?:eval|exec|compile|__import__)\(|\b(?:pickle|marshal|shelve|yaml|os\.system)\b|"
        r"allow_pickle=True|shell=True"
    )
    found = [
        f"{path.relative_to(SOURCES)}: {line.strip()}"
        for folder in ("calfsocket", "forms", "meshes")
        for path in sorted((SOURCES / folder).rglob("*.py"))
        for line in path.read_text(encoding="utf-8").splitlines()
        if word.search(line)
    ]
    assert found == []
    assert word.search("x = eval(text)") and word.search("import pickle")


def test_the_container_runs_unprivileged():
    lines = (SOURCES / "Dockerfile").read_text(encoding="utf-8").splitlines()
    last = max(number for number, line in enumerate(lines) if line.startswith("FROM "))
    (user,) = [line.split()[1] for line in lines[last:] if line.startswith("USER ")]
    assert user not in ("root", "0")


def custom_results(folder: Path, cases) -> Path:
    """Write results of custom cases, with a title and a sweep."""
    threshold = Threshold("contact_pressure", "skin", 9.0)
    made = {
        key: result(key, *case, changes={"model.friction": float(key[0].split("=")[1][:3])})
        for key, case in cases.items()
    }
    write_results(folder, made, thresholds=[threshold])
    run = json.loads((folder / "run.json").read_text())
    run["study"]["content"] = {"study": {"title": TITLE}}
    run["laws"]["soft"] = run["laws"]["separate"] | {
        "soleus": {"law": "hencky", "e": 0.03, "nu": 0.45}
    }
    (folder / "run.json").write_text(json.dumps(run))
    sockets, sets = zip(*made, strict=True)
    sweep = pd.DataFrame({"case": list(run["cases"]), "socket": sockets, "material_set": sets,
                          "p": "'=1+1", "status": "solved"})  # fmt: skip
    sweep.to_csv(folder / "sweep.csv", index=False)
    return folder


def solved(factor: float):
    fields = limb(factor, shear=0.02)
    return fields, contact_on(fields, 5 * factor)


@pytest.fixture(scope="module")
def custom(tmp_path_factory) -> Path:
    cases = {key: solved(1.0 + i) for i, key in enumerate(OWN)}
    return write_small_report(custom_results(tmp_path_factory.mktemp("custom"), cases))


def test_titles_are_escaped_in_the_page(custom):
    page = (custom / "report.html").read_text(encoding="utf-8")
    assert "<script" not in page
    assert "<h1>Walls &lt;script&gt;alert(&#34;1&#34;)&lt;/script&gt; &amp; more</h1>" in page


def test_a_study_without_the_papers_cases_is_not_compared_with_the_paper(custom):
    page = (custom / "report.html").read_text(encoding="utf-8")
    assert 'id="scoreboard"' not in page and "#scoreboard" not in page
    assert "the paper" not in re.search(r'<ol class="answer">.*?</ol>', page, re.S)[0]
    assert not (custom / "tables" / "scoreboard.csv").exists()
    assert not (custom / "tables" / "table2.csv").exists()
    assert sorted(path.stem for path in (custom / "tables").glob("*.csv")) == [
        "cases", "damage", "laws", "levels", "maxima", "settings", "sweep", "thresholds", "versions"
    ]  # fmt: skip
    headings = re.findall(r"<h2>(.*?)</h2>", page)
    assert headings == ["The answer", "The model", "The cases side by side", "Stress", "Strain",
                        "Contact pressure", "Damage thresholds", "How it was computed"]  # fmt: skip
    for word in (">nan<", ">None<", ">NaN<"):
        assert word not in page


def test_the_page_of_another_study_does_not_speak_of_the_paper(custom):
    page = (custom / "report.html").read_text(encoding="utf-8")
    text = re.sub(r"<style>.*?</style>|data:[^\"]*", "", page, flags=re.DOTALL)
    for word in ("paper", "calves", "TC", "TSB", "HS ", "laim", "coreboard"):
        assert word not in text.replace("calfsocket", ""), word


def test_its_tables_have_its_numbers(custom):
    results = load_results(custom)
    assert tuple(results) == OWN and guest(Findings(results)) is None
    assert (
        tables.laws(Findings(results).laws).shown.loc["soleus", "soft"]
        == "hencky: e 0.03 MPa, nu 0.45"
    )
    maxima = tables.maxima(results).shown
    assert list(maxima.columns) == list(OWN)
    assert maxima.loc[("skin", "mean contact pressure, kPa"), OWN[1]] == "10.0"
    thresholds = tables.thresholds(results).shown
    assert thresholds.loc[("skin", "contact pressure above 9 kPa"), OWN[0]] == "0"
    assert thresholds.loc[("skin", "contact pressure above 9 kPa"), OWN[1]] == "100"
    assert "model.friction = 0.2" in (custom / "report.html").read_text(encoding="utf-8")


def test_a_mixed_study_compares_only_the_papers_cases():
    key = ("TC", "separate")
    added = guest(Findings(results_of({key: solved(1.0), OWN[0]: solved(2.0)})))
    assert list(added.tables["table2"].shown.columns) == [("TC", "Separate")]
    assert not added.values["whole"]  # what the other cases need stays
    assert sum(counts(added.tables["scoreboard"].data).values()) == 53
