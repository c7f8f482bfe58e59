"""Waterfall and cascade of frequency spectra."""

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.signals.errors import RecordTooShortError
from analysis.signals.header import Tacho
from analysis.spectra.frequency_spectrum import frequency_map
from analysis.tacho.pulse_record import pulse_record
from analysis.tacho.shaft_angle import ShaftAngle, shaft_angle

FloatArray = NDArray[np.float64]
RATE = 2_000.0
TIME = np.arange(20_000) / RATE
TACHO = Tacho(threshold=2.0, hysteresis=1.0, response_time=1e-5)


def motion(noise: float = 0.1) -> FloatArray:
    """Return a whip at 62 Hz and a 1X from 50 to 150 Hz in ten seconds, of larger amplitude at y from the middle on."""
    turns = 50.0 * TIME + 5.0 * TIME**2
    whip = 8.0 * np.cos(2 * np.pi * 62.0 * TIME) * np.array([np.ones(TIME.size), 1.0 * (TIME > 5.0)])
    noises = noise * np.random.default_rng(0).standard_normal((2, TIME.size))
    return np.asarray(20.0 * np.cos(2 * np.pi * turns) + whip + noises)


def run_up() -> ShaftAngle:
    return shaft_angle(pulse_record(np.asarray((np.sqrt(2500.0 + 20.0 * np.arange(990)) - 50.0) / 10.0), TACHO))


def test_line_of_constant_frequency_has_its_amplitude_at_every_time() -> None:
    found = frequency_map(motion(), RATE, resolution=2.0, highest=400.0)
    assert found.frequencies[-1] == 400.0
    assert found.noise_bandwidth == 3.0
    late = found.times > 5.5
    np.testing.assert_allclose(found.amplitudes[:, late, 31], 8.0, atol=0.05)
    assert found.amplitudes[1, found.times < 4.5, 31][12:].max() < 0.1  # before it swells, once 1X has gone by
    assert np.isnan(found.speeds).all()


def test_noise_floor_of_a_frame_is_that_of_a_noise_line() -> None:
    noise = np.random.default_rng(1).standard_normal((2, 40_000))
    found = frequency_map(noise, RATE, resolution=4.0)
    assert np.mean(found.sigma) == pytest.approx(np.sqrt(2 * 1.5 / 500), rel=0.03)
    assert np.std(found.amplitudes[:, :, 5:-5]) == pytest.approx(0.655 * np.mean(found.sigma), rel=0.03)  # Rayleigh's


def test_cascade_contains_the_largest_amplitudes_at_each_speed() -> None:
    found = frequency_map(motion(), RATE, run_up(), resolution=4.0)
    known = np.isfinite(found.speeds)
    np.testing.assert_allclose(found.speeds[known], 2 * np.pi * (50.0 + 10.0 * found.times[known]), rtol=1e-6)
    speeds, rows = found.cascade(2 * np.pi * 10.0)
    assert np.all(np.diff(speeds) > 0.0)
    for speed, row in zip(speeds[1:-1], rows[0, 1:-1], strict=True):
        at = found.frequencies[np.argmax(np.where(np.abs(found.frequencies - 62.0) > 12.0, row, 0.0))]
        assert abs(at - speed / (2 * np.pi)) < 12.0
    with pytest.raises(ValueError, match="width"):
        found.cascade(0.0)


def test_records_shorter_than_a_frame_are_refused() -> None:
    with pytest.raises(RecordTooShortError):
        frequency_map(np.zeros((2, 100)), RATE)
    with pytest.raises(ValueError, match="displacement"):
        frequency_map(np.zeros((3, 9_000)), RATE)
    with pytest.raises(ValueError, match="highest"):
        frequency_map(np.zeros((2, 9_000)), RATE, highest=0.0)
