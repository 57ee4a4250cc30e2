"""Limbs of many levels that cannot be used: one line each, nothing solved."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tiny_levels
from test_bad_input import refused, shortened

import reliability
from reliability import Trial

TITLE = "Limbs of many levels"
INTRO = "What `check` and `run` say of a limb's levels, and of sockets for them."


def changed(change: Callable[[Any], object], study: str = tiny_levels.STUDY) -> Any:
    """Return what writes the study, with its list of levels changed."""

    def make(folder: Path) -> None:
        tiny_levels.write_study(folder, study)
        path = folder / "mine.json"
        content = json.loads(path.read_text())
        change(content)
        path.write_text(json.dumps(content))

    return make


def of_section(change: Callable[[Any], object]) -> Any:
    """Return what writes the study, with the section of its second level changed."""

    def make(folder: Path) -> None:
        tiny_levels.write_study(folder)
        path = folder / "mine_0.400.json"
        content = json.loads(path.read_text())
        change(content)
        path.write_text(json.dumps(content))

    return make


def studied(text: str) -> Any:
    """Return what writes another study over the levels, and an outline for it."""

    def make(folder: Path) -> None:
        tiny_levels.write_study(folder, text)
        angles = np.deg2rad(10 * np.arange(36))
        rows = [f"{20 * np.cos(a):.4f},{20 * np.sin(a):.4f}" for a in angles]
        (folder / "face.csv").write_text("\n".join(["x_mm,y_mm", *rows, ""]))

    return make


def mirrored(content: Any) -> None:
    content["side"], content["axes"] = "left", {"+x": "medial", "+y": "anterior"}


TRIALS = (
    Trial("a section that is missing",
          changed(lambda c: c["levels"][1].update(file="mine_0.300.json")),
          ("mine.json: levels.1.file: ", "mine_0.300.json: cannot be read")),
    Trial("a section that is a scan", changed(lambda c: c["levels"][1].update(file="leg.stl")),
          ("levels.1.file", "is a surface mesh (STL)")),
    Trial("a level of levels", changed(lambda c: c["levels"][1].update(file="mine.json")),
          ("levels.1.file", "lists the levels of a limb")),
    Trial("no level", changed(lambda c: c["levels"].clear()), ("mine.json: levels: ",)),
    Trial("levels that descend", changed(lambda c: c["levels"].reverse()),
          ("levels.1.height: is 0.5, below that of levels.0", "from distal to proximal")),
    Trial("heights in mm that descend", changed(lambda c: c["levels"][2].update(height_mm=3)),
          ("levels.2.height_mm: is 3, below that of levels.1",)),
    Trial("a level listed twice", changed(lambda c: c["levels"].insert(0, c["levels"][0])),
          ("levels.1.file: mine_0.200.json is also that of levels.0",)),
    Trial("two levels at one height", changed(lambda c: c["levels"][1].update(height=0.2002)),
          ("levels.1.height: is 0.2002, as that of levels.0",)),
    Trial("a height of a level that is not its section's",
          changed(lambda c: c["levels"][1].update(height=0.45)),
          ("levels.1.height: is 0.45, but mine_0.400.json lies at 0.4",)),
    Trial("a height in mm for a share", changed(lambda c: c["levels"][1].update(height=16)),
          ("levels.1.height: is 16; it must be less than or equal to 1",)),
    Trial("a level without its height", changed(lambda c: c["levels"][1].pop("height_mm")),
          ("levels.1.height_mm: is missing; add it",)),
    Trial("a key of a level that is none", changed(lambda c: c["levels"][1].update(level=0.4)),
          ("levels.1: unknown key 'level'",)),
    Trial("sections of two sides", of_section(mirrored),
          ("levels.1: mine_0.400.json has the side left, and mine_0.200.json right",)),
    Trial("sections of two scans",
          of_section(lambda c: c["source"].update(files={"other.stl": "1" * 64})),
          ("levels.1: mine_0.400.json was made of other files than mine_0.200.json",)),
    Trial("a bone that leaves the skin at one level",
          of_section(lambda c: c["curves"]["bone"].update(semi_axes=[14, 4])),
          ("levels.1.file", "mine_0.400.json: ")),
    Trial("one outline for many levels",
          studied(tiny_levels.STUDY.split("[sockets")[0] + '[sockets.tight]\noutline = "face.csv"'),
          ("sockets.tight: is one outline, and the limb has 4 levels", "like = 'HS'")),
    Trial("a socket that does not fit one level",
          studied(tiny_levels.STUDY.replace('"0.15 mm"\nwall', '"7 mm"\nwall')),
          ("sockets.tight: level 0.200: reaches into bone",)),
    Trial("a law of a region that no level has",
          studied(tiny_levels.STUDY + "[laws.soleus]\nlaw = 'neo-hookean'\nmu = '9 kPa'\nnu = 0.4"),
          ("laws.soleus: no tissue or region 'soleus'",)),
)  # fmt: skip


def said(trial: Trial, folder: Path) -> str:
    trial.given(folder)
    return shortened(refused(["check", str(folder / "study.toml")]), folder)


@pytest.mark.parametrize("trial", TRIALS, ids=str)
def test_levels_that_cannot_be_used_are_refused_in_one_line(trial: Trial, tmp_path: Path) -> None:
    line = said(trial, tmp_path)
    for part in trial.says:
        assert part in line
    assert reliability.row(trial, line) in reliability.rows()
