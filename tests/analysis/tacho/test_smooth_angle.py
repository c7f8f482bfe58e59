"""The live shaft angle at known speeds."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.tacho.shaft_angle import smooth_angle

FloatArray = NDArray[np.float64]


def time_in_run_up(turns: NDArray[Any]) -> FloatArray:
    """Return the times of revolutions in a run-up from 1,000 r/min by 730 r/min per second."""
    return np.asarray((np.sqrt(16.7**2 + 2 * 12.2 * turns) - 16.7) / 12.2)


def test_steady_speed_is_exact_and_has_no_jitter() -> None:
    turns = np.arange(100, 128)
    angle = smooth_angle(turns, np.asarray(3.0 + 0.01 * turns, dtype=np.float64))
    np.testing.assert_allclose(angle.time(np.array([100.0, 111.25, 127.0])), [4.0, 4.1125, 4.27], rtol=1e-13)
    assert angle.jitter < 1e-12


def test_jitter_is_measured_and_averaged() -> None:
    random = np.random.default_rng(2)
    turns = np.arange(29)
    errors, jitters = [], []
    for _ in range(200):
        angle = smooth_angle(turns, 0.004 * turns + 5e-6 * random.standard_normal(turns.size))
        errors.append(angle.time(np.linspace(8, 24, 50)) - 0.004 * np.linspace(8, 24, 50))
        jitters.append(angle.jitter)
    assert np.mean(jitters) == pytest.approx(5e-6, rel=0.25)  # seven of its 29 degrees of freedom are fitted
    assert np.std(errors) < 0.5 * 5e-6


def test_angle_of_a_fast_run_up_is_accurate() -> None:
    turns = np.arange(29)
    fine = np.linspace(8, 28, 200)
    angle = smooth_angle(turns, time_in_run_up(turns))
    truth = time_in_run_up(fine)
    assert np.abs((angle.time(fine) - truth) * (16.7 + 12.2 * truth) * 360).max() < 0.02  # degrees


def test_slow_speed_fluctuation_is_resolved() -> None:
    turns = np.arange(29)
    times = turns / 20.0 + 0.002 / (2 * np.pi) * np.sin(2 * np.pi * turns / 20.0)  # 0.2 % at 1 Hz
    fine = np.linspace(8, 24, 200)
    truth = fine / 20.0 + 0.002 / (2 * np.pi) * np.sin(2 * np.pi * fine / 20.0)
    assert np.abs((smooth_angle(turns, times).time(fine) - truth) * 20 * 360).max() < 0.02  # degrees


def test_missing_marks_are_interpolated() -> None:
    turns = np.delete(np.arange(29), [5, 6, 14, 15, 23])
    angle = smooth_angle(turns, np.asarray(0.05 * turns, dtype=np.float64))
    np.testing.assert_allclose(angle.time(np.arange(29.0)), 0.05 * np.arange(29), atol=1e-12)


def test_outlying_mark_is_rejected() -> None:
    turns = np.arange(29)
    times = 0.05 * turns + 1e-6 * np.random.default_rng(4).standard_normal(29)
    times[12] += 0.008
    assert np.abs(smooth_angle(turns, times).time(np.arange(29.0)) - 0.05 * turns).max() < 5e-6


def test_two_marks_give_a_straight_line_and_one_is_refused() -> None:
    angle = smooth_angle(np.array([3, 4]), np.array([1.0, 2.0]))
    assert float(angle.time(3.5)) == pytest.approx(1.5)
    with pytest.raises(ValueError, match="2 marks"):
        smooth_angle(np.array([3]), np.array([1.0]))
