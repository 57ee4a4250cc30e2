"""Limbs whose skin or fat is thicker or thinner than in their file."""

from types import SimpleNamespace

import numpy as np
import pytest

from calfsocket.imaging.layer_thickness import LayerThickness
from calfsocket.imaging.thickness import thickness
from calfsocket.io.errors import InputError
from calfsocket.meshes.limb import Limb, limb_curves
from calfsocket.paper.guest import papers_cases
from calfsocket.study.record import laws_of_sets
from calfsocket.study.study import Study
from tiny_study import OVALS, tiny_limb

STAYS = ("skin_outline", "tibia", "tibia_medullary", "fibula")


@pytest.fixture(scope="module")
def fatter() -> Limb:
    return LayerThickness(fat_thickness="130 %").of(Limb.reference())


def of_tissue(limb: Limb, tissue: str) -> float:
    areas = limb.areas
    return sum(areas[each.name] for each in limb.regions if each.tissue == tissue)


def test_fat_is_as_many_times_as_thick_and_nothing_else_is_lost(fatter):
    limb = Limb.reference()
    before, after = thickness(limb), thickness(fatter)
    assert after["fat"].median == pytest.approx(1.3 * before["fat"].median, rel=0.01)
    for layer in ("skin", "septa", "crural fascia"):
        assert after[layer].median == pytest.approx(before[layer].median, rel=0.06), layer
    # over the bare tibia fat stays as it is
    assert after["fat"].smallest == pytest.approx(before["fat"].smallest, rel=0.02)
    assert of_tissue(fatter, "fat") == pytest.approx(1.26 * of_tissue(limb, "fat"), rel=0.02)
    # what lies deeper has as much less room as muscle and fascia together make
    left = [of_tissue(fatter, tissue) / of_tissue(limb, tissue) for tissue in ("muscle", "fascia")]
    assert left == pytest.approx([0.94, 0.94], abs=0.01)
    assert sum(fatter.areas.values()) == pytest.approx(sum(limb.areas.values()), rel=1e-9)
    loops, own = limb_curves(fatter), limb_curves(limb)
    for name in STAYS:
        assert (loops[name].knots == own[name].knots).all(), name


def test_a_limb_without_a_table_of_layers_can_be_changed_and_changed_back(fatter):
    assert fatter.layers is None and all(c.type == "spline" for c in fatter.curves.values() if c)
    again = LayerThickness(fat_thickness=f"{100 / 1.3:.6f} %").of(fatter)
    limb = Limb.reference()
    loops, own = limb_curves(again), limb_curves(limb)
    for name in ("skin_inner", "fascia_outer", "soleus", "small_saphenous_vein"):
        assert loops[name].area == pytest.approx(own[name].area, rel=0.01), name


@pytest.mark.parametrize("mm", [2.0, 0.8])  # of 1.6: 0.8 is the least
def test_skin_has_the_thickness_in_mm(mm):
    found = thickness(LayerThickness(skin_thickness=f"{mm} mm").of(Limb.reference()))["skin"]
    assert (found.smallest, found.median) == pytest.approx((mm, mm), abs=2e-3)


def test_an_oval_limb_has_a_thicker_skin_and_no_fat():
    limb = tiny_limb()
    loops = limb_curves(LayerThickness(skin_thickness="120 %").of(limb))
    a, b = np.array(OVALS["outside"]) - 1.2 * 1.5
    assert loops["inside"].area == pytest.approx(np.pi * a * b, rel=1e-3)
    with pytest.raises(InputError, match="fat_thickness: no fat lies all around this limb"):
        LayerThickness(fat_thickness="120 %").of(limb)


@pytest.mark.parametrize("said", [{}, {"fat_thickness": "100 %"}])
def test_layers_as_they_are_leave_the_limb_as_it_is(said):
    limb = Limb.reference()
    assert LayerThickness(**said).of(limb) is limb


def test_a_study_has_its_limbs_with_these_layers_and_they_are_none_of_the_papers():
    paper = Study.paper()
    plan = paper.changed({"layers": {"fat_thickness": "110 %"}}).plan
    assert plan.settings["layers"] == {"fat_thickness": "110 %"}
    assert "layers" not in paper.plan.settings
    fat = [of_tissue(each.cases[0].limb, "fat") for each in (paper.plan, plan)]
    assert fat[1] == pytest.approx(1.09 * fat[0], rel=0.01)
    assert len({id(case.limb) for case in plan.cases}) == 1  # made once
    assert set(plan.fingerprints.values()).isdisjoint(paper.plan.fingerprints.values())
    for each, known in ((paper.plan, 6), (plan, 0)):
        results = Keys.fromkeys(case.key for case in each.cases)
        results.run = SimpleNamespace(
            limb=each.limb,
            settings=each.settings,
            sockets={case.socket.name: case.socket for case in each.cases},
            laws=laws_of_sets(each),
        )
        assert len(papers_cases(results)) == known


class Keys(dict):
    """Results of which nothing but their names and their study is asked for."""
