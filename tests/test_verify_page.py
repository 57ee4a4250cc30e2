"""The verification page: sections that stay, checks and tables as a reader sees them."""

import sys
import types

import numpy as np
import pandas as pd
import pytest
from jinja2 import ChoiceLoader, DictLoader
from matplotlib.figure import Figure

from calfsocket.io.errors import InputError
from calfsocket.verification import page
from calfsocket.verification.report import Check, Section

TEMPLATE = """\
## Subject NAME

What {{ what }}.

{{ checks }}

{{ table("numbers", "Numbers.", 3) }}

In full: {{ file("NAME.csv") }}.

{{ figure("NAME_figure", "A line
of two.") }}
"""


@pytest.fixture
def subjects(monkeypatch):
    """Two custom subjects; the value of their one check can be set."""
    values = {"first": 1.0, "second": 2.0}

    def subject(name):
        def report(extra=0.0):
            frame = pd.DataFrame({"|name|": ["|a|"], "number": [1.23456], "count": [7]})
            return Section(
                [Check("error", values[name] + extra, 2.0, "by hand", "mm")],
                {f"{name}_figure": lambda axes: axes.plot([0, 1])},
                {"numbers": frame},
                {f"{name}.csv": frame},
                {"what": "it is"},
            )

        module = types.ModuleType(f"calfsocket.verification.{name}")
        module.report = report
        return module

    for name in values:
        monkeypatch.setitem(sys.modules, f"calfsocket.verification.{name}", subject(name))
    monkeypatch.setattr(page, "SUBJECTS", ("first", "second"))
    templates = {f"{name}.md": TEMPLATE.replace("NAME", name) for name in values}
    loader = ChoiceLoader([DictLoader(templates), page.TEMPLATES.loader])
    monkeypatch.setattr(page, "TEMPLATES", page.TEMPLATES.overlay(loader=loader))
    return values


def test_page_holds_checks_tables_figures_and_files(subjects, tmp_path):
    assert page.write_page(tmp_path, page.SUBJECTS)
    text = (tmp_path / "verification.md").read_text()
    assert "| error | 1 mm | ≤ 2 mm | passes | by hand |" in text
    assert r"| \|name\| | number | count |" in text
    assert r"| \|a\| | 1.23 | 7 |" in text
    assert "| [Subject first](#subject-first) | `first` | 1 | 1 |" in text
    assert "| all |  | 2 | 2 |" in text
    assert "\n\nWhat it is.\n\n| measured |" in text
    assert "\n\n*Numbers.*\n\n|" in text
    assert "![A line of two.](verification/first_figure.png)\n\n*A line of two.*\n" in text
    for name in subjects:
        assert (tmp_path / "verification" / f"{name}_figure.png").stat().st_size > 1000
        assert list(pd.read_csv(tmp_path / "verification" / f"{name}.csv").number) == [1.23456]


def test_one_subject_again_keeps_the_other(subjects, tmp_path):
    page.write_page(tmp_path, page.SUBJECTS)
    before = (tmp_path / "verification.md").read_text()
    subjects["first"] = subjects["second"] = 3.0
    assert not page.write_page(tmp_path, ["second"])
    after = (tmp_path / "verification.md").read_text()
    assert page.Part.all_of(after)["first"] == page.Part.all_of(before)["first"]
    assert "| error | 3 mm | ≤ 2 mm | **fails** | by hand |" in after
    assert after.index("## Subject first") < after.index("## Subject second")
    assert "| all |  | 2 | 1 |" in after


def test_a_missing_section_is_added_at_its_place(subjects, tmp_path):
    page.write_page(tmp_path, ["second"])
    page.write_page(tmp_path, ["first"])
    text = (tmp_path / "verification.md").read_text()
    assert text.index("## Subject first") < text.index("## Subject second")


def test_options_reach_their_subject(subjects, tmp_path):
    assert not page.write_page(tmp_path, ["first", "second"], {"first": {"extra": 5.0}})
    assert "| error | 6 mm |" in (tmp_path / "verification.md").read_text()


def test_unknown_subject_names_the_known_ones(subjects):
    assert page.chosen_subjects(["second", "first"]) == ["first", "second"]
    with pytest.raises(InputError, match="--only: unknown subject 'third'; use first, second"):
        page.chosen_subjects(["first", "third"])


@pytest.mark.parametrize(
    ("rule", "measured", "passes"),
    [
        ("at most", -1.9, True),
        ("at most", -2.1, False),
        ("at most", float("nan"), False),
        ("at least", 2.0, True),
        ("at least", 1.9, False),
        ("at least", float("nan"), False),
        ("exactly", 2.0, True),
        ("exactly", 3.0, False),
    ],
)
def test_rules_of_a_check(rule, measured, passes):
    assert Check("name", measured, 2.0, "by hand", rule=rule).passes is passes


def test_all_that_a_subject_has_must_be_shown(subjects, tmp_path, monkeypatch):
    monkeypatch.setattr(page.TEMPLATES, "loader", DictLoader({"first.md": "## Subject\n"}))
    with pytest.raises(
        ValueError, match=r"first.md: does not show first_figure, numbers, first.csv"
    ):
        page.write_page(tmp_path, ["first"])


@pytest.mark.parametrize(
    ("limits", "labels"),
    [
        ((0.8, 4.5), [1, 2, 3]),
        ((1.7e-5, 6e-5), [2e-5, 3e-5, 5e-5]),
        ((5e-7, 2.0), 10.0 ** np.arange(-6, 1)),
    ],
)
def test_logarithmic_axes_have_few_labels(limits, labels):
    axes = Figure().subplots()
    axes.set(xscale="log", xlim=limits)
    page.label(axes.xaxis)
    low, high = limits
    ticks = [t.get_position()[0] for t in axes.get_xticklabels(which="both") if t.get_text()]
    assert [tick for tick in ticks if low <= tick <= high] == pytest.approx(labels)


def test_every_subject_has_a_report_and_a_template():
    for subject in page.SUBJECTS:
        module = __import__(f"calfsocket.verification.{subject}", fromlist=["report"])
        assert callable(module.report)
        assert page.TEMPLATES.get_template(f"{subject}.md")
