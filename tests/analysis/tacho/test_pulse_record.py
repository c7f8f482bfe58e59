"""Pulse records: correct counts or an error."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.signals.errors import AmbiguousTachoError, AnalysisError
from analysis.signals.header import Tacho
from analysis.tacho.pulse_record import pulse_record
from analysis.tacho.shaft_angle import shaft_angle

FloatArray = NDArray[np.float64]

TACHO = Tacho(threshold=2.0, hysteresis=1.0, response_time=1e-5)


def run_up(turns: int, begin: float = 100.0, rise: float = 30.0) -> FloatArray:
    """Return the times of the marks of a linear run-up, in revolutions per second and per second squared."""
    return np.asarray((np.sqrt(begin**2 + 2 * rise * np.arange(turns)) - begin) / rise)


def spoiled(marks: FloatArray, missing: float, double: float, seed: int) -> FloatArray:
    random = np.random.default_rng(seed)
    keep = random.random(marks.size) >= missing
    extra = np.flatnonzero(random.random(marks.size - 1) < double)
    where = marks[extra] + random.uniform(0.02, 0.98, extra.size) * np.diff(marks)[extra]
    return np.asarray(np.sort(np.concatenate([marks[keep], where])))


def wrong_turns(times: FloatArray, numbers: NDArray[np.int64], marks: FloatArray) -> int:
    """Return the error of the count at the true pulses, revolutions."""
    true = np.searchsorted(marks, times)
    is_true = marks[np.minimum(true, marks.size - 1)] == times
    offsets = (true - numbers)[is_true]
    return int(np.ptp(offsets))


def test_clean_pulses_are_numbered_and_the_delay_is_subtracted() -> None:
    marks = run_up(1000)
    record = pulse_record(marks + 3e-4, replace(TACHO, delay=3e-4))
    np.testing.assert_array_equal(record.numbers, np.arange(1000))
    np.testing.assert_allclose(record.times, marks, atol=1e-12)
    assert (record.filled, record.rejected, record.repaired_fraction, record.too_fast) == (0, 0, 0.0, False)


@pytest.mark.parametrize("seed", range(6))
def test_two_per_cent_missing_and_two_per_cent_double_leave_the_count_exact(seed: int) -> None:
    marks = run_up(4000)
    record = pulse_record(spoiled(marks, 0.02, 0.02, seed), TACHO)
    assert wrong_turns(record.times, record.numbers, marks) == 0
    assert record.filled > 40
    assert record.rejected > 40
    assert record.numbers[-1] > 3900
    assert 0.02 < record.repaired_fraction < 0.06


@pytest.mark.parametrize("seed", range(12))
def test_five_per_cent_missing_and_double_are_counted_correctly_or_refused(seed: int) -> None:
    marks = run_up(4000)
    try:
        record = pulse_record(spoiled(marks, 0.05, 0.05, seed), TACHO)
    except AmbiguousTachoError as error:
        assert "tacho" in str(error)  # noqa: PT017  # either outcome is right
        return
    assert wrong_turns(record.times, record.numbers, marks) == 0


WHEELS: dict[str, tuple[float, ...]] = {
    "one mark": (0.0,),
    "two": (0.0, 0.5),
    "two, uneven": (0.0, 0.3),
    "four, about even": (0.0, 0.26, 0.49, 0.75),
    "three, uneven": (0.0, 0.1, 0.4),
    "twelve": tuple(np.arange(12) / 12),
    "sixty less two": tuple(np.arange(58) / 60),
}


def turned(wheel: tuple[float, ...], turns: int = 300) -> FloatArray:
    """Return the times of the marks of a wheel in the run-up."""
    at = (np.arange(turns)[:, None] + np.array(wheel)).ravel()
    return np.asarray((np.sqrt(100.0**2 + 60.0 * at) - 100.0) / 30.0, dtype=np.float64)


def assert_right_or_refused(wheel: tuple[float, ...], pulses: FloatArray, marks: FloatArray) -> None:
    try:
        record = pulse_record(pulses, replace(TACHO, pulses_per_revolution=len(wheel)))
        angle = shaft_angle(record)
    except AnalysisError as error:
        assert any(word in str(error) for word in ("tacho", "pulses"))  # noqa: PT017  # either outcome is right
        return
    assert wrong_turns(record.times, record.numbers, marks) == 0
    begin = np.flatnonzero(marks == record.times[np.isin(record.times, marks)][0])[0]
    turns, first = np.divmod(begin - record.numbers[np.isin(record.times, marks)][0], len(wheel))
    counted = np.linspace(angle.first + 3.0, angle.last - 3.0, 200)
    truth = (np.sqrt(100.0**2 + 60.0 * (counted + turns + wheel[first])) - 100.0) / 30.0
    assert np.abs((angle.time(counted) - truth) * angle.speed(counted)).max() < np.radians(1.0)


@pytest.mark.parametrize("wheel", WHEELS)
def test_clean_marks_may_lie_anywhere_on_the_shaft(wheel: str) -> None:
    places = WHEELS[wheel]
    record = pulse_record(turned(places), replace(TACHO, pulses_per_revolution=len(places)))
    assert (record.filled, record.rejected, record.numbers.size) == (0, 0, 300 * len(places))
    angle = shaft_angle(record)
    np.testing.assert_allclose(angle.mark_angles, 2 * np.pi * np.array(places), atol=1e-3)
    assert_right_or_refused(places, turned(places), turned(places))


@pytest.mark.parametrize("wheel", WHEELS)
@pytest.mark.parametrize("part", [0.02, 0.05])
@pytest.mark.parametrize("gap", [0, 2, 7])
def test_faulty_pulses_of_every_wheel_are_counted_correctly_or_refused(wheel: str, part: float, gap: int) -> None:
    marks = turned(WHEELS[wheel], 1 + 1500 // len(WHEELS[wheel]))
    pulses = spoiled(marks, part, part, seed=gap)
    pulses = np.delete(pulses, slice(400, 400 + gap))
    assert_right_or_refused(WHEELS[wheel], pulses, marks)


@pytest.mark.campaign
@pytest.mark.parametrize("wheel", WHEELS)
@pytest.mark.parametrize("missing", [0.01, 0.05, 0.08])
@pytest.mark.parametrize("double", [0.01, 0.05, 0.08])
def test_hundreds_of_faulty_trains_are_counted_correctly_or_refused(wheel: str, missing: float, double: float) -> None:
    marks = turned(WHEELS[wheel], 60 + 2000 // len(WHEELS[wheel]))
    for seed in range(60):
        pulses = spoiled(marks, missing, double, seed)
        assert_right_or_refused(WHEELS[wheel], np.delete(pulses, slice(500, 500 + seed % 4)), marks)


def test_wheel_with_undeclared_missing_marks_is_refused() -> None:
    wheel = WHEELS["sixty less two"]
    marks = np.delete(turned(wheel), 5000)  # so that not every interval is like the one a turn before
    with pytest.raises(AmbiguousTachoError, match="repeats with the 58 marks"):
        pulse_record(marks, replace(TACHO, pulses_per_revolution=58))
    found = pulse_record(marks, replace(TACHO, pulses_per_revolution=60))
    assert found.filled == 599  # two a turn between the first and the last tooth, and the one taken out
    places = (np.arange(300)[:, None] * 60 + np.arange(58)).ravel()
    np.testing.assert_array_equal(found.numbers, np.delete(places, 5000))


@pytest.mark.parametrize(
    ("times", "says"),
    [
        (np.arange(5.0), "at least 8"),
        (np.cumsum(np.random.default_rng(0).exponential(0.01, 500)), "regular|breaks|differ"),
    ],
)
def test_noise_is_refused(times: FloatArray, says: str) -> None:
    with pytest.raises(AmbiguousTachoError, match=says):
        pulse_record(times, TACHO)


def test_record_with_a_stop_is_refused_with_its_time() -> None:
    marks = run_up(500)
    with pytest.raises(AmbiguousTachoError, match="analyse the record in parts"):
        pulse_record(np.concatenate([marks, marks + 20.0]), TACHO)


def test_times_that_fall_are_refused() -> None:
    with pytest.raises(AmbiguousTachoError, match="pulse 2 at"):
        pulse_record(np.array([0.0, 1.0, 0.9, 2.0]), TACHO)


@pytest.mark.parametrize("missing", [[], [400]])
def test_timestamp_delivered_twice_is_rejected_once(missing: list[int]) -> None:
    marks = np.delete(run_up(1000), missing)
    once, twice = pulse_record(marks, TACHO), pulse_record(np.insert(marks, [100, 700], marks[[100, 700]]), TACHO)
    np.testing.assert_array_equal(twice.times, once.times)
    np.testing.assert_array_equal(twice.numbers, once.numbers)
    assert (once.rejected, twice.rejected) == (0, 2)
    assert (twice.filled, twice.edges) == (len(missing), once.edges + 2)


@pytest.mark.parametrize("times", [np.array([0.0, np.nan, 2.0]), np.zeros((2, 2))])
def test_times_that_are_no_finite_row_are_a_misuse(times: FloatArray) -> None:
    with pytest.raises(ValueError, match="times"):
        pulse_record(times, TACHO)


def test_exceeded_sensor_response_is_reported() -> None:
    record = pulse_record(run_up(1000), replace(TACHO, response_time=5e-3, mark_fraction=0.5))
    assert record.too_fast
