"""Sections that the atlas cannot be carried into: one line with the place, and what to do."""

from collections.abc import Callable
from pathlib import Path

import pytest
from geometry import LOOPS

from calfsocket.imaging.atlas import carried
from calfsocket.imaging.outlines import Outline, SectionOutlines
from calfsocket.io.errors import InputError
from calfsocket.meshes import curves
from calfsocket.meshes.curves import ClosedCurve
from calfsocket.meshes.frame import Frame
from reliability import Trial

TITLE = "Sections for the atlas"
INTRO = "What the atlas says of outlines into which the reference calf cannot be carried."

LOOP = {name: Outline(curve) for name, curve in LOOPS.items()}
SKIN, TIBIA, FIBULA = (LOOP[name] for name in ("skin_outline", "tibia", "fibula"))


def section(**changes: object) -> Callable[[], SectionOutlines]:
    """Skin and bones of the calf, with changes."""
    given = {
        "skin": SKIN,
        "bones": {"tibia": TIBIA, "fibula": FIBULA},
        "frame": Frame("lateral", "anterior"),
        "side": "right",
    }
    return lambda: SectionOutlines(**(given | changes))  # type: ignore[arg-type]


def inward(by: float) -> Outline:
    """The skin moved inward, mm."""
    return Outline(curves.offset(SKIN.curve, lambda x: -by + 0 * x[:, 0]))


def ellipse(*center: float, axes: tuple[float, float]) -> Outline:
    curve: ClosedCurve = curves.ellipse(center, axes, 0.0)
    return Outline(curve)


TRIALS = (
    Trial("axes that are not known", section(frame=Frame()), ("what is lateral and anterior",)),
    Trial("a femur", section(bones={"femur": TIBIA}), ("choose a level between knee and ankle",)),
    Trial("a fibula alone", section(bones={"fibula": FIBULA}), ("the section has fibula",)),
    Trial("tibia and fibula exchanged", section(bones={"tibia": FIBULA, "fibula": TIBIA}),
          ("the fibula lies anteromedial of the tibia", "which bone is which")),
    Trial("the other side", section(frame=Frame("medial", "anterior"), side="left"),
          ("the fibula lies posteromedial of the tibia", "correct side")),
    Trial("a tibia through the skin", section(skin=inward(7.0)),
          ("tibia: lies outside the skin at 100 degrees",)),
    Trial("a tibia just below the skin", section(skin=inward(5.3)),
          ("tibia: lies 0.", "below the skin's surface at 1", "need 0.7 mm")),
    Trial("muscles through the skin", section(muscle_envelope=inward(-2.5)),
          ("muscles: lies outside the skin",)),
    Trial("bones that overlap",
          section(bones={"tibia": ellipse(-12, 8, axes=(30, 40)),
                         "fibula": ellipse(26, -6, axes=(14, 16))}),
          ("tibia and fibula overlap or touch at", "correct the outlines")),
    Trial("bones where the calf has muscles",
          section(bones={"tibia": ellipse(10, -33, axes=(8, 10)),
                         "fibula": ellipse(22, -45, axes=(3, 3))}),
          ("the atlas would fold near", "choose another level, or tissues lumped")),
    Trial("a cavity outside its bone",
          section(cavities={"tibia": ellipse(-10, 10, axes=(5, 4))}), ("tibia_medullary",)),
    Trial("a layer among the regions", section(regions={"skin": ("skin", LOOP["soleus"])}),
          ("region skin: skin, bones and the layers between",)),
    Trial("a muscle outside the skin",
          section(regions={"soleus": ("muscle", ellipse(0, -50, axes=(12, 12)))}),
          ("soleus: lies outside the skin",)),
)  # fmt: skip


def said(trial: Trial, folder: Path) -> str:
    """Return the line that a trial gives."""
    with pytest.raises(InputError) as error:
        carried(trial.given())
    return str(error.value)


@pytest.mark.parametrize("trial", TRIALS, ids=str)
def test_a_section_that_cannot_be_gets_one_line(trial: Trial, tmp_path: Path) -> None:
    line = said(trial, tmp_path)
    assert "\n" not in line
    for part in trial.says:
        assert part in line
