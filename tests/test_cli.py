"""The command line as a person meets it: help, bad input, exit codes."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parent.parent


def calfsocket(*words: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "calfsocket", *words],
        cwd=cwd,
        env=os.environ | {"PYTHONPATH": os.fspath(REPOSITORY)},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


def test_help_teaches_and_is_quick(tmp_path):
    start = time.perf_counter()
    run = calfsocket("--help", cwd=tmp_path)
    elapsed = time.perf_counter() - start
    assert run.returncode == 0
    for word in ("--size", "--sockets", "--socket-support", "summary.csv", "mpirun", "mesh"):
        assert word in run.stdout
    # No MPI, no dolfinx: a few tenths of a second, on a busy machine a few more.
    assert elapsed < 5


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--sizes", "coarse"], ["--sizes", "did you mean --size?"]),
        (["studdy"], ["studdy", "no such option or command"]),
        (["--size", "tiny"], ["tiny", "coarse, medium, paper"]),
        (["--sockets", "TC,XX"], ["--sockets", "'XX'", "TC, TSB, HS"]),
        (["--sockets", "TC,tc"], ["--sockets", "twice"]),
        (["--sockets", ""], ["--sockets", "TC, TSB, HS"]),
        (["--materials", "separate,both"], ["--materials", "'both'", "separate, combined"]),
        (["--socket-support", "glued"], ["--socket-support", "floating", "outer-fixed"]),
        (["--fascia-c10", "5"], ["--fascia-c10", "printed", "tables"]),
        (["--friction", "-0.1"], ["--friction", "-0.1", "0 or more"]),
        (["--friction", "nan"], ["--friction", "nan"]),
        (["--friction", "much"], ["--friction", "'much'"]),
        (["--ranks-per-case", "0"], ["--ranks-per-case", "1 to 1"]),
        (["--ranks-per-case", "2"], ["--ranks-per-case", "mpirun"]),
        (["--out", "/proc/calfsocket"], ["--out", "/proc/calfsocket"]),
        (["mesh", "--socket", "HS"], ["--out"]),
        (["mesh", "--socket", "XX", "--out", "x.msh"], ["XX", "HS"]),
        (["picture", "nowhere"], ["nowhere"]),
        (["verify", "--only", "element,limbs"], ["--only", "'limbs'", "exact_ring", "limb"]),
        (["verify", "--size", "paper"], ["--size", "paper", "two"]),
        (["verify", "--size", "coarse,tiny"], ["size", "tiny", "medium"]),
        (["calibrate", "--specimen", "arm"], ["--specimen", "compound", "limb"]),
        (["calibrate", "--out", "/proc/calibration"], ["--out", "/proc/calibration"]),
    ],
)
def test_bad_input_gets_one_line_and_exit_code_2(words, says, tmp_path):
    run = calfsocket(*words, cwd=tmp_path)
    assert run.returncode == 2
    assert run.stdout == ""
    lines = run.stderr.strip().splitlines()
    assert len(lines) == 1, run.stderr
    assert lines[0].startswith("calfsocket: ")
    for word in says:
        assert word in lines[0]
    assert list(tmp_path.iterdir()) == []


def test_bad_input_is_said_once_under_mpirun(mpirun, tmp_path):
    output = mpirun(2, ["-m", "calfsocket", "--size", "tiny"], timeout=120, code=2)
    assert output == ""
    assert list(tmp_path.iterdir()) == []
