"""Overall vibration of a record, and trimmed extremes."""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.resampling.angular_record import probe_displacement
from analysis.shaft.overall import OverallWindow, overall, trimmed_extremes
from analysis.signals.errors import RecordTooShortError
from analysis.signals.units import MICROMETRE

if TYPE_CHECKING:
    from tests.analysis.conftest import Bench

RATE = 100_000.0
TIME = np.arange(100_000) / RATE


def test_peak_to_peak_is_that_of_the_waveform_and_not_of_its_largest_line() -> None:
    one, whirl = np.cos(2 * np.pi * 200.0 * TIME), np.cos(2 * np.pi * 94.0 * TIME + 1.0)
    found = overall(np.stack([20 * one + 8 * whirl, 20 * one]) * MICROMETRE, RATE, 100 * MICROMETRE)
    np.testing.assert_allclose(found.peak_to_peak[0], 56 * MICROMETRE, rtol=0.02)
    np.testing.assert_allclose(found.peak_to_peak[1], 40 * MICROMETRE, rtol=1e-3)
    np.testing.assert_allclose(found.clearance_fraction[1], 0.2, rtol=1e-3)
    np.testing.assert_allclose(found.times, 0.05 + 0.1 * np.arange(10))


def test_excluding_glitch_samples_has_the_stated_bias() -> None:
    sine = np.cos(2 * np.pi * 203.7 * TIME) * np.ones((2, 1))
    found = overall(sine, RATE, 1.0)
    assert found.excluded_samples == 20
    lost = 1.0 - found.peak_to_peak / 2.0
    np.testing.assert_allclose(lost, (np.pi * 20 / 10_000) ** 2 / 2, rtol=0.3)
    spiked = sine.copy()
    spiked[0, 5_000:5_010] = 50.0
    assert overall(spiked, RATE, 1.0).peak_to_peak[0, 0] == pytest.approx(2.0, rel=1e-3)


def test_whole_record_gives_the_live_peak_to_peak(make_bench: Callable[..., "Bench"]) -> None:
    bench = make_bench()
    codes = bench.codes(
        bench.ramp(50.0, 150.0, 2.0), bench.circles((20 * MICROMETRE, 1.0, 0.0), (5 * MICROMETRE, 0.47, 0.0)), 2.0
    )
    live = [snapshot.peak_to_peak for snapshot in bench.snapshots(codes)]
    found = overall(probe_displacement(bench.acquisition, codes), bench.acquisition.rate, 100 * MICROMETRE)
    np.testing.assert_array_equal(found.peak_to_peak.T, live)


def test_rms_is_that_of_the_vibration_without_its_mean_over_the_window() -> None:
    """A sine of amplitude A has an RMS of A / √2, white noise its standard deviation, whatever the mean."""
    hop, samples = 2000, 8000
    time = np.arange(samples) / RATE
    noise = 3e-6 * np.random.default_rng(5).standard_normal(samples)
    motion = np.stack([10e-6 * np.sin(2.0 * np.pi * 100.0 * time), noise]) - np.array([[4e-4], [1e-3]])
    window = OverallWindow(RATE, hop, 100)
    slow = 2.0 * np.pi * RATE / samples  # rad/s: one revolution lasts four hops
    found = [window.add(motion[:, k : k + hop], slow) for k in range(0, samples, hop)][-1]
    assert found[1, 0] == pytest.approx(10e-6 / math.sqrt(2.0), rel=1e-9)
    assert found[1, 1] == pytest.approx(noise.std(), rel=1e-9)
    assert found[1, 1] == pytest.approx(3e-6, rel=0.03)


def test_rms_covers_one_interval_where_the_speed_is_unknown() -> None:
    window = OverallWindow(RATE, 2000, 100)
    window.add(np.array([[1e-6, -1e-6] * 1000] * 2), math.nan)
    assert window.add(np.array([[2e-6, -2e-6] * 1000] * 2), math.nan)[1] == pytest.approx([2e-6, 2e-6])


def test_misuse_is_refused() -> None:
    with pytest.raises(RecordTooShortError):
        overall(np.zeros((2, 100)), RATE, 1.0)
    with pytest.raises(ValueError, match="finite"):
        overall(np.full((2, 20_000), np.nan), RATE, 1.0)
    with pytest.raises(ValueError, match="clearance"):
        overall(np.zeros((2, 20_000)), RATE, 0.0)


@settings(max_examples=200, deadline=None)
@given(
    st.lists(st.floats(-1e3, 1e3) | st.integers(-3, 3).map(float), min_size=1, max_size=400),
    st.integers(0, 30),
    st.integers(1, 40),
)
def test_trimmed_extremes_equal_those_of_sorting(values: list[float], excluded: int, repeats: int) -> None:
    row = np.tile(values, repeats)
    excluded = min(excluded, (row.size - 1) // 2)
    ranked = np.sort(row)
    low, high = trimmed_extremes(row[None], excluded)
    assert (low[0], high[0]) == (ranked[excluded], ranked[row.size - 1 - excluded])


def test_trimmed_extremes_of_motion_with_glitches_equal_those_of_sorting() -> None:
    random = np.random.default_rng(1)
    rows = np.sin(np.linspace(0.0, 600.0, 10_000)) * [[1.0], [2.0]] + 0.01 * random.standard_normal((2, 10_000))
    rows[:, random.integers(0, 10_000, 12)] += 30.0 * random.standard_normal((2, 12))
    low, high = trimmed_extremes(rows, 20)
    ranked = np.sort(rows, axis=1)
    np.testing.assert_array_equal(low, ranked[:, 20])
    np.testing.assert_array_equal(high, ranked[:, -21])
    assert np.ptp(rows[1]) > 2.0 * float(high[1] - low[1])


@pytest.mark.parametrize(("shape", "excluded"), [((2, 10), 5), ((10,), 0), ((2, 10), -1)])
def test_excluding_too_many_samples_is_refused(shape: tuple[int, ...], excluded: int) -> None:
    with pytest.raises(ValueError, match="samples, excluded"):
        trimmed_extremes(np.zeros(shape), excluded)
