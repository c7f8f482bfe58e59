"""Alarms as text for the operator and as markers in the file."""

import math
from collections.abc import Sequence

from analysis.live.alarms import Alarm, MonitoredQuantity
from analysis.signals.units import MICROMETRE, RPM
from recordings.mcap.markers import MAX_MARKER_LENGTH, Marker, MarkerKind


def alarm_name(alarm: Alarm) -> str:
    """Return severity, quantity and probe: "danger at x", "1X alarm at x", "speed danger"."""
    which = "" if alarm.quantity is MonitoredQuantity.OVERALL else f"{alarm.quantity.value} "
    return f"{which}{alarm.severity.value}" + (f" at {alarm.probe}" if alarm.probe else "")


def alarm_value_text(alarm: Alarm) -> str:
    """Return the largest value so far and the limit: "96 µm peak-to-peak, limit 90"."""
    if alarm.quantity is MonitoredQuantity.SPEED:
        return f"{alarm.largest / RPM:,.0f} r/min, limit {alarm.limit / RPM:,.0f}"
    value, unit = alarm.largest / MICROMETRE, "peak-to-peak" if alarm.quantity is MonitoredQuantity.OVERALL else "peak"
    return f"{value:.{0 if value >= 20.0 else 1}f} µm {unit}, limit {alarm.limit / MICROMETRE:g}"


def alarm_text(alarm: Alarm) -> str:
    """Return name, value, limit and speed: "danger at x: 96 µm peak-to-peak, limit 90, at 12,000 r/min"."""
    has_speed = math.isfinite(alarm.begin.speed) and alarm.quantity is not MonitoredQuantity.SPEED
    at = f", at {alarm.begin.speed / RPM:,.0f} r/min" if has_speed else ""
    return f"{alarm_name(alarm)}: {alarm_value_text(alarm)}{at}"


def alarm_marker(alarm: Alarm, rate: float, host_time_ns: int) -> Marker:
    """Return the marker of a new alarm.

    Parameters
    ----------
    alarm : Alarm
        The alarm.
    rate : float
        Sample rate, Hz.
    host_time_ns : int
        Host clock, ns since 1970.
    """
    sample = round(alarm.begin.time * rate)
    return Marker(alarm.begin.segment, sample, alarm_text(alarm)[:MAX_MARKER_LENGTH], host_time_ns, MarkerKind.ALARM)


def acknowledgement_marker(alarms: Sequence[Alarm], segment: int, sample: int, host_time_ns: int) -> Marker:
    """Return the marker of the acknowledgement of alarms at a sample of a segment; host clock in ns since 1970."""
    named = ", ".join(alarm_name(alarm) for alarm in alarms)
    return Marker(segment, sample, f"acknowledged {named}"[:MAX_MARKER_LENGTH], host_time_ns, MarkerKind.ACKNOWLEDGED)
