"""Alarms on vibration and speed, with hold time, hysteresis and latching."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Annotated

import numpy as np

from analysis.signals import FloatArray
from analysis.signals.blocks import TimeInRun
from analysis.signals.header import Limits, Severity
from analysis.signals.snapshot import Snapshot
from analysis.signals.units import NUMBER

MAX_ALARMS = 256  # stored ended alarms of a run; beyond it that with the smallest excess is dropped


class MonitoredQuantity(StrEnum):
    """Quantity that is monitored against limits."""

    OVERALL = "overall"  # m peak-to-peak, at each probe
    ORDER_1X = "1X"  # m peak, at each probe, as measured
    BELOW_1X = "below 1X"  # m peak, at each probe: the amplitudes of all components, added
    SPEED = "speed"  # rad/s


@dataclass(frozen=True, slots=True)
class Alarm:
    """An alarm: a limit that was exceeded for the hold time.

    Parameters
    ----------
    quantity : MonitoredQuantity
        Quantity that exceeded its limit.
    probe : str
        Name of the channel; empty for the speed.
    limit : float
        The limit, m peak-to-peak, m peak or rad/s.
    largest : float
        Largest value since the limit was exceeded, in the unit of the limit.
    """

    number: Annotated[int, NUMBER.of("Number in order of time, from 1")]
    quantity: MonitoredQuantity
    probe: str
    severity: Annotated[Severity, NUMBER.of("Severity of the exceeded limit")]
    limit: float
    begin: Annotated[TimeInRun, NUMBER.of("Start of the alarm: end of the hold time")]
    largest: float
    largest_at: Annotated[TimeInRun, NUMBER.of("Time of the largest value")]
    end: Annotated[
        TimeInRun | None,
        NUMBER.of("Time when the value fell below the limit by the rig's hysteresis; unknown while the alarm lasts"),
    ] = None

    @property
    def is_active(self) -> bool:
        """Whether the alarm has not ended."""
        return self.end is None


class LimitMonitor:
    """Monitors one value against one limit, with hysteresis and hold time.

    Parameters
    ----------
    limit : float
        In the unit of the value; a value equal to it exceeds it.
    hysteresis : float
        Fraction of the limit by which the value must fall below it before the alarm ends, 0 to below 1.
    hold : float
        Time that the limit must be exceeded without interruption before the alarm, s (1 s to 3 s in API 670 as
        quoted).
    """

    def __init__(self, limit: float, hysteresis: float, hold: float) -> None:
        if not limit > 0.0 or not 0.0 <= hysteresis < 1.0 or not hold >= 0.0:
            raise ValueError(
                f"limit, hysteresis, hold: {limit}, {hysteresis} and {hold} s, expected above 0, 0 to below 1 and "
                "0 or more"
            )
        self._limit, self._reset_level, self._hold = limit, limit * (1.0 - hysteresis), hold
        self._exceeded_since: TimeInRun | None = None  # begin of the present excess
        self.is_on = False
        self.largest, self.largest_at = 0.0, TimeInRun(0, 0.0, math.nan)  # of the present excess

    def update(self, value: float, at: TimeInRun) -> bool:
        """Add the next value; return whether the alarm is on.

        NaN (unknown) changes nothing. A gap between segments restarts the hold time.
        """
        if math.isnan(value):
            return self.is_on
        if value < (self._reset_level if self.is_on else self._limit):
            self._exceeded_since, self.is_on = None, False
            return False
        if self._exceeded_since is None or (not self.is_on and self._exceeded_since.segment != at.segment):
            self._exceeded_since, self.largest = at, 0.0
        if value > self.largest:
            self.largest, self.largest_at = value, at
        self.is_on = self.is_on or at.time - self._exceeded_since.time >= self._hold
        return self.is_on


class AlarmMonitor:
    """Monitors vibration and speed against their limits; the result depends on the samples only, not on the clock.

    Parameters
    ----------
    limits : Limits
        Alarm and danger limits, hysteresis and hold time.
    probes : sequence of str
        Names of the probes x and y.
    """

    def __init__(self, limits: Limits, probes: Sequence[str]) -> None:
        levels = {
            MonitoredQuantity.OVERALL: (limits.peak_to_peak_alarm, limits.peak_to_peak_danger),
            MonitoredQuantity.ORDER_1X: (limits.order_1x_alarm, limits.order_1x_danger),
            MonitoredQuantity.BELOW_1X: (limits.below_1x_alarm, limits.below_1x_danger),
            MonitoredQuantity.SPEED: (limits.speed_alarm, limits.speed_danger),
        }
        self._monitors = [
            (
                quantity,
                row,
                name,
                severity,
                limit,
                LimitMonitor(limit, limits.hysteresis, 0.0 if quantity is MonitoredQuantity.SPEED else limits.hold),
            )
            for quantity, pair in levels.items()
            for row, name in enumerate(("",) if quantity is MonitoredQuantity.SPEED else probes)
            for severity, limit in zip((Severity.ALARM, Severity.DANGER), pair, strict=True)
            if math.isfinite(limit)
        ]
        self._active: dict[int, Alarm] = {}  # by index in _monitors
        self._ended: list[Alarm] = []
        self._count = 0

    def update(self, snapshot: Snapshot) -> tuple[Alarm, ...]:
        """Add the next snapshot; return the new alarms."""
        at = TimeInRun(snapshot.segment, snapshot.time, snapshot.speed)
        new_alarms, values = [], monitored_values(snapshot)
        for key, (quantity, row, probe, severity, limit, monitor) in enumerate(self._monitors):
            is_on = monitor.update(float(values[quantity][row]), at)
            active = self._active.get(key)
            if not is_on:
                if active is not None:
                    self._close(replace(self._active.pop(key), end=at))
            elif active is None:
                self._count += 1
                alarm = Alarm(self._count, quantity, probe, severity, limit, at, monitor.largest, monitor.largest_at)
                self._active[key] = alarm
                new_alarms.append(alarm)
            elif monitor.largest > active.largest:
                self._active[key] = replace(active, largest=monitor.largest, largest_at=monitor.largest_at)
        return tuple(new_alarms)

    def _close(self, alarm: Alarm) -> None:
        self._ended.append(alarm)
        if len(self._ended) > MAX_ALARMS:
            self._ended.remove(min(self._ended, key=lambda alarm: alarm.largest / alarm.limit))

    @property
    def alarms(self) -> tuple[Alarm, ...]:
        """All alarms so far, in the order of their begin."""
        return tuple(sorted([*self._ended, *self._active.values()], key=lambda alarm: alarm.number))


def monitored_values(snapshot: Snapshot) -> dict[MonitoredQuantity, FloatArray]:
    """Return the monitored values, each of shape (2,) at the probes x and y, the speed of shape (1,).

    Speed and order amplitudes are NaN without valid tacho pulses.
    """
    one = below = np.full(2, np.nan)
    if snapshot.frame is not None:
        one = np.abs(snapshot.frame.vectors[0])
        below = sum((np.abs(whirl.vectors) for whirl in snapshot.frame.whirls), start=np.zeros(2))
    return {
        MonitoredQuantity.OVERALL: snapshot.peak_to_peak,
        MonitoredQuantity.ORDER_1X: one,
        MonitoredQuantity.BELOW_1X: below,
        MonitoredQuantity.SPEED: np.array([snapshot.speed]),
    }


def visible_alarms(alarms: Sequence[Alarm], acknowledged: int, *, latch: bool) -> tuple[Alarm, ...]:
    """Return the alarms to show: active ones, and latched ones that are not acknowledged.

    Parameters
    ----------
    alarms : sequence of Alarm
        From `AlarmMonitor`.
    acknowledged : int
        Number of the last acknowledged alarm; 0 for none.
    latch : bool
        Whether an ended alarm stays visible until it is acknowledged.
    """
    return tuple(alarm for alarm in alarms if alarm.is_active or (latch and alarm.number > acknowledged))


def worst_severity(alarms: Sequence[Alarm]) -> Severity:
    """Return the worst severity of alarms; normal without alarms."""
    return max((alarm.severity for alarm in alarms), key=lambda severity: severity.rank, default=Severity.NORMAL)
