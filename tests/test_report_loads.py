"""The report of a study with a liner and stages of loading: true of the study at hand."""

import html
import re
from collections import Counter
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from markupsafe import Markup
from matplotlib.figure import Figure

from calfsocket.materials.material_set import MaterialSet
from calfsocket.meshes.placement import check_placement
from calfsocket.plotting import loading
from calfsocket.plotting.files import Drawing
from calfsocket.report.damage import DamageThresholds
from calfsocket.report.page import Page
from calfsocket.report.write import write_report
from calfsocket.simulation.results import load_results
from calfsocket.study.cases import Case
from calfsocket.study.document import Document
from tiny_study import tiny_limb, tiny_socket, tiny_study

LOADS = [
    {"name": "twist", "moment": "0.6 N mm/mm", "steps": 1},
    {"name": "loss", "moment": "0 N mm/mm", "volume": {"muscle": "-2 %"}, "steps": 1},
]
LINER = {"thickness": "1 mm", "law": "gel", "bonded": "socket", "undersize": "2 %"}


OVER = {"name": "over", "moment": "30 N mm/mm", "steps": 1}


def report(out, thresholds=None, **tables):
    """Solve the tiny limb with these tables of a study file; return the report's text."""
    given = {"model": {"size": "coarse"}, **tables}
    document, limb, socket = Document.model_validate(given), tiny_limb(), tiny_socket("B")
    case = Case(
        limb,
        socket,
        MaterialSet.paper("combined"),
        document,
        of=("B", "combined"),
        changes={},
        placement=check_placement(socket, limb, liner=document.liner),
    )
    study = tiny_study(out)
    plan = replace(study.plan, document=document, cases=(case,))
    assert replace(study, plan=plan).run()
    page = write_report(load_results(out), thresholds=thresholds).read_text()
    page = re.sub(r"<style>.*?</style>", "", page, flags=re.DOTALL)
    text = html.unescape(re.sub(r"<[^>]+>", "", page)).replace("\N{NO-BREAK SPACE}", " ")
    return re.sub(r"\s+", " ", text)


def test_a_lined_socket_that_is_donned_wide_and_loaded_evenly(tmp_path):
    model = {"size": "coarse", "socket_carried": "evenly", "donning": "expanded"}
    text = report(tmp_path / "lined", model=model, loads=LOADS, liner=LINER)
    for sentence in (
        "A liner of 1.00 mm is bonded to the socket's inner face, and meets the skin in contact.",
        "It is bonded there stretched: before, every fibre around the limb is 2.00 % shorter.",
        "It starts wide and clear of the limb, and shrinks to its size in small steps.",
        "(the share by which a wide socket has shrunk to its size)",
        "Socket donned wide, moved over the limb and let go. Pressure between skin and liner,",
        "Forces and moments are spread evenly over the socket's outer face",
        "The skin's effective stress is largest after stage loss,",
        "Every state is a stable equilibrium (no negative modes).",
        "Skin. Before the loads, 99.9 % of its area stays below",
        "Damage thresholds. In the donned socket, before its loads, 50 % shear strain in muscle",
        "At the end of no stage is 50 % shear strain in muscle exceeded.",
        "Strains against damage thresholds. Of the donned socket, before its loads. Magnitude",
        "outer face under loads evenly",
    ):
        assert sentence in text, sentence
    for sentence in ("rigid frame carries", "overlap is released", "put on stretched", "borne"):
        assert sentence not in text, sentence


def test_a_force_that_is_not_borne_is_in_the_answer(tmp_path):
    low = DamageThresholds(muscle_shear_pct=1.0)
    text = report(tmp_path / "bare", low, loads=[OVER])
    (share,) = re.findall(
        r"At the end of stage over, 1 % shear strain in muscle is exceeded in ([\d.]+) % of the "
        r"tissue\.", text
    )  # fmt: skip
    (before,) = re.findall(
        r"In the donned socket, before its loads, 1 % shear strain in muscle is exceeded in "
        r"([\d.]+) % of the tissue\.", text
    )  # fmt: skip
    assert float(share) > float(before) > 0
    for sentence in (
        "Not all loads are borne: stage over, limit reached at moment",
        "N mm/mm of 30.",
        "A rigid frame carries the socket's outer face.",
        "The overlap is released in small steps, until the limb lies inside the socket.",
        "(the share of the overlap that is released)",
        "Socket donned by closing the gaps in proportion. Pressure between skin and socket,",
    ):
        assert sentence in text, sentence
    assert "liner" not in text


def test_figures_without_a_number_do_not_take_one_that_is_given(tmp_path):
    """The loads' curves stand among the paper's figures, which keep their numbers."""
    names = ("first", "loading_0", "second", "loading_1")
    drawing = Drawing.of(Figure(figsize=(1, 1)))
    page = Page(tmp_path, dict.fromkeys(names, drawing), {}, {"first": "2", "second": "3"})
    figures = "".join(page.figure(name, name, lambda: Markup("words")) for name in names)
    assert re.findall(r"Figure (\d+)", figures) == ["2", "4", "3", "5"]


@pytest.mark.parametrize(
    ("rises", "labels"),
    [
        ({"volume_muscle_percent": 1, "volume_fat_percent": 1}, ["volume of muscle and fat, %"]),
        (
            {"volume_muscle_percent": 1, "volume_fat_percent": 2},
            ["volume of muscle, %", "volume of fat, %"],
        ),
        ({"volume_fat_percent": 1}, ["volume of fat, %"]),
        ({}, []),
        (
            {"force_x_N_per_mm": 1, "volume_muscle_percent": 1, "volume_fat_percent": 3},
            ["displacement x, mm", "volume of muscle, %", "volume of fat, %"],
        ),
    ],
)
def test_curves_name_the_volume_that_changes_and_leave_no_place_empty(rises, labels):
    stays = ["force_x_N_per_mm", "force_y_N_per_mm", "displacement_x_mm", "displacement_y_mm"]
    stays += ["pressing_N_per_mm", "slipping_percent", "dissipated_N_mm_per_mm"]
    rises = {"moment_N_mm_per_mm": 1, "rotation_deg": 1, **rises}
    curve = pd.DataFrame({"stage": ["donned", "day", "day"]})
    curve = curve.assign(**dict.fromkeys(stays, 0.0))
    curve = curve.assign(**{name: rate * np.arange(3.0) for name, rate in rises.items()})
    axes = loading.draw(curve).axes
    assert [panel.get_xlabel() for panel in axes] == [
        "rotation, deg",
        *labels,
        "equilibrium",
        "equilibrium",
    ]
    taken = Counter()
    for panel in axes:
        place = panel.get_subplotspec()
        taken[place.rowspan.start] += len(place.colspan)
    assert set(taken.values()) == {axes[0].get_gridspec().ncols}
