"""Shares beyond thresholds against areas and lengths counted by hand."""

import numpy as np
import pytest

from calfsocket.postprocess.quantities import running_mean, summary_rows
from calfsocket.postprocess.thresholds import Threshold, area_share, outline_share, threshold_rows
from report_results import contact_on_plate, plate, with_shear


def test_a_patch_counts_by_the_area_that_holds_its_level():
    """Nine of 72 squares of 1 mm carry 5 kPa, 1 kPa elsewhere: 1/8 of the plate, 1/4 of muscle."""
    fields = with_shear(plate(), (2.5, 1.5, 5.0))
    patch = Threshold("shear_stress", "muscle", 3.0)
    assert area_share(fields, patch) == pytest.approx(9 / 36)
    assert area_share(fields, Threshold("shear_stress", "skin", 3.0)) == 0
    assert area_share(fields, Threshold("shear_stress", "skin", 0.5)) == pytest.approx(1)


def test_the_sign_does_not_count():
    fields = with_shear(plate(), (2.5, 1.5, -5.0))
    assert area_share(fields, Threshold("shear_stress", "muscle", 3.0)) == pytest.approx(9 / 36)


@pytest.mark.parametrize("limit", [0.5, 1.5, 3.0, 4.9, 5.0, 5.1, 7.0])
def test_something_is_beyond_a_threshold_exactly_where_the_maximum_is(limit):
    fields = with_shear(plate(), (2.5, 1.5, 5.0), (9.5, 4.5, 7.0))
    contact = contact_on_plate(np.ones_like)
    summary = summary_rows(fields, contact, "s", "m").set_index(["tissue", "outcome"]).value
    for tissue in ("muscle", "skin"):
        share = area_share(fields, Threshold("shear_stress", tissue, limit))
        assert (share > 0) == (abs(summary[tissue, "shear_stress"]) > limit)


def test_contact_pressure_counts_by_the_running_mean_along_the_skin():
    """10 kPa on 6 of 18 mm: above 5 kPa where more than half of 3 mm lies there, 6 mm again."""
    contact = contact_on_plate(lambda arc: np.where((arc > 6) & (arc < 12), 10.0, 0.0))
    assert outline_share(contact, 5.0) == pytest.approx(6 / 18, abs=0.4 / 18)
    assert outline_share(contact, 0.01) == pytest.approx(9 / 18, abs=0.4 / 18)
    assert outline_share(contact, 9.999) == pytest.approx(3 / 18, abs=0.4 / 18)
    assert outline_share(contact, running_mean(contact).max()) == 0


def test_rows_say_what_is_beyond_what():
    fields, contact = plate(), contact_on_plate(np.ones_like)
    thresholds = [
        Threshold("contact_pressure", "skin", 0.5),
        Threshold("shear_log_strain", "muscle", 50.0),
        Threshold("pressure", "vessel", 1.0),  # the plate has none
    ]
    rows = threshold_rows(fields, contact, thresholds, "mine", "soft")
    assert rows.outcome.tolist() == [
        "share_of_contact_pressure_above_0.5_kPa",
        "share_of_shear_log_strain_above_50_percent",
    ]
    assert rows.value.tolist() == [100.0, 0.0]
    assert set(rows.unit) == {"%"} and set(rows.socket) == {"mine"}
