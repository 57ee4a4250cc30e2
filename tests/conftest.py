"""Shared by all tests: order among MPI ranks, and programs run on several ranks."""

import gc
import json
import os
import subprocess
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import pytest
from mpi4py import MPI

REPOSITORY = Path(__file__).resolve().parent.parent
ENVIRONMENT = REPOSITORY / "debian13-environment"


def pytest_collection_finish() -> None:
    """Keep what the tests import out of the collections below: 0.1 to 0.2 s a test."""
    gc.collect()
    gc.freeze()


@pytest.fixture(autouse=True)
def ranks_in_step() -> Iterator[None]:
    """After each test, free PETSc's objects and wait: a rank that hangs shows in its own test."""
    yield
    gc.collect()
    MPI.COMM_WORLD.barrier()


@pytest.fixture
def launch(tmp_path: Path) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Run a Python program on n ranks, in the test's own folder; return how it ended.

    ``launch(3, ["-m", "calfsocket", "--size", "coarse"])``, ``launch(2, ["-c", "..."])`` or
    ``launch(2, [script])``. No end within ``timeout`` seconds fails the test.
    """

    def run(
        n: int, program: Sequence[str | Path], timeout: float = 300
    ) -> subprocess.CompletedProcess[str]:
        command = [ENVIRONMENT, "mpirun", "-n", str(n), "python3", *program]
        ours = ("OMPI_", "PMIX_", "PRTE_")  # of the MPI job that this process is
        process = subprocess.Popen(
            [str(word) for word in command],
            cwd=tmp_path,
            env={k: v for k, v in os.environ.items() if not k.startswith(ours)},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            errors="replace",
        )
        try:
            output, errors = process.communicate(timeout=timeout)
        except subprocess.TimeoutExpired:
            process.terminate()  # mpirun then ends its ranks; killed, it could not
            output, errors = process.communicate()
            pytest.fail(f"no end within {timeout} s on {n} ranks\n{output}\n{errors}")
        return subprocess.CompletedProcess(command, process.returncode, output, errors)

    return run


@pytest.fixture
def mpirun(launch: Callable[..., subprocess.CompletedProcess[str]]) -> Callable[..., str]:
    """As `launch`; another exit code than ``code`` fails the test. Returns standard output."""

    def run(n: int, program: Sequence[str | Path], timeout: float = 300, code: int = 0) -> str:
        ended = launch(n, program, timeout)
        if ended.returncode != code:
            pytest.fail(
                f"exit code {ended.returncode} on {n} ranks\n{ended.stdout}\n{ended.stderr}"
            )
        return ended.stdout

    return run


@pytest.fixture(scope="session")
def six_runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results of six hand-made runs, with their report."""
    from calfsocket.report.writing import write_report
    from report_results import limb_study, write_results

    folder = write_results(tmp_path_factory.mktemp("six"), limb_study())
    write_report(folder)
    return folder


WHY = "load 0.3 & no <script>alert(1)</script>"


@pytest.fixture(scope="session")
def one_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results of one hand-made run, unstable, beside one that failed for `WHY`; with report."""
    from calfsocket.report.writing import write_report
    from report_results import limb_study, write_results

    folder = tmp_path_factory.mktemp("one")
    write_results(folder, limb_study((("HS", "separate"),)), failed={"HS_combined": WHY})
    run = json.loads((folder / "run.json").read_text())
    run["cases"]["HS_separate"] |= {"negative_modes": 2, "warnings": ["unstable equilibrium"]}
    (folder / "run.json").write_text(json.dumps(run))
    write_report(folder)
    return folder
