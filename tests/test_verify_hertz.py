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
    push,
)

LINES = {"flat": Line(), "bore": BORE}


def within(errors, most, profile):
    """Whether all errors are below `most`, and that of a profile below its own."""
    return all(abs(e) < (profile if "profile" in what else most) for what, e in errors.items())


@pytest.mark.parametrize("line", LINES)
def test_hertz(line):
    pressed = press(replace(LINES[line], divisions=6.0))
    assert pressed.half_width / pressed.line.half_width == pytest.approx(1.0, abs=0.05)
    assert pressed.total == pytest.approx(pressed.force, rel=1e-4)
    assert within(pressed.hertz_errors(), 0.01, profile=0.02)
    assert pressed.edges.shear.abs().max() < 1e-9 * pressed.peak
    coarse = press(replace(LINES[line], divisions=3.0))
    peaks = [abs(p.hertz_errors()["peak pressure"]) for p in (coarse, pressed)]
    assert peaks[1] < 0.5 * peaks[0]


def test_closed_forms_by_hand():
    line = Line(bore=12.5)
    assert line.relative_radius == pytest.approx(50.0)
    assert line.modulus == pytest.approx(1.0 / (2 * 0.91))
    # The pressure carries the force: pi/2 a p0 = P.
    assert np.pi / 2 * line.half_width_of(0.3) * line.peak_of(0.3) == pytest.approx(0.3)


def test_part_of_the_contact_slips_under_half_the_limit():
    pulled = push(replace(PARTIAL_SLIP, divisions=4.0), [SHARE], SHARE / 3).states[-1]
    assert 0.3 < pulled.tangential / (0.4 * pulled.force) < 0.8
    assert within(pulled.slip_errors(), 0.04, profile=0.06)
    limit = pulled.line.friction * pulled.edges.pressure
    assert np.all(pulled.edges.shear.abs() <= limit * (1 + 1e-9))
    assert pulled.stick_half_width < 0.9 * pulled.exact_half_width


@pytest.mark.slow
@pytest.mark.parametrize("line", LINES)
def test_hertz_on_a_fine_mesh(line):
    errors = press(replace(LINES[line], divisions=12.0)).hertz_errors()
    del errors["force of the measured half-width"]  # twice that of the half-width
    assert within(errors, 0.002, profile=0.006)


@pytest.mark.slow
def test_cattaneo_and_mindlin():
    pulled = push(replace(PARTIAL_SLIP, divisions=16.0), [SHARE], SHARE / STEPS).states[-1]
    assert within(pulled.slip_errors(), 0.02, profile=0.02)
    exact = pulled.stick_ratio * pulled.exact_half_width
    assert pulled.stick_half_width == pytest.approx(exact, rel=0.03)  # it counts points, and jumps
