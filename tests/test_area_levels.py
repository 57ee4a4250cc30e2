"""Levels by area against fields whose quantiles are known."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from mpi4py import MPI

from calfsocket.materials.material_set import MaterialSet
from calfsocket.mechanics.limb_problem import limb_problem
from calfsocket.mechanics.stepping import LoadStepper
from calfsocket.meshes.rings import ring_mesh
from calfsocket.postprocess.contact_line import ContactLine
from calfsocket.postprocess.extract import contact_line, section_fields
from calfsocket.postprocess.fields import SectionFields
from calfsocket.postprocess.levels import (
    BELOW,
    LEVEL_COLUMNS,
    SHARES,
    STATISTICS,
    level,
    levels,
    statistics,
)
from calfsocket.postprocess.quantities import REPORTED, Quantities, contact_quantities, reported
from calfsocket.postprocess.thresholds import Threshold, area_beyond, tissue_area
from calfsocket.verification.radial import (
    LIMB,
    SOCKET,
    SOCKET_THICKNESS,
    RadialSolution,
    Ring,
    exact_ring,
)
from report_results import contact_on, contact_on_plate, limb, plate
from sections import annulus, contact_around, grid, section, shape_values

EVEN = contact_on_plate(np.ones_like)


def shear_of(x: np.ndarray) -> np.ndarray:
    """Return x of the place as s12, kPa."""
    return np.stack([0 * x[..., 0]] * 3 + [x[..., 0]], -1)


def square(n: int, length: float = 10.0) -> SectionFields:
    """A square of muscle about the origin, whose shear stress is x."""
    points, cells = grid(n, n)
    points = length * (points / n - 0.5)
    return section(points, cells, np.ones(len(cells), int), {1: ("a", "muscle")}, stress=shear_of)


def row(fields: SectionFields, tissue: str, quantity: str, contact: ContactLine = EVEN, region=""):
    table = levels(Quantities.of(fields), contact).set_index(["tissue", "region", "quantity"])
    return table.loc[(tissue, region, quantity)]


# --- the definition


@pytest.mark.parametrize(
    ("share", "expected"), [(10, 1), (20, 1), (20.1, 2), (50, 2), (50.1, 5), (100, 5)]
)
def test_a_level_is_the_smallest_value_with_enough_area_at_or_below_it(share, expected):
    """2 of 10 mm2 at 1 kPa, 3 at 2, 5 at 5; the order of the points does not matter."""
    values, weights = np.array([5.0, 1.0, 2.0, 5.0]), np.array([4.0, 2.0, 3.0, 1.0])
    assert level(values, weights, share) == expected
    assert level(values[::-1], weights[::-1], share) == expected


def test_a_point_counts_by_its_area():
    values = np.array([1.0, 9.0])
    assert level(values, np.array([9995.0, 5.0]), 99.9) == 1
    assert level(values, np.array([9980.0, 20.0]), 99.9) == 9


def test_mean_rms_and_both_ends_by_hand():
    """-3 on 1 mm2, 1 on 3 mm2: mean 0, rms sqrt((9 + 3)/4)."""
    values, weights = np.array([-3.0, 1.0]), np.array([1.0, 3.0])
    found = statistics(values, weights, "shear_stress")
    assert found["mean"] == 0 and found["rms"] == pytest.approx(np.sqrt(3))
    assert (found["below_50"], found["below_99"]) == (1, 3)  # in magnitude
    assert (found["upper_50"], found["upper_99"]) == (1, 1)
    assert (found["lower_50"], found["lower_99"]) == (1, -3)
    one_end = statistics(np.abs(values), weights, "effective_stress")
    assert one_end["below_99"] == 3 and np.isnan(one_end["upper_99"] + one_end["lower_99"])
    pressure = statistics(values, weights, "pressure")  # in compression
    assert (pressure["below_99"], pressure["lower_99"]) == (1, -3)


def test_less_area_than_the_rest_is_beyond_a_level_as_thresholds_count_it():
    quantities = Quantities.of(limb(2.0, shear=0.05))
    found = levels(quantities, EVEN)
    whole = found[(found.region == "") & (found.quantity == "effective_stress")]
    assert len(whole) == 5
    for each in whole.itertuples(index=False):
        for name, share in zip(("below_50", "below_95"), (50, 95), strict=True):
            value = getattr(each, name)
            area = tissue_area(quantities.fields, each.tissue)
            beyond = area_beyond(quantities, Threshold("effective_stress", each.tissue, value))
            lower = np.nextafter(value, 0)
            more = area_beyond(quantities, Threshold("effective_stress", each.tissue, lower))
            left = (1 - share / 100) * area
            assert beyond <= left * (1 + 1e-9) and more > left * (1 - 1e-9)


# --- fields with known levels


def test_a_linear_field_on_a_square_converges_to_its_levels():
    """Evenly spread from -5 to 5: |x| stays below 5 s, x below 10 s - 5; rms 10/sqrt(12)."""
    errors = []
    for n in (8, 16, 32, 64):
        found = row(square(n), "muscle", "shear_stress")
        exact = {"mean": 0.0, "rms": 10 / np.sqrt(12)}
        for share in SHARES:
            exact |= {
                f"below_{share:g}": 5 * share / 100,
                f"upper_{share:g}": 10 * share / 100 - 5,
                f"lower_{share:g}": 5 - 10 * share / 100,
            }
        assert set(exact) == set(STATISTICS)
        assert found["rms"] == pytest.approx(exact["rms"], abs=1e-12)  # of degree 2: exact
        errors.append(max(abs(found[name] - value) for name, value in exact.items()))
        assert errors[-1] < 10 / n  # the spread of the field over an element
    assert errors[-1] < errors[0] / 4


def test_a_linear_field_on_a_disc_converges_to_its_levels():
    """On a unit disc the share below x is 1/2 + (x sqrt(1 - x2) + asin x) / pi."""

    def disc(n: int) -> SectionFields:
        points, cells, _ = annulus([1e-6, 1.0], 4 * n, per_mm=n)
        return section(points, cells, np.ones(len(cells), int), {1: ("a", "fat")}, stress=shear_of)

    errors = []
    for n in (8, 32):
        found = row(disc(n), "fat", "shear_stress")
        assert found["area_mm2"] == pytest.approx(np.pi, rel=1e-4)
        assert found["rms"] == pytest.approx(0.5, rel=1e-3)
        x = np.array([found[f"upper_{share:g}"] for share in SHARES])
        below = 0.5 + (x * np.sqrt(1 - x**2) + np.arcsin(x)) / np.pi
        errors.append(np.abs(100 * below - SHARES).max())
        assert found["lower_99"] == pytest.approx(-found["upper_99"], abs=0.3 / n)
    assert errors[1] < errors[0] / 3 and errors[1] < 0.2  # % of the area


def test_levels_do_not_depend_on_how_a_mesh_is_graded():
    """Columns of elements from a quarter to 7/4 of their width: areas count, not points."""
    even = square(32)
    share = even.points[:, 0] / 10 + 0.5
    x = 10 * (share * (1 + 3 * share) / 4 - 0.5)
    graded = replace(even, points=np.column_stack([x, even.points[:, 1]]))
    shapes = shape_values(graded.gauss_points)
    places = np.einsum("ga,nai->ngi", shapes, graded.points[graded.cells])
    graded = replace(graded, stress=shear_of(places))
    a, b = (row(each, "muscle", "shear_stress")[[*STATISTICS]] for each in (even, graded))
    np.testing.assert_allclose(a.astype(float), b.astype(float), atol=0.3)


# --- the concentric limb in a smaller socket


def exact_levels(rings: list[Ring], solution: RadialSolution, n: int = 20_000) -> np.ndarray:
    """Levels of Mises stress, kPa: each ring cut into n parts of equal area, at their middles."""
    stress, area = [], []
    for ring in rings:
        part = (np.arange(n) + 0.5) / n
        radius = np.sqrt(ring.inner**2 + part * (ring.outer**2 - ring.inner**2))
        along, hoop, axial = 1e3 * np.asarray(solution.profile(ring.name, radius).stress, float)
        shear = (along - hoop) ** 2 + (hoop - axial) ** 2 + (axial - along) ** 2
        stress.append(np.sqrt(shear / 2))
        area.append(np.full(n, np.pi * (ring.outer**2 - ring.inner**2) / n))
    return level(np.concatenate(stress), np.concatenate(area), SHARES)


@pytest.fixture(scope="module")
def rings() -> tuple[list[pd.DataFrame], RadialSolution]:
    """Levels of the whole tissues on elements of 3 and 1.5 mm, and the exact solution."""
    laws = MaterialSet.paper("separate").tissue_laws()
    inner = LIMB[-1].outer - 0.5
    layers = [(ring.name, ring.inner, ring.outer) for ring in LIMB]
    tissues = {ring.name: ring.tissue for ring in LIMB} | {SOCKET: SOCKET}
    found = []
    for h in (3.0, 1.5):
        mesh = ring_mesh(MPI.COMM_SELF, layers, (inner, inner + SOCKET_THICKNESS), h)
        problem = limb_problem(mesh, {name: laws[tissue] for name, tissue in tissues.items()})
        LoadStepper(problem, [1.0]).run()
        table = levels(Quantities.of(section_fields(problem, tissues)), contact_line(problem))
        found.append(table[table.region == ""].set_index(["tissue", "quantity"]))
    return found, exact_ring(laws, 0.5, 1.0).solution


@pytest.mark.parametrize("tissue", ["skin", "fat", "muscle", "fascia", "vessel"])
def test_levels_of_a_ring_are_those_of_the_exact_solution(rings, tissue):
    """Stress by radius, whose area is known: within 2 % on elements as thick as a layer, in all."""
    found, solution = rings
    exact = exact_levels([ring for ring in LIMB if ring.tissue == tissue], solution)
    off = []
    for table in found:
        mine = table.loc[(tissue, "effective_stress"), [*BELOW]].to_numpy(float)
        off.append(np.abs(mine / exact - 1).max())
    assert off[0] < 0.02 and off[1] < 0.01
    coarse, fine = (table.loc[(tissue, "effective_stress")] for table in found)
    area = sum(np.pi * (r.outer**2 - r.inner**2) for r in LIMB if r.tissue == tissue)
    assert fine.area_mm2 == pytest.approx(area, rel=1e-3)
    assert coarse["rms"] == pytest.approx(fine["rms"], rel=1e-3)


# --- the table


def test_every_quantity_of_the_summary_has_rows_of_each_tissue_and_region():
    fields = limb(2.0)
    table = levels(Quantities.of(fields), contact_around())
    assert tuple(table.columns) == LEVEL_COLUMNS
    whole = table[(table.region == "") & table.length_mm.isna()]
    tissues = [name for name in REPORTED if name in fields.region_tissues.values()]
    assert [*zip(whole.tissue, whole.quantity, strict=True)] == [
        (tissue, quantity) for tissue in tissues for quantity in reported(tissue)
    ]
    for tissue in tissues:
        mine = table[(table.tissue == tissue) & (table.quantity == "shear_stress")]
        area = tissue_area(fields, tissue)
        assert mine.area_mm2[mine.region == ""].tolist() == pytest.approx([area])
        assert mine.area_mm2[mine.region != ""].sum() == pytest.approx(area)
    muscle = table[(table.tissue == "muscle") & (table.quantity == "effective_stress")]
    parts = muscle[muscle.region != ""]
    assert set(parts.region) == {"soleus"}
    assert parts["below_99"].max() >= muscle["below_99"].iloc[0] >= parts["below_99"].min()


def test_contact_counts_over_the_skin_that_touches():
    """10 + 12 cos 3 angle where positive: the mean is that of the summary."""
    fields, contact = limb(), contact_around(n=3600)
    table = levels(Quantities.of(fields), contact)
    rows = table[table.length_mm.notna()].set_index("quantity")
    pressure, shear = rows.loc["contact_pressure"], rows.loc["contact_shear"]
    summary = contact_quantities(fields, contact)
    assert pressure["mean"] == pytest.approx(summary["contact_pressure_mean"].value)
    share = summary["contact_share"].value / 100
    assert pressure.length_mm == pytest.approx(share * 2 * np.pi * 48)
    half = np.arccos(-10 / 12)  # where it is 0, of 3 angle
    assert pressure["below_95"] == pytest.approx(10 + 12 * np.cos(0.05 * half), rel=1e-3)
    assert shear["below_95"] == pytest.approx(0.1 * pressure["below_95"])
    assert shear["upper_95"] == shear["below_95"] and shear["lower_95"] >= 0
    assert np.isnan(pressure["lower_95"])


def test_no_contact_is_none_of_pressure():
    table = levels(Quantities.of(plate()), contact_on_plate(np.zeros_like))
    rows = table[table.length_mm.notna()]
    assert rows.length_mm.tolist() == [0, 0] and (rows[["mean", "rms", "below_99.9"]] == 0).all(
        None
    )


def test_a_liner_has_contact_of_its_own():
    fields = limb()
    lined = replace(fields, region_tissues=fields.region_tissues | {5: "liner"})
    inner, outer = contact_on(fields, 5.0), contact_on(fields, 7.0)
    table = levels(Quantities.of(lined), inner, outer)
    means = table[table.quantity == "contact_pressure"].set_index("tissue")["mean"]
    assert means.to_dict() == pytest.approx({"liner": 7.0})  # the skin has become the liner
