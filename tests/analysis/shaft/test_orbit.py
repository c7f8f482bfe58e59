"""Orbits and the shaft centreline."""

from collections.abc import Callable

import numpy as np
import pytest

from analysis.resampling.angular_record import AngularRecord
from analysis.shaft.orbit import centreline, direct_orbit, filtered_orbit, orbit_without
from analysis.signals.errors import RecordTooShortError
from analysis.signals.units import MICROMETRE

Maker = Callable[..., AngularRecord]


def test_filtered_orbit_contains_one_order_and_starts_at_theta_0(make_angular: Maker) -> None:
    record = make_angular((20.0, 1.0, 0.4), (4.0, -1.0, 0.0), (8.0, 0.5, 0.0), (3.0, 2.0, 1.0))
    orbit = filtered_orbit(record, (1.0,))
    truth = 20 * np.exp(1j * (2 * np.pi * np.arange(64) / 64 + 0.4)) + 4 * np.exp(-2j * np.pi * np.arange(64) / 64)
    np.testing.assert_allclose(orbit.motion[0, 0] + 1j * orbit.motion[1, 0], truth, atol=1e-6)
    np.testing.assert_allclose(orbit.keyphasor_points[:, 0], [truth[0].real, truth[0].imag], atol=1e-6)
    assert orbit.ellipses[0].major == pytest.approx(24.0)
    assert orbit.ellipses[0].minor == pytest.approx(16.0)
    assert orbit.speed == pytest.approx(2 * np.pi * 100)
    assert np.diff(orbit.times[0]) == pytest.approx(1 / 6400)


def test_filtered_and_residual_orbit_add_up_to_the_direct_orbit(make_angular: Maker) -> None:
    record = make_angular((20.0, 1.0, 0.4), (8.0, 0.47, 0.0), noise=0.1)
    filtered = filtered_orbit(record, (1.0,), revolutions=4)
    left = orbit_without(record, (1.0,), revolutions=4)
    direct = direct_orbit(record, 4)
    rest = direct.motion - filtered.motion - left.motion
    assert np.ptp(rest, axis=(1, 2)).max() < 1e-9  # but for a constant, the mean being taken off each
    assert left.peak_to_peak == pytest.approx([16.0, 16.0], abs=1.0)
    assert 0.001 < filtered.sigma < 0.05


def test_orbit_can_contain_several_orders(make_angular: Maker) -> None:
    record = make_angular((20.0, 1.0, 0.4), (3.0, 2.0, 1.0), (8.0, 0.5, 0.0))
    both = filtered_orbit(record, (1.0, 2.0), revolutions=2)
    assert len(both.ellipses) == 2
    assert orbit_without(record, (1.0, 2.0, 0.5)).peak_to_peak.max() < 1e-3


def test_too_few_revolutions_are_refused(make_angular: Maker) -> None:
    record = make_angular((20.0, 1.0, 0.4), revolutions=8)
    with pytest.raises(RecordTooShortError):
        filtered_orbit(record, (1.0,))
    with pytest.raises(RecordTooShortError):
        direct_orbit(record, 9)
    with pytest.raises(ValueError, match="orders"):
        filtered_orbit(record, (), averaging_revolutions=8)
    with pytest.raises(ValueError, match="revolutions"):
        direct_orbit(record, 0)


def test_shaft_lifts_from_its_rest_position(make_angular: Maker) -> None:
    record = make_angular(
        (20 * MICROMETRE, 1.0, 0.0), noise=0.5 * MICROMETRE, mean=(-500 * MICROMETRE, -480 * MICROMETRE)
    )
    line = centreline(record, np.array([-520 * MICROMETRE, -540 * MICROMETRE]), 100 * MICROMETRE)
    np.testing.assert_allclose(line.positions[0], 20 * MICROMETRE, atol=0.05 * MICROMETRE)
    np.testing.assert_allclose(line.positions[1], -40 * MICROMETRE, atol=0.05 * MICROMETRE)
    np.testing.assert_allclose(line.eccentricity_ratio, np.hypot(0.2, 0.4), atol=1e-3)
    np.testing.assert_allclose(line.attitude, np.arctan2(20, 40), atol=2e-3)
    assert line.is_inside.all()
    assert line.sigma.mean() == pytest.approx(0.5 * MICROMETRE / np.sqrt(16 * 64), rel=0.3)
    assert line.speeds.size == 4
    np.testing.assert_allclose(np.hypot(*line.circle()), 100 * MICROMETRE)


def test_wrong_rest_position_shows_as_a_shaft_outside_its_clearance(make_angular: Maker) -> None:
    line = centreline(
        make_angular(mean=(0.0, 0.0)), np.zeros(2), 100 * MICROMETRE, rest_position=(0.0, -150 * MICROMETRE)
    )
    assert not line.is_inside.any()


def test_misuse_is_refused(make_angular: Maker) -> None:
    record = make_angular(revolutions=8)
    with pytest.raises(RecordTooShortError):
        centreline(record, np.zeros(2), 100 * MICROMETRE)
    with pytest.raises(ValueError, match="clearance"):
        centreline(record, np.zeros(2), 0.0)
