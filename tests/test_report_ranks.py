"""The report on several ranks, and what a study hands on to it instead of its files."""

import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from calfsocket.io.errors import InputError
from calfsocket.parallel.tasks import side_by_side
from calfsocket.simulation import results
from calfsocket.simulation.results import load_results
from calfsocket.study import runner
from calfsocket.study.runner import Runner
from report_results import ALL, limb_study, result, write_results

ONE = ALL[:2]


def files_of(folder: Path) -> dict[str, bytes]:
    parts = (folder / "figures", folder / "tables", folder / "report.html")
    paths = [path for part in parts for path in [part, *part.glob("*")] if path.is_file()]
    return {str(path.relative_to(folder)): path.read_bytes() for path in paths}


def test_the_report_has_the_same_bytes_on_two_ranks(mpirun, tmp_path):
    folder = write_results(tmp_path / "two", limb_study(ONE))
    found = []
    for ranks in (2, 1):
        output = mpirun(ranks, ["-m", "calfsocket", "report", folder], timeout=600)
        assert output.split() == [str(folder / "report.html")]
        found.append(files_of(folder))
        for name in found[-1]:
            (folder / name).unlink()
    assert found[0] == found[1]
    assert len(found[0]) > 30


def test_a_missing_file_is_one_line_on_two_ranks(launch, tmp_path):
    folder = write_results(tmp_path / "two", limb_study(ONE))
    (folder / "TC_separate" / "fields.vtu").unlink()
    ended = launch(2, ["-m", "calfsocket", "report", folder])
    (line,) = [line for line in ended.stderr.splitlines() if line.startswith("calfsocket: ")]
    assert "fields.vtu: cannot be read" in line and "solve the case again" in line
    assert "Traceback" not in ended.stderr and not (folder / "report.html").exists()


class Two(MPI.Intracomm):
    """The second of two ranks, of which the first has other parts."""

    def __new__(cls, first):
        made = super().__new__(cls, MPI.COMM_SELF)
        made.first = first
        return made

    def allgather(self, mine):
        return [self.first, pickle.loads(pickle.dumps(mine))]

    def allreduce(self, mine):
        return runner.cells_of(self.first.values()) + mine


def test_what_is_solved_is_handed_on_while_there_is_room(tmp_path, monkeypatch):
    made = {key: result(key, *case) for key, case in limb_study(ONE).items()}
    cells = len(made[ONE[0]].fields.cells)
    first, second = ({key: made[key]} for key in ONE)
    study = Runner(Two(first), None, tmp_path)
    study.keep(made[ONE[1]])
    assert study.solved == second
    for each in made.values():
        _ = each.quantities
    shared = study.shared()
    assert tuple(shared) == ONE
    other = shared[ONE[1]]
    assert "quantities" in other.__dict__ and other.quantities.fields is other.fields
    np.testing.assert_array_equal(other.fields.stress, made[ONE[1]].fields.stress)

    folder = write_results(tmp_path / "two", made)
    for path in folder.glob("*/fields.vtu"):
        path.unlink()  # is not read
    assert load_results(folder, shared)[ONE[0]] is made[ONE[0]]

    monkeypatch.setattr(runner, "KEPT_CELLS", 2 * cells - 1)
    assert study.shared() is study.solved
    study.keep(made[ONE[0]])
    assert study.solved == second


class Second(Two):
    """As `Two`, where results are read."""

    rank, size = 1, 2

    def allgather(self, mine):
        return [None, None] if mine is None else super().allgather(mine)

    def allreduce(self, mine):
        return 2 * mine


def test_each_case_is_read_by_one_rank_while_there_is_room(tmp_path, monkeypatch):
    made = {key: result(key, *case) for key, case in limb_study(ONE).items()}
    folder = write_results(tmp_path / "two", made)
    first = {ONE[0]: made[ONE[0]]}
    shared = load_results(folder).shared(Second(first))
    assert shared[ONE[0]] is made[ONE[0]]
    assert "quantities" in shared[ONE[1]].__dict__

    cells = len(made[ONE[0]].fields.cells)
    monkeypatch.setattr(results, "SHARED_CELLS", 2 * cells - 1)
    alone = load_results(folder).shared(Second(first))
    assert alone[ONE[0]] is not made[ONE[0]] and alone[ONE[1]].fields.cells.shape[0] == cells


def test_a_case_that_has_stopped_is_not_handed_on(tmp_path):
    (key,) = ONE[:1]
    made = result(key, *limb_study((key,))[key])
    stopped = replace(made, record=made.record.model_copy(update={"status": "failed"}))
    study = Runner(MPI.COMM_SELF, None, tmp_path)
    study.keep(stopped)
    assert study.shared() == {}


def test_tasks_return_their_values_in_order_and_fail_together():
    comm = MPI.COMM_SELF
    assert side_by_side(comm, [lambda: "a", lambda: "b"]) == ["a", "b"]
    done = []

    def refuse():
        raise InputError("no")

    with pytest.raises(InputError, match="no"):
        side_by_side(comm, [refuse, lambda: done.append(1)])
    assert done == [1]
