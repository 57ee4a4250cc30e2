"""Where the time goes: events are counted where they happen, and nothing is counted twice."""

import io
from types import SimpleNamespace

import pandas as pd
import pytest
from mpi4py import MPI
from rich.console import Console

from calfsocket.mechanics.stepping import LoadStepper, LoadSteps
from calfsocket.simulation import profile
from calfsocket.simulation.profile import (
    FACTORISATION,
    SOLVE,
    TRIANGULAR,
    Phases,
    Profile,
    solve_ratio,
)
from ring_model import ring_model


@pytest.fixture(scope="module")
def solved():
    mine = Profile()
    stepper = LoadStepper(ring_model(MPI.COMM_SELF, h=6.0), LoadSteps())
    stepper.newton.factorise()  # not counted yet
    mine.start()
    stepper.run()
    mine.stop()
    stepper.newton.factorise()  # not counted any more
    return stepper, mine.rows({"mesh": 1.0, "solve": 2.0})


def test_events_are_those_of_the_solution(solved):
    stepper, rows = solved
    calls = rows.set_index(["level", "what"])["calls"]
    iterations = sum(step.newton.iterations for step in stepper.steps)
    for level, what in (
        (SOLVE, FACTORISATION),
        (SOLVE, TRIANGULAR),
        (SOLVE, "tangent"),
        ("within", "tangent: tissues"),
        ("within", "tangent: contact"),
    ):
        assert calls[level, what] == iterations, what
    # Full steps: one residual an iteration, and one where each step begins.
    assert calls[SOLVE, "residual"] == iterations + len(stepper.steps)
    assert calls["dolfinx", "Build dofmap data"] >= 1


def test_the_parts_are_the_whole(solved):
    _, rows = solved
    assert rows[rows["level"] == SOLVE]["seconds"].sum() == pytest.approx(2.0)
    seconds = rows.set_index(["level", "what"])["seconds"]
    assert 0 < seconds["within", "tangent: tissues"] < seconds[SOLVE, "tangent"]
    assert 0 < seconds["within", "residual: contact"] < seconds[SOLVE, "residual"]
    assert (seconds >= 0).all()


def test_ratio_is_of_the_solution_to_its_algebra():
    rows = pd.DataFrame(
        [("phase", "solve", 1, 14.0), (SOLVE, FACTORISATION, 9, 8.0), (SOLVE, TRIANGULAR, 9, 2.0)],
        columns=["level", "what", "calls", "seconds"],
    )
    assert solve_ratio(rows) == pytest.approx(1.4)


def test_table_has_a_column_a_case(solved, tmp_path):
    rows = solved[1]
    cases = []
    for socket in ("TC", "HS"):
        case = rows.copy()
        case.insert(0, "socket", socket)
        case.insert(1, "material_set", "separate")
        cases.append(case)
    pd.concat(cases).to_csv(tmp_path / profile.PROFILE_FILE, index=False)
    console = Console(width=160, record=True, file=io.StringIO())
    console.print(profile.table(tmp_path))
    text = console.export_text()
    assert "TC separate" in text and "HS separate" in text
    assert "1.00" in text and FACTORISATION in text and "ratio" not in text.split("\n")[0]


def test_a_phase_does_not_count_what_another_inside_it_does(monkeypatch):
    clock = iter([0, 10, 11, 20, 22, 100])
    monkeypatch.setattr(profile, "time", SimpleNamespace(perf_counter=lambda: next(clock)))
    phase = Phases()
    with phase("solve"):
        for _ in range(2):
            with phase("checkpoints"):
                pass
    assert phase.seconds == {"checkpoints": 1 + 2, "solve": 100 - 3}
