"""Several marks on the shaft: learned spacing, and the same mark at theta = 0 in every train and record."""

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.resampling.angular_record import angular_record_from_codes
from analysis.signals.header import Tacho
from analysis.signals.snapshot import TachoState
from analysis.tacho.mark_spacing import MarkSpacing, interval_ratios, reference_mark
from analysis.tacho.pulse_record import pulse_record
from analysis.tacho.pulse_train import PulseTrain
from analysis.tacho.shaft_angle import shaft_angle
from analysis.vectors.order_track import track_order

if TYPE_CHECKING:
    from tests.analysis.conftest import Bench

FloatArray = NDArray[np.float64]

RATE = 100_000.0
TACHO = Tacho(threshold=2.0, hysteresis=1.0, response_time=1e-5)
WHEELS = {  # mark positions in revolutions; theta = 0 is the mark at 0, after the longest gap
    "one tooth of twelve missing": np.arange(11) / 12,
    "two teeth of sixty missing": np.arange(58) / 60,
    "four anywhere": np.array([0.0, 0.16, 0.42, 0.53]),
    "two unlike": np.array([0.0, 0.3]),
    "six, one gap longer by a fifth": np.arange(6) / 6.2,
}


def edges_of(wheel: FloatArray, begin: float, rise: float, first: float, turns: float) -> tuple[FloatArray, FloatArray]:
    """Return times and angles, revolutions, of the marks from revolution ``first`` on, at a speed and acceleration."""
    angles = (np.arange(int(first) - 1, int(first + turns) + 1)[:, None] + wheel).ravel()
    angles = angles[(angles >= first) & (angles < first + turns)]
    passed = angles - first
    times = passed / begin if rise == 0.0 else (np.sqrt(begin**2 + 2.0 * rise * passed) - begin) / rise
    return np.asarray(times), angles


def fed(train: PulseTrain, times: FloatArray) -> PulseTrain:
    """Add edges in stretches of 0.1 s."""
    for hop in range(int(times[-1] / 0.1)):
        begin, end = np.searchsorted(times, [0.1 * hop, 0.1 * (hop + 1)])
        train.advance(times[begin:end], 0.1 * (hop + 1), 0.1, RATE)
    return train


def off_mark(train: PulseTrain, times: FloatArray, angles: FloatArray) -> FloatArray:
    """Return the deviation of the marks of a train from angle 0, revolutions."""
    _, marks = train.marks
    there = angles[np.searchsorted(times, marks)]
    return np.abs(there - np.round(there))


@pytest.mark.parametrize("wheel", WHEELS)
@pytest.mark.parametrize("first", [0.0, 0.35])
@pytest.mark.parametrize("rise", [0.0, 20.0])
def test_live_train_finds_the_same_mark_from_any_start(wheel: str, first: float, rise: float) -> None:
    times, angles = edges_of(WHEELS[wheel], 50.0, rise, first, 60.0)
    train = fed(PulseTrain(replace(TACHO, pulses_per_revolution=WHEELS[wheel].size), 30), times)
    assert off_mark(train, times, angles).max() < 1e-9
    assert train.marks[0].size >= 20
    report = train.report(train.state(float(times[-1]) - 0.1, train.speed(0.1), np.nan), np.nan)
    assert (report.state, report.filled, report.phase_reference_is_arbitrary) == (TachoState.GOOD, 0, False)
    middle = int(times[-1] / 0.1) * 0.1 - 0.06  # approximately of the revolutions from which the speed is computed
    assert train.speed(0.1) == pytest.approx(2 * np.pi * (50.0 + rise * middle), rel=0.01 if rise else 1e-9)


@pytest.mark.parametrize("wheel", WHEELS)
def test_train_restarts_at_the_same_mark_after_a_break(wheel: str) -> None:
    tacho = replace(TACHO, pulses_per_revolution=WHEELS[wheel].size)
    times, angles = edges_of(WHEELS[wheel], 50.0, 0.0, 0.1, 120.0)
    remaining = (times < 1.2) | (times > 1.2337)
    times, angles = times[remaining], angles[remaining]
    train = PulseTrain(tacho, 30)
    for hop in range(24):
        begin, end = np.searchsorted(times, [0.1 * hop, 0.1 * (hop + 1)])
        train.advance(times[begin:end], 0.1 * (hop + 1), 0.1, RATE)
        if train.is_settled:
            assert off_mark(train, times, angles).max() < 1e-9
            assert train.speed(0.1) == pytest.approx(2 * np.pi * 50.0)
        assert train.is_settled or hop < 6 or hop == 12


@pytest.mark.parametrize("wheel", WHEELS)
@pytest.mark.parametrize("seed", range(2))
def test_missing_and_double_pulses_of_uneven_marks_do_not_change_the_count(wheel: str, seed: int) -> None:
    tacho = replace(TACHO, pulses_per_revolution=WHEELS[wheel].size)
    times, angles = edges_of(WHEELS[wheel], 50.0, 10.0, 0.1, 150.0)
    random, begin = np.random.default_rng(seed), 40 * WHEELS[wheel].size
    keep = random.random(times.size) >= 0.01
    extra = random.random(times.size - 1) < 0.01
    keep[:begin], extra[:begin] = True, False
    where = (times[:-1] + random.uniform(0.1, 0.9, times.size - 1) * np.diff(times))[extra]
    spoiled = np.sort(np.concatenate([times[keep], where]))
    train, slips = PulseTrain(tacho, 30), 0
    for hop in range(int(spoiled[-1] / 0.1)):
        low, high = np.searchsorted(spoiled, [0.1 * hop, 0.1 * (hop + 1)])
        train.advance(spoiled[low:high], 0.1 * (hop + 1), 0.1, RATE)
        if train.is_settled:
            marks = train.marks[1][:-1]  # the last may be taken back
            there = np.interp(marks, times, angles)
            slips += int(np.count_nonzero(np.abs(there - np.round(there)) > 0.3 * np.diff(WHEELS[wheel]).min()))
    assert slips == 0


def test_even_marks_have_an_arbitrary_phase_reference() -> None:
    times, _ = edges_of(np.arange(4) / 4, 50.0, 10.0, 0.3, 60.0)
    train = fed(PulseTrain(replace(TACHO, pulses_per_revolution=4), 30), times)
    report = train.report(train.state(float(times[-1]) - 0.1, train.speed(0.1), np.nan), np.nan)
    assert (report.state, report.phase_reference_is_arbitrary) == (TachoState.GOOD, True)
    assert pulse_record(times, replace(TACHO, pulses_per_revolution=4)).phase_reference_is_arbitrary
    assert not pulse_record(times, TACHO).phase_reference_is_arbitrary


def test_marks_of_a_symmetrical_wheel_have_an_arbitrary_phase_reference() -> None:
    wheel = np.array([0.0, 0.3, 0.5, 0.8])
    times, _ = edges_of(wheel, 50.0, 0.0, 0.1, 60.0)
    train = fed(PulseTrain(replace(TACHO, pulses_per_revolution=4), 30), times)
    assert train.speed(0.1) == pytest.approx(2 * np.pi * 50.0)
    assert train.report(TachoState.GOOD, np.nan).phase_reference_is_arbitrary


def test_speed_is_withheld_until_the_spacing_is_known() -> None:
    times, _ = edges_of(WHEELS["one tooth of twelve missing"], 50.0, 0.0, 0.0, 60.0)
    train = PulseTrain(replace(TACHO, pulses_per_revolution=11), 30)
    speeds = []
    for time in times:
        train.advance(np.array([time]), float(time), 0.002, RATE)
        speeds.append(train.speed(0.1))
    known = np.isfinite(speeds)
    assert not known[:33].any()
    assert known[80:].all()
    np.testing.assert_allclose(np.array(speeds)[known], 2 * np.pi * 50.0)


def test_configured_but_missing_tooth_is_counted_as_filled() -> None:
    times, _ = edges_of(np.arange(11) / 12, 50.0, 0.0, 0.0, 60.0)
    train = fed(PulseTrain(replace(TACHO, pulses_per_revolution=12), 30), times)
    report = train.report(train.state(float(times[-1]) - 0.1, train.speed(0.1), np.nan), np.nan)
    assert train.speed(0.1) == pytest.approx(2 * np.pi * 50.0)
    assert report.filled > 40
    assert report.phase_reference_is_arbitrary


def test_noise_gives_no_spacing() -> None:
    random = np.random.default_rng(3)
    for marks in (2, 3, 12):
        spacing = MarkSpacing(marks)
        times = np.cumsum(random.exponential(1e-3, 30_000))
        assert not any(spacing.add_edges(times[k : k + 100]) for k in range(0, times.size, 100))


@pytest.mark.parametrize("wheel", WHEELS)
def test_whole_record_finds_the_same_mark_from_any_start(wheel: str) -> None:
    for first in (0.0, 0.35, 0.8):
        times, angles = edges_of(WHEELS[wheel], 50.0, 15.0, first, 60.0)
        record = pulse_record(times, replace(TACHO, pulses_per_revolution=WHEELS[wheel].size))
        assert not record.phase_reference_is_arbitrary
        assert record.filled == 0
        at_zero = angles[record.numbers % WHEELS[wheel].size == 0]
        np.testing.assert_allclose(at_zero, np.round(at_zero), atol=1e-9)
        angle = shaft_angle(record)
        np.testing.assert_allclose(angle.mark_angles / (2 * np.pi), WHEELS[wheel], atol=1e-3)


def test_interval_ratios_are_unknown_for_a_mark_never_seen() -> None:
    numbers = np.delete(np.arange(40), np.arange(2, 40, 4))
    assert interval_ratios(numbers, numbers.astype(np.float64), 4) is None


def test_reference_mark_needs_one_interval_clearly_longer_than_every_other() -> None:
    assert reference_mark(np.array([1.0])) == 0
    assert reference_mark(np.array([0.9, 1.2, 0.9])) == 1
    assert reference_mark(np.array([0.98, 1.04, 0.98])) is None
    assert reference_mark(np.array([1.3, 0.7, 1.3, 0.7])) is None


def test_live_and_whole_record_agree_on_the_phase_of_1x_with_uneven_marks(make_bench: Callable[..., "Bench"]) -> None:
    bench = make_bench(tacho={"pulses_per_revolution": 3, "response_time": 1e-5})
    wheel = np.array([0.0, 0.25, 0.55])
    codes = bench.codes(bench.steady(80.0, 0.62), bench.circles((20e-6, 1.0, 0.4)), 3.0)
    row = 2
    time = np.arange(codes.shape[1]) / RATE + row / bench.acquisition.convert_rate
    turn = (80.0 * time + 0.62) % 1.0
    away = np.min(np.abs((turn[:, None] - wheel + 0.5) % 1.0 - 0.5 - 0.05), axis=1)  # each mark is a tenth of a turn
    codes[row] = np.round(np.clip(0.5 + (0.05 - away) * 40.0, 0.0, 1.0) * 4.3 / (10.0 / 32768)).astype(np.int16)
    snapshots = bench.snapshots(codes)
    frame = next(each.frame for each in reversed(snapshots) if each.frame is not None)
    assert np.angle(frame.vectors[0, 0]) == pytest.approx(0.4, abs=0.03)
    assert not snapshots[-1].tacho.phase_reference_is_arbitrary
    track = track_order(angular_record_from_codes(bench.acquisition, codes), 1.0)
    whole = np.angle(track.vectors[0].mean())
    assert np.angle(frame.vectors[0, 0]) == pytest.approx(whole, abs=0.01)
    for one, other in zip(snapshots, bench.snapshots(codes, 7_777), strict=True):
        assert (one.speed, one.tacho) == (other.speed, other.tacho) or np.isnan(one.speed)
        assert (one.frame is None) == (other.frame is None)
        if one.frame is not None and other.frame is not None:
            np.testing.assert_array_equal(one.frame.spectrum, other.frame.spectrum)
