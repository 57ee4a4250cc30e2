"""The limb's verification: energy balance, mesh convergence, results read or solved."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from mpi4py import MPI

from calfsocket.contact.parameters import Contact
from calfsocket.io.errors import InputError
from calfsocket.io.fenics import cell_nodes
from calfsocket.materials.material_set import MaterialSet
from calfsocket.mechanics.limb_problem import limb_problem
from calfsocket.mechanics.stepping import LoadStepper, LoadSteps
from calfsocket.meshes.rings import ring_mesh
from calfsocket.study.runner import Runner
from calfsocket.verification import limb_runs
from calfsocket.verification.energy import EnergyMeter, energy_error, trapezoid_error
from calfsocket.verification.limb import coarsest_first
from calfsocket.verification.limb_convergence import (
    digest,
    long_table,
    nearest_material,
    stress_quantiles,
    unconverged,
)
from calfsocket.verification.limb_path import follow
from sections import section

LAYERS = [("muscle", 14.0, 26.0), ("fat", 26.0, 30.0), ("skin", 30.0, 32.0)]


def ring_balance(steps, overclosure=0.8, oval=0.0, friction=0.4):
    """Energies of a ring pressed in equal steps; an `oval` socket is wider and lower by a share."""
    laws = MaterialSet.paper("separate").tissue_laws()
    mesh = ring_mesh(MPI.COMM_SELF, LAYERS, (32.0 - overclosure, 36.0), 4.0)
    nodes = np.unique(cell_nodes(mesh.mesh)[mesh.cell_tags.find(mesh.regions["socket"])])
    mesh.mesh.geometry.x[nodes] *= (1.0 + oval, 1.0 - oval, 1.0)
    regions = {name: laws[name] for name in mesh.regions}
    model = limb_problem(mesh, regions, Contact(friction=friction))
    meter = EnergyMeter(model)
    size = 1.0 / steps
    LoadStepper(model, LoadSteps(first=size, largest=size), on_step=meter.record).run()
    return meter.balance


def test_work_of_a_shrink_fit_is_stored_with_an_error_of_second_order():
    coarse, fine = ring_balance(2), ring_balance(4)
    assert abs(energy_error(fine)) < 2e-3
    assert trapezoid_error(coarse) / trapezoid_error(fine) == pytest.approx(4.0, rel=0.1)
    # Axisymmetric: nothing slips, and the normal does not turn.
    assert abs(fine.friction.iloc[-1]) + abs(fine.lever.iloc[-1]) < 1e-6 * fine.work.iloc[-1]
    assert np.all(np.diff(fine.work) > 0)
    assert np.all(np.diff(fine.limb) > 0)


def test_energy_balances_with_slip():
    """An oval socket on little friction: the skin slips nearly everywhere, normals turn."""
    coarse, fine = (ring_balance(steps, oval=0.05, friction=0.1) for steps in (4, 8))
    assert fine.friction.iloc[-1] > 0.01 * fine.work.iloc[-1]
    assert abs(trapezoid_error(fine)) < 2e-4
    assert abs(trapezoid_error(fine)) < 0.4 * abs(trapezoid_error(coarse))
    for share in (fine.friction, fine.lever, fine.penetration, fine.socket):
        assert abs(share.iloc[-1]) > 1.4 * abs(trapezoid_error(fine)) * fine.work.iloc[-1]


def test_socket_stores_what_lames_ring_does():
    """A ring under inner pressure p stores p times its bore's displacement times pi r."""
    balance = ring_balance(4, overclosure=0.05)
    law = MaterialSet.paper("separate").tissue_laws()["socket"]
    a, b = 31.95, 36.0
    # The limb is so soft that p = (energy of the limb)'s slope; take it from the work itself:
    # W = 2 pi r d p / 2 for a small overclosure d.
    p = 2.0 * balance.work.iloc[-1] / (2.0 * np.pi * 32.0 * 0.05)
    E, nu = law.e / (1.0 - law.nu**2), law.nu / (1.0 - law.nu)  # plane strain
    u = p * a / E * ((b**2 + a**2) / (b**2 - a**2) + nu)
    assert balance.socket.iloc[-1] == pytest.approx(np.pi * a * p * u, rel=0.02)


# -- mesh convergence -----------------------------------------------------------------------------


def summaries(
    *values, quantity="effective_stress", tissue="skin", material="separate", x=(0, 0, 0)
):
    """One number at three mesh sizes."""
    return {
        size: pd.DataFrame(
            {
                "socket": "TC",
                "material_set": material,
                "tissue": tissue,
                "quantity": quantity,
                "value": [value],
                "unit": "kPa",
                "x_mm": [float(at)],
                "y_mm": [0.0],
                "region": "skin",
            }
        )
        for size, value, at in zip(("coarse", "medium", "paper"), values, x, strict=True)
    }


CELLS = {"coarse": 100.0, "medium": 400.0, "paper": 1600.0}


@pytest.mark.parametrize(
    ("values", "verdict"),
    [
        ((10.0, 12.0, 12.5), "converged"),  # 4.2 %
        ((10.0, 12.0, -12.5), "converged"),  # magnitudes count
        ((10.0, 12.0, 13.0), "converging"),  # 20 %, then 8.3 %
        ((10.0, 10.5, 11.2), "not converged"),  # 5 %, then 6.7 %
        ((10.0, 15.0, 18.0), "not converged"),  # 50 %, then 20 %
    ],
)
def test_verdicts(values, verdict):
    assert list(long_table(summaries(*values), CELLS).verdict) == [verdict]


def test_uncertainty_is_roaches_index():
    """Twice as fine, 8 % of change: 1.25 times 8 % over 2 - 1."""
    row = long_table(summaries(10.0, 12.5, 13.5), CELLS).iloc[0]
    assert row.change_paper_pct == pytest.approx(8.0)
    assert row.uncertainty_pct == pytest.approx(10.0)


def test_reasons_and_digest():
    table = long_table(summaries(1.0, 2.0, -4.0, tissue="fascia", x=(0, 0, 50)), CELLS)
    assert table.reason[0] == "bending across the fascia; another site, of the other sign"
    table = long_table(summaries(1.0, 2.0, 4.0), CELLS)
    assert table.reason[0] == "a peak as narrow as the elements"
    shown = digest(table, list(CELLS)).iloc[0]
    assert shown["separate: change"] == pytest.approx(100.0)
    assert shown["separate: uncertainty"] == "not converged"


def two_squares():
    """A square of skin beside one of fat, x < 1 and x > 1; effective stress 10 and 30 kPa."""
    corners = np.array([[x, y] for x in (0.0, 0.5, 1.0, 1.5, 2.0) for y in (0.0, 0.5, 1.0)])

    def node(i, j):
        return 3 * i + j

    cells, region = [], []
    for k in range(2):
        i = 2 * k
        lower = [(i, 0), (i + 2, 0), (i + 2, 2), (i + 1, 0), (i + 2, 1), (i + 1, 1)]
        upper = [(i, 0), (i + 2, 2), (i, 2), (i + 1, 1), (i + 1, 2), (i, 1)]
        cells += [[node(*at) for at in lower], [node(*at) for at in upper]]
        region += [k + 1, k + 1]

    def stress(x):
        value = np.zeros((*x.shape[:2], 4))
        value[..., 0] = np.where(x[..., 0] < 1.0, 10.0, 30.0)
        return value

    regions = {1: ("skin", "skin"), 2: ("subcutaneous_fat", "fat")}
    return section(corners, np.array(cells), np.array(region), regions, stress=stress)


def test_stress_quantiles_and_nearest_material():
    fields = two_squares()
    found = stress_quantiles(fields, "fat")
    assert found == pytest.approx({"rms": 30.0, "50 %": 30.0, "90 %": 30.0, "99 %": 30.0})
    name, distance = nearest_material(fields, "separate", "skin", 0.75, 0.5)
    assert name == "subcutaneous_fat"
    assert distance == pytest.approx(0.25)
    table = long_table(summaries(1.0, 2.0, 4.0), CELLS)
    rows = unconverged(table, list(CELLS), {"TC_separate": fields})
    assert rows["nearest other material"][0] == "subcutaneous fat, 1.0 mm"


def test_sizes_come_coarsest_first():
    assert coarsest_first(["paper", "coarse"]) == ["coarse", "paper"]
    with pytest.raises(InputError, match="two mesh sizes"):
        coarsest_first(["paper", "paper"])
    with pytest.raises(InputError, match="tiny"):
        coarsest_first(["coarse", "tiny"])


# -- runs -----------------------------------------------------------------------------------------


def test_results_of_other_inputs_are_refused(tmp_path, monkeypatch):
    """A folder that holds the study's results is not solved again; one of another size is named."""
    solved = []
    monkeypatch.setattr(Runner, "run", lambda runner, resume: solved.append((runner.out, resume)))
    found = SimpleNamespace(write_maps=lambda pictures: None)
    monkeypatch.setattr("calfsocket.simulation.results.load_results", lambda *_: found)
    assert limb_runs.solved_study(tmp_path, "coarse", ["combined"]) is found
    assert solved == [(tmp_path, True)]

    def refuse(folder, plan):
        raise InputError("other inputs")

    monkeypatch.setattr(limb_runs, "results_folder", refuse)
    with pytest.raises(InputError, match=r"--results: .* other inputs; name another folder"):
        limb_runs.solved_study(tmp_path, "medium", ["combined"])
    assert len(solved) == 1


@pytest.mark.slow
def test_a_followed_run_balances_its_energy():
    """The quickest case: 0.01 % of its work unaccounted, the tangent exact at its end."""
    path = follow("TSB", "combined", "coarse", 0.25)
    assert abs(energy_error(path.energy)) < 1e-4
    assert path.energy.socket.iloc[-1] > 0.01 * path.energy.work.iloc[-1]
    assert path.newton_order == pytest.approx(2.0, abs=0.05)
    assert path.end.checks.negative_modes == 0
    assert len(path.solves) == len(path.steps)
