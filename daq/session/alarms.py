"""Alarms as the operator reads them and as marks keep them."""

import math
from collections.abc import Sequence

from analysis.alarm import Alarm
from recordings.marks import MOST_LETTERS, Mark, MarkKind

MICRO = 1e-6
RPM = 2 * math.pi / 60


def alarm_text(alarm: Alarm) -> str:
    """Return what came: which limit at which probe, how much, at what speed."""
    at = f" at {alarm.begin.speed / RPM:,.0f} r/min" if math.isfinite(alarm.begin.speed) else ""
    value, limit = alarm.largest / MICRO, alarm.limit / MICRO
    return f"{alarm.severity.value} at {alarm.probe}: {value:.0f} µm peak-to-peak{at}, limit {limit:g}"


def alarm_mark(alarm: Alarm, rate: float, host_time_ns: int) -> Mark:
    """Return the mark of an alarm that has come, for a sample rate, Hz, and the host's clock, ns since 1970."""
    sample = round(alarm.begin.time * rate)
    return Mark(alarm.begin.segment, sample, alarm_text(alarm)[:MOST_LETTERS], host_time_ns, MarkKind.ALARM)


def acknowledgement(alarms: Sequence[Alarm], segment: int, sample: int, host_time_ns: int) -> Mark:
    """Return the mark of the moment at which somebody took note of alarms."""
    named = ", ".join(f"{alarm.severity.value} at {alarm.probe}" for alarm in alarms)
    return Mark(segment, sample, f"acknowledged {named}"[:MOST_LETTERS], host_time_ns, MarkKind.ACKNOWLEDGED)
