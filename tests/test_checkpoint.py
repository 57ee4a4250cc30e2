"""A run that is interrupted after a step continues as if it had never stopped."""

import json
import random
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from calfsocket.io.errors import SolveError, WriteError
from calfsocket.materials.material_set import MaterialSet
from calfsocket.mechanics.newton import Newton
from calfsocket.mechanics.stepping import LoadStepper, LoadSteps, Milestone
from calfsocket.meshes.limb import Limb
from calfsocket.meshes.socket import Socket
from calfsocket.simulation.checkpoint import Checkpoint, CheckpointError
from calfsocket.simulation.simulation import Monitor, Simulation
from ring_checkpoint import CONTROLS
from ring_model import ring_model

PROGRAM = Path(__file__).with_name("ring_checkpoint.py")


def solve(control, path=None, start_from=None):
    """Solve the ring, or continue it; leave a checkpoint a step in a folder."""
    model = ring_model(MPI.COMM_SELF, h=6.0)

    def save(milestone: Milestone) -> None:
        Checkpoint(path / f"{len(milestone.steps)}.npz", model, {}).save(milestone)

    stepper = LoadStepper(model, control, on_milestone=save if path else None)
    stepper.run(Checkpoint(start_from, model, {}).load() if start_from else None)
    return stepper


@pytest.fixture(scope="module", params=CONTROLS)
def unbroken(request, tmp_path_factory):
    """Name of the control, the solved ring, and the folder of its checkpoints."""
    folder = tmp_path_factory.mktemp("checkpoints")
    return request.param, solve(CONTROLS[request.param], folder), folder


def test_every_step_can_be_gone_on_from(unbroken):
    control, whole, folder = unbroken
    paths = sorted(folder.glob("*.npz"))
    assert len(paths) == len(whole.steps) >= 2
    for path in paths:
        resumed = solve(CONTROLS[control], start_from=path)
        assert len(resumed.steps) == len(whole.steps)
        for one, other in zip(resumed.steps, whole.steps, strict=True):
            assert (one.number, one.load) == (other.number, other.load)
            assert one.newton.iterations == other.newton.iterations
        # The same factorisations of the same numbers: nothing is different but the clock.
        np.testing.assert_array_equal(resumed.problem.w.x.array, whole.problem.w.x.array)
        np.testing.assert_array_equal(
            resumed.problem.contact.converged_arc, whole.problem.contact.converged_arc
        )
        assert resumed.problem.load == 1.0


def test_slip_history_matters(unbroken, tmp_path):
    """Without it the run would end elsewhere: it is no accident that the numbers agree."""
    control, whole, folder = unbroken
    model = ring_model(MPI.COMM_SELF, h=6.0)
    start = Checkpoint(folder / "1.npz", model, {}).load()
    forgetful = LoadStepper(model, CONTROLS[control])
    forgetful.run(replace(start, converged_arc=start.converged_arc + 0.05))
    difference = forgetful.problem.w.x.array - whole.problem.w.x.array
    assert np.abs(difference).max() > 1e-6


def test_a_step_that_failed_fails_again(tmp_path, monkeypatch):
    """What was saved last leads to the same failure, in the same words."""
    solve_one = Newton.solve

    def fail_late(solver, ahead):
        result = solve_one(solver, ahead)
        late = model.load > 0.5
        return replace(result, converged=False, reason="too late") if late else result

    monkeypatch.setattr(Newton, "solve", fail_late)
    said = []
    for _ in range(2):
        model = ring_model(MPI.COMM_SELF, h=6.0)
        checkpoint = Checkpoint(tmp_path / "c.npz", model, {})
        control = LoadSteps(first=0.25, smallest=0.1)
        stepper = LoadStepper(model, control, on_milestone=checkpoint.save)
        start = checkpoint.load()
        with pytest.raises(SolveError) as failure:
            stepper.run(start)
        said.append((str(failure.value), len(stepper.steps), model.w.x.array.tobytes()))
    assert start is not None and start.load == 0.5
    assert said[0] == said[1]
    assert "no equilibrium between load 0.5000 and" in said[0][0]


@pytest.mark.parametrize("ranks", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_it_may_continue_with_other_ranks(ranks, unbroken, mpirun):
    control, whole, folder = unbroken
    last = folder / f"{len(whole.steps)}.npz"
    state = json.loads(mpirun(ranks, [PROGRAM, control, folder / "1.npz", last], timeout=120))
    assert state["newton"] == [step.newton.iterations for step in whole.steps]
    assert state["difference"] < 1e-9
    assert state["arc_difference"] < 1e-9


def test_a_checkpoint_of_anything_else_is_refused(unbroken):
    _, _, folder = unbroken
    for model, inputs in (
        (ring_model(MPI.COMM_SELF, h=6.0), {"friction": 0.3}),
        (ring_model(MPI.COMM_SELF, h=5.0), {}),
    ):
        with pytest.raises(CheckpointError, match=r"1\.npz: .*other inputs, options or versions"):
            Checkpoint(folder / "1.npz", model, inputs).load()


def test_no_checkpoint_is_no_error(tmp_path):
    assert Checkpoint(tmp_path / "c.npz", ring_model(MPI.COMM_SELF, h=6.0), {}).load() is None


def test_a_damaged_checkpoint_is_refused_or_means_the_same(unbroken, tmp_path):
    _, _, folder = unbroken
    model = ring_model(MPI.COMM_SELF, h=6.0)
    good = (folder / "1.npz").read_bytes()
    expected = Checkpoint(folder / "1.npz", model, {}).load()
    chance = random.Random(7)
    refused = 0
    for trial in range(200):
        content = bytearray(good)
        if trial % 4 == 0:
            del content[chance.randrange(len(content)) :]
        else:
            for _ in range(chance.randrange(1, 4)):
                # Half of them where the structure is, at either end.
                near = chance.choice([len(content), 400])
                at = chance.randrange(near) * chance.choice([1, -1])
                content[at % len(content)] ^= 1 << chance.randrange(8)
        path = tmp_path / "damaged.npz"
        path.write_bytes(content)
        try:
            found = Checkpoint(path, model, {}).load()
        except CheckpointError as error:
            assert str(error).startswith(f"{path}: ") and "\n" not in str(error)
            refused += 1
        else:
            np.testing.assert_array_equal(found.unknowns.array, expected.unknowns.array)
            np.testing.assert_array_equal(found.converged_arc, expected.converged_arc)
            assert found.steps == expected.steps
    assert refused > 150


def test_nothing_in_a_checkpoint_is_executed(unbroken, tmp_path):
    """A pickle in the place of an array is refused before it is looked at."""
    _, _, folder = unbroken

    class Trap:
        def __reduce__(self):
            return Path.touch, (tmp_path / "sprung",)

    with np.load(folder / "1.npz") as file:
        arrays = dict(file)
    arrays["unknowns"] = np.array([Trap()], dtype=object)
    np.savez(tmp_path / "trap.npz", **arrays, allow_pickle=True)
    model = ring_model(MPI.COMM_SELF, h=6.0)
    with pytest.raises(CheckpointError):
        Checkpoint(tmp_path / "trap.npz", model, {}).load()
    assert not (tmp_path / "sprung").exists()


def test_a_checkpoint_that_cannot_be_written_leaves_the_one_before(unbroken, tmp_path, monkeypatch):
    _, _, folder = unbroken
    path = tmp_path / "c.npz"
    path.write_bytes((folder / "1.npz").read_bytes())
    model = ring_model(MPI.COMM_SELF, h=6.0)
    checkpoint = Checkpoint(path, model, {})
    milestone = checkpoint.load()

    def full(handle):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(WriteError, match=r"c\.npz: cannot be written: No space left on device"):
        checkpoint.save(milestone)
    assert path.read_bytes() == (folder / "1.npz").read_bytes()
    assert [file.name for file in tmp_path.iterdir()] == ["c.npz"]


class StoppedLater(Exception):
    """Raised after a few steps."""


class StopAfter(Monitor):
    """Breaks a simulation off when its third step is done, the checkpoint of the second written."""

    def step(self, step):
        if step.number == 3:
            raise StoppedLater


@pytest.mark.slow
@pytest.mark.parametrize("material_set", ["separate", "combined"])
def test_a_limb_resumes_as_if_it_had_never_stopped(material_set, tmp_path):
    """The coarse mesh, friction and a waving fascia; steps are cut back and grown on the way."""

    def simulation() -> Simulation:
        materials = MaterialSet.paper(material_set)
        return Simulation(Limb.reference(), Socket.reference("HS"), materials, "coarse")

    whole = simulation().solve()
    with pytest.raises(StoppedLater):
        simulation().solve(StopAfter(), tmp_path / "c.npz")
    resumed = simulation().solve(checkpoint=tmp_path / "c.npz", resume=True)
    assert resumed.record.resumed_from_load > 0
    iterations = [list(each.steps["newton_iterations"]) for each in (resumed, whole)]
    assert iterations[0] == iterations[1]
    difference = np.abs(resumed.fields.displacement - whole.fields.displacement).max()
    assert difference < 1e-8
    assert resumed.checks.negative_modes == whole.checks.negative_modes
