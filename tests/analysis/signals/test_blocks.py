"""Ramp direction, clock error and backlog of a run."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.signals.blocks import (
    ClockEstimator,
    DeliveryMonitor,
    DeliveryStatistics,
    RampDirection,
    RampStep,
    RampTracker,
    SampleBlock,
)
from analysis.signals.header import Acquisition, RunHeader
from analysis.signals.units import PPM, RPM


def steps(*speeds_rpm: float) -> list[RampStep]:
    ramp = RampTracker()
    return [ramp.update(speed * RPM) for speed in speeds_rpm]


def test_reversal_needs_a_change_above_the_speed_fluctuation() -> None:
    found = steps(1000, 1050, 1150, 2000, 3000, 2990, 2950, 2880, 2800, 2850)
    within, furthest, reversal = RampStep.WITHIN, RampStep.FURTHEST, RampStep.REVERSED
    assert found == [
        within,
        within,
        reversal,
        furthest,
        furthest,
        within,
        within,
        reversal,
        furthest,
        within,
    ]


@pytest.mark.parametrize(("last", "direction"), [(29_500, RampDirection.RUN_UP), (29_300, RampDirection.RUN_DOWN)])
def test_two_per_cent_of_a_high_speed_is_fluctuation(last: float, direction: RampDirection) -> None:
    ramp = RampTracker()
    for speed in (1000, 30_000, last):
        ramp.update(speed * RPM)
    assert ramp.direction is direction


def test_constant_speed_does_not_change_the_ramp_direction() -> None:
    air = np.random.default_rng(1).normal(10_000.0, 20.0, 2000)
    up, down = RampTracker(), RampTracker()
    up.update(1000 * RPM)
    for speed in (15_000, 12_000):
        down.update(speed * RPM)
    for speed in air:
        up.update(speed * RPM)
        down.update(speed * RPM)
    assert (up.direction, down.direction) == (RampDirection.RUN_UP, RampDirection.RUN_DOWN)


@pytest.mark.parametrize(("last", "direction"), [(4000, RampDirection.RUN_UP), (2000, RampDirection.RUN_DOWN)])
def test_first_direction_is_that_of_the_first_ramp(last: float, direction: RampDirection) -> None:
    ramp = RampTracker()
    for speed in np.linspace(3000, last, 50):
        ramp.update(speed * RPM)
    assert ramp.direction is direction


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


def statistics(acquisition: Acquisition, *backlogs: tuple[int, int]) -> DeliveryStatistics:
    """Return the statistics of one block for each pair of segment and backlog."""
    monitor = DeliveryMonitor(acquisition)
    for segment, backlog in backlogs:
        monitor.add_block(SampleBlock(np.zeros((3, 100), np.int16), segment, 0, START, backlog))
    return monitor.statistics()


def test_statistics_contain_the_largest_backlog_of_all_segments(header: RunHeader) -> None:
    card = replace(header.acquisition, buffer=round(4 * header.acquisition.rate))
    found = statistics(card, (0, 10), (0, 700), (1, 300))
    assert found.backlog == pytest.approx(700 / card.rate)
    assert found.buffer == pytest.approx(4.0)


def test_backlog_of_a_device_without_a_buffer_is_unknown(header: RunHeader) -> None:
    assert statistics(replace(header.acquisition, buffer=0), (0, 700)) == DeliveryStatistics()
