"""Alarms: limits, hysteresis, hold time, latching and the number of stored alarms."""

import math
from dataclasses import replace

import numpy as np
import pytest

from analysis.live.alarms import (
    MAX_ALARMS,
    Alarm,
    AlarmMonitor,
    LimitMonitor,
    MonitoredQuantity,
    monitored_values,
    visible_alarms,
    worst_severity,
)
from analysis.signals.blocks import TimeInRun
from analysis.signals.header import Limits, Severity
from analysis.signals.snapshot import OVERALL, OrderFrame, Snapshot, TachoReport, TachoState, Trace, Whirl
from analysis.signals.units import MICROMETRE

LIMITS = Limits(80 * MICROMETRE, 95 * MICROMETRE, 100 * MICROMETRE, 2000.0)
AT_ONCE = replace(LIMITS, hold=0.0)


def fed(monitor: LimitMonitor, values: list[float], segment: int = 0) -> list[bool]:
    """Add overall vibrations in um, two per second."""
    return [monitor.update(value * MICROMETRE, TimeInRun(segment, 0.5 * k, 1000.0)) for k, value in enumerate(values)]


def snapshot(time: float, x: float, y: float, segment: int = 0) -> Snapshot:
    return Snapshot(
        segment=segment,
        sample=round(time * 1000),
        time=time,
        speed=100.0 * time,
        tacho=TachoReport(TachoState.GOOD, 1, 0, 0, 1e-6),
        gap_volts=np.array([5.0, 5.0]),
        gap_in_window=np.array([True, True]),
        overall=np.array([[x, y]] * len(OVERALL.rows)) * MICROMETRE,
        clipped=np.zeros(3, dtype=np.int64),
        frame=None,
        trace=Trace(np.empty(0), np.empty((2, 0)), np.empty(0)),
    )


def alarms_of(limits: Limits, x: list[float], y: float = 0.0) -> tuple[Alarm, ...]:
    """Return the alarms of a run with these overall vibrations at probe x, um, two per second."""
    monitor = AlarmMonitor(limits, ("x", "y"))
    for k, value in enumerate(x):
        monitor.update(snapshot(0.5 * k, value, y))
    return monitor.alarms


def order_frame(one: tuple[float, float], *whirls: tuple[float, float]) -> OrderFrame:
    """Return a frame with 1X and components below it of given amplitudes, um peak at x and y, and various phases."""
    turned = np.array([np.exp(0.3j), np.exp(-2.0j)])
    vectors = np.zeros((2, 2), dtype=np.complex128)
    vectors[0] = np.array(one) * MICROMETRE * turned
    return OrderFrame(
        speed=1000.0,
        acceleration=0.0,
        orders=np.empty(0),
        spectrum=np.empty((2, 0), dtype=np.complex128),
        vectors=vectors,
        noise=0.0,
        whirls=tuple(
            Whirl(0.2 + 0.1 * k, max(pair) * MICROMETRE, 0.0, np.array(pair) * MICROMETRE * turned)
            for k, pair in enumerate(whirls)
        ),
        orbit=np.empty((2, 0)),
    )


def summarised(alarms: tuple[Alarm, ...]) -> list[tuple[str, str, str, float | None]]:
    return [
        (alarm.quantity.value, alarm.probe, alarm.severity.value, None if alarm.end is None else alarm.end.time)
        for alarm in alarms
    ]


def test_1x_is_monitored_at_each_probe_as_measured() -> None:
    monitor = AlarmMonitor(
        replace(AT_ONCE, order_1x_alarm=20 * MICROMETRE, order_1x_danger=30 * MICROMETRE), ("x", "y")
    )
    for k, one in enumerate([(10.0, 10.0), (22.0, 31.0), (19.5, 28.0), (18.0, 10.0)]):
        monitor.update(replace(snapshot(0.5 * k, 5.0, 5.0), frame=order_frame(one)))
    assert summarised(monitor.alarms) == [
        ("1X", "x", "alarm", 1.5),  # 19.5 is not below it by the hysteresis
        ("1X", "y", "alarm", 1.5),
        ("1X", "y", "danger", 1.0),
    ]
    assert monitor.alarms[2].largest == pytest.approx(31 * MICROMETRE)
    assert monitor.alarms[2].limit == 30 * MICROMETRE


def test_components_below_1x_are_monitored_as_a_sum() -> None:
    monitor = AlarmMonitor(replace(AT_ONCE, below_1x_danger=12 * MICROMETRE), ("x", "y"))
    for k, whirls in enumerate([[(8.0, 11.0)], [(8.0, 11.0), (5.0, 0.5)], []]):
        monitor.update(replace(snapshot(0.5 * k, 5.0, 5.0), frame=order_frame((50.0, 50.0), *whirls)))
    assert summarised(monitor.alarms) == [("below 1X", "x", "danger", 1.0)]
    assert monitor.alarms[0].largest == pytest.approx(13 * MICROMETRE)


def test_overspeed_gives_one_alarm_without_a_probe() -> None:
    monitor = AlarmMonitor(replace(AT_ONCE, speed_alarm=100.0, speed_danger=150.0), ("x", "y"))
    for k, speed in enumerate([90.0, 101.0, 160.0, 149.0, math.nan, 96.0, 94.0]):
        monitor.update(replace(snapshot(0.5 * k, 5.0, 5.0), speed=speed))
    assert summarised(monitor.alarms) == [
        ("speed", "", "alarm", 3.0),
        ("speed", "", "danger", 2.5),
    ]  # 149 is within 5 %
    assert [alarm.largest for alarm in monitor.alarms] == [160.0, 160.0]


def test_overspeed_has_no_hold_time() -> None:
    monitor = AlarmMonitor(replace(LIMITS, speed_danger=150.0, order_1x_danger=20 * MICROMETRE), ("x", "y"))
    new_alarms = monitor.update(replace(snapshot(0.0, 99.0, 99.0), speed=151.0, frame=order_frame((30.0, 30.0))))
    assert summarised(new_alarms) == [("speed", "", "danger", None)]


def test_quantity_without_limit_raises_no_alarm() -> None:
    monitor = AlarmMonitor(AT_ONCE, ("x", "y"))
    monitor.update(replace(snapshot(0.5, 5.0, 5.0), speed=1e6, frame=order_frame((500.0, 500.0), (500.0, 500.0))))
    assert monitor.alarms == ()


def test_without_tacho_a_1x_alarm_neither_begins_nor_ends() -> None:
    monitor = AlarmMonitor(replace(AT_ONCE, order_1x_alarm=20 * MICROMETRE), ("x", "y"))
    loud, silent = replace(snapshot(0.0, 5.0, 5.0), frame=order_frame((25.0, 1.0))), snapshot(1.0, 60.0, 60.0)
    assert np.isnan(monitored_values(silent)[MonitoredQuantity.ORDER_1X]).all()
    counts = []
    for each in (silent, loud, silent):
        monitor.update(each)
        counts.append(sum(alarm.is_active for alarm in monitor.alarms))
    assert counts == [0, 1, 1]


def test_alarms_of_all_quantities_are_numbered_in_the_order_of_their_begin() -> None:
    limits = replace(AT_ONCE, order_1x_alarm=20 * MICROMETRE, speed_danger=150.0)
    monitor = AlarmMonitor(limits, ("x", "y"))
    for k, (overall, one, speed) in enumerate([(70, 25, 100.0), (85, 25, 100.0), (10, 1, 200.0), (10, 1, 100.0)]):
        monitor.update(replace(snapshot(0.5 * k, overall, 1.0), speed=speed, frame=order_frame((one, 0.0))))
    assert [(alarm.number, alarm.quantity) for alarm in monitor.alarms] == [
        (1, MonitoredQuantity.ORDER_1X),
        (2, MonitoredQuantity.OVERALL),
        (3, MonitoredQuantity.SPEED),
    ]
    assert worst_severity(visible_alarms(monitor.alarms, 2, latch=True)) is Severity.DANGER
    assert visible_alarms(monitor.alarms, 3, latch=True) == ()


def test_alarm_begins_after_the_hold_time() -> None:
    monitor = LimitMonitor(80 * MICROMETRE, 0.05, hold=1.0)
    assert fed(monitor, [70, 85, 70, 85, 90, 85]) == [False] * 5 + [True]
    assert monitor.largest == pytest.approx(90 * MICROMETRE)
    assert monitor.largest_at.time == 2.0


def test_alarm_ends_below_the_hysteresis() -> None:
    assert fed(LimitMonitor(80 * MICROMETRE, 0.05, 0.0), [80, 77, 76.1, 75.9, 79]) == [True, True, True, False, False]


def test_gap_restarts_the_hold_time_but_does_not_end_an_alarm() -> None:
    monitor = LimitMonitor(80 * MICROMETRE, 0.05, 1.0)
    assert fed(monitor, [85, 85]) == [False, False]
    assert fed(monitor, [85, 85, 85], segment=1) == [False, False, True]
    assert fed(monitor, [78], segment=2) == [True]


def test_unknown_value_changes_nothing() -> None:
    assert fed(LimitMonitor(80 * MICROMETRE, 0.05, 0.0), [math.nan, 85, math.nan, 79]) == [False, True, True, True]


def test_alarms_contain_probe_limit_time_and_largest_value() -> None:
    first, second = alarms_of(AT_ONCE, [70, 85, 97, 90, 60])
    assert (first.number, first.probe, first.severity, first.limit) == (1, "x", Severity.ALARM, 80 * MICROMETRE)
    assert (first.begin.time, first.begin.speed) == (0.5, 50.0)
    assert first.end is not None
    assert first.end.time == 2.0
    assert first.largest == pytest.approx(97 * MICROMETRE)
    assert (second.severity, second.begin.time, second.largest_at.time) == (Severity.DANGER, 1.0, 1.0)
    assert second.end == TimeInRun(0, 1.5, 150.0)


def test_alarm_is_reported_once_and_stays_active_to_the_end_of_the_run() -> None:
    monitor = AlarmMonitor(replace(LIMITS, hold=0.5), ("x", "y"))
    new_alarms = [monitor.update(snapshot(0.5 * k, 10, 85)) for k in range(4)]
    assert [len(each) for each in new_alarms] == [0, 1, 0, 0]
    (alarm,) = monitor.alarms
    assert (alarm.probe, alarm.is_active) == ("y", True)


def test_latched_alarms_stay_visible_until_acknowledged_and_active_ones_until_ended() -> None:
    alarms = alarms_of(AT_ONCE, [85, 60, 85])
    assert visible_alarms(alarms, 0, latch=True) == alarms
    assert visible_alarms(alarms, 2, latch=True) == alarms[1:]
    assert visible_alarms(alarms, 0, latch=False) == alarms[1:]
    assert visible_alarms(alarms_of(AT_ONCE, [85, 60]), 1, latch=True) == ()


def test_worst_severity_without_alarms_is_normal() -> None:
    assert worst_severity(()) is Severity.NORMAL
    assert worst_severity(alarms_of(AT_ONCE, [85, 97])) is Severity.DANGER


def test_alarms_with_the_smallest_excess_are_dropped_first() -> None:
    values = [value for k in range(MAX_ALARMS + 20) for value in (81 + 10 * k / (MAX_ALARMS + 20), 10)]
    alarms = alarms_of(AT_ONCE, values)
    assert len(alarms) == MAX_ALARMS
    assert alarms[0].number == 21


@pytest.mark.parametrize(("hysteresis", "hold"), [(1.0, 0.0), (-0.1, 0.0), (0.0, math.nan), (0.0, -1.0)])
def test_settings_out_of_range_are_refused(hysteresis: float, hold: float) -> None:
    with pytest.raises(ValueError, match="hysteresis"):
        LimitMonitor(80 * MICROMETRE, hysteresis, hold)
