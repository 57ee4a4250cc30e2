"""A whole simulation with stages of loading, on a tiny limb: resumed, carried, lined, donned wide."""

from functools import cache

import numpy as np
import pandas as pd
import pytest
from mpi4py import MPI

from calfsocket.materials.material_set import MaterialSet
from calfsocket.mechanics.loading import Loading, Stage
from calfsocket.simulation.simulation import Monitor, Simulation
from tiny_study import tiny_limb, tiny_socket

TWIST = Stage(name="twist", moment=0.6, steps=3, cycles=1)
OVER = Stage(name="over", moment=12.0, steps=1)
LOSS = Stage(name="loss", volume={"muscle": "-2 %"}, steps=2)
PUSH = Stage(name="push", force={"x": 0.05}, steps=2)
STAGES = (TWIST, PUSH, LOSS, OVER)


def simulation(**changes):
    given = {"loading": Loading(stages=STAGES), "mesh_size": "coarse", "comm": MPI.COMM_SELF}
    return Simulation(
        tiny_limb(), tiny_socket("B"), MaterialSet.paper("combined"), **(given | changes)
    )


@cache
def whole(carried):
    """An uninterrupted run."""
    return simulation(loading=Loading(stages=STAGES, carried=carried)).solve()


class Stopped(Exception):
    """Raised in the middle of a run."""


class StopAfter(Monitor):
    """Stops a run with so many load steps of stages done."""

    def __init__(self, steps):
        self.left = steps
        self.said = []

    def message(self, text, load, milestone=False):
        self.said.append(text)
        if text.startswith("stage") and "iterations" in text:
            self.left -= 1
            if self.left < 0:
                raise Stopped


@pytest.mark.parametrize(
    ("carried", "steps"),
    [("evenly", 7), ("evenly", 12), ("frame", 2), ("frame", 15)],
)
def test_a_run_is_resumed_within_its_stages(carried, steps, tmp_path):
    """Within a way of a cycle, between stages, on the way to a limit."""
    loading, uninterrupted = Loading(stages=STAGES, carried=carried), whole(carried)
    path = tmp_path / "checkpoint.npz"
    with pytest.raises(Stopped):
        simulation(loading=loading).solve(StopAfter(steps), path)
    monitor = StopAfter(1000)
    resumed = simulation(loading=loading).solve(monitor, path, resume=True)
    assert any("continues from its checkpoint" in text for text in monitor.said) == (steps > 1)
    pd.testing.assert_frame_equal(resumed.curve, uninterrupted.curve, rtol=1e-7, atol=1e-9)
    assert list(resumed.states) == list(uninterrupted.states)
    for name, state in uninterrupted.states.items():
        again = resumed.states[name]
        assert again.record.state == state.record.state
        assert again.checks.negative_modes == state.checks.negative_modes
        assert again.steps.newton_iterations.tolist() == state.steps.newton_iterations.tolist()
        moved = again.fields.displacement - state.fields.displacement
        assert np.abs(moved).max() < 1e-8


@pytest.mark.parametrize("carried", ["frame", "evenly"])
def test_stages_of_a_limb_balance_and_come_to_their_limit(carried):
    result = whole(carried)
    assert result.curve.relative_imbalance.max() < 1e-8
    limit = result.states["over"].record.state.limit
    assert limit.startswith("limit reached at moment") and limit.endswith("N mm/mm of 12")
    assert [state.checks.negative_modes for state in result.states.values()] == [0, 0, 0, 0]
    # Friction is what holds the moment: beyond the limit all of the contact slips.
    assert result.curve.slipping_percent.iloc[-1] > 99.0


def test_a_frame_is_stiffer_than_an_even_load():
    """The stiff, round socket deforms little under the loads of these stages."""
    frame, evenly = (whole(carried).curve for carried in ("frame", "evenly"))
    first = frame.stage == "twist"
    turn = evenly.rotation_deg[first] / frame.rotation_deg[first]
    assert turn.between(0.999, 1.05).all()
