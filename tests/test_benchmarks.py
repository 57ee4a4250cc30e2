"""The benchmarks' own arithmetic; what they measure is not tested but printed."""

import sys
from pathlib import Path

import pytest

from benchmarks import __main__ as command
from benchmarks import measures, process

CHECKOUT = Path(measures.__file__).resolve().parents[1]


def program(monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    """Let a program stand for `python3 -m calfsocket`."""
    original = process.subprocess.Popen

    def started(_command, **how):
        return original([sys.executable, "-u", "-c", text], **how)

    monkeypatch.setattr(process.subprocess, "Popen", started)


def test_iterations_are_those_of_the_case_and_end_the_process(monkeypatch):
    program(
        monkeypatch,
        "import time\n"
        "print('  0 SNES Function norm 1')\n"  # of the ring
        "print('one: mesh and set-up')\n"
        "print('  0 SNES Function norm 1')\n"
        "time.sleep(0.3)\n"
        "print('  1 SNES Function norm 1')\n"
        "time.sleep(60)\n",
    )
    ended = process.run([], CHECKOUT, iterations=2)
    (first, _), (second, _) = ended.iterations
    assert 0.25 < second - first < 30
    assert ended.memory > 1


def test_a_process_that_fails_is_reported_with_its_output(monkeypatch):
    program(monkeypatch, "import sys; print('why'); sys.exit(3)")
    with pytest.raises(RuntimeError, match="exit code 3\nwhy"):
        process.run([], CHECKOUT)


def test_exponents_are_those_of_the_costs(monkeypatch):
    def iterations(_subject, size, n=1):
        step = 1e-6 * size**1.2
        return process.Ended(0.0, 0.0, 0.1 * size**0.9, [(i * step, i * step) for i in range(5)])

    monkeypatch.setattr(measures, "_iterations", iterations)
    found = measures.growth(measures.Subject(CHECKOUT))
    assert found["exponent_of_iteration"] == pytest.approx(1.2)
    assert found["exponent_of_memory"] == pytest.approx(0.9)


def test_a_machine_that_is_twice_as_fast_has_the_same_ratios():
    numbers = {"check_of_four_cases_s": 2.0, "case_paper_MB": 800.0, "exponent": 1.1}
    baseline = {"numbers": command.in_units({"unit_s": 0.1, "numbers": numbers})}
    fast = {name: value / 2 if name.endswith("_s") else value for name, value in numbers.items()}
    rows = command.compared({"unit_s": 0.05, "numbers": fast}, baseline)
    assert [ratio for *_, ratio in rows] == pytest.approx([1.0, 1.0, 1.0])
    assert rows[0][:3] == ("check_of_four_cases_s", 1.0, pytest.approx(1.0))


def test_the_page_has_a_place_for_the_table():
    text = command.PAGE.read_text(encoding="utf-8")
    assert text.count(command.BEGIN) == text.count(command.END) == 1
