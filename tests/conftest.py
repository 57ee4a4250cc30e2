"""Shared by all tests: order among MPI ranks, and programs run on several ranks."""

import gc
import os
import subprocess
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import pytest
from mpi4py import MPI

REPOSITORY = Path(__file__).resolve().parent.parent
ENVIRONMENT = REPOSITORY / "debian13-environment"


@pytest.fixture(autouse=True)
def ranks_in_step() -> Iterator[None]:
    """After each test, free PETSc's objects and wait: a rank that hangs shows in its own test."""
    yield
    gc.collect()
    MPI.COMM_WORLD.barrier()


@pytest.fixture
def mpirun(tmp_path: Path) -> Callable[..., str]:
    """Run a Python program on n ranks, in the test's own folder; return its standard output.

    ``mpirun(3, ["-m", "calfsocket", "--size", "coarse"])``, ``mpirun(2, ["-c", "..."])`` or
    ``mpirun(2, [script])``. Another exit code than ``code``, or no end within ``timeout`` seconds,
    fails the test.
    """

    def run(n: int, program: Sequence[str | Path], timeout: float = 300, code: int = 0) -> str:
        command = [ENVIRONMENT, "mpirun", "-n", str(n), "python3", *program]
        ours = ("OMPI_", "PMIX_", "PRTE_")  # of the MPI job that this process is
        process = subprocess.Popen(
            [str(word) for word in command],
            cwd=tmp_path,
            env={k: v for k, v in os.environ.items() if not k.startswith(ours)},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        try:
            output, errors = process.communicate(timeout=timeout)
        except subprocess.TimeoutExpired:
            process.terminate()  # mpirun then ends its ranks; killed, it could not
            output, errors = process.communicate()
            pytest.fail(f"no end within {timeout} s on {n} ranks\n{output}\n{errors}")
        if process.returncode != code:
            pytest.fail(f"exit code {process.returncode} on {n} ranks\n{output}\n{errors}")
        return output

    return run
