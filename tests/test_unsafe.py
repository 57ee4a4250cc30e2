"""What users write is data: it is never run, and escaped where it is shown."""

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from calfsocket.report import tables
from calfsocket.report.figures import draw_figures
from calfsocket.report.figures.panels import MOST_ABREAST, MOST_SHOWN, abreast
from calfsocket.report.results import read_results
from calfsocket.report.scoreboard import scoreboard
from calfsocket.report.writing import write_report
from report_results import contact_on, limb, write_results

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


def own_results(folder: Path, cases) -> Path:
    """Write results of cases of one's own, with a title and a sweep."""
    write_results(folder, cases)
    run = json.loads((folder / "run.json").read_text())
    run["study"] = {"content": {"study": {"title": TITLE}}}
    run["laws"]["soft"] = run["laws"]["separate"] | {
        "soleus": {"law": "hencky", "e": 0.03, "nu": 0.45}
    }
    for name, entry in run["cases"].items():
        if "@" in name:
            entry["changes"] = {"model.friction": float(name.split("=")[1][:3])}
    (folder / "run.json").write_text(json.dumps(run))
    summary = pd.read_csv(folder / "summary.csv")
    first = summary[summary.quantity == "contact_pressure_mean"]
    beyond = first.assign(quantity="share_of_contact_pressure_above_9_kPa", value=12.5, unit="%")
    pd.concat([summary, beyond]).to_csv(folder / "summary.csv", index=False)
    sweep = pd.DataFrame({"case": list(run["cases"]), "socket": "s", "material_set": "m",
                          "p": "'=1+1", "status": "solved"})  # fmt: skip
    sweep.to_csv(folder / "sweep.csv", index=False)
    return folder


def solved(factor: float):
    fields = limb(factor, shear=0.02)
    return fields, contact_on(fields, 5 * factor)


@pytest.fixture(scope="module")
def own(tmp_path_factory) -> Path:
    cases = {key: solved(1.0 + i) for i, key in enumerate(OWN)}
    folder = own_results(tmp_path_factory.mktemp("own"), cases)
    write_report(folder)
    return folder


def test_titles_are_escaped_in_the_page(own):
    page = (own / "report.html").read_text(encoding="utf-8")
    assert "<script" not in page
    assert "<h1>Walls &lt;script&gt;alert(&#34;1&#34;)&lt;/script&gt; &amp; more</h1>" in page


def test_a_study_without_the_papers_cases_is_not_held_against_the_paper(own):
    page = (own / "report.html").read_text(encoding="utf-8")
    assert 'id="scoreboard"' not in page and "#scoreboard" not in page
    assert "the paper" not in re.search(r'<ol class="answer">.*?</ol>', page, re.S)[0]
    assert not (own / "tables" / "scoreboard.csv").exists()
    assert not (own / "tables" / "table2.csv").exists()
    assert sorted(path.stem for path in (own / "tables").glob("*.csv")) == [
        "damage", "laws", "maxima", "sweep", "thresholds"
    ]  # fmt: skip
    headings = re.findall(r"<h2>(.*?)</h2>", page)
    assert headings == ["The answer", "The model", "The cases side by side", "Stress", "Strain",
                        "Contact pressure", "Damage thresholds", "How it was computed"]  # fmt: skip
    for word in (">nan<", ">None<", ">NaN<"):
        assert word not in page


def test_tables_of_its_own_hold_its_numbers(own):
    results = read_results(own)
    assert results.cases == OWN and results.of_paper is None
    made = {table.name: table for table in tables.build(results)}
    assert made["laws"].shown.loc["soleus", "soft"] == "hencky: e 0.03 MPa, nu 0.45"
    maxima = made["maxima"].shown
    assert list(maxima.columns) == list(OWN)
    assert maxima.loc[("skin", "mean contact pressure, kPa"), OWN[1]] == "10.0"
    thresholds = made["thresholds"].shown
    assert thresholds.loc[("skin", "contact pressure above 9 kPa"), OWN[0]] == "12.5"
    assert "model.friction = 0.2" in (own / "report.html").read_text(encoding="utf-8")


def test_a_mixed_study_compares_only_the_papers_cases(tmp_path):
    key = ("TC", "separate")
    folder = own_results(tmp_path, {key: solved(1.0), OWN[0]: solved(2.0)})
    results = read_results(folder)
    assert results.of_paper.cases == (key,)
    assert results.of_paper.sockets == ("TC",) and set(results.of_paper.summary.socket) == {"TC"}
    made = {table.name: table for table in tables.build(results)}
    assert list(made["table2"].shown.columns) == [("TC", "Separate")]
    assert {"laws", "maxima", "pressure"} <= made.keys()
    assert made["damage"].shown.shape[1] == 2
    assert len(scoreboard(results)) == 105


def test_many_sockets_are_drawn_in_rows_and_the_rest_is_said(tmp_path):
    sockets = [f"s{i:02d}" for i in range(14)]
    assert [len(row) for row in abreast(sockets)] == [MOST_ABREAST] * 3
    one = solved(1.0)
    folder = own_results(tmp_path, {(name, "soft"): one for name in sockets[:5]})
    for figure in draw_figures(read_results(folder)):
        assert figure.png.is_file()
    assert MOST_SHOWN == 12 and np.isfinite(one[1].pressure_kPa).all()
