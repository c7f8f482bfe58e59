"""State levels of a tacho signal."""

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.preflight.switching_levels import SignalLevels, find_state_levels

FloatArray = NDArray[np.float64]

N = 20_000
TIME = np.arange(N) / N
RNG = np.random.default_rng(7)


def square(
    *, high: float = 4.2, low: float = 0.1, duty: float = 0.5, turns: float = 20.0, noise: float = 0.01
) -> FloatArray:
    return np.where(turns * TIME % 1.0 < duty, high, low) + noise * RNG.standard_normal(N)


@pytest.mark.parametrize("duty", [0.02, 0.1, 0.5, 0.9, 0.98])
def test_levels_of_a_square_wave_are_found_for_any_duty_cycle(duty: float) -> None:
    found = find_state_levels(square(duty=duty))
    assert found is not None
    assert (found.low, found.high) == pytest.approx((0.1, 4.2), abs=0.01)
    assert found.scatter == pytest.approx(0.01, rel=0.2)
    assert found.high_fraction == pytest.approx(duty, abs=0.005)


def test_slow_edges_do_not_shift_the_levels() -> None:
    edges = np.clip(np.abs((20 * TIME % 1.0) - 0.5) * 12 - 2.5, 0.0, 1.0)
    found = find_state_levels(4.0 * edges)
    assert found is not None
    assert (found.low, found.high) == pytest.approx((0.0, 4.0), abs=1e-6)


@pytest.mark.parametrize(
    "volts",
    [
        np.full(N, 2.0),
        2.0 + 0.5 * np.sin(40 * np.pi * TIME),
        RNG.standard_normal(N),
        RNG.uniform(0.0, 5.0, N),
        5.0 * TIME,
        2.0 + 0.02 * np.sign(np.sin(40 * np.pi * TIME)),
    ],
    ids=["constant", "sine", "normal", "uniform", "ramp", "tiny"],
)
def test_voltage_that_does_not_switch_has_no_levels(volts: FloatArray) -> None:
    assert find_state_levels(volts) is None


def test_hysteresis_grows_with_noise_and_stays_within_the_swing() -> None:
    assert SignalLevels(0.0, 4.0, 0.01, 0.5).hysteresis == 1.0
    assert SignalLevels(0.0, 4.0, 0.2, 0.5).hysteresis == pytest.approx(1.6)
    assert SignalLevels(0.0, 4.0, 0.6, 0.5).hysteresis == pytest.approx(2.4)
    assert SignalLevels(1.0, 4.0, 0.0, 0.5).middle == 2.5


def test_levels_of_no_samples_are_refused() -> None:
    with pytest.raises(ValueError, match="volts: shape"):
        find_state_levels(np.empty(0))
