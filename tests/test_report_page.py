"""The report's page in a real browser, its answer against numbers known by hand, its command."""

import base64
import json
import logging
import re
import subprocess
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import pytest
from report_text import Report, plain, written

from calfsocket import cli
from calfsocket.commands import report as command
from calfsocket.report import method, templates
from calfsocket.report.damage import DamageThresholds
from calfsocket.report.findings import Findings
from calfsocket.report.templates import commands
from calfsocket.report.write import values_of
from calfsocket.simulation import results
from calfsocket.study.study import Study
from conftest import WHY
from report_results import contact_on, limb, result, results_of

# Reports on the page from within it; added to a copy, since the page itself has no script.
PROBE = """<script>
window.onerror = message => { (window.errors ||= []).push(message) };
window.onload = () => {
  const root = document.documentElement;
  const images = [...document.images];
  const wide = [...document.querySelectorAll("body *")].filter(element =>
    !element.closest(".scroll") && element.getBoundingClientRect().right > root.clientWidth + 1);
  const result = {
    width: root.clientWidth,
    scroll: root.scrollWidth,
    wide: wide.map(element => element.outerHTML.slice(0, 80)),
    images: images.length,
    broken: images.filter(image => !image.complete || !image.naturalWidth).length,
    unnamed: images.filter(image => !image.alt).length,
    anchors: [...document.querySelectorAll('a[href^="#"]')].map(a => a.getAttribute("href"))
      .filter(name => !document.querySelector(name)),
    files: [...document.querySelectorAll('a:not([href^="#"])')].map(a => a.getAttribute("href")),
    claims: document.querySelectorAll(".claims li").length,
    answer: [...document.querySelectorAll("ol.answer li")].map(line => line.textContent),
    warnings: [...document.querySelectorAll(".warning li")].map(line => line.textContent),
    headings: [...document.querySelectorAll("h2")].map(heading => heading.textContent),
    tables: [...document.querySelectorAll("figure.table")].map(table => table.id),
    errors: window.errors || [],
  };
  const out = document.createElement("pre");
  out.id = "probe";
  out.textContent = btoa(unescape(encodeURIComponent(JSON.stringify(result))));
  document.body.append(out);
};
</script></head>"""


@dataclass(frozen=True)
class Seen:
    """What a browser saw: the probe's findings, and messages on its console."""

    found: dict
    console: list[str]


def browse(page: Path, width: int) -> Seen:
    """Open a page in a window of a width in pixels."""
    probed = page.with_name(f"probed-{width}.html")
    probed.write_text(page.read_text(encoding="utf-8").replace("</head>", PROBE), encoding="utf-8")
    command = [
        "chromium-headless-shell",
        "--no-sandbox",
        "--disable-gpu",
        "--enable-logging=stderr",
        "--hide-scrollbars",
    ]
    command += [f"--window-size={width},844", "--dump-dom", probed.as_uri()]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    probed.unlink()
    (encoded,) = re.findall(r'<pre id="probe">([^<]*)</pre>', done.stdout)
    console = [line for line in done.stderr.splitlines() if ":CONSOLE" in line]
    return Seen(json.loads(base64.b64decode(encoded)), console)


@pytest.fixture(scope="module")
def page(six_runs) -> Path:
    return six_runs / "report.html"


@pytest.fixture(scope="module")
def phone(page) -> Seen:
    return browse(page, 390)


def test_a_phone_scrolls_down_only(phone):
    assert phone.found["width"] == 390
    assert phone.found["scroll"] == 390
    assert phone.found["wide"] == []


def test_nothing_is_missing_and_nothing_complains(page, phone):
    assert phone.console == [] and phone.found["errors"] == []
    assert phone.found["images"] == 9
    assert phone.found["broken"] == phone.found["unnamed"] == 0
    assert phone.found["anchors"] == []
    for name in phone.found["files"]:
        assert (page.parent / name).is_file(), name
    assert phone.found["claims"] == 105
    assert len(phone.found["answer"]) == 10
    assert phone.found["headings"][0] == "The answer"
    assert phone.found["headings"][-2:] == ["Scoreboard", "How it was computed"]
    tables = [
        "table1",
        "levels",
        "table2",
        "table4",
        "table3",
        "table5",
        "pressure",
        "damage",
        "agreement",
    ]
    assert phone.found["tables"] == [*tables, "cases", "settings", "versions"]
    assert phone.found["warnings"] == []


def test_the_browser_notices_a_wide_page_and_a_lost_image(page, tmp_path):
    text = page.read_text(encoding="utf-8")
    broken = re.sub(
        r'src="data:image/webp;base64,....', 'src="data:image/webp;base64,AAAA', text, count=1
    )
    broken = broken.replace("<main>", '<main><p style="width: 500px">wide</p>')
    (tmp_path / "report.html").write_text(broken, encoding="utf-8")
    seen = browse(tmp_path / "report.html", 390)
    assert seen.found["scroll"] > 390
    assert len(seen.found["wide"]) == 1
    assert seen.found["broken"] == 1


def test_the_page_needs_no_network_and_no_script_and_is_light(page):
    text = page.read_text(encoding="utf-8")
    assert "<script" not in text
    assert not re.findall(r'(?:src|href)="(?:https?:)?//', text)
    assert not re.findall(r"url\(|@import", text)
    assert page.stat().st_size < 8e6


def test_the_answer_is_computed(six_runs):
    said = Report(plain((six_runs / "report.html").read_text(encoding="utf-8")), {}).answer
    # 5 kPa times 2, 1, 3, half as much again with Combined
    assert said["Contact pressure"].startswith(
        "On average 10.0, 5.00 and 15.0 kPa in TC, TSB and HS"
    )
    merging = said["Merging fascia and muscle"]
    assert "+50, +50 and +50 % and the largest by +50, +50 and +50 %" in merging
    assert "+134, +58 and +37 %" in merging
    assert said["Muscle"].startswith(
        "Loaded most in HS (Separate set): 99.9 % of its area stays below 22.9 kPa effective stress"
    )
    assert "(highest: soleus, " in said["Muscle"]
    assert "in muscle stress by +50 %" in said["Merging and the tissues"]
    assert "the highest effective stress stays in skin" in said["Merging and the tissues"]
    assert said["How far to trust it"].startswith("Every result is a stable equilibrium")
    trust = said["How far to trust it"]
    found = re.search(
        r"paper's (\d+) claims on results (\d+) hold, (\d+) do not hold and (\d+) cannot be "
        r"checked; (\d+) more",
        trust,
    )
    of, *counts, apart = map(int, found.groups())
    assert of == sum(counts) == 53 and of + apart == 105


def test_damage_is_said_where_it_is(tmp_path):
    fields = limb(1.0, shear=0.7)  # ln V of simple shear 0.7: LE12 = 2 e12 of about 65 %
    case = {("TC", "separate"): (fields, contact_on(fields, 10.0))}
    said = written(results_of(case, folder=tmp_path)).answer
    assert re.search(
        r"50 % shear strain in muscle is exceeded in 100 % of the tissue, and",
        said["Damage thresholds"],
    )


def test_one_run_and_a_failure_still_get_a_page(one_run):
    seen = browse(one_run / "report.html", 390)
    assert seen.console == []
    assert seen.found["images"] == 5
    assert seen.found["warnings"] == [
        f"HS_combined is left out: {WHY}",
        "HS_separate: unstable equilibrium: 2 negative modes",
    ]
    assert "Merging" not in " ".join(seen.found["answer"])
    assert "What merging fascia and muscle changes" not in seen.found["headings"]
    assert "not a stable equilibrium: negative modes in HS_separate (2)" in seen.found["answer"][-1]


def test_the_method_has_settings_in_words(six_results):
    findings = Findings(six_results)
    settings = method.tables(findings)[1]
    assert settings.shown["value"]["friction coefficient"] == "0.4"
    assert settings.shown["value"]["extrapolation from the last two steps"] == "no"
    assert method._text(None) == "as by default"  # LoadSteps().extrapolate
    assert method.in_words(findings, method.FIRST) == [
        "mesh size coarse", "socket floating", "friction 0.4"
    ]  # fmt: skip


def test_a_sweep_has_every_value_of_its_settings(tmp_path):
    fields = limb()
    cases = {}
    for value in (0.2, 0.6):
        key = (f"TC@friction={value}", "separate")
        about = {"changes": {"model.friction": value}}
        cases[key] = result(key, fields, contact_on(fields, 10.0), **about)
    findings = Findings(results_of(cases, folder=tmp_path))
    assert "friction 0.2 and 0.6" in method.in_words(findings, method.FIRST)
    settings = method.tables(findings)[1]
    assert settings.shown["value"]["friction coefficient"] == "0.2 and 0.6"
    assert values_of(findings)["several"] == "sockets at their points of the sweep"


def test_options_in_a_note_do_not_break_at_their_hyphens():
    code = commands("solve `calibrate --out F<1>`, with --mesh-error or b--c")
    assert code == (
        'solve <code>calibrate <span class="option">--out</span> F&lt;1&gt;</code>, with '
        '<span class="option">--mesh-error</span> or b--c'
    )
    assert ".option { white-space: nowrap; }" in templates.read("report.css")


def test_command_writes_the_report_with_the_thresholds_asked_for(monkeypatch, capsys):
    asked = []
    found = lambda folder: SimpleNamespace(shared=lambda _: folder)  # noqa: E731
    monkeypatch.setattr(results, "load_results", found)
    monkeypatch.setattr(command, "write", lambda _, *given: asked.append(given) or "page")
    assert cli.main(["report", "here", "--muscle-shear", "40", "--fascia-strain", "20"]) == 0
    assert asked == [(Path("here"), DamageThresholds(muscle_shear_pct=40, fascia_strain_pct=20))]
    assert capsys.readouterr().out == "page\n"


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["nowhere"], "nowhere: contains neither"),
        ([".", "--muscle-shear", "-1"], "muscle_shear_pct is -1"),
    ],
)
def test_bad_input_is_one_line(words, says, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["report", *words]) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert says in line
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("solved", [True, False])
def test_a_report_that_fails_does_not_change_the_exit_code(solved, tmp_path, monkeypatch, caplog):
    keys = {("TC", "separate"), ("TC", "combined")} if solved else set()

    def run(*_, then, **__):
        then(SimpleNamespace(folder=tmp_path / "r"))
        return keys

    monkeypatch.setattr(Study, "run", run)
    monkeypatch.setattr(command, "write", lambda *_: 1 / 0)
    with caplog.at_level(logging.WARNING):
        code = cli.main(["--out", str(tmp_path / "r"), "--sockets", "TC"])
    assert code == (0 if solved else 1)
    (record,) = caplog.records
    expected = f"the report in {tmp_path}/r could not be made: ZeroDivisionError: division by zero"
    assert record.getMessage() == expected


def test_no_report_is_written_when_none_is_wanted(tmp_path, monkeypatch):
    def run(study, *_, then, **__):
        then(SimpleNamespace(folder=tmp_path / "r"))
        return {case.key for case in study.plan.cases}

    monkeypatch.setattr(Study, "run", run)
    monkeypatch.setattr(command, "write", lambda *_: pytest.fail("written"))
    assert cli.main(["--out", str(tmp_path / "r"), "--no-report"]) == 0
