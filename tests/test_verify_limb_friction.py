"""Friction on the limb: what depends on the load step and on the path, and what does not."""

import numpy as np
import pytest

from calfsocket.contact.parameters import Contact
from calfsocket.verification.limb_friction import FREE, Fitting, fit
from calfsocket.verification.limb_runs import largest_distance

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def closed() -> Fitting:
    return fit("TSB", "closed", 0.25)


def test_shear_does_not_depend_on_the_load_step(closed):
    """Points that stick do not creep, in however many steps."""
    finer = fit("TSB", "closed", 0.05)
    assert finer.shear_ratio == pytest.approx(closed.shear_ratio, rel=1e-3)
    assert finer.mean_pressure == pytest.approx(closed.mean_pressure, rel=1e-5)


def test_springs_creep_and_do_not_slip(closed):
    soft, usual, stiff = (
        fit("TSB", "stiffened", 0.1, contact=Contact(gamma_t=ratio)) for ratio in (0.1, 0.5, 8.0)
    )
    assert soft.shear_ratio < 0.6 * usual.shear_ratio < 0.6 * stiff.shear_ratio
    assert stiff.shear_ratio < closed.shear_ratio
    for made in (soft, usual, stiff):
        assert made.history.slip_share.max() < 0.01
        assert made.mean_pressure == pytest.approx(closed.mean_pressure, rel=0.02)
        assert made.end.checks.negative_modes == 0


def test_without_friction_all_paths_end_alike():
    paths = "closed", "stiffened"
    ends = [fit("TSB", path, 0.1, contact=FREE).line.pressure_kPa for path in paths]
    np.testing.assert_allclose(ends[1], ends[0], atol=1e-5 * ends[0].max())


def test_a_shrinking_socket_slides_first_and_holds_then(closed):
    shrunk = fit("TSB", "shrunk", 0.05)
    slips = shrunk.history.slip_share
    assert slips.max() > 0.1 > slips.iloc[-1]
    assert 0.02 < shrunk.shear_ratio < closed.shear_ratio
    assert shrunk.mean_pressure == pytest.approx(closed.mean_pressure, rel=0.02)
    assert shrunk.end.checks.relative_force_imbalance < 1e-6


def test_the_fascia_snaps_to_another_branch_as_contact_stiffens():
    """HS: the same problem, another equilibrium, both of them stable."""
    closed, stiffened, shrunk = (
        fit("HS", path, step)
        for path, step in (("closed", 0.1), ("stiffened", 0.05), ("shrunk", 0.05))
    )
    for made, least, most in ((stiffened, 1.0, 4.0), (shrunk, 0.0, 0.6)):
        assert least < largest_distance(made.end, closed.end) < most
        assert made.end.checks.negative_modes == 0
        assert made.mean_pressure == pytest.approx(closed.mean_pressure, rel=0.03)
    assert 0.1 < shrunk.shear_ratio < closed.shear_ratio < 0.2
