"""What goes wrong while a study runs: the other cases are solved, and the rest can be resumed."""

import ctypes
import json
import logging
import os
import random
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pandas as pd
import pytest
from mpi4py import MPI

from calfsocket.io.errors import InputError, WriteError
from calfsocket.meshes import store
from calfsocket.simulation import simulation
from calfsocket.simulation.precompile import precompile
from calfsocket.study import restart, runner
from reliability import Trial
from tiny_study import Fault, mesh_again, tiny_study

TITLE = "Faults while running"
INTRO = """\
A fault strikes the first case of a study. The others are solved; run.json and cases.csv say what
failed and why; exit code 1. With the fault gone, `--resume` keeps what is solved, continues from
the last equilibrium, and ends with the same bytes as an unbroken run."""

PROGRAM = Path(__file__).with_name("tiny_study.py")
FULL = (28, "No space left on device")


def fails(name: str, says: str, *fault: object, **more: object) -> Trial:
    return Trial(name, Fault(*fault, **more), (says,), f"the case fails: `{says}`")


def passes(name: str, gives: str, *fault: object, **more: object) -> Trial:
    return Trial(name, Fault(*fault, **more), (), f"solved; {gives}")


TRIALS = (
    fails(
        "the mesh cannot be built",
        "the mesh was not built: ValueError: injected",
        "calfsocket.meshes.section:build",
        error="ValueError",
    ),
    fails(
        "a socket that cannot be meshed",
        "socket A: the inner face crosses itself",
        "calfsocket.meshes.section:build",
        error="InputError",
        words=("socket A: the inner face crosses itself",),
    ),
    fails(
        "no memory for the matrix",
        "out of memory; use a coarser mesh or fewer ranks at a time",
        "calfsocket.mechanics.problem:Problem.create_matrix",
        error="MemoryError",
        words=(),
    ),
    fails(
        "an exception in the residual, inside PETSc",
        "RuntimeError: injected",
        "calfsocket.mechanics.problem:Problem.residual",
        call=9,
    ),
    fails(
        "an exception in the tangent, inside PETSc",
        "ZeroDivisionError: injected",
        "calfsocket.mechanics.problem:Problem.tangent",
        call=6,
        error="ZeroDivisionError",
    ),
    fails(
        "Newton's method finds no equilibrium",
        "no equilibrium between load 0.2500 and 0.2550",
        "calfsocket.mechanics.stepping:LoadStepper.run",
        error="ConvergenceError",
        words=("no equilibrium between load 0.2500 and 0.2550",),
    ),
    fails(
        "an exception in the checks of a result",
        "RuntimeError: injected",
        "calfsocket.mechanics.problem:Problem.force_balance",
    ),
    fails(
        "an exception in the quantities",
        "IndexError: injected",
        "calfsocket.simulation.simulation:section_fields",
        error="IndexError",
    ),
    fails(
        "no space for the fields",
        "fields.vtu: cannot be written: No space left on device; free some space",
        "calfsocket.postprocess.vtu:xml_text",
        error="OSError",
        words=FULL,
    ),
    passes(
        "no space for a step while solving",
        "reported once, and the steps are written at the end",
        "calfsocket.study.runner:_CaseRunner._merge",
        error="OSError",
        words=FULL,
    ),
    passes(
        "no space for a checkpoint",
        "reported once; the case could not be resumed from there",
        "numpy:savez",
        error="OSError",
        words=FULL,
    ),
    passes(
        "no space for run.json when a case ends",
        "reported, and written when there is space",
        "calfsocket.study.record:cases_table",
        call=2,
        error="OSError",
        words=FULL,
    ),
    passes(
        "an exception while the picture is drawn",
        "reported; `calfsocket picture` can draw it later",
        "calfsocket.plotting.case:save",
    ),
)  # fmt: skip


@pytest.fixture(autouse=True)
def without_precompiling(monkeypatch):
    """Forms are compiled once for all: rank 0 solves a ring for that, which faults would strike."""
    if not precompiled:
        precompile(MPI.COMM_SELF)
        precompiled.append(True)
    for module in (runner, simulation):
        monkeypatch.setattr(module, "precompile", lambda *_: None)


precompiled: list[bool] = []


@pytest.fixture(autouse=True)
def _own_meshes(monkeypatch):
    monkeypatch.setattr(store, "stored", mesh_again)


@pytest.fixture(scope="module")
def unbroken(tmp_path_factory):
    """Results of a study that nothing happened to."""
    precompile(MPI.COMM_SELF)
    out = tmp_path_factory.mktemp("unbroken")
    assert tiny_study(out).run()
    return out


def entries(out: Path) -> dict:
    return json.loads((out / "run.json").read_text())["cases"]


def same_results(out: Path, other: Path, cases=("A_combined", "B_combined")) -> bool:
    """Whether two folders hold the same results, to the byte apart from wall times."""
    for name in ("summary.csv", "contact.csv", *(f"{case}/fields.vtu" for case in cases)):
        assert (out / name).read_bytes() == (other / name).read_bytes(), name
    steps = [pd.read_csv(folder / "steps.csv").drop(columns="seconds") for folder in (out, other)]
    pd.testing.assert_frame_equal(*steps)
    assert {case: entry["status"] for case, entry in entries(out).items()} == dict.fromkeys(
        cases, "solved"
    )
    left = [path.name for path in out.rglob("*") if path.name.startswith((".unf", "checkpoint"))]
    assert left == []
    return True


@pytest.mark.parametrize("trial", TRIALS, ids=str)
def test_a_fault_in_one_case(trial, unbroken, tmp_path, monkeypatch, caplog):
    caplog.set_level(logging.INFO)
    monkeypatch.chdir(tmp_path)
    out = tmp_path / "results"
    study = tiny_study(out, pictures="plotting" in trial.given.where)
    owner, name = trial.given.owner()
    with monkeypatch.context() as patch:
        patch.setattr(owner, name, trial.given.put_into(getattr(owner, name)))
        solved = study.run()
    assert (tmp_path / "injected-0").exists()
    assert solved == (not trial.says)
    found = entries(out)
    assert found["B_combined"]["status"] == "solved"
    table = pd.read_csv(out / "cases.csv", keep_default_na=False).set_index("case")
    if trial.says:
        (says,) = trial.says
        assert found["A_combined"]["status"] == table.status["A_combined"] == "failed"
        assert says in found["A_combined"]["message"] == table.message["A_combined"]
        assert says in caplog.text.replace(f"{out}/A_combined/", "")
        assert "1 of 2 cases failed" in caplog.text and "--resume" in caplog.text
        for name in ("summary.csv", "contact.csv"):
            assert set(pd.read_csv(out / name).socket) == {"B"}
        assert study.run(resume=True)
        assert "B_combined: already solved; kept" in caplog.text
    else:
        assert caplog.text.count(trial.given.words[-1]) == 1
    assert same_results(out, unbroken)


def test_the_fault_is_in_run_json_with_its_place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    fault = Fault("calfsocket.mechanics.problem:Problem.residual", call=5)
    owner, name = fault.owner()
    monkeypatch.setattr(owner, name, fault.put_into(getattr(owner, name)))
    assert not tiny_study(tmp_path / "r", ("A",)).run()
    trace = "".join(entries(tmp_path / "r")["A_combined"]["traceback"])
    assert "stepping.py" in trace and "RuntimeError: injected" in trace


@pytest.mark.parametrize("stop", [KeyboardInterrupt, SystemExit])
def test_who_wants_to_end_is_not_a_failing_case(stop, tmp_path, monkeypatch):
    """Ctrl-C inside a callback of PETSc comes out as Ctrl-C."""
    monkeypatch.chdir(tmp_path)
    fault = Fault("calfsocket.mechanics.problem:Problem.tangent", call=5, error=stop.__name__)
    owner, name = fault.owner()
    monkeypatch.setattr(owner, name, fault.put_into(getattr(owner, name)))
    with pytest.raises(stop):
        tiny_study(tmp_path / "r").run()
    assert {entry["status"] for entry in entries(tmp_path / "r").values()} == {"running"}


# -- what --resume keeps --------------------------------------------------------------------------


def drop_rows(path: Path) -> None:
    rows = pd.read_csv(path, dtype=str)
    rows[rows.socket != "A"].to_csv(path, index=False)


@pytest.mark.parametrize(
    ("file", "damage"),
    [
        ("A_combined/fields.vtu", lambda path: path.unlink()),
        ("A_combined/fields.vtu", lambda path: os.truncate(path, 1000)),
        ("A_combined/contact.csv", lambda path: path.write_text("")),
        ("summary.csv", drop_rows),
        ("steps.csv", lambda path: path.write_bytes(b"\x00\xff")),
        ("contact.csv", lambda path: path.unlink()),
    ],
)
def test_results_that_are_not_whole_are_made_anew(file, damage, unbroken, tmp_path, caplog):
    caplog.set_level(logging.INFO)
    out = tmp_path / "results"
    subprocess.run(["cp", "-r", unbroken, out], check=True)
    damage(out / file)
    study = tiny_study(out)
    if file == "steps.csv":  # not a table: nothing can be put into it
        with pytest.raises(WriteError, match=r"steps\.csv: is not the table that this run wrote"):
            study.run(resume=True)
        return
    assert study.run(resume=True)
    assert (
        f"A_combined: solved again, because files are missing or have changed: {file}"
        in caplog.text
    )
    assert same_results(out, unbroken)


def test_nothing_to_do_changes_nothing(unbroken, tmp_path):
    out = tmp_path / "results"
    subprocess.run(["cp", "-r", unbroken, out], check=True)
    before = {path: path.read_bytes() for path in out.rglob("*") if path.is_file()}
    assert tiny_study(out).run(resume=True)
    for path, content in before.items():
        if path.name != "run.json":  # its wall time
            assert path.read_bytes() == content


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda run: run["versions"].update(petsc="3.0"), "was made with other versions"),
        (lambda run: run.update(petsc_options={"x": "1"}), "was made with other petsc_options"),
        (lambda run: run.pop("cases"), "cases: is missing"),
    ],
)
def test_a_run_of_other_versions_is_not_resumed(change, says, unbroken, tmp_path):
    out = tmp_path / "results"
    subprocess.run(["cp", "-r", unbroken, out], check=True)
    run = json.loads((out / "run.json").read_text())
    change(run)
    (out / "run.json").write_text(json.dumps(run))
    with pytest.raises(InputError, match=says):
        tiny_study(out).run(resume=True)


def test_a_foreign_checkpoint_is_left_aside(unbroken, tmp_path, caplog):
    caplog.set_level(logging.INFO)
    out = tmp_path / "results"
    (out / "A_combined").mkdir(parents=True)
    (out / "A_combined" / "checkpoint.npz").write_bytes(b"PK\x03\x04 not one")
    assert tiny_study(out).run(resume=True)
    assert "A_combined: load 0.000, starts from load 0: " in caplog.text
    assert same_results(out, unbroken)


def test_digests_are_of_a_case_alone(unbroken):
    one, other = (restart.digests(unbroken, (socket, "combined")) for socket in "AB")
    assert one["summary.csv"] != other["summary.csv"]
    nobody = restart.digests(unbroken, ("C", "combined"))
    assert nobody["C_combined/fields.vtu"] is None


# -- processes ------------------------------------------------------------------------------------


def start(out: Path, **how: object) -> subprocess.Popen[str]:
    """Start the study as a process of its own."""
    how = {"study": {}} | how | {"out": str(out)}
    ours = ("OMPI_", "PMIX_", "PRTE_")  # of the MPI job that this process is
    return subprocess.Popen(
        [sys.executable, PROGRAM, json.dumps(how)],
        cwd=out.parent,
        env={name: value for name, value in os.environ.items() if not name.startswith(ours)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.fixture
def small_disk(tmp_path):
    """Mount a disk of a size; `resize` it later. It lives as long as this mount namespace."""
    libc = ctypes.CDLL(None, use_errno=True)
    folder = tmp_path / "disk"
    folder.mkdir()

    def mount(size: str, flags: int = 0) -> Path:
        options = f"size={size}".encode()
        if libc.mount(b"tmpfs", os.fsencode(folder), b"tmpfs", flags, options) != 0:
            pytest.skip(f"cannot mount here: {os.strerror(ctypes.get_errno())}")
        return folder

    yield mount
    libc.umount2(os.fsencode(folder), 2)


@pytest.mark.parametrize(
    ("size", "expected"),
    [
        ("16k", ("running", "running")),  # run.json can be written once, but not replaced
        ("500k", ("solved", "failed")),
    ],
)
def test_a_full_disk(size, expected, small_disk, unbroken):
    out = small_disk(size) / "results"
    process = start(out)
    _, errors = process.communicate(timeout=120)
    assert process.returncode == 1
    assert "No space left on device; free some space" in errors
    assert "Traceback" not in errors
    statuses = {case: entry["status"] for case, entry in entries(out).items()}
    assert statuses == dict(zip(("A_combined", "B_combined"), expected, strict=True))
    for path in out.rglob("*.csv"):
        assert len(pd.read_csv(path)) > 0
    small_disk("64m", 32)  # MS_REMOUNT
    process = start(out, resume=True)
    process.communicate(timeout=120)
    assert process.returncode == 0
    assert same_results(out, unbroken)


def test_a_limit_on_the_size_of_files(unbroken, tmp_path):
    out = tmp_path / "results"
    process = start(out, largest_file=150_000)
    _, errors = process.communicate(timeout=120)
    assert process.returncode == 1
    assert errors.count("fields.vtu: cannot be written: File too large") == 4  # twice a case
    assert "Traceback" not in errors


FREED = """
import signal, sys, time
from calfsocket.parallel.abort import exit_code, handle_termination

class Freed:
    def __del__(self):
        signal.raise_signal({number})

signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored in a shell's background jobs
handle_termination()
freed = Freed()
try:
    del freed
    time.sleep(10)
except KeyboardInterrupt as interrupt:
    sys.exit(exit_code(interrupt))
"""


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_while_an_object_is_freed_is_not_lost(number, code):
    """Python drops an exception there, with a traceback, and would go on."""
    command = [sys.executable, "-c", FREED.format(number=int(number))]
    process = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert process.returncode == code
    assert process.stderr == ""


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_ctrl_c_ends_it_with_one_line(number, code, unbroken, tmp_path):
    out = tmp_path / "results"
    process = start(out)
    while not (out / "A_combined" / "checkpoint.npz").exists():
        time.sleep(0.01)
    process.send_signal(number)
    _, errors = process.communicate(timeout=10)
    assert process.returncode == code
    assert errors.count("calfsocket: interrupted\n") == 1
    assert "Traceback" not in errors
    assert entries(out)["B_combined"]["status"] == "running"
    assert not [path for path in out.rglob(".unfinished-*")]
    process = start(out, resume=True)
    _, errors = process.communicate(timeout=120)
    assert process.returncode == 0
    assert "resumes from its last equilibrium" in errors
    assert same_results(out, unbroken)


def test_a_second_run_into_the_folder_of_a_running_one_is_refused(unbroken, tmp_path):
    out = tmp_path / "results"
    first = start(out)
    while not (out / "A_combined" / "checkpoint.npz").exists():
        time.sleep(0.01)
    first.send_signal(signal.SIGSTOP)
    before = (out / "run.json").read_bytes()
    for how in ({}, {"resume": True}):
        second = start(out, **how)
        _, errors = second.communicate(timeout=120)
        assert second.returncode == 2
        (line,) = errors.splitlines()
        who = f"process {first.pid} on {socket.gethostname()} (since {time.strftime('%Y-')}"
        assert line.startswith(f"calfsocket: {out}: {who}") and "name another folder" in line
        assert (out / "run.json").read_bytes() == before
    first.kill()  # what it leaves behind blocks nobody
    first.communicate()
    again = start(out, resume=True)
    _, errors = again.communicate(timeout=120)
    assert again.returncode == 0, errors
    assert same_results(out, unbroken)


@pytest.mark.parametrize("kills", [3, pytest.param(50, marks=pytest.mark.slow)])
def test_killed_at_random_moments(kills, unbroken, tmp_path):
    """kill -9, and on with --resume, until all is solved; again with a new folder until enough."""
    chance = random.Random(kills)
    clock = time.monotonic()
    process = start(tmp_path / "whole")
    process.communicate(timeout=120)
    assert process.returncode == 0
    whole = time.monotonic() - clock
    killed, resumed, finished = 0, 0, 0
    while killed < kills or not finished:
        out = tmp_path / f"results{finished}"
        while True:
            process = start(out, resume=True)
            try:
                # Nothing is at stake before the imports are done.
                limit = chance.uniform(0.4, 1.0) * whole if killed < kills else 120
                _, errors = process.communicate(timeout=limit)
            except subprocess.TimeoutExpired:
                process.kill()
                _, errors = process.communicate()
                killed += 1
            resumed += errors.count("resumes from its last equilibrium")
            if (out / "run.json").exists():
                assert entries(out)
            assert "Traceback" not in errors
            if process.returncode == 0:
                break
        assert same_results(out, unbroken)
        finished += 1
    assert killed == kills
    if kills >= 50:  # a few may all come before the first equilibrium
        assert resumed > kills / 10
