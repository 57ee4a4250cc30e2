"""Cases of one geometry share mesh, problem and analysis; each has the digits that it has alone."""

import gc
import json
import weakref
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from mpi4py import MPI

from calfsocket.contact.parameters import Contact
from calfsocket.io.errors import ConvergenceError
from calfsocket.materials.liner import Liner
from calfsocket.materials.material_set import MaterialSet
from calfsocket.mechanics.layout import Layout
from calfsocket.mechanics.loading import Loading
from calfsocket.mechanics.stepping import LoadSteps
from calfsocket.parallel.scheduler import FREE, chosen
from calfsocket.simulation import simulation
from calfsocket.simulation.prepared import Prepared
from calfsocket.simulation.simulation import Monitor, Simulation
from tiny_study import tiny_limb, tiny_socket, tiny_study

COMBINED = MaterialSet.paper("combined")
STIFF = COMBINED.replace(fat=COMBINED.laws["fat"].model_copy(update={"mu": (0.02,)}))
PROGRAM = Path(__file__).with_name("tiny_study.py")

# What differs from the first: numbers, the foundation, how it is donned, what follows, the shape.
TRIALS = {
    "first": {},
    "slippery": {"contact": Contact(friction=0.3)},
    "rough": {"contact": Contact(friction=0.9)},
    "stiff": {"materials": STIFF},
    # This one comes to no equilibrium at full load.
    "frictionless": {"contact": Contact(friction=0.0), "steps": LoadSteps(smallest=0.05)},
    "expanded": {"donning": "expanded"},
    "fixed": {"support": "outer-fixed"},
    "swollen": {
        "loading": Loading(stages=[{"name": "swollen", "volume": {"muscle": 0.02}}]),
    },
    "other socket": {"socket": tiny_socket("B")},
    "undersized liner": {"liner": Liner(thickness=2.0, law="gel", undersize=0.02)},
    "wider liner": {"liner": Liner(thickness=2.0, law="urethane", undersize=0.0)},
}


def simulated(name: str) -> Simulation:
    given = {"socket": tiny_socket("A"), "materials": COMBINED} | TRIALS[name]
    return Simulation(tiny_limb(), mesh_size="coarse", comm=MPI.COMM_SELF, **given)


def digits(name: str, prepared: Prepared | None = None) -> bytes:
    """All that a case shows, bit by bit, the last residuals included."""
    try:
        result = simulated(name).solve(prepared=prepared)
    except ConvergenceError as error:
        result = error.result
    states = [result, *result.states.values()]
    parts = [state.fields.displacement.tobytes() for state in states]
    parts += [state.fields.stress.tobytes() for state in states]
    parts += [state.line.pressure_kPa.tobytes() for state in states]
    return b"".join([*parts, result.steps.residual_N_per_mm.to_numpy().tobytes()])


@pytest.fixture(scope="module")
def alone() -> dict[str, bytes]:
    return {name: digits(name) for name in TRIALS}


@pytest.mark.parametrize("backwards", [False, True])
def test_a_case_has_the_same_digits_after_any_other(alone, backwards):
    prepared, names = Prepared(), [*TRIALS, "first", "rough"]
    for before, name in pairwise(["nothing", *(names[::-1] if backwards else names)]):
        assert digits(name, prepared) == alone[name], f"{name} after {before}"


def test_a_case_has_the_same_digits_after_one_that_ends_on_its_way(alone):
    class Stopped(Monitor):
        def step(self, step) -> None:
            raise RuntimeError("stopped")

    for stopped in ("rough", "expanded"):
        prepared = Prepared()
        with pytest.raises(RuntimeError, match="stopped"):
            simulated(stopped).solve(Stopped(), prepared=prepared)
        for name in ("first", "expanded"):
            assert digits(name, prepared) == alone[name], f"{name} after {stopped}, stopped"


def test_cases_of_one_geometry_share_mesh_and_analysis(monkeypatch):
    made = []
    mesh, layout = simulation.section_mesh, Layout.__init__

    def count_mesh(*given, **how):
        made.append("mesh")
        return mesh(*given, **how)

    def count_layout(self, *given):
        made.append("layout")
        layout(self, *given)

    monkeypatch.setattr(simulation, "section_mesh", count_mesh)
    monkeypatch.setattr(Layout, "__init__", count_layout)
    prepared = Prepared()
    for name in ("first", "slippery", "stiff", "rough"):
        simulated(name).solve(prepared=prepared)
    assert made == ["mesh", "layout"]
    simulated("other socket").solve(prepared=prepared)
    assert made == ["mesh", "layout"] * 2


@pytest.mark.parametrize("ranks", [2, 3])
def test_a_sweep_has_the_same_digits_on_any_number_of_ranks(ranks, mpirun, tmp_path):
    study = {"sockets": ["A", "B"], "frictions": [0.3, 0.5, 0.7]}
    for n in (1, ranks):
        mpirun(n, [PROGRAM, json.dumps({"out": f"on{n}", "study": study})])
    for name in ("summary.csv", "levels.csv", "contact.csv"):
        one, more = ((tmp_path / f"on{n}" / name).read_bytes() for n in (1, ranks))
        assert one == more
    residuals = [
        pd.read_csv(tmp_path / f"on{n}" / "steps.csv").residual_N_per_mm for n in (1, ranks)
    ]
    np.testing.assert_array_equal(*residuals)


def given_out(families: list[int], turns: list[int]) -> list[int]:
    """Cases in the order in which groups take them, one of `turns` after the other."""
    takers, last, found = [FREE] * len(families), {}, []
    for group in turns:
        case = chosen(families, takers, last.get(group))
        if case != FREE:
            takers[case], last[group] = group, families[case]
        found.append(case)
    return found


def test_a_group_goes_on_with_the_geometry_that_it_has():
    # Two groups, each with a geometry of its own; the one that ends first helps with the third.
    assert given_out([0, 1, 2, 0, 1, 2, 2], [0, 1, 0, 1, 0, 1, 1, 0]) == [0, 1, 3, 4, 2, 5, 6, -1]
    assert given_out([0, 0, 0, 0], [0, 1, 1, 0, 1]) == [0, 1, 2, 3, -1]
    assert given_out([0, 1, 2], [0, 0, 0]) == [0, 1, 2]


def test_a_study_leaves_the_garbage_of_its_caller_to_be_collected(tmp_path):
    """A notebook's failed cases, with their meshes and communicators, are not kept for ever."""

    class Cycle:
        pass

    gc.disable()
    try:
        cycle = Cycle()
        cycle.itself = cycle
        reference = weakref.ref(cycle)
        del cycle
        tiny_study(tmp_path / "results", sockets=("A",)).run()
        gc.collect()
        assert reference() is None
    finally:
        gc.enable()
