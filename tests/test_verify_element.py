"""The element: patch test, rates of convergence, a bending fascia."""

import pytest

from calfsocket.verification.bending import (
    CONSTANT,
    CONTINUOUS,
    OURS,
    REFERENCE,
    bending,
    bending_errors,
)
from calfsocket.verification.manufactured import RATES, compressible, convergence, isochoric
from calfsocket.verification.patch_test import patch_strips, patch_test
from calfsocket.verification.report import order


@pytest.mark.parametrize("name", patch_strips())
@pytest.mark.parametrize("stress", [-0.002, 0.003])
def test_patch(name, stress):
    """Exact to rounding: what is left of it is 1e-14 and, in pressure, 1e-12."""
    patch = patch_test(patch_strips()[name], stress=stress)
    assert patch.displacement < 1e-12
    assert patch.stretch < 1e-11
    assert patch.pressure < 1e-10


@pytest.mark.parametrize("exact", [compressible, isochoric])
def test_rates_on_curved_triangles(exact):
    errors = convergence(exact())
    for norm, least in RATES.items():
        assert order(errors.index, errors[norm]) > least, norm
    assert errors["u L2"].iloc[-1] < 1e-4


@pytest.mark.slow
def test_bending_fascia():
    """One element across the fascia is enough for this element, and for no other."""
    fine = bending(OURS, REFERENCE)
    force, deflection = bending_errors(OURS, fine)
    assert abs(force) < 1e-5
    assert abs(deflection) < 1e-3
    assert bending_errors(CONTINUOUS, fine)[0] < -0.5  # the pressure leaks out of muscle
    assert bending_errors(CONSTANT, fine)[1] > 0.02  # too soft in bending
