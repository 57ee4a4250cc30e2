"""A fault on any one rank, in any phase, ends all ranks with one message, or one case on all."""

import json
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from reliability import Trial
from test_faults import entries
from tiny_study import Fault, tiny_study

RESIDUAL = "calfsocket.mechanics.problem:Problem.residual"
CONSTRAINTS = "calfsocket.mechanics.problem:constrained_unknowns"
TANGENT = "calfsocket.mechanics.problem:Problem.tangent"

TITLE = "Faults of one rank among several"
INTRO = """\
A fault strikes one of two ranks that solve a case together. Where all ranks can know, that case
fails and the next one is solved; where the other waits for the one that cannot continue, both end
within 10 s with its message, once, and `--resume` finishes the study."""

PROGRAM = Path(__file__).with_name("tiny_study.py")
LIMIT_S = 10.0


def ends(name: str, *fault: object, slow: bool = True, **more: object) -> object:
    trial = Trial(name, Fault(*fault, **more), (), "all ranks end, with the message once")
    return _marked(trial, slow)


def agrees(name: str, *fault: object, slow: bool = True, **more: object) -> object:
    trial = Trial(
        name, Fault(*fault, **more), (), "the case fails on all ranks; the next is solved"
    )
    return _marked(trial, slow)


def _marked(trial: Trial, slow: bool) -> object:
    return pytest.param(trial, marks=[pytest.mark.slow] if slow else [], id=trial.name)


CASES = (
    ends("compiling, first rank", "calfsocket.simulation.precompile:_compile", (0,)),
    agrees("mesh, first rank", "calfsocket.meshes.section:build", (0,)),
    ends("mesh, second rank", "calfsocket.meshes.distributed:SectionMesh", (1,)),
    ends("set-up, first rank", "calfsocket.contact.interface:surface_region", (0,)),
    ends("set-up, second rank", "calfsocket.contact.interface:surface_region", (1,)),
    ends("input refused by the second rank alone", CONSTRAINTS, (1,),
         error="InputError"),
    ends("residual, first rank", RESIDUAL, (0,), 12),
    ends("residual, second rank", RESIDUAL, (1,), 12, slow=False),
    agrees("residual, both ranks", RESIDUAL, (0, 1), 12),
    ends("tangent, first rank", TANGENT, (0,), 6),
    ends("tangent, second rank, no memory", TANGENT, (1,), 6,
         error="MemoryError"),
    ends("checkpoint, second rank", "calfsocket.simulation.checkpoint:Checkpoint._collect", (1,),
         4),
    ends("checks, second rank", "calfsocket.mechanics.problem:Problem.smallest_volume_ratio", (1,)),
    ends("quantities, first rank", "calfsocket.simulation.simulation:skin_line", (0,)),
    ends("quantities, second rank", "calfsocket.simulation.simulation:section_fields", (1,)),
    agrees("files, first rank", "calfsocket.study.runner:_CaseRunner._write", (0,), slow=False),
    ends("run.json, first rank", "calfsocket.study.record:Recorder.put", (0,)),
    ends("next case, second rank", "calfsocket.parallel.scheduler:Scheduler.next_case", (1,), 2),
    ends("killed, first rank", RESIDUAL, (0,), 12, error="SIGKILL"),
    ends("killed, second rank", RESIDUAL, (1,), 12, error="SIGKILL",
         slow=False),
    ends("killed while writing", "numpy:savez", (0,), 2, error="SIGKILL"),
)  # fmt: skip
TRIALS = tuple(case.values[0] for case in CASES)


@pytest.fixture(scope="module")
def unbroken(tmp_path_factory):
    out = tmp_path_factory.mktemp("unbroken")
    assert tiny_study(out).run()
    return out


def run(launch, ranks, **how):
    how = {"study": {}, "out": "results"} | how
    return launch(ranks, [PROGRAM, json.dumps(how)], timeout=240)


def close(out: Path, other: Path) -> bool:
    """Whether two folders hold the same results, to solver tolerance."""
    for name in ("summary.csv", "levels.csv", "contact.csv"):
        one, two = (pd.read_csv(folder / name) for folder in (out, other))
        text = list(one.select_dtypes(exclude="number"))
        pd.testing.assert_frame_equal(one[text], two[text])
        for column in one.columns.difference(text):
            scale = np.abs(two[column]).max()
            np.testing.assert_allclose(one[column], two[column], atol=1e-6 * scale, err_msg=column)
    return True


@pytest.mark.parametrize("trial", CASES)
def test_a_fault_of_one_rank(trial, launch, tmp_path, unbroken):
    fault = trial.given
    ended = run(launch, 2, ranks_per_case=2, fault=fault.__dict__)
    late = time.time() - min(path.stat().st_mtime for path in tmp_path.glob("injected-*"))
    assert ended.returncode != 0
    out = tmp_path / "results"
    statuses = {case: entry["status"] for case, entry in entries(out).items()}
    said = ended.stderr.count("injected")
    if trial.gives.startswith("the case fails"):
        # No limit: the next case is solved.
        assert ended.returncode == 1
        assert statuses == {"A_combined": "failed", "B_combined": "solved"}
        assert "injected" in entries(out)["A_combined"]["message"]
        assert said == 2  # when it happens, and at the end
        assert "Traceback" not in ended.stderr
    elif fault.error == "SIGKILL":
        assert late < LIMIT_S
        assert "signal 9" in ended.stdout + ended.stderr  # mpirun says so, MPICH's to stdout
        assert statuses["B_combined"] == "running"
    else:
        assert late < LIMIT_S
        assert said == 1
        assert ended.stderr.count("Traceback") <= 1
        assert statuses["B_combined"] == "running"
    resumed = run(launch, 1, resume=True)
    assert resumed.returncode == 0, resumed.stderr
    assert close(out, unbroken)


@pytest.mark.parametrize(
    ("ranks", "how"),
    [
        pytest.param(3, {}, id="more-ranks-than-cases"),
        pytest.param(
            4, {"ranks_per_case": 3}, id="a-rank-that-makes-no-group", marks=pytest.mark.slow
        ),
        pytest.param(4, {"study": {"sockets": ["A"]}}, id="4-ranks-1-case", marks=pytest.mark.slow),
        pytest.param(
            4, {"study": {"sockets": ["A", "B", "C"]}}, id="4-ranks-3-cases", marks=pytest.mark.slow
        ),
        pytest.param(
            2, {"owners": [0, 1], "ranks_per_case": 2}, id="limb-first", marks=pytest.mark.slow
        ),
        pytest.param(
            2, {"owners": [1, 0], "ranks_per_case": 2}, id="socket-first", marks=pytest.mark.slow
        ),
        pytest.param(
            3, {"owners": [2, 0], "ranks_per_case": 3}, id="one-rank-empty", marks=pytest.mark.slow
        ),
    ],
)
def test_shapes(ranks, how, launch, tmp_path):
    """Ranks without limb, skin or socket, or with nothing at all, are interrupted and continue."""
    study = how.get("study", {"sockets": ["A", "B"]})
    expected = tmp_path / "expected"
    assert tiny_study(expected, tuple(study["sockets"])).run()
    fault = Fault(
        "calfsocket.simulation.checkpoint:Checkpoint.save", tuple(range(ranks)), 3, "SIGKILL"
    )
    ended = run(launch, ranks, fault=fault.__dict__, **how)
    assert ended.returncode != 0
    ended = run(launch, ranks, resume=True, **how)
    assert ended.returncode == 0, ended.stderr
    assert "resumes from its last equilibrium" in ended.stderr
    assert close(tmp_path / "results", expected)
    assert not list((tmp_path / "results").rglob("checkpoint.npz"))


def test_mpirun_asked_to_end(launch, tmp_path):
    """SIGTERM to one rank ends all; results are whole, and the message comes once."""
    fault = Fault(RESIDUAL, (1,), 4, "SIGTERM")
    ended = run(launch, 2, fault=fault.__dict__, study={"sockets": ["A", "B", "C"]})
    assert ended.returncode == 143
    assert ended.stderr.count("calfsocket: interrupted") == 1
    assert "Traceback" not in ended.stderr
    assert set(entries(tmp_path / "results")) == {"A_combined", "B_combined", "C_combined"}


def test_cases_side_by_side_fail_alone(launch, tmp_path, unbroken):
    """A rank by itself needs nobody's agreement: the other's case continues meanwhile."""
    fault = Fault(RESIDUAL, (0,), 8)
    ended = run(launch, 2, fault=fault.__dict__)
    assert ended.returncode == 1
    assert sorted(entry["status"] for entry in entries(tmp_path / "results").values()) == [
        "failed",
        "solved",
    ]
    assert run(launch, 2, resume=True).returncode == 0  # both ranks share the case that is left
    assert close(tmp_path / "results", unbroken)
