"""A simulation with stages of loading, on a tiny limb: resumed, carried, lined, donned wide."""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from mpi4py import MPI

from calfsocket.materials.liner import Liner
from calfsocket.materials.material_set import MaterialSet
from calfsocket.mechanics.carrier import Control
from calfsocket.mechanics.limb_problem import limb_problem
from calfsocket.mechanics.loading import Loading, Stage
from calfsocket.mechanics.stages import StageStepper
from calfsocket.mechanics.stepping import LoadStepper
from calfsocket.meshes.section import section_mesh
from calfsocket.simulation.simulation import Monitor, Simulation
from tiny_study import tiny_limb, tiny_socket

RESUMED = Path(__file__).with_name("stages_resumed.py")

TWIST = Stage(name="twist", moment=0.6, steps=3, cycles=1)
OVER = Stage(name="over", moment=30.0, steps=1)
LOSS = Stage(name="loss", volume={"muscle": "-2 %"}, steps=2)
PUSH = Stage(name="push", force={"x": 0.05}, moment=0.2, steps=2)
STAGES = (TWIST, OVER, PUSH, LOSS)


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
    """Stops a run when a stage has done so many load steps."""

    def __init__(self, stage="", steps=0):
        self.stage, self.left = stage, steps
        self.said = []

    def message(self, text, load, milestone=False):
        self.said.append(text)
        if text.startswith(f"stage {self.stage},"):
            if not self.left:
                raise Stopped
            self.left -= 1


@pytest.mark.parametrize(
    ("carried", "stage", "steps"),
    [("evenly", "twist", 7), ("evenly", "push", 1), ("frame", "over", 3), ("frame", "loss", 0)],
)
def test_a_run_is_resumed_within_its_stages(carried, stage, steps, tmp_path):
    """Within a way of a cycle, after slip, on the way to a limit, between stages."""
    loading, uninterrupted = Loading(stages=STAGES, carried=carried), whole(carried)
    path = tmp_path / "checkpoint.npz"
    with pytest.raises(Stopped):
        simulation(loading=loading).solve(StopAfter(stage, steps), path)
    monitor = StopAfter()
    resumed = simulation(loading=loading).solve(monitor, path, resume=True)
    assert "stage twist: continues from its checkpoint" in monitor.said
    done = "twist" if stage == "twist" else "over"
    assert (f"stage {done}, 100 %" in " ".join(monitor.said)) == (stage in ("twist", "over"))
    pd.testing.assert_frame_equal(resumed.curve, uninterrupted.curve, rtol=1e-7, atol=1e-9)
    assert list(resumed.states) == list(uninterrupted.states)
    for name, state in uninterrupted.states.items():
        again = resumed.states[name]
        assert again.record.state == state.record.state
        assert again.checks.negative_modes == state.checks.negative_modes
        assert again.steps.newton_iterations.tolist() == state.steps.newton_iterations.tolist()
        moved = again.fields.displacement - state.fields.displacement
        assert np.abs(moved).max() < 1e-8


@pytest.mark.slow
def test_stages_may_continue_with_other_ranks(mpirun, tmp_path):
    path, whole_curve = tmp_path / "checkpoint.npz", whole("evenly").curve
    with pytest.raises(Stopped):
        simulation(loading=Loading(stages=STAGES, carried="evenly")).solve(
            StopAfter("push", 1), path
        )
    found = json.loads(mpirun(2, [RESUMED, path, "evenly"], timeout=200))
    assert found["continued"]
    assert found["negative_modes"] == [0, 0, 0, 0]
    expected = whole_curve[["moment_N_mm_per_mm", "rotation_deg", "dissipated_N_mm_per_mm"]]
    np.testing.assert_allclose(found["curve"], expected, rtol=1e-6, atol=1e-8)


@pytest.mark.parametrize("carried", ["frame", "evenly"])
def test_stages_of_a_limb_balance_and_come_to_their_limit(carried):
    result = whole(carried)
    assert result.curve.relative_imbalance.max() < 1e-8
    limit = result.states["over"].record.state.limit
    assert limit.startswith("limit reached at moment") and limit.endswith("N mm/mm of 30")
    assert [state.checks.negative_modes for state in result.states.values()] == [0, 0, 0, 0]
    # Friction is what holds the moment: at the limit all of the contact slips.
    over = result.curve[result.curve.stage == "over"]
    assert over.slipping_percent.iloc[-1] > 99.0


@pytest.mark.parametrize("carried", ["frame", "evenly"])
def test_a_state_beyond_the_limit_is_stable_by_its_way_alone(carried):
    """Under its moment it would turn round: the negative mode is the carrier's."""
    model = simulation()
    section = section_mesh(MPI.COMM_SELF, model.limb, model.socket, model.mesh_size)
    laws = {name: model.region_laws[name] for name in section.regions}
    donned = LoadStepper(limb_problem(section, laws, model.contact), model.steps)
    donned.run()
    stages = StageStepper(donned, model.limb.frame, carried=carried)
    assert stages.run(OVER) is not None
    moments = [point.force[2] for point in stages.points]
    assert moments[-1] < max(moments)
    newton, held = stages.stepper.newton, np.zeros(3, dtype=bool)
    assert newton.negative_modes() == 0
    stages.carrier.control = Control.of(held, stages.points[-1].force, np.zeros(3))
    assert newton.negative_modes() == 1
    stages.carrier.control = Control.of(~held, np.zeros(3), stages.points[-1].place)
    assert newton.negative_modes() == 0


@pytest.mark.slow
def test_a_socket_with_a_soft_liner_turns_round_at_a_limit():
    """Of 1 mm of gel: points went to and fro over its kinks, and the stage failed on its way."""
    liner = Liner(thickness=1.0, law="gel", bonded="socket")
    found = simulation(liner=liner, loading=Loading(stages=(OVER,))).solve()
    assert found.states["over"].record.state.limit.startswith("limit reached at moment ")
    last = found.curve.iloc[-1]
    assert last.slipping_percent > 99.0 and 0.0 < last.moment_N_mm_per_mm < 30.0


def test_a_frame_is_stiffer_than_an_even_load():
    """The stiff, round socket deforms little under the loads of these stages."""
    frame, evenly = (whole(carried).curve for carried in ("frame", "evenly"))
    first = frame.stage == "twist"
    turn = evenly.rotation_deg[first] / frame.rotation_deg[first]
    assert turn.between(0.999, 1.05).all()
