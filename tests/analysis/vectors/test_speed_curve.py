"""Bode and polar data of a known resonance."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.signals.ramp import RampDirection
from analysis.signals.units import MICROMETRE
from analysis.vectors.order_track import OrderTrack
from analysis.vectors.speed_curve import speed_curves

FloatArray = NDArray[np.float64]
CRITICAL = 2 * np.pi * 200.0
WIDTH = 2 * np.pi * 2.0


def track_of(speeds: FloatArray, damping: float = 0.05, noise: float = 0.0, step: int = 16) -> OrderTrack:
    """Return 1X of a rotor with one resonance: the unbalance response at each speed."""
    ratio = speeds / CRITICAL
    response = 2 * MICROMETRE * ratio**2 / (1 - ratio**2 + 2j * damping * ratio)
    random = np.random.default_rng(0)
    shaken = noise * (random.standard_normal((2, speeds.size)) + 1j * random.standard_normal((2, speeds.size)))
    vectors = response * np.array([[1.0], [-1.0j]]) + shaken
    sigma = np.full((2, speeds.size), max(noise, 1e-12))
    times = 0.1 * np.arange(speeds.size, dtype=np.float64)
    return OrderTrack(1.0, vectors, sigma, sigma / np.abs(vectors), speeds, np.zeros(speeds.size), times, 16, step)


def test_resonance_is_found_with_amplification_factor_and_phase() -> None:
    (curve,) = speed_curves(track_of(2 * np.pi * np.linspace(100, 300, 800)), WIDTH)
    (resonance,) = curve.resonances(0)
    assert curve.direction is RampDirection.RUN_UP
    assert resonance.speed == pytest.approx(CRITICAL, rel=0.01)
    assert resonance.amplitude == pytest.approx(20 * MICROMETRE, rel=0.01)
    assert resonance.amplification_factor == pytest.approx(10.0, rel=0.03)
    assert np.degrees(resonance.phase_change) == pytest.approx(90.0, abs=3.0)
    assert np.degrees(curve.lags[0, -1] - curve.lags[0, 0]) == pytest.approx(170.0, abs=10.0)


def test_run_up_and_run_down_give_separate_curves() -> None:
    up = 2 * np.pi * np.linspace(100, 300, 400)
    ripple = 2.0 * np.sin(np.arange(800))
    track = track_of(np.concatenate([up, up[::-1]]) + ripple)
    doubled = replace(track, vectors=track.vectors * np.where(np.arange(800) < 400, 1.0, 2.0))
    first, second = speed_curves(doubled, WIDTH)
    assert (first.direction, second.direction) == (RampDirection.RUN_UP, RampDirection.RUN_DOWN)
    assert first.amplitudes.max() == pytest.approx(20 * MICROMETRE, rel=0.02)
    assert second.amplitudes.max() == pytest.approx(40 * MICROMETRE, rel=0.02)
    assert first.speeds.size == pytest.approx(100, abs=3)
    assert first.frames.sum() + second.frames.sum() == 800


def test_constant_speed_gives_one_curve() -> None:
    speeds = CRITICAL + np.random.default_rng(0).standard_normal(200)
    assert len(speed_curves(track_of(speeds), WIDTH)) == 1


def test_uncertainty_of_a_mean_falls_with_independent_frames_only() -> None:
    steady = np.full(400, CRITICAL)
    (curve,) = speed_curves(track_of(steady, noise=0.1 * MICROMETRE), WIDTH)
    assert curve.sigma[0, 0] == pytest.approx(0.1 * MICROMETRE / 20, rel=0.1)
    (shared,) = speed_curves(track_of(steady, noise=0.1 * MICROMETRE, step=4), WIDTH)
    assert shared.sigma[0, 0] == pytest.approx(np.sqrt(8 / 3) * curve.sigma[0, 0], rel=0.01)
    assert curve.phase_sigma[0, 0] == pytest.approx(curve.sigma[0, 0] / (20 * MICROMETRE), rel=0.2)


def test_curve_that_ends_on_a_slope_has_no_resonance() -> None:
    (curve,) = speed_curves(track_of(2 * np.pi * np.linspace(100, 190, 300)), WIDTH)
    assert curve.resonances(0) == ()
    (half,) = speed_curves(track_of(2 * np.pi * np.linspace(100, 203, 300)), WIDTH)
    assert [np.isnan(resonance.amplification_factor) for resonance in half.resonances(0)] in ([True], [])


def test_zero_width_is_refused() -> None:
    with pytest.raises(ValueError, match="width"):
        speed_curves(track_of(np.full(5, CRITICAL)), 0.0)
