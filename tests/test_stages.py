"""Stages of loading on the turned ring: elastic slope, Coulomb's limit, hysteresis, balance."""

import math

import numpy as np
import pytest

from calfsocket.io.errors import InputError
from calfsocket.mechanics import stages
from calfsocket.mechanics.loading import Loading, Stage
from calfsocket.meshes.frame import Frame
from calfsocket.postprocess.loading_curve import in_words
from calfsocket.verification.loaded_ring import AXES, CARRIED, LoadedRing, slopes
from calfsocket.verification.report import order

LOADED = LoadedRing()
RING, LIMIT, CALF = LOADED.ring, LOADED.limit, AXES


def follow(*stages, carried="frame"):
    return LoadedRing(carried=carried).follow(*stages)


@pytest.fixture(scope="module")
def turned():
    """A moment below the limit, a rotation in a cycle far beyond it, a moment above it."""
    most = math.degrees(2.5 * LIMIT * RING.compliance)
    return follow(
        Stage(name="twist", moment=0.5 * LIMIT, steps=1),
        Stage(name="turn", rotation=most, steps=10, cycles=1),
        Stage(name="over", moment=1.2 * LIMIT, steps=2),
    )


def of_stage(stepper, name):
    return [point for point in stepper.points if point.stage == name]


def test_the_elastic_slope_is_exact(turned):
    (point,) = of_stage(turned, "twist")
    assert point.place[2] / point.force[2] == pytest.approx(RING.compliance, rel=1e-3)
    assert point.slipping == 0.0
    assert abs(point.dissipated) < 1e-5 * point.applied


@pytest.mark.parametrize("carried", CARRIED)
def test_the_elastic_slope_converges_to_the_closed_form(carried):
    coarse = slopes(carried, (3.4, 2.4, 1.7))
    assert order(coarse.h, coarse.error.abs()) > 2.0
    assert abs(coarse.error.iloc[-1]) < 2e-5


def test_the_limit_is_coulombs_and_is_told(turned):
    plateau = [point.force[2] for point in of_stage(turned, "turn") if point.slipping > 0.99]
    assert np.abs(plateau) == pytest.approx(LIMIT, rel=1e-3)
    (limit,) = turned.limits
    assert limit.stage == "over"
    assert limit.asked[2] == 1.2 * LIMIT
    assert limit.force[2] == pytest.approx(LIMIT, rel=1e-3)
    failed = [step.newton.iterations for step in turned.steps if not step.newton.converged]
    assert failed and max(failed) <= 5  # a line search would go on to the last of 20
    assert of_stage(turned, "over")[-1].force[2] == pytest.approx(limit.force[2], rel=1e-3)


def test_a_force_that_is_not_followed_to_its_end_ends_with_what_was_reached(monkeypatch):
    monkeypatch.setattr(stages, "MOST_STEPS", 1)
    monkeypatch.setattr(stages, "MOST_PER_STEP", 0)
    stepper = LOADED.donned()
    limit = stepper.run(Stage(name="over", moment=1.2 * LIMIT, steps=2))
    assert limit.still_rises
    reached = of_stage(stepper, "over")[-1]
    assert 0.6 * LIMIT < limit.force[2] < 1.001 * LIMIT
    assert reached.force[2] == pytest.approx(limit.force[2])
    assert in_words(limit, CALF).startswith("no equilibrium found beyond moment ")
    monkeypatch.undo()
    assert stepper.run(Stage(name="release", moment=0.0, steps=1)) is None
    assert of_stage(stepper, "release")[-1].force[2] == pytest.approx(0.0, abs=1e-9)


def test_a_closed_cycle_dissipates_the_area_of_its_loop(turned):
    points = of_stage(turned, "turn")
    cycle = points[9:]  # from the largest turn, to the other side, and back
    dissipated = cycle[-1].dissipated - cycle[0].dissipated
    turn = np.array([point.place[2] for point in cycle])
    moment = np.array([point.force[2] for point in cycle])
    assert turn[-1] == pytest.approx(turn[0])
    exact = 4.0 * LIMIT * (turn[0] - LIMIT * RING.compliance)
    assert dissipated == pytest.approx(exact, rel=5e-3)
    assert cycle[-1].applied - cycle[0].applied == pytest.approx(exact, rel=2e-2)  # trapezoids
    assert np.all(np.diff([point.dissipated for point in points]) > -1e-6 * exact)
    assert np.abs(moment).max() <= LIMIT * 1.001


def test_every_equilibrium_is_balanced(turned):
    assert max(point.imbalance for point in turned.points) < 1e-8


def test_an_even_load_turns_the_ring_as_a_frame_does():
    """Its traction is uniform around the ring, so that slope and limit are the frame's."""
    stepper = follow(
        Stage(name="twist", moment=0.5 * LIMIT, steps=1),
        Stage(name="over", moment=1.2 * LIMIT, steps=2),
        Stage(name="release", moment=0.0, steps=1),
        Stage(name="push", force={"lateral": 1e-4}, steps=1),
        carried="evenly",
    )
    (twist,) = of_stage(stepper, "twist")
    assert twist.place[2] / twist.force[2] == pytest.approx(RING.compliance, rel=1e-3)
    (limit,) = stepper.limits
    assert limit.force[2] == pytest.approx(LIMIT, rel=1e-3)
    (*_, release), (push,) = of_stage(stepper, "release"), of_stage(stepper, "push")
    assert release.force == pytest.approx([0.0, 0.0, 0.0], abs=1e-12)
    left = of_stage(stepper, "over")[-1].place[2] - LIMIT * RING.compliance
    assert release.place[2] == pytest.approx(left, rel=5e-3)
    assert push.force == pytest.approx([1e-4, 0.0, 0.0], abs=1e-12)
    assert push.place[0] > 0.0
    assert max(point.imbalance for point in stepper.points) < 1e-8
    assert stepper.stepper.newton.negative_modes() == 0


def test_what_a_stage_does_not_name_stays():
    side = Stage(name="side", displacement={"medial": 1e-4}, steps=1)
    twist = Stage(name="twist", moment=0.1 * LIMIT, steps=1)
    push = Stage(name="push", force={"posterior": 1e-4}, steps=1)
    release = Stage(name="release", force={"medial": 0.0}, steps=1)
    points = follow(side, twist, push, release).points[1:]
    assert [point.place[0] for point in points[:3]] == pytest.approx([-1e-4] * 3)
    assert points[0].force[1:] == pytest.approx([0.0, 0.0], abs=1e-8)
    assert [point.force[2] for point in points[1:]] == pytest.approx([0.1 * LIMIT] * 3, abs=1e-7)
    assert points[3].force[:2] == pytest.approx([0.0, -1e-4], abs=1e-8)
    assert abs(points[3].place[0]) < 1e-6


REFUSED = {
    "nothing": ({}, "loads nothing; give force, moment, displacement, rotation or volume"),
    "both": ({"moment": "1 N mm/mm", "rotation": "1 deg"}, "one follows from the other"),
    "line": ({"force": {"medial": 1.0, "lateral": 1.0}}, "lie along one line"),
    "axes": ({"force": {"medial": 1.0}, "displacement": {"y": 1.0}}, "not both"),
    "steps": ({"moment": 1.0, "steps": 0}, "steps: is 0; it must be greater than or equal to 1"),
    "cycles": ({"moment": 1.0, "cycles": -1}, "cycles: is -1; it must be greater than or equal"),
    "volume": ({"volume": {"fat": "-100 %"}}, "volume.fat: is -100 %; it must be more than -100 %"),
    "tissue": ({"volume": {"bone": "1 %"}}, "volume.bone"),
    "twice": ({"volume": {"soft": 0.1, "fat": 0.1}}, "soft is muscle and fat"),
    "unit": ({"force": {"medial": "3 N"}}, "unit 'N' is unknown; use N/mm"),
    "side": ({"force": {"front": 1.0}}, "front"),
    "name": ({"name": "donned", "moment": 1.0}, "is the state before all stages"),
    "folder": ({"name": "second_mesh", "moment": 1.0}, "is another folder of a case"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_stage_is_refused(name):
    values, message = REFUSED[name]
    with pytest.raises(InputError) as refusal:
        Stage(**{"name": "stage", **values})
    assert message in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_stages_need_names_of_their_own_and_sides_need_axes():
    stage = Stage(name="a", force={"lateral": "2 N/cm"})
    assert stage.force == {"lateral": 0.2}
    with pytest.raises(InputError, match="two stages have the name 'a'"):
        Loading(stages=(stage, stage))
    with pytest.raises(InputError, match="stages"):
        Loading(stages=())
    with pytest.raises(InputError, match="carried: is 'springs'; it must be"):
        Loading(stages=(stage,), carried="springs")
    for moved in (Stage(name="m", displacement={"x": 1.0}), Stage(name="m", rotation=1.0)):
        with pytest.raises(InputError, match="an outer face loaded evenly deforms"):
            Loading(stages=(stage, moved), carried="evenly")
    with pytest.raises(InputError, match="lateral: the limb's data do not say"):
        stage.targets(Frame())
    assert stage.targets(Frame("medial", "anterior")).force == {0: -0.2}
    assert stage.targets(Frame("anterior", "lateral")).force == {1: 0.2}
