"""Quantities against numbers that can be checked by hand."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import logm

from calfsocket.postprocess.contact_line import ContactLine, running_mean
from calfsocket.postprocess.fields import GAUSS_POINTS, SectionFields
from calfsocket.postprocess.quantities import (
    EXTRAPOLATION,
    SUMMARY_COLUMNS,
    Quantities,
    contact_quantities,
    effective_stress,
    log_strain,
    neighbours,
    pair_levels,
    principal_strains,
    summary,
)
from sections import contact_around, grid, limb_and_socket, section


def plate(nx, ny, tissue="muscle", **kwargs) -> SectionFields:
    points, cells = grid(nx, ny)
    region = np.ones(len(cells), dtype=int)
    return section(points, cells, region, {1: ("soleus", tissue)}, **kwargs)


def with_stress(fields, values, component=3) -> SectionFields:
    """Set one stress component, constant in each cell."""
    stress = np.zeros_like(fields.stress)
    stress[:, :, component] = np.asarray(values, dtype=float)[:, None]
    return replace(fields, stress=stress)


# --- components and invariants


def test_extrapolation_is_exact_for_a_linear_field():
    def linear(x):
        return 3 - 2 * x[:, 0] + 5 * x[:, 1]

    nodes = np.array([[0, 0], [1, 0], [0, 1], [0.5, 0], [0.5, 0.5], [0, 0.5]])
    np.testing.assert_allclose(EXTRAPOLATION @ linear(GAUSS_POINTS), linear(nodes), atol=1e-14)
    # a corner is 5/3 of its own Gauss value less 1/3 of each other: 5/3 + 1/3 * 2 = 1 in all
    np.testing.assert_allclose(EXTRAPOLATION[1], [-1 / 3, 5 / 3, -1 / 3], atol=1e-14)


@pytest.mark.parametrize(
    ("stress", "mises"),
    [
        ([10, 0, 0, 0], 10),
        ([0, 0, 0, 2], 2 * np.sqrt(3)),
        ([-7, -7, -7, 0], 0),
        ([10, 0, 5, 0], np.sqrt(0.5 * (100 + 25 + 25))),  # s33 counts
    ],
)
def test_effective_stress(stress, mises):
    assert effective_stress(np.array(stress, dtype=float)) == pytest.approx(mises, abs=1e-12)


@pytest.mark.parametrize(
    ("strain", "amp"),
    [([0.1, -0.3, 0], -0.3), ([0.3, -0.1, 0], 0.3), ([0.1, 0.1, 0.05], 0.15), ([-0.2, 0, 0], -0.2)],
)
def test_absolute_maximum_principal(strain, amp):
    assert principal_strains(np.array(strain))[0] == pytest.approx(amp, abs=1e-15)


def test_log_strain_of_stretches_and_rotations():
    angle = np.radians(30)
    rotation = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    np.testing.assert_allclose(log_strain(rotation), 0, atol=1e-15)
    np.testing.assert_allclose(log_strain(1.1 * np.eye(2)), [np.log(1.1), np.log(1.1), 0])
    # stretched by 2 along +x, then turned by 30 deg: ln V = ln 2 n n^T, n = (cos 30, sin 30)
    f = rotation @ np.diag([2.0, 1.0])
    np.testing.assert_allclose(log_strain(f), np.log(2) * np.array([0.75, 0.25, np.sqrt(3) / 4]))
    # to first order the strain is that of the displacement gradient
    tiny = np.array([[1 + 1e-9, 3e-9], [1e-9, 1 - 2e-9]])
    np.testing.assert_allclose(log_strain(tiny), [1e-9, -2e-9, 2e-9], rtol=1e-6)


@pytest.mark.parametrize("size", [3e-4, 4e-3, 6e-3, 0.1, 0.6])
def test_log_strain_is_the_matrix_logarithm(size):
    rng = np.random.default_rng(1)
    for f in np.eye(2) + size * rng.uniform(-1, 1, (20, 2, 2)):
        exact = 0.5 * logm(f @ f.T)
        np.testing.assert_allclose(
            log_strain(f), [exact[0, 0], exact[1, 1], exact[0, 1]], rtol=1e-9, atol=1e-13
        )


def test_shear_log_strain_is_engineering_shear_in_percent():
    fields = plate(1, 1, displacement=lambda x: np.column_stack([0.02 * x[:, 1], 0 * x[:, 0]]))
    # simple shear by 0.02: 2 e12 = 0.02 to second order
    shear = Quantities.of(fields).nodal["shear_log_strain"]
    np.testing.assert_allclose(shear, 2.0, rtol=1e-3)


# --- averages at nodes


def test_averages_stay_within_a_tissue():
    points, cells = grid(2, 1)
    region = np.array([1, 1, 2, 2])
    fields = section(points, cells, region, {1: ("soleus", "muscle"), 2: ("deep", "fascia")})
    nodal = Quantities.of(with_stress(fields, [10, 10, 2, 2])).nodal["shear_stress"]
    np.testing.assert_allclose(nodal[:2], 10)
    np.testing.assert_allclose(nodal[2:], 2)


def test_averages_cross_the_regions_of_one_tissue():
    points, cells = grid(2, 1)
    region = np.array([1, 1, 2, 2])
    fields = section(points, cells, region, {1: ("deep", "fascia"), 2: ("tendon", "fascia")})
    nodal = Quantities.of(with_stress(fields, [10, 10, 2, 2])).nodal["shear_stress"]
    # cell 0 is (0,0) (1,0) (1,1): at (1,0) it meets cells 2 and 3, (10 + 2 + 2)/3;
    # at (1,1) it meets 1 and 3, (10 + 10 + 2)/3; at (1, 0.5) cell 3 alone, (10 + 2)/2
    np.testing.assert_allclose(nodal[0], [10, 14 / 3, 22 / 3, 10, 6, 10])


def stretched(fields, jacobian) -> SectionFields:
    """Stretch along x by 1.2, with J given at the Gauss points."""
    f = np.zeros_like(fields.deformation_gradient)
    f[..., 0, 0] = 1.2
    f[..., 1, 1] = jacobian / 1.2
    return replace(fields, deformation_gradient=f)


@pytest.mark.parametrize(
    "sides",
    [
        np.where(np.arange(8) % 2, -1, 1)[:, None] * np.ones(3),  # alternate cells
        np.tile([1, -1, 1], (8, 1)),  # within each cell
    ],
)
def test_amp_does_not_cancel_where_incompressible(sides):
    # J lies a little above 1 here and below 1 there: AMP = +- ln 1.2 = +- 18.2 %
    fields = stretched(plate(2, 2), 1 + 1e-5 * sides)
    quantities = Quantities.of(fields)
    mean = quantities.mean["amp_log_strain"]
    np.testing.assert_allclose(np.abs(mean), 100 * np.log(1.2), rtol=1e-4)
    largest = quantities.maximum("muscle", "amp_log_strain")
    # the sign says nothing here; extrapolated to the corners, J - 1 is up to 7/3 of 1e-5
    assert abs(largest.value) == pytest.approx(100 * np.log(1.2), rel=1e-4)


def test_amp_has_the_sign_that_prevails():
    fields = plate(2, 2, displacement=lambda x: np.column_stack([-0.1 * x[:, 0], 0 * x[:, 0]]))
    largest = Quantities.of(fields).maximum("muscle", "amp_log_strain")
    assert largest.value == pytest.approx(100 * np.log(0.9))


def test_sign_does_not_hang_on_rounding():
    # one cell in tension, one in compression, of equal magnitude but for 1e-13: no sign prevails
    fields = stretched(plate(1, 1), 1 + np.array([1e-13, -1e-13])[:, None])
    quantities = Quantities.of(fields)
    shared = quantities.nodal["amp_log_strain"][0, [0, 2, 5]]
    np.testing.assert_allclose(shared, 100 * np.log(1.2))
    largest = quantities.maximum("muscle", "amp_log_strain")
    assert largest.value == pytest.approx(100 * np.log(1.2))


# --- the rule


def test_neighbours_on_a_plate():
    fields = plate(2, 2)
    pairs = neighbours(fields)
    # 4 diagonals, 2 upright and 2 level edges lie between two cells
    assert len(pairs.cells) == 8
    assert pairs.cells[:, 0].tolist() == sorted(pairs.cells[:, 0].tolist())
    for cells, corner, edge_node in zip(pairs.cells, pairs.corner, pairs.edge_node, strict=True):
        nodes = fields.cells.ravel()[corner]
        assert set(nodes) == set(fields.cells[cells].ravel())
        assert len(set(nodes)) == 9
        assert edge_node in fields.cells[cells[0]] and edge_node in fields.cells[cells[1]]


def test_neighbours_are_of_one_tissue():
    points, cells = grid(2, 1)
    fields = section(
        points, cells, np.array([1, 1, 2, 2]), {1: ("soleus", "muscle"), 2: ("deep", "fascia")}
    )
    assert neighbours(fields).cells.tolist() == [[0, 1], [2, 3]]


def test_pair_level():
    nodal = np.array([[9, 8, 7, 6, 5, 4, 3, 2, 1], [9, 9, 9, 9, 1, 1, 1, 1, 1]], dtype=float)
    # the fifth largest counts; a cell mean below it counts instead
    np.testing.assert_allclose(pair_levels(nodal, np.array([[6.0, 8.0], [9.0, 9.0]])), [5, 1])
    np.testing.assert_allclose(pair_levels(nodal, np.array([[4.5, 8.0], [9.0, 0.5]])), [4.5, 0.5])


def quantities_with(fields, nodes, cells) -> Quantities:
    """Make shear stress 1, but for the values given at some nodes and in some cells."""
    at_node = np.ones(len(fields.points))
    at_node[list(nodes)] = list(nodes.values())
    mean = np.ones(len(fields.cells))
    mean[list(cells)] = list(cells.values())
    return replace(
        Quantities.of(fields),
        nodal={"shear_stress": at_node[fields.cells]},
        mean={"shear_stress": mean},
    )


def test_spike_at_a_node_is_dropped():
    fields = plate(3, 3)
    quantities = quantities_with(fields, {24: 1000.0}, {8: 200.0, 9: 200.0})
    largest = quantities.maximum("muscle", "shear_stress")
    assert largest.value == 1


def test_spike_in_a_cell_is_dropped():
    fields = plate(3, 3)
    stressed = with_stress(fields, np.where(np.arange(18) == 8, 1000.0, 1.0))
    quantities = Quantities.of(stressed)
    # averaged to nodes it reaches more than five, and only the neighbours' means speak against it
    assert np.count_nonzero(quantities.nodal["shear_stress"][8] > 100) >= 5
    largest = quantities.maximum("muscle", "shear_stress")
    assert largest.value == pytest.approx(1)


def test_plateau_over_two_cells_is_kept():
    fields = plate(3, 3)
    nodes = dict.fromkeys(fields.cells[[8, 9]].ravel(), 7.0)
    quantities = quantities_with(fields, nodes, {8: 7.0, 9: 7.0})
    largest = quantities.maximum("muscle", "shear_stress")
    assert largest.value == 7
    # cells 8 and 9 halve the middle square along the diagonal through (1.5, 1.5)
    assert (largest.x_mm, largest.y_mm, largest.region) == (1.5, 1.5, "soleus")


def test_larger_magnitude_wins_with_its_sign():
    fields = plate(3, 3)
    nodes = dict.fromkeys(fields.cells[[0, 1]].ravel(), 5.0)
    nodes |= dict.fromkeys(fields.cells[[16, 17]].ravel(), -8.0)
    quantities = quantities_with(fields, nodes, {0: 5.0, 1: 5.0, 16: -8.0, 17: -8.0})
    largest = quantities.maximum("muscle", "shear_stress")
    assert (largest.value, largest.x_mm, largest.y_mm) == (-8, 2.5, 2.5)


def test_all_negative_field_keeps_its_sign():
    fields = with_stress(plate(2, 2), np.full(8, -4.0))
    largest = Quantities.of(fields).maximum("muscle", "shear_stress")
    assert largest.value == pytest.approx(-4)


def test_ties_go_to_the_first_whatever_the_rounding():
    fields = plate(3, 3)
    nodes = dict.fromkeys(fields.cells[[0, 1]].ravel(), 7.0)
    nodes |= dict.fromkeys(fields.cells[[16, 17]].ravel(), 7.0 * (1 + 1e-12))
    means = {0: 7.0, 1: 7.0, 16: 7.0 * (1 + 1e-12), 17: 7.0 * (1 + 1e-12)}
    quantities = quantities_with(fields, nodes, means)
    largest = quantities.maximum("muscle", "shear_stress")
    assert (largest.x_mm, largest.y_mm) == (0.5, 0.5)


def test_region_is_that_of_the_fuller_cell():
    points, cells = grid(1, 1)
    fields = section(points, cells, np.array([1, 2]), {1: ("deep", "fascia"), 2: ("t", "fascia")})
    fields = with_stress(fields, [-5, -6])
    largest = Quantities.of(fields).maximum("fascia", "shear_stress")
    assert (largest.value, largest.region) == (pytest.approx(-5), "t")


def test_level_at_a_site_is_that_of_its_pair():
    fields = plate(3, 3)
    nodes = dict.fromkeys(fields.cells[[0, 1]].ravel(), 5.0)
    nodes |= dict.fromkeys(fields.cells[[16, 17]].ravel(), -8.0)
    quantities = quantities_with(fields, nodes, {0: 5.0, 1: 5.0, 16: -8.0, 17: -8.0})
    case = ("muscle", "shear_stress")
    assert quantities.level_at(*case, 0.5, 0.5) == 5
    assert quantities.level_at(*case, 2.4, 2.6) == -8  # the nearest common edge is at (2.5, 2.5)
    assert np.isnan(quantities.level_at("fat", "shear_stress", 0, 0))


def test_a_pair_that_holds_neither_direction_holds_0():
    fields = plate(1, 1)
    # five nodes of nine reach 3, but one cell's mean is -1: neither 3 nor -1 is reached in both
    nodes = dict.fromkeys(fields.cells[0], 3.0) | {fields.cells[1, 1]: -2.0}
    quantities = quantities_with(fields, nodes, {0: 3.0, 1: -1.0})
    assert quantities.level_at("muscle", "shear_stress", 0.5, 0.5) == 0


def test_a_tissue_of_one_cell_holds_no_level():
    points, cells = grid(1, 1)
    fields = section(points, cells, np.array([1, 2]), {1: ("a", "vessel"), 2: ("b", "fascia")})
    largest = Quantities.of(fields).maximum("vessel", "pressure")
    assert np.isnan(largest.value) and largest.region == ""


# --- contact


def line(pressure, weight, status=None) -> ContactLine:
    pressure, weight = np.array(pressure, dtype=float), np.array(weight, dtype=float)
    n, zero = len(pressure), np.zeros(len(pressure))
    return ContactLine(
        arc_mm=np.cumsum(weight) - weight / 2,
        angle_deg=zero,
        x_mm=zero,
        y_mm=zero,
        pressure_kPa=pressure,
        shear_kPa=zero,
        gap_mm=zero,
        weight_mm=weight,
        status=np.array(status if status else ["stick"] * n),
    )


def test_running_mean_spreads_a_spike_over_its_window():
    pressure, weight = np.zeros(100), np.full(100, 0.1)
    pressure[50] = 60.0
    smooth = running_mean(line(pressure, weight), window_mm=3.0)
    # 60 kPa over 0.1 mm of 3 mm is 2 kPa, within 1.5 mm of the spike's middle; half of the
    # spike at 15 points away
    assert smooth[50] == pytest.approx(2) and smooth[36] == pytest.approx(2)
    assert smooth[35] == pytest.approx(1) and smooth[34] == pytest.approx(0, abs=1e-12)


def test_of_contact_in_short_pieces_the_mean_may_be_above_the_maximum():
    """1 mm of 12 in contact at 30 kPa: the 3 mm window holds 30 kPa mm / 3 mm = 10 kPa."""
    pressure = np.zeros(12)
    pressure[4] = 30.0
    contact = line(pressure, np.ones(12), ["open"] * 4 + ["stick"] + ["open"] * 7)
    rows = contact_quantities(limb_and_socket(), contact)
    assert rows["contact_pressure_mean"].value == pytest.approx(30)
    assert rows["contact_pressure_max"].value == pytest.approx(10)
    assert rows["contact_share"].value == pytest.approx(100 / 12)


def test_running_mean_goes_around_the_end_and_weighs_lengths():
    pressure = np.array([30.0] + [0.0] * 9)
    weight = np.array([2.0] + [1.0] * 9)
    smooth = running_mean(line(pressure, weight), window_mm=3.0)
    # around the last point, at 10.5 of 11 mm, the window reaches 12 mm: 1 of 3 mm has 30 kPa
    np.testing.assert_allclose(smooth[[0, 1, 2, 9]], [20, 10, 0, 10], atol=1e-12)


def test_contact_quantities():
    fields = limb_and_socket(24)
    pressure = np.array([10.0, 20.0, 30.0, 0.0])
    contact = line(pressure, [1, 1, 2, 4], ["stick", "slip", "stick", "open"])
    rows = contact_quantities(fields, contact)
    # (10 + 20 + 2 * 30) / 4 over the 4 of 8 mm in contact
    assert rows["contact_pressure_mean"].value == pytest.approx(22.5)
    assert rows["contact_share"].value == pytest.approx(50)
    # 3 mm about the third point's middle (at 3 of 8 mm): 0.5 of 20 kPa, 2 of 30, 0.5 of 0
    assert rows["contact_pressure_max"].value == pytest.approx(70 / 3)


def test_contact_site_is_in_the_reference_section():
    fields = limb_and_socket(72)
    # pressure 10 + 12 cos(3 angle) is highest at 0, 120 and 240 deg; round the first one counts
    row = contact_quantities(fields, contact_around())["contact_pressure_max"]
    assert row.x_mm == pytest.approx(48) and abs(row.y_mm) < 0.01
    assert row.region == "skin"


def test_no_contact_at_all_has_no_mean_to_divide_by():
    fields = limb_and_socket(24)
    rows = contact_quantities(fields, line(np.zeros(8), np.ones(8), ["open"] * 8))
    assert [row.value for row in rows.values()] == [0, 0, 0]


# --- the summary


def test_summary_columns():
    frame = summary(Quantities.of(limb_and_socket()), contact_around())
    assert tuple(frame.columns) == SUMMARY_COLUMNS
    assert frame.groupby("tissue").quantity.count().to_dict() == {
        "skin": 7,
        "fat": 4,
        "muscle": 4,
        "fascia": 4,
        "vessel": 5,
    }
    pressure = frame[frame.quantity == "pressure"]
    assert pressure.tissue.tolist() == ["vessel"]
    assert pressure.value.item() == pytest.approx(8) and pressure.unit.item() == "kPa"
    assert pressure.region.item() == "fibular_artery"
    assert set(frame[frame.quantity.str.endswith("strain")].unit) == {"%"}
    assert frame.value.notna().all()


def test_summary_leaves_out_tissues_that_are_not_there():
    skin = plate(4, 4, tissue="skin")
    frame = summary(Quantities.of(skin), line(np.ones(8), np.ones(8)))
    assert set(frame.tissue) == {"skin"}


def test_summary_does_not_depend_on_the_order_of_distinct_values():
    fields, contact = limb_and_socket(), contact_around()
    again = replace(fields, stress=fields.stress * (1 + 1e-12))
    first = summary(Quantities.of(fields), contact)
    second = summary(Quantities.of(again), contact)
    assert first[["x_mm", "y_mm", "region"]].equals(second[["x_mm", "y_mm", "region"]])


# --- what the arrays must be


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda f: {"displacement": f.displacement[:-1]}, "displacement has shape"),
        (lambda f: {"pressure": f.pressure * np.nan}, "pressure has values that are not finite"),
        (lambda f: {"cells": f.cells + 1}, "nodes outside"),
        (lambda f: {"region": f.region + 1}, "region 2 has no name"),
        (lambda f: {"region_tissues": {1: "musle"}}, "tissue 'musle'; allowed: skin, fat"),
        (lambda f: {"deformation_gradient": -f.deformation_gradient[..., ::-1]}, "inverted"),
    ],
)
def test_section_fields_are_checked(change, message):
    fields = plate(1, 1)
    with pytest.raises(ValueError, match=message):
        replace(fields, **change(fields))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda c: {"gap_mm": c.gap_mm[1:]}, "gap_mm has shape"),
        (lambda c: {"shear_kPa": c.shear_kPa + np.inf}, "not finite"),
        (lambda c: {"status": np.full(360, "closed")}, "open, stick, slip"),
        (lambda c: {"arc_mm": c.arc_mm[::-1]}, "sort the points"),
        (lambda c: {"weight_mm": c.weight_mm * 0}, "not positive"),
    ],
)
def test_contact_line_is_checked(change, message):
    contact = contact_around()
    with pytest.raises(ValueError, match=message):
        replace(contact, **change(contact))
