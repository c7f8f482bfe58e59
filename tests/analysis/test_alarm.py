"""Alarms: hysteresis, hold time, latching, and what is remembered of them."""

import math
from dataclasses import replace

import numpy as np
import pytest

from analysis.alarm import MOST_ALARMS, Alarm, AlarmWatch, LimitWatch, shown_alarms, worst
from analysis.findings import Moment
from analysis.run import Limits, Severity
from analysis.snapshot import Snapshot, TachoReport, TachoState, Trace

MICRO = 1e-6
LIMITS = Limits(80 * MICRO, 95 * MICRO, 100 * MICRO, 2000.0)
AT_ONCE = replace(LIMITS, hold=0.0)


def fed(watch: LimitWatch, values: list[float], segment: int = 0) -> list[bool]:
    """Feed overall vibrations in um, two a second."""
    return [watch.update(value * MICRO, Moment(segment, 0.5 * k, 1000.0)) for k, value in enumerate(values)]


def snapshot(time: float, x: float, y: float, segment: int = 0) -> Snapshot:
    return Snapshot(
        segment=segment,
        sample=round(time * 1000),
        time=time,
        speed=100.0 * time,
        tacho=TachoReport(TachoState.GOOD, 1, 0, 0, 1e-6),
        gap_volts=np.array([5.0, 5.0]),
        gap_ok=np.array([True, True]),
        peak_to_peak=np.array([x, y]) * MICRO,
        clipped=np.zeros(3, dtype=np.int64),
        frame=None,
        trace=Trace(np.empty(0), np.empty((2, 0)), np.empty(0)),
    )


def course(limits: Limits, x: list[float], y: float = 0.0) -> tuple[Alarm, ...]:
    """The alarms of a run whose probe x shows these overall vibrations, um, two a second."""
    watch = AlarmWatch(limits, ("x", "y"))
    for k, value in enumerate(x):
        watch.snapshot(snapshot(0.5 * k, value, y))
    return watch.alarms


def test_a_limit_must_be_held_before_its_alarm_comes() -> None:
    watch = LimitWatch(80 * MICRO, 0.05, hold=1.0)
    assert fed(watch, [70, 85, 70, 85, 90, 85]) == [False] * 5 + [True]
    assert watch.largest == pytest.approx(90 * MICRO)
    assert watch.largest_at.time == 2.0


def test_an_alarm_ends_a_hysteresis_below_its_limit() -> None:
    assert fed(LimitWatch(80 * MICRO, 0.05, 0.0), [80, 77, 76.1, 75.9, 79]) == [True, True, True, False, False]


def test_a_limit_is_not_held_over_a_gap_but_an_alarm_outlasts_it() -> None:
    watch = LimitWatch(80 * MICRO, 0.05, 1.0)
    assert fed(watch, [85, 85]) == [False, False]
    assert fed(watch, [85, 85, 85], segment=1) == [False, False, True]
    assert fed(watch, [78], segment=2) == [True]


def test_what_is_not_known_changes_nothing() -> None:
    assert fed(LimitWatch(80 * MICRO, 0.05, 0.0), [math.nan, 85, math.nan, 79]) == [False, True, True, True]


def test_alarms_tell_probe_limit_moment_and_largest_value() -> None:
    first, second = course(AT_ONCE, [70, 85, 97, 90, 60])
    assert (first.number, first.probe, first.severity, first.limit) == (1, "x", Severity.ALARM, 80 * MICRO)
    assert (first.begin.time, first.begin.speed) == (0.5, 50.0)
    assert first.end is not None
    assert first.end.time == 2.0
    assert first.largest == pytest.approx(97 * MICRO)
    assert (second.severity, second.begin.time, second.largest_at.time) == (Severity.DANGER, 1.0, 1.0)
    assert second.end == Moment(0, 1.5, 150.0)


def test_an_alarm_is_told_once_when_it_comes_and_lasts_to_the_end_of_the_run() -> None:
    watch = AlarmWatch(replace(LIMITS, hold=0.5), ("x", "y"))
    came = [watch.snapshot(snapshot(0.5 * k, 10, 85)) for k in range(4)]
    assert [len(each) for each in came] == [0, 1, 0, 0]
    (alarm,) = watch.alarms
    assert (alarm.probe, alarm.lasts) == ("y", True)


def test_latched_alarms_stay_until_somebody_acknowledges_them_and_lasting_ones_until_they_are_over() -> None:
    alarms = course(AT_ONCE, [85, 60, 85])
    assert shown_alarms(alarms, 0, latch=True) == alarms
    assert shown_alarms(alarms, 2, latch=True) == alarms[1:]
    assert shown_alarms(alarms, 0, latch=False) == alarms[1:]
    assert shown_alarms(course(AT_ONCE, [85, 60]), 1, latch=True) == ()


def test_the_worst_of_no_alarms_is_normal() -> None:
    assert worst(()) is Severity.NORMAL
    assert worst(course(AT_ONCE, [85, 97])) is Severity.DANGER


def test_of_too_many_alarms_those_that_passed_their_limit_least_are_forgotten() -> None:
    values = [value for k in range(MOST_ALARMS + 20) for value in (81 + 10 * k / (MOST_ALARMS + 20), 10)]
    alarms = course(AT_ONCE, values)
    assert len(alarms) == MOST_ALARMS
    assert alarms[0].number == 21


@pytest.mark.parametrize(("hysteresis", "hold"), [(1.0, 0.0), (-0.1, 0.0), (0.0, math.nan), (0.0, -1.0)])
def test_settings_out_of_range_are_refused(hysteresis: float, hold: float) -> None:
    with pytest.raises(ValueError, match="hysteresis"):
        LimitWatch(80 * MICRO, hysteresis, hold)
