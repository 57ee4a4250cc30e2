"""Shared by all tests: order among MPI ranks, and programs run on several ranks."""

import gc
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from mpi4py import MPI

if TYPE_CHECKING:
    from calfsocket.simulation.results import Results

REPOSITORY = Path(__file__).resolve().parent.parent
#: A rank that waits gives its processor away: other tests run beside it, on as many cores as ranks.
POLITE = {"OMPI_MCA_mpi_yield_when_idle": "1", "MPIR_CVAR_ENABLE_HEAVY_YIELD": "1"}


def on_ranks(n: int, program: Sequence[str | Path]) -> list[str]:
    """Return the command that runs a Python program on n ranks of the MPI that is here."""
    if find_spec("dolfinx_solver"):  # installed by pip, with an MPI of its own
        command = [Path(sys.prefix) / "bin" / "mpirun", "-n", n, sys.executable, *program]
    else:
        command = [REPOSITORY / "debian13-environment", "mpirun", "-n", n, "python3", *program]
    return [str(word) for word in command]


@pytest.fixture(autouse=True)
def ranks_in_step() -> Iterator[None]:
    """After each test, free PETSc's objects and wait: a rank that hangs shows in its own test.

    One rank alone waits for nobody, and a collection takes 0.1 to 0.2 s.
    """
    yield
    if MPI.COMM_WORLD.size > 1:
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
        command = on_ranks(n, program)
        ours = ("OMPI_", "PMIX_", "PRTE_", "PMI_")  # of the MPI job that this process is
        environment = {k: v for k, v in os.environ.items() if not k.startswith(ours)}
        process = subprocess.Popen(
            command,
            cwd=tmp_path,
            env=environment | POLITE,
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


def write_small_report(folder: Path) -> Path:
    """Write the report of a folder with small figures."""
    from report_text import write_small

    from calfsocket.simulation.results import load_results

    write_small(load_results(folder))
    return folder


@pytest.fixture(scope="session")
def six_runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results of six hand-made runs, with their report."""
    from report_results import limb_study, write_results

    return write_small_report(write_results(tmp_path_factory.mktemp("six"), limb_study()))


@pytest.fixture(scope="session")
def six_results() -> "Results":
    """Results of six hand-made runs, in no file."""
    from report_results import limb_study, results_of

    return results_of(limb_study())


WHY = "load 0.3 & no <script>alert(1)</script>"


@pytest.fixture(scope="session")
def one_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results of one hand-made run, unstable, beside one that failed for `WHY`; with report."""
    from report_results import checks, limb_study, result, write_results

    key = ("HS", "separate")
    fields, line = limb_study((key,))[key]
    unstable = result(key, fields, line, checks=checks(fields, line, negative_modes=2))
    folder = tmp_path_factory.mktemp("one")
    return write_small_report(
        write_results(folder, {key: unstable}, failed={("HS", "combined"): WHY})
    )
