"""The clock error of the card."""

import numpy as np
import pytest

from analysis.live.delivery import PPM, ClockEstimator
from analysis.signals.blocks import SampleBlock

RATE, BLOCK = 1000.0, 100
START = 1_795_000_000_000_000_000


def blocks(
    fit: ClockEstimator,
    n: int,
    *,
    error: float,
    delay: float = 0.0,
    seed: int = 0,
    segment: int = 0,
    start: int = START,
) -> None:
    """Read `n` blocks of a card whose clock is off by `error`, each late by a random time of mean `delay`, s."""
    random = np.random.default_rng(seed)
    codes = np.zeros((1, BLOCK), np.int16)
    for k in range(n):
        host = (k + 1) * BLOCK / (RATE * (1 + error)) + random.exponential(delay)
        fit.add_block(SampleBlock(codes, segment, k * BLOCK, start + round(host * 1e9)))


@pytest.mark.parametrize("error", [50e-6, -50e-6, 0.0])
def test_clock_error_without_delays_is_exact(error: float) -> None:
    fit = ClockEstimator(RATE)
    blocks(fit, 3000, error=error)
    found = fit.error()
    assert found is not None
    assert abs(found.error - error) < 1e-9
    assert found.uncertainty < 1e-9


def test_uncertainty_covers_the_true_clock_error_as_often_as_stated() -> None:
    within = 0
    for seed in range(100):
        fit = ClockEstimator(RATE)
        blocks(fit, 1200, error=30e-6, delay=5e-3, seed=seed)
        found = fit.error()
        assert found is not None
        assert 5 * PPM < found.uncertainty < 13 * PPM
        within += abs(found.error - 30e-6) < found.uncertainty
    assert 90 <= within <= 99


def test_segments_share_one_slope_and_have_separate_offsets() -> None:
    fit = ClockEstimator(RATE)
    blocks(fit, 300, error=40e-6)
    blocks(fit, 300, error=40e-6, segment=1, start=START + 77_000_000_000)
    found = fit.error()
    assert found is not None
    assert abs(found.error - 40e-6) < 1e-9


def test_late_reader_does_not_bias_the_clock_error() -> None:
    fit = ClockEstimator(RATE)
    codes = np.zeros((1, BLOCK), np.int16)
    for k in range(600):
        backlog = k * BLOCK // 2  # it falls behind more and more
        host = ((k + 1) * BLOCK + backlog) / RATE
        fit.add_block(SampleBlock(codes, 0, k * BLOCK, START + round(host * 1e9), backlog))
    found = fit.error()
    assert found is not None
    assert abs(found.error) < 1e-9


def test_short_run_has_no_clock_error() -> None:
    fit = ClockEstimator(RATE)
    blocks(fit, 40, error=0.0)
    assert fit.error() is None


def test_samples_not_in_real_time_have_no_clock_error() -> None:
    fit = ClockEstimator(RATE)
    blocks(fit, 3000, error=20.0)
    assert fit.error() is None
