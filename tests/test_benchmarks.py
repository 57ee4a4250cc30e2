"""The benchmarks' own arithmetic; what they measure is not tested but printed."""

import io
import sys

import pytest
from rich.console import Console

from benchmarks import growth, measure, ranks, report, runs, start


def test_a_process_is_timed_and_its_first_iteration_is_the_studys():
    program = (
        "import time\n"
        "print('  0 SNES Function norm 1', flush=True)\n"
        "print('  1 SNES Function norm 1', flush=True)\n"  # of the ring
        "time.sleep(0.3)\n"
        "print('  1 SNES Function norm 1', flush=True)\n"
        "time.sleep(0.3)\n"
    )
    seconds, first, memory = measure.process([sys.executable, "-c", program])
    assert first is not None
    assert 0.3 < first < seconds - 0.25
    assert memory > 1


def test_a_process_that_fails_is_reported_with_its_output():
    with pytest.raises(RuntimeError, match="exit code 3\nwhy"):
        measure.process([sys.executable, "-c", "import sys; sys.stderr.write('why'); sys.exit(3)"])


def test_exponents_are_those_of_the_costs(monkeypatch):
    import pandas as pd

    from calfsocket.simulation.profile import FACTORISATION, SOLVE, TRIANGULAR

    def study(*options):
        n = int(options[1])
        profile = pd.DataFrame(
            [(SOLVE, FACTORISATION, 10 * 1e-6 * n**1.5), (SOLVE, TRIANGULAR, 10 * 1e-6 * n**1.1)],
            columns=["level", "what", "seconds"],
        )
        case = {
            "checks": {"cells": n, "unknowns": 9 * n, "newton_iterations": 10, "failed_steps": 0},
            "seconds": {"mesh": 1e-4 * n, "solve": 10 * (1e-6 * (n**1.5 + n**1.1) + 1e-5 * n)},
        }
        return measure.Measured(1.0, 0.5, 0.1 * n**1.2, {"cases": {"one": case}}, profile)

    monkeypatch.setattr(growth, "study", study)
    exponents = growth.measure(("1000", "10000", "100000"))["exponents"]
    expected = {
        "factorisation_s": 1.5,
        "triangular_solve_s": 1.1,
        "other_s": 1.0,
        "mesh_s": 1.0,
        "memory_MiB": 1.2,
    }
    for name, value in expected.items():
        assert exponents[name] == pytest.approx(value, abs=1e-6), name


def test_tables_show_measured_and_bar():
    shown = Console(width=200, record=True, file=io.StringIO())
    shown.print(
        ranks.table(
            {
                "size": "paper",
                "six_on_1_s": 100.0,
                "six_on_2_s": 54.0,
                "six_ratio": 0.54,
                "one_on_1_s": 20.0,
                "one_on_2_s": 18.0,
                "one_ratio": 0.9,
            }
        )
    )
    times = {"help_s": 0.1, "first_iteration_cold_s": 20.0, "first_iteration_cached_s": 5.0}
    shown.print(start.table({"size": "paper", "compiled": 16, "compiled_again": 0, **times}))
    text = shown.export_text()
    assert "0.54" in text and "0.55" in text and "16 / 0" in text and "20.00" in text
    assert set(runs.ITERATIONS) == {
        (socket, name) for socket in ("TC", "TSB", "HS") for name in ("separate", "combined")
    }


def test_processor_time_is_that_of_all_processes_of_a_command():
    work = "x = 0\nfor i in range(10**7): x += i\n"
    nested = f"import subprocess, sys; subprocess.run([sys.executable, '-c', {work!r}])"
    idle = report.timed([sys.executable, "-c", "import time; time.sleep(0.5)"])
    assert idle["seconds"] > 0.5 > idle["processor_s"]
    assert report.timed([sys.executable, "-c", nested])["processor_s"] > 0.1
    shown = io.StringIO()
    Console(file=shown, width=100).print(report.table({"size": "coarse", "picture": idle}))
    assert "picture" in shown.getvalue()
