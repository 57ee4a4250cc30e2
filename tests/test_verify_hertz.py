"""Hertz on a flat and in a bore, Cattaneo and Mindlin's partial slip."""

from dataclasses import replace

import numpy as np
import pytest

from calfsocket.verification.hertz import (
    BORE,
    PARTIAL_SLIP,
    SHARE,
    STEPS,
    Line,
    press,
    press_and_pull,
)


@pytest.mark.parametrize("line", [Line(divisions=6.0), replace(BORE, divisions=6.0)])
def test_hertz(line):
    pressed = press(line)
    assert pressed.half_width / line.half_width == pytest.approx(1.0, abs=0.05)
    assert pressed.imbalance < 1e-4
    assert abs(pressed.force_error) < 0.01
    assert abs(pressed.half_width_error) < 0.01
    assert abs(pressed.peak_error) < 0.01
    assert pressed.profile_error < 0.02
    assert np.abs(pressed.shear).max() < 1e-9 * pressed.peak


def test_peak_converges_to_hertz():
    errors = [abs(press(Line(divisions=n)).peak_error) for n in (3.0, 6.0)]
    assert errors[1] < 0.5 * errors[0]


def test_closed_forms_by_hand():
    line = Line(bore=12.5)
    assert line.relative_radius == pytest.approx(50.0)
    assert line.modulus == pytest.approx(1.0 / (2 * 0.91))
    # The pressure carries the force: pi/2 a p0 = P.
    assert np.pi / 2 * line.half_width_of(0.3) * line.peak_of(0.3) == pytest.approx(0.3)


def test_part_of_the_contact_slips_under_half_the_limit():
    pulled = press_and_pull(replace(PARTIAL_SLIP, divisions=4.0), SHARE, 3)
    assert 0.3 < pulled.tangential / (0.4 * pulled.force) < 0.8
    assert abs(pulled.stick_error) < 0.04
    assert pulled.shear_error < 0.06
    limit = pulled.line.friction * pulled.pressure
    assert np.all(np.abs(pulled.shear) <= limit * (1 + 1e-9))
    assert pulled.stick_half_width < 0.9 * pulled.exact_half_width


@pytest.mark.slow
@pytest.mark.parametrize("line", [Line(divisions=12.0), replace(BORE, divisions=12.0)])
def test_hertz_on_a_fine_mesh(line):
    pressed = press(line)
    assert abs(pressed.half_width_error) < 0.002
    assert abs(pressed.peak_error) < 0.002
    assert pressed.profile_error < 0.006


@pytest.mark.slow
def test_cattaneo_and_mindlin():
    pulled = press_and_pull(replace(PARTIAL_SLIP, divisions=16.0), SHARE, STEPS)
    assert abs(pulled.stick_error) < 0.02
    assert abs(pulled.stick_points_error) < 0.03  # it counts points, and jumps
    assert pulled.shear_error < 0.02
