"""Status of the run in the live view: the banner, the details page, and the quantities as text."""

import cmath
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from analysis.live.alarms import Alarm, MonitoredQuantity
from analysis.signals.header import Role, Severity
from analysis.signals.snapshot import OVERALL, OrderFrame, Snapshot, TachoState
from analysis.signals.units import MICROMETRE, RPM, phase_lag_degrees
from daq.colours import ALARM, DANGER, DARK_TEXT, GOOD, GRID, LABEL, MEASURED_X, MEASURED_Y, TEXT, Color
from daq.session.live_update import LiveUpdate, RunState, Status
from daq.view.drawing import Anchor, Drawing, text_width
from model.prediction.prediction_map import Prediction

ComplexArray = NDArray[np.complex128]


def rpm(speed: float) -> str:
    """Return a speed, rad/s, in whole r/min."""
    return f"{speed / RPM:,.0f}"


def clock(elapsed: float) -> str:
    """Return a time, s, as 02:41 or 1:02:41."""
    seconds = max(0, int(elapsed))
    minutes, seconds = divmod(seconds, 60)
    if minutes < 60:
        return f"{minutes:02d}:{seconds:02d}"
    return f"{minutes // 60}:{minutes % 60:02d}:{seconds:02d}"


def worst_alarm(alarms: Sequence[Alarm]) -> str:
    """Return the text of the worst alarm, such as DANGER x 96 µm or ALARM 1X y 24 µm."""
    worst = max(alarms, key=lambda alarm: (alarm.severity.rank, alarm.largest / alarm.limit))
    word = worst.severity.value.upper()
    if worst.quantity is MonitoredQuantity.SPEED:
        return f"{word} {rpm(worst.largest)} r/min"
    which = "" if worst.quantity is MonitoredQuantity.OVERALL else f"{worst.quantity.value} "
    return f"{word} {which}{worst.probe} {worst.largest / MICROMETRE:.0f} µm"


def disk_time(left: float) -> str:
    """Return the remaining time until the disk is full, s, as 41 h or 25 min."""
    if not math.isfinite(left):
        return "not written"
    return f"{left / 3600.0:,.0f} h" if left >= 7200.0 else f"{left / 60.0:.0f} min"


def micrometres(length: float) -> str:
    """Return a length, m, in µm with two or three significant digits."""
    return f"{length / MICROMETRE:.0f} µm" if abs(length) >= 9.95e-6 else f"{length / MICROMETRE:.1f} µm"


def lost_samples(status: Status) -> str:
    """Return the number of lost samples, as "at least 12,345" where it is a lower bound."""
    return f"{'' if status.lost_is_exact else 'at least '}{status.lost:,}"


def basis(prediction: Prediction) -> str:
    """Return whether a prediction is integrated at its speed or interpolated, as text."""
    return f"exact at {rpm(prediction.speed)} r/min" if prediction.is_exact else "interpolated"


def sigma(value: float) -> str:
    """Return a standard deviation with one significant digit."""
    return f"{float(f'{max(value, 0.001):.1g}'):g}"


def vector(value: complex) -> str:
    """Return a vector, m peak, as amplitude and phase lag."""
    return f"{micrometres(abs(value))}, {phase_lag_degrees(value):.0f}°"


_LAST_LATIN = 0x24F


def replace_unprintable(text: str) -> str:
    """Return the text with question marks for characters that the viewer's font lacks.

    The viewer may fail on such a character, and names, notes and messages come from outside.
    """
    return "".join(c if c == "\n" or (c.isprintable() and ord(c) <= _LAST_LATIN) or c in "–—…" else "?" for c in text)


def details(update: LiveUpdate) -> str:
    """Return the details page of a live update, Markdown."""
    lines = [f"### {_below_synchronous(update)}", "", "| | x | y |", "|---|---|---|"]
    if update.snapshot is not None:
        lines += _shaft(update, update.snapshot)
    lines += ["", *_system(update)]
    return replace_unprintable("\n".join(lines))


def _below_synchronous(update: LiveUpdate) -> str:
    """Return the measured and predicted components below 1X as text."""
    frame, prediction = update.order_frame, update.prediction
    text = "no spectrum yet"
    if frame is not None:
        whirls = [
            f"{whirl.order:.2f}X {micrometres(whirl.amplitude)} {'forward' if whirl.is_forward else 'backward'}"
            for whirl in frame.whirls
        ]
        text = ", ".join(whirls) or "nothing below 1X"
    if prediction is None:
        return text
    if prediction.whirl_amplitude > 0.0:
        return f"{text} (model {prediction.whirl_order:.2f}X {micrometres(prediction.whirl_amplitude)})"
    return f"{text} (model: none)"


def _shaft(update: LiveUpdate, snapshot: Snapshot) -> list[str]:
    rows = [
        _row(f"**{measure.unit.removeprefix('µm ')}**", [micrometres(value) for value in values])
        for measure, values in zip(OVERALL.rows, snapshot.overall.tolist(), strict=True)
    ]
    prediction = update.prediction
    if prediction is not None:
        rows.append(_row("model", [micrometres(float(v)) for v in prediction.peak_to_peak]))
    gaps = [
        f"{volts:.2f} V {'ok' if ok else '**OUT OF WINDOW**'}"
        for volts, ok in zip(snapshot.gap_volts, snapshot.gap_in_window, strict=True)
    ]
    gap_row = _row("gap voltage", gaps)
    frame = snapshot.frame
    if frame is None:
        return [*rows, gap_row]
    for order in (1, 2):
        uncertainty = _uncertainty(frame) if order == 1 else ""
        is_known = frame.compensated is not None
        rows.append(_vector_row(f"**{order}X** peak, lag{'' if is_known else uncertainty}", frame.vectors[order - 1]))
        if frame.compensated is not None:
            rows.append(_vector_row(f"compensated{uncertainty}", frame.compensated[order - 1]))
        if prediction is not None:
            rows.append(_vector_row("model", prediction.vectors[order - 1]))
    return [*rows, gap_row]


def _uncertainty(frame: OrderFrame) -> str:
    """Return the standard deviations of 1X as text; empty if unknown."""
    if not math.isfinite(float(frame.compensated_sigma[0])):
        return ""
    amplitude, lag = frame.compensated_sigma[0] / MICROMETRE, frame.compensated_phase_sigma[0].max()
    return f" ± {sigma(float(amplitude))} µm, {sigma(math.degrees(float(lag)))}°"


def _vector_row(name: str, vectors: ComplexArray) -> str:
    return _row(name, ["unknown" if cmath.isnan(each) else vector(each) for each in vectors.tolist()])


def _row(name: str, values: list[str]) -> str:
    return f"| {name} | {' | '.join(values)} |"


def _system(update: LiveUpdate) -> list[str]:
    status = update.status
    lines = [f"**{status.state.value}** · {update.header.run}", ""]
    if status.detail:
        lines.append(f"**{status.detail}**")
    lines.append(
        f"- **{status.samples:,}** samples per channel, lost **{lost_samples(status)}**, backlog {status.backlog:.2f} s"
    )
    lines.append(
        f"- disk {disk_time(status.disk_left)}; not analysed live {status.skipped:,}; "
        f"not drawn {status.dropped_updates:,}"
    )
    if update.snapshot is not None:
        lines += _signals(update, update.snapshot)
    lines.append(f"- model: {status.model}{_model(update.prediction)}")
    return lines


def _signals(update: LiveUpdate, snapshot: Snapshot) -> list[str]:
    tacho = snapshot.tacho
    state = tacho.state.value if tacho.state is TachoState.GOOD else f"**{tacho.state.value.upper()}**"
    speed = f"{rpm(snapshot.speed)} r/min" if math.isfinite(snapshot.speed) else "no speed"
    lines = [f"- tacho {state}, {speed}, {tacho.pulses:,} pulses, {tacho.filled} filled in, {tacho.rejected} rejected"]
    if tacho.phase_reference_is_arbitrary:
        lines.append("- keyphasor marks are indistinguishable: phases refer to the first one")
    if snapshot.counter is not None:
        difference = "; ".join(filter(None, (snapshot.counter.message, snapshot.counter.recent_message)))
        compared = f"**{difference}**" if difference else "counter and samples agree"
        lines.append(f"- speed and phase from the {update.header.acquisition.tacho.reference}; {compared}")
    channels = update.header.acquisition.channels
    clipped = [f"{channel.name} {count:,}" for channel, count in zip(channels, snapshot.clipped, strict=True) if count]
    lines.append(f"- **CLIPPED** {', '.join(clipped)} samples" if clipped else "- clipping none")
    return lines


def _model(prediction: Prediction | None) -> str:
    if prediction is None:
        return ""
    text = f"; {basis(prediction)}"
    if math.isfinite(prediction.growth_rate):
        text += (
            "; oil film unstable at this speed" if prediction.growth_rate > 0.0 else "; oil film stable at this speed"
        )
    return text


BANNER_BOUNDS = ((0.0, 1900.0), (8.0, 180.0))
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
        text = f"LOST {lost_samples(status)}"
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
