"""Banner at the top of the live view: speed, overall vibration, alarms and recording status."""

import math

from analysis.signals.header import Role, Severity
from analysis.signals.snapshot import TachoState
from analysis.signals.units import MICROMETRE, RPM
from daq.colours import ALARM, DANGER, DARK_TEXT, GOOD, GRID, LABEL, MEASURED_X, MEASURED_Y, TEXT, Color
from daq.session.live_update import LiveUpdate, RunState, Status
from daq.view.drawing import Anchor, Drawing
from daq.view.status_text import clock, disk_time, rpm, worst_alarm
from daq.view.stroke_font import text_width

BOUNDS = ((0.0, 1900.0), (8.0, 180.0))
_STEADY = 3.0 * RPM  # rad/s²: up to 3 r/min per second no ramp is shown
_BLOCKS: dict[Severity, tuple[str, Color, Color]] = {
    Severity.NORMAL: ("NORMAL", GOOD, TEXT),
    Severity.ALARM: ("ALARM", ALARM, DARK_TEXT),
    Severity.DANGER: ("DANGER", DANGER, DARK_TEXT),
}


def banner(update: LiveUpdate) -> Drawing:
    """Return the banner of a live update."""
    drawing = Drawing()
    _speed(drawing, update)
    _overall(drawing, update)
    _severity(drawing, update)
    _recording(drawing, update.status, _warning(update))
    return drawing


def _speed(drawing: Drawing, update: LiveUpdate) -> None:
    snapshot = update.snapshot
    if snapshot is None or not math.isfinite(snapshot.speed):
        drawing.text("--", (535.0, 140.0), 105.0, LABEL, Anchor.RIGHT)
        why = "no data" if snapshot is None else f"tacho: {snapshot.tacho.state.value}"
        drawing.text(why, (545.0, 140.0), min(24.0, 180.0 / text_width(why)), ALARM)
        return
    drawing.text(rpm(snapshot.speed), (535.0, 140.0), 105.0, TEXT, Anchor.RIGHT)
    drawing.text("r/min", (556.0, 140.0), 34.0, LABEL)
    acceleration = snapshot.frame.acceleration if snapshot.frame is not None else 0.0
    if abs(acceleration) > _STEADY:
        drawing.text("▲" if acceleration > 0.0 else "▼", (562.0, 86.0), 50.0, TEXT)


def _overall(drawing: Drawing, update: LiveUpdate) -> None:
    drawing.text("µm peak-to-peak", (735.0, 38.0), 22.0, LABEL)
    for name, row, color, left in (("x", 0, MEASURED_X, 735.0), ("y", 1, MEASURED_Y, 940.0)):
        value = "--" if update.snapshot is None else f"{update.snapshot.peak_to_peak[row] / MICROMETRE:.0f}"
        drawing.text(name, (left, 116.0), 36.0, color)
        drawing.text(value, (left + 42.0, 116.0), 58.0, color)
    limits = update.header.limits
    text = f"alarm {limits.peak_to_peak_alarm / MICROMETRE:.0f}   danger {limits.peak_to_peak_danger / MICROMETRE:.0f}"
    drawing.text(text, (735.0, 160.0), 20.0, LABEL)


def _severity(drawing: Drawing, update: LiveUpdate) -> None:
    status = update.status
    now, paper, ink = _BLOCKS[status.severity]
    if update.snapshot is None:
        now, paper, ink = "NO DATA", GRID, TEXT
    elif status.alarms and status.severity is Severity.NORMAL:
        now, paper, ink = "LATCHED", GRID, TEXT
    drawing.block(1150.0, 54.0, 270.0, 62.0, paper)
    drawing.text(now, (1285.0, 102.0), 35.0, ink, Anchor.CENTRE)
    if not status.alarms:
        drawing.text("no alarm", (1285.0, 38.0), 17.0, LABEL, Anchor.CENTRE)
    else:
        _, paper, ink = _BLOCKS[status.latched]
        text = worst_alarm(status.alarms)
        drawing.block(1150.0, 10.0, 270.0, 38.0, paper)
        drawing.text(text, (1285.0, 38.0), min(20.0, 250.0 / text_width(text)), ink, Anchor.CENTRE)
    if not _warning(update):
        drawing.text(update.header.rig[:16], (1285.0, 160.0), 22.0, LABEL, Anchor.CENTRE)


_STATES: dict[RunState, tuple[str, Color]] = {
    RunState.STARTING: ("STARTING", LABEL),
    RunState.ARMED: ("ARMED", ALARM),
    RunState.RECORDING: ("RECORDING", DANGER),
    RunState.DEGRADED: ("BUFFER FILLING", ALARM),
    RunState.INTERRUPTED: ("NO SAMPLES", ALARM),
    RunState.REPLAYING: ("REPLAY", MEASURED_X),
    RunState.FINISHED: ("FINISHED", LABEL),
    RunState.FAILED: ("FAILED", DANGER),
}


def _warning(update: LiveUpdate) -> str:
    """Return the error of the run, or else warnings about the measurement; empty without any."""
    status, snapshot = update.status, update.snapshot
    if status.detail or snapshot is None:
        return status.detail
    warnings = [f"{each.channel} CLIPPED {each.samples:,}" for each in status.clipped]
    probes = [channel.name for channel in update.header.acquisition.channels if channel.role is not Role.TACHO]
    warnings += [
        f"probe {name} reads {volts:.2f} V, out of its window"
        for name, volts, ok in zip(probes, snapshot.gap_volts, snapshot.gap_in_window, strict=True)
        if not ok
    ]
    if snapshot.tacho.state in {TachoState.IRREGULAR, TachoState.TOO_FAST}:
        warnings.append(f"tacho {snapshot.tacho.state.value}")
    return "; ".join(warnings)


def _recording(drawing: Drawing, status: Status, warning: str) -> None:
    word, color = _STATES[status.state]
    drawing.dot((1472.0, 35.0), 16.0, color)
    drawing.text(word, (1500.0, 47.0), 23.0, TEXT)
    drawing.text(clock(status.elapsed), (1888.0, 52.0), 40.0, TEXT, Anchor.RIGHT)
    if status.lost:
        text = f"LOST {'' if status.lost_is_exact else 'at least '}{status.lost:,}"
        drawing.text(text, (1456.0, 108.0), min(31.0, 430.0 / text_width(text)), DANGER)
    else:
        drawing.text("lost 0", (1456.0, 108.0), 31.0, TEXT)
        drawing.text(f"backlog {status.backlog:.1f} s", (1888.0, 108.0), 25.0, TEXT, Anchor.RIGHT)
    if warning:
        _detail(drawing, warning)
        return
    drawing.text(f"{status.samples / 1e6:,.1f} M samples", (1456.0, 160.0), 22.0, LABEL)
    drawing.text(f"disk {disk_time(status.disk_left)}", (1888.0, 160.0), 25.0, TEXT, Anchor.RIGHT)


def _detail(drawing: Drawing, detail: str) -> None:
    """Write the warning on one line, scaled to fit."""
    drawing.block(1150.0, 126.0, 740.0, 46.0, ALARM)
    height = min(24.0, 690.0 / text_width(detail))
    drawing.text(detail, (1520.0, 149.0 + 0.5 * height), height, DARK_TEXT, Anchor.CENTRE)
