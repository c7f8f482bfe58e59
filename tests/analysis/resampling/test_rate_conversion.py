"""Interpolation and the decimation pyramid on known waves."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from analysis.resampling.rate_conversion import HALF_BAND_REACH, HALF_WIDTH, DecimationPyramid, interpolate
from analysis.spectra.order_map import order_spectrum

FloatArray = NDArray[np.float64]


@pytest.mark.parametrize(("frequency", "bar"), [(0.0, 1e-12), (0.05, 5e-5), (0.3, 5e-5), (0.4, 3e-4), (0.42, 1e-3)])
def test_interpolation_is_accurate_up_to_0_4_of_the_rate(frequency: float, bar: float) -> None:
    n = np.arange(500)
    positions = np.linspace(20.0, 470.0, 3001)[None]
    for phase in (0.0, 1.0, 2.0):
        wave = np.cos(2 * np.pi * frequency * n + phase)[None]
        truth = np.cos(2 * np.pi * frequency * positions + phase)
        assert np.abs(interpolate(wave, positions) - truth).max() < bar


def test_interpolation_at_samples_gives_the_samples() -> None:
    samples = np.random.default_rng(0).standard_normal((2, 80))
    positions = np.tile(np.arange(HALF_WIDTH - 1.0, 80.0 - 1 - HALF_WIDTH), (2, 1))
    np.testing.assert_allclose(
        interpolate(samples, positions), samples[:, HALF_WIDTH - 1 : -1 - HALF_WIDTH], atol=1e-14
    )


def test_interpolation_reads_each_channel_at_its_own_positions() -> None:
    ramp = np.tile(np.arange(100.0), (2, 1))
    np.testing.assert_allclose(interpolate(ramp, np.array([[50.25], [40.5]])), [[50.25], [40.5]], atol=1e-3)


@pytest.mark.parametrize("position", [HALF_WIDTH - 1.01, 100.0 - HALF_WIDTH])
def test_interpolation_refuses_positions_at_the_ends(position: float) -> None:
    with pytest.raises(ValueError, match="positions"):
        interpolate(np.zeros((1, 100)), np.array([[position]]))


def pushed(pyramid: DecimationPyramid, samples: FloatArray, size: int) -> DecimationPyramid:
    for begin in range(0, samples.shape[1], size):
        pyramid.push(samples[:, begin : begin + size])
    return pyramid


@pytest.mark.parametrize("level", [1, 2, 4])
def test_level_contains_the_samples_at_its_rate(level: int) -> None:
    n = np.arange(20_000)
    frequency = 0.2 / 2**level
    samples = np.stack([np.cos(2 * np.pi * frequency * n), 3.0 + np.sin(2 * np.pi * frequency * n)])
    samples_of_level, first = pushed(DecimationPyramid(2, 5, 30_000, 0), samples, 999).level(level)
    at = (first + np.arange(samples_of_level.shape[1])) * 2**level
    truth = np.stack([np.cos(2 * np.pi * frequency * at), 3.0 + np.sin(2 * np.pi * frequency * at)])
    np.testing.assert_allclose(samples_of_level, truth, atol=1e-4)
    assert at[-1] > 20_000 - 2 * HALF_BAND_REACH * 2**level


@pytest.mark.parametrize("frequency", [0.3, 0.37, 0.5])
def test_level_contains_no_aliases(frequency: float) -> None:
    wave = np.cos(2 * np.pi * frequency * np.arange(4000))[None]
    samples_of_level, _ = pushed(DecimationPyramid(1, 2, 4000, 0), wave, 4000).level(1)
    assert np.abs(samples_of_level).max() < 1.5e-4


@pytest.mark.parametrize("size", [1, 7, 64, 1000])
def test_levels_are_bit_identical_for_any_block_size(size: int) -> None:
    samples = np.random.default_rng(1).standard_normal((2, 2000))
    whole, piece = (
        pushed(DecimationPyramid(2, 4, 4000, 100), samples, 2000),
        pushed(DecimationPyramid(2, 4, 4000, 100), samples, size),
    )
    for level in range(4):
        assert whole.level(level)[1] == piece.level(level)[1]
        np.testing.assert_allclose(whole.level(level)[0], piece.level(level)[0], atol=1e-14)


def test_pyramid_discards_old_samples() -> None:
    pyramid = pushed(DecimationPyramid(1, 3, 500, 0), np.arange(10_000.0)[None], 128)
    for level in range(3):
        samples_of_level, first = pyramid.level(level)
        assert samples_of_level.shape[1] == 500
        np.testing.assert_allclose(samples_of_level[0], (first + np.arange(500)) * 2**level, rtol=1e-12)


def test_orders_one_to_six_at_600_hertz_are_accurate_within_a_quarter_per_cent() -> None:
    """Orders 1, 0.5, 4 and 6 sampled at 600 Hz on a shaft from 10 to 40 Hz: order 6 reaches 0.4 of the rate."""
    rate, duration = 600.0, 5.0
    time = np.arange(int(rate * duration)) / rate
    turns = 10.0 * time + 0.5 * 6.0 * time**2
    amplitudes = {1.0: 1.0, 0.5: 0.5, 4.0: 2.0**0.5, 6.0: 2.0}
    wave = sum(a * np.cos(2 * np.pi * order * turns) for order, a in amplitudes.items())
    revolutions, points = 16, 64
    worst = dict.fromkeys(amplitudes, 0.0)
    for begin in range(2, int(turns[-1]) - revolutions - 1, 4):
        grid = begin + np.arange(revolutions * points) / points
        positions = np.asarray((np.sqrt(100.0 + 12.0 * grid) - 10.0) / 6.0 * rate)[None]
        _, spectrum = order_spectrum(interpolate(np.asarray(wave)[None], positions), revolutions)
        for order, amplitude in amplitudes.items():
            error = abs(abs(spectrum[0, round(order * revolutions)]) / amplitude - 1.0)
            worst[order] = max(worst[order], float(error))
    assert max(worst.values()) < 0.0025, worst


def test_interpolation_beats_a_cubic_spline_at_high_frequencies() -> None:
    n = np.arange(400)
    positions = np.linspace(30.0, 350.0, 999)
    wave = np.cos(2 * np.pi * 0.3 * n)
    truth = np.cos(2 * np.pi * 0.3 * positions)
    ours = np.abs(interpolate(wave[None], positions[None])[0] - truth).max()
    spline = np.abs(CubicSpline(n, wave)(positions) - truth).max()
    assert ours < 0.01 * spline
