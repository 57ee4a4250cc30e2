"""The command line as a person meets it: help, bad input, exit codes."""

import gc
import os
import subprocess
import sys
from pathlib import Path

import pytest

from calfsocket import cli
from calfsocket.calibration import run as calibration
from calfsocket.parallel.abort import Terminated
from calfsocket.study.study import Study

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


def test_help_teaches_and_waits_for_no_heavy_package(tmp_path):
    program = (
        "import contextlib, sys, calfsocket\n"
        "before = set(sys.modules)\n"  # mpi4py, where pip installed it
        "from calfsocket import cli\n"
        "with contextlib.suppress(SystemExit): cli.main(['--help'])\n"
        "heavy = {'numpy', 'pydantic', 'rich', 'mpi4py', 'petsc4py', 'dolfinx'}\n"
        "print(heavy & (set(sys.modules) - before))"
    )
    run = subprocess.run(
        [sys.executable, "-c", program],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": os.fspath(REPOSITORY)},
        capture_output=True,
        text=True,
        check=True,
    )
    *printed, loaded = run.stdout.splitlines()
    for word in ("--size", "--sockets", "--socket-support", "summary.csv", "mpirun", "mesh"):
        assert word in "\n".join(printed)
    assert loaded == "set()"


MESH = ["mesh", "--socket", "HS", "--size", "coarse", "--out", "hs.msh"]


def test_what_solves_a_study_waits_for_no_table():
    program = (
        "import sys, calfsocket.study.runner; print({'pandas', 'matplotlib'} & {*sys.modules})"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert done.stdout == "set()\n"


def test_a_command_leaves_pythons_garbage_collector_as_it_was(capsys):
    before = gc.get_threshold()
    assert cli.main(["schema"]) == 0
    capsys.readouterr()
    assert gc.get_threshold() == before


@pytest.mark.parametrize(
    ("words", "code"), [(["schema"], 0), (["picture", "nowhere"], 2), (MESH, 0)]
)
def test_a_command_of_one_process_starts_no_mpi(tmp_path, words, code):
    program = (
        "import sys\n"
        "from calfsocket import cli\n"
        "before = set(sys.modules)\n"  # mpi4py, where pip installed it
        f"print(cli.main({words}))\n"
        "print({'mpi4py'} & (set(sys.modules) - before))"
    )
    launched = ("OMPI_", "PMIX_", "PMI_")
    alone = {name: of for name, of in os.environ.items() if not name.startswith(launched)}
    run = subprocess.run(
        [sys.executable, "-c", program],
        cwd=tmp_path,
        env=alone | {"PYTHONPATH": os.fspath(REPOSITORY)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert run.stdout.splitlines()[-2:] == [str(code), "set()"]


@pytest.mark.parametrize("name", cli.COMMANDS)
def test_every_command_is_listed_and_has_help(name, capsys):
    with pytest.raises(SystemExit) as end:
        cli.main(["--help"])
    assert end.value.code == 0
    assert f"  {name:10s} {cli.COMMANDS[name].help}\n" in capsys.readouterr().out
    with pytest.raises(SystemExit) as end:
        cli.main([name, "--help"])
    assert end.value.code == 0
    printed = capsys.readouterr().out
    assert printed.startswith(f"usage: python3 -m calfsocket {name} ")
    # argparse breaks lines anew.
    assert " ".join(cli.COMMANDS[name].description.split()) in " ".join(printed.split())


def test_calibration_goes_where_the_report_looks_for_it(capsys):
    with pytest.raises(SystemExit):
        cli.main(["calibrate", "--help"])
    printed = " ".join(capsys.readouterr().out.split())
    assert "--out DIR default: results/calibration," in printed


@pytest.mark.parametrize("command", [[], ["calibrate"]])
@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--friction", "-0.1"], "--friction: '-0.1' is not a number of 0 or more"),
        (["--friction", "inf"], "--friction: 'inf' is not a number of 0 or more"),
        (["--friction", "nan"], "--friction: 'nan' is not a number of 0 or more"),
        (["--friction", "much"], "--friction: 'much' is not a number of 0 or more"),
        (["--size", "tiny"], "size: no mesh size 'tiny'; allowed: adaptive, coarse, medium, paper"),
        (["--material", "fascia"], "--material: is 'fascia'; it must be TISSUE=FILE.toml"),
        (["--material", "fascia=no.toml"], "no.toml: cannot be read"),
    ],
)
def test_what_study_and_calibration_share_is_refused_by_both(
    command, words, says, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(Study, "run", lambda *_, **__: pytest.fail("solved"))
    monkeypatch.setattr(calibration, "calibrate", lambda *_, **__: pytest.fail("solved"))
    assert cli.main([*command, *words]) == 2
    output, errors = capsys.readouterr()
    (line,) = errors.splitlines()
    assert output == "" and says in line
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--sizes", "coarse"], ["--sizes", "did you mean --size?"]),
        (["studdy"], ["studdy", "no such option or command"]),
        (["--sockets", "TC,XX"], ["--sockets", "'XX'", "TC, TSB, HS"]),
        (["--sockets", "TC,tc"], ["--sockets", "twice"]),
        (["--sockets", ""], ["--sockets", "TC, TSB, HS"]),
        (["--materials", "separate,both"], ["--materials", "'both'", "separate, combined"]),
        (["--socket-support", "glued"], ["--socket-support", "floating", "outer-fixed"]),
        (["--fascia-c10", "5"], ["--fascia-c10", "printed", "tables"]),
        (["--ranks-per-case", "0"], ["--ranks-per-case", "1 to 1"]),
        (["--ranks-per-case", "2"], ["--ranks-per-case", "MPI ranks"]),
        (["--out", "/proc/calfsocket"], ["--out", "/proc/calfsocket"]),
        (["--resume", "--overwrite"], ["--resume", "--overwrite", "use one of the two"]),
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
def test_bad_input_gets_one_line_and_exit_code_2(words, says, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    assert cli.main(words) == 2
    output, errors = capfd.readouterr()
    assert output == ""
    (line,) = errors.strip().splitlines()
    assert line.startswith("calfsocket: ")
    for word in says:
        assert word in line
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("words", [[], ["--resume"]])
def test_resume_continues_with_what_is_there(words, tmp_path, monkeypatch):
    asked = []

    def solve(study, *_, resume, **__):
        asked.append(resume)
        return {case.key for case in study.plan.to_solve}

    monkeypatch.setattr(Study, "run", solve)
    assert cli.main([*words, "--out", str(tmp_path / "r"), "--no-report"]) == 0
    assert asked == [bool(words)]


@pytest.mark.parametrize(("interrupt", "code"), [(KeyboardInterrupt, 130), (Terminated, 143)])
def test_an_interrupt_is_one_line_that_says_how_to_continue(
    interrupt, code, tmp_path, monkeypatch, capsys
):
    def stop(*_, **__):
        raise interrupt

    monkeypatch.setattr(Study, "run", stop)
    assert cli.main(["--out", str(tmp_path / "r")]) == code
    (line,) = capsys.readouterr().err.splitlines()
    assert line == (
        f"calfsocket: interrupted; the finished cases are complete in {tmp_path / 'r'}, and the "
        "same command with --resume continues"
    )


def test_the_exit_code_reaches_the_shell(tmp_path):
    run = calfsocket("picture", "nowhere", cwd=tmp_path)
    assert run.returncode == 2
    assert run.stdout == ""
    assert run.stderr.startswith("calfsocket: ") and run.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_bad_input_is_said_once_under_mpirun(launch, tmp_path):
    ended = launch(2, ["-m", "calfsocket", "--size", "tiny"], timeout=120)
    assert ended.returncode == 2
    assert ended.stdout == ""
    # mpirun adds a note on the exit code.
    (line,) = [line for line in ended.stderr.splitlines() if "calfsocket" in line]
    assert line.startswith("calfsocket: ") and "tiny" in line
    assert "Traceback" not in ended.stderr
    assert list(tmp_path.iterdir()) == []


def test_what_the_first_rank_refuses_all_ranks_refuse(mpirun):
    program = (
        "import sys; from mpi4py import MPI\n"
        "from calfsocket.parallel.first_rank import on_first_rank\n"
        "from calfsocket.io.errors import InputError\n"
        "def refuse(): raise InputError(f'refused on {MPI.COMM_WORLD.rank}')\n"
        "try: on_first_rank(MPI.COMM_WORLD, refuse)\n"
        "except InputError as error: sys.stdout.write(f'{error}\\n')\n"
        "on_first_rank(MPI.COMM_WORLD, lambda: sys.stdout.write('done\\n'))\n"
    )
    output = mpirun(2, ["-c", program], timeout=60)
    assert sorted(output.split("\n")) == ["", "done", "refused on 0", "refused on 0"]
