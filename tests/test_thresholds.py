"""Shares beyond thresholds against areas and lengths counted by hand."""

from dataclasses import replace

import numpy as np
import pytest

from calfsocket.io.errors import InputError
from calfsocket.postprocess.contact_line import ContactLine
from calfsocket.postprocess.fields import SectionFields
from calfsocket.postprocess.quantities import Quantities
from calfsocket.postprocess.thresholds import (
    Threshold,
    area_beyond,
    share_beyond,
    shares_beyond,
    tissue_area,
)
from report_results import contact_on_plate, plate, with_shear

EVEN = contact_on_plate(np.ones_like)


def share(fields: SectionFields, threshold: Threshold, contact: ContactLine = EVEN) -> float:
    return share_beyond(Quantities.of(fields), contact, threshold)


def test_areas_add_up():
    assert plate().gauss_area.sum() == pytest.approx(72)
    assert tissue_area(plate(), "muscle") == pytest.approx(36)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_patch_counts_by_its_area_and_by_its_magnitude(sign):
    """Nine of 72 squares of 1 mm carry 5 kPa, 1 kPa elsewhere: 1/8 of the plate, 1/4 of muscle."""
    fields = with_shear(plate(), (2.5, 1.5, 5.0 * sign))
    assert share(fields, Threshold("shear_stress", "muscle", 3.0)) == pytest.approx(9 / 36)
    assert share(fields, Threshold("shear_stress", "skin", 3.0)) == 0
    assert share(fields, Threshold("shear_stress", "skin", 0.5)) == pytest.approx(1)


def test_one_gauss_point_counts_although_no_maximum_reaches_it():
    """A third of one of 72 triangles of muscle, 1/6 mm2 of 36: below the level of two elements."""
    fields = with_shear(plate())
    stress = fields.stress.copy()
    stress[0, 1, 3] = 9.0
    quantities = Quantities.of(replace(fields, stress=stress))
    threshold = Threshold("shear_stress", "muscle", 3.0)
    assert area_beyond(quantities, threshold) == pytest.approx(1 / 6)
    assert abs(quantities.maximum("muscle", "shear_stress").value) < 3


@pytest.mark.parametrize(
    ("quantity", "level"),
    [("amp_log_strain", 29.57), ("tensile_log_strain", 29.57), ("shear_log_strain", 56.64)],
)
def test_strains_of_simple_shear(quantity, level):
    """By 0.6: stretches exp(+-asinh 0.3); LE12 is engineering shear, 2 asinh(0.3)/sqrt(1.09)."""
    f = np.tile(np.eye(2), (144, 3, 1, 1))
    f[plate().points[plate().cells].mean(axis=1)[:, 0] < 4, :, 0, 1] = 0.6
    fields = replace(plate(), deformation_gradient=f)
    # 4 of 12 mm
    assert share(fields, Threshold(quantity, "muscle", level - 0.1)) == pytest.approx(1 / 3)
    assert share(fields, Threshold(quantity, "muscle", level + 0.1)) == 0


def test_compression_is_no_tension():
    fields = replace(plate(), deformation_gradient=np.tile(np.diag([0.7, 1.0]), (144, 3, 1, 1)))
    # e11 = ln 0.7 = -35.7 %, e22 = 0
    assert share(fields, Threshold("amp_log_strain", "muscle", 35.0)) == pytest.approx(1)
    assert share(fields, Threshold("tensile_log_strain", "muscle", 0.1)) == 0


def test_contact_pressure_counts_by_the_running_mean_along_the_skin():
    """10 kPa on 6 of 18 mm: above 5 kPa where more than half of 3 mm lies there, 6 mm again."""
    contact = contact_on_plate(lambda arc: np.where((arc > 6) & (arc < 12), 10.0, 0.0))
    for value, expected in ((5.0, 6), (0.01, 9), (9.999, 3), (contact.running_mean_kPa.max(), 0)):
        found = share(plate(), Threshold("contact_pressure", "skin", value), contact)
        assert found == pytest.approx(expected / 18, abs=0.4 / 18)


def test_rows_of_the_summary():
    thresholds = [
        Threshold("contact_pressure", "skin", 0.5),
        Threshold("shear_log_strain", "muscle", 50.0),
        Threshold("pressure", "vessel", 1.0),  # the plate has none
    ]
    rows = shares_beyond(Quantities.of(plate()), EVEN, thresholds)
    assert rows["quantity"].tolist() == [
        "share_of_contact_pressure_above_0.5_kPa",
        "share_of_shear_log_strain_above_50_percent",
    ]
    assert rows.value.tolist() == [100.0, 0.0] and set(rows.unit) == {"%"}


@pytest.mark.parametrize(
    ("given", "says"),
    [
        (("pain", "skin", 1.0), "quantity is 'pain'"),
        (("contact_pressure", "fat", 1.0), "tissue is 'fat'"),
        (("pressure", "vessel", 0.0), "above 0"),
        (("pressure", "vessel", float("nan")), "above 0"),
    ],
)
def test_thresholds_are_checked(given, says):
    with pytest.raises(InputError, match=says):
        Threshold(*given)
