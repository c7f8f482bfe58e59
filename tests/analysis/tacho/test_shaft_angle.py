"""Smooth shaft angle: fit of a whole record, and live fit of the last revolutions."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.signals.header import Tacho
from analysis.tacho.pulse_record import PulseRecord, pulse_record
from analysis.tacho.shaft_angle import shaft_angle, smooth_angle

TACHO = Tacho(threshold=2.0, hysteresis=1.0, response_time=1e-5)


def run_up(turns: int, jitter: float = 0.0, marks: tuple[float, ...] = (0.0,)) -> PulseRecord:
    """Return the pulses of a run-up from 100 revolutions per second by 90 per second squared, with several marks."""
    at = np.concatenate([turn + np.array(marks) for turn in range(turns)])
    times = (np.sqrt(100.0**2 + 180.0 * at) - 100.0) / 90.0
    times += jitter * np.random.default_rng(0).standard_normal(times.size)
    return pulse_record(times, replace(TACHO, pulses_per_revolution=len(marks)))


def test_run_up_is_accurate_to_a_hundredth_of_a_degree() -> None:
    angle = shaft_angle(run_up(2000))
    turns = np.linspace(3.0, 1990.0, 5001)
    truth = (np.sqrt(100.0**2 + 180.0 * turns) - 100.0) / 90.0
    assert np.abs((angle.time(turns) - truth) * angle.speed(turns)).max() < np.radians(0.01)
    assert angle.speed(np.array([1000.0]))[0] == pytest.approx(2 * np.pi * np.sqrt(100.0**2 + 180_000.0), rel=1e-5)
    np.testing.assert_allclose(angle.turns(truth), turns, atol=1e-4)
    assert np.isnan(angle.turns(np.array([-1.0, 1e3]))).all()
    assert angle.is_measured


def test_jitter_is_reported_and_averaged() -> None:
    angle = shaft_angle(run_up(2000, jitter=2e-6))
    assert angle.jitter == pytest.approx(2e-6, rel=0.1)
    turns = np.linspace(20.0, 1980.0, 5001)
    truth = (np.sqrt(100.0**2 + 180.0 * turns) - 100.0) / 90.0
    assert np.std(angle.time(turns) - truth) < 0.5 * 2e-6


def test_stated_time_uncertainty_is_the_scatter_of_many_runs() -> None:
    clean = run_up(120)
    turns = np.array([0.0, 1.0, 4.0, 11.0, 37.5, 60.0, 100.0, 117.0, 119.0])
    random = np.random.default_rng(0)
    noises = 2e-6 * random.standard_normal((400, clean.times.size))
    angles = [shaft_angle(replace(clean, times=clean.times + noise)) for noise in noises]
    seen = np.std([angle.time(turns) for angle in angles], axis=0)
    stated = np.mean([angle.time_sigma(turns) for angle in angles], axis=0)
    np.testing.assert_allclose(stated, seen, rtol=0.15)
    assert stated[0] > 1.5 * stated[4]


def test_outlying_pulse_is_rejected() -> None:
    clean = run_up(500)
    times = clean.times.copy()
    times[250] += 3e-4
    angle = shaft_angle(replace(clean, times=times))
    assert angle.outliers == 1
    assert abs(angle.time(250.0) - clean.times[250]) < 1e-7


def test_uneven_marks_are_located_and_do_not_distort_the_angle() -> None:
    marks = (0.0, 0.26, 0.49, 0.75)
    angle = shaft_angle(run_up(500, marks=marks))
    np.testing.assert_allclose(angle.mark_angles, 2 * np.pi * np.array(marks), atol=2e-3)
    turns = np.linspace(5.0, 490.0, 1001)
    truth = (np.sqrt(100.0**2 + 180.0 * turns) - 100.0) / 90.0
    assert np.abs((angle.time(turns) - truth) * angle.speed(turns)).max() < np.radians(0.1)


def test_cubics_equal_the_spline_within_each_revolution() -> None:
    angle = shaft_angle(run_up(200))
    cubics = angle.cubics(np.arange(10, 150))
    part = 0.37
    values = cubics[0] + part * (cubics[1] + part * (cubics[2] + part * cubics[3]))
    np.testing.assert_allclose(values, angle.time(np.arange(10, 150) + part), atol=1e-12)


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
