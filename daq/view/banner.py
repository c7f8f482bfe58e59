"""The strip along the top: speed, overall vibration against its limits, and whether it is being recorded."""

import math

from daq.session.frame import LiveFrame, RunState, Severity, Status
from daq.view.drawing import Anchor, Drawing
from daq.view.palette import ALARM, DANGER, GOOD, INK, MEASURED_X, MEASURED_Y, QUIET, TEXT, Color
from daq.view.wording import clock, hours, rpm

BOUNDS = ((0.0, 1900.0), (0.0, 196.0))
_STEADY = 3.0 * math.pi / 30.0  # rad/s²: slower than 3 r/min each second is called steady
_BLOCKS: dict[Severity, tuple[str, Color, Color]] = {
    Severity.NORMAL: ("NORMAL", GOOD, TEXT),
    Severity.ALARM: ("ALARM", ALARM, INK),
    Severity.DANGER: ("DANGER", DANGER, TEXT),
}


def banner(frame: LiveFrame) -> Drawing:
    """Return the strip for one moment."""
    drawing = Drawing()
    _speed(drawing, frame)
    _overall(drawing, frame)
    _severity(drawing, frame)
    _recording(drawing, frame.status)
    return drawing


def _speed(drawing: Drawing, frame: LiveFrame) -> None:
    snapshot = frame.snapshot
    known = snapshot is not None and math.isfinite(snapshot.speed)
    drawing.text(rpm(snapshot.speed) if snapshot and known else "--", (455.0, 160.0), 124.0, TEXT, Anchor.RIGHT)
    drawing.text("r/min", (480.0, 160.0), 40.0, QUIET)
    if snapshot is None or not known:
        return
    acceleration = snapshot.frame.acceleration if snapshot.frame is not None else 0.0
    if abs(acceleration) > _STEADY:
        drawing.text("▲" if acceleration > 0.0 else "▼", (500.0, 95.0), 56.0, TEXT)


def _overall(drawing: Drawing, frame: LiveFrame) -> None:
    drawing.text("µm peak-to-peak", (660.0, 40.0), 22.0, QUIET)
    for name, row, color, left in (("x", 0, MEASURED_X, 660.0), ("y", 1, MEASURED_Y, 840.0)):
        value = "--" if frame.snapshot is None else f"{frame.snapshot.peak_to_peak[row] * 1e6:.0f}"
        drawing.text(name, (left, 124.0), 38.0, color)
        drawing.text(value, (left + 40.0, 124.0), 66.0, color)
    limits = frame.header.limits
    text = f"alarm {limits.peak_to_peak_alarm * 1e6:.0f}  danger {limits.peak_to_peak_danger * 1e6:.0f}"
    drawing.text(text, (660.0, 172.0), 22.0, QUIET)


def _severity(drawing: Drawing, frame: LiveFrame) -> None:
    status = frame.status
    now, paper, ink = _BLOCKS[status.severity]
    drawing.text("now", (1030.0, 40.0), 22.0, QUIET)
    drawing.block(1030.0, 58.0, 300.0, 64.0, paper)
    drawing.text(now, (1180.0, 108.0), 38.0, ink, Anchor.CENTRE)
    worst, paper, ink = _BLOCKS[status.latched]
    if status.latched is Severity.NORMAL:
        drawing.text("no limit passed in this run", (1180.0, 168.0), 20.0, QUIET, Anchor.CENTRE)
    else:
        drawing.block(1030.0, 134.0, 300.0, 50.0, paper)
        drawing.text(f"{worst} WAS PASSED", (1180.0, 169.0), 21.0, ink, Anchor.CENTRE)


_STATES: dict[RunState, tuple[str, Color]] = {
    RunState.STARTING: ("STARTING", QUIET),
    RunState.RECORDING: ("RECORDING", DANGER),
    RunState.REPLAYING: ("REPLAY", MEASURED_X),
    RunState.FINISHED: ("FINISHED", QUIET),
    RunState.FAILED: ("FAILED", DANGER),
}


def _recording(drawing: Drawing, status: Status) -> None:
    word, color = _STATES[status.state]
    drawing.dot((1400.0, 40.0), 20.0, color)
    drawing.text(word, (1436.0, 55.0), 32.0, TEXT)
    drawing.text(clock(status.elapsed), (1890.0, 55.0), 46.0, TEXT, Anchor.RIGHT)
    lost = f"{'' if status.lost_is_exact else 'at least '}{status.lost:,}"
    drawing.text(f"lost {lost}", (1380.0, 118.0), 34.0, DANGER if status.lost else TEXT)
    drawing.text(f"backlog {status.backlog:.1f} s", (1890.0, 118.0), 30.0, TEXT, Anchor.RIGHT)
    if status.detail:
        drawing.text(status.detail[:48], (1380.0, 174.0), 22.0, ALARM)
        return
    drawing.text(f"{status.samples / 1e6:,.1f} M samples", (1380.0, 174.0), 26.0, QUIET)
    drawing.text(f"disk {hours(status.disk_left)}", (1890.0, 174.0), 30.0, TEXT, Anchor.RIGHT)
