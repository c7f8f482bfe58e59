"""Status texts of the live view: formatted quantities, details page and signal table."""

import cmath
import math
from collections.abc import Sequence

from analysis.live.alarms import Alarm, MonitoredQuantity
from analysis.signals import ComplexArray
from analysis.signals.snapshot import OrderFrame, Snapshot, TachoState
from analysis.signals.units import MICROMETRE, RPM, phase_lag_degrees
from daq.colours import ALARM, FRAME, GOOD, LABEL, MEASURED_X, MEASURED_Y, MODEL, TEXT, Color
from daq.session.live_update import LiveUpdate
from daq.view.drawing import Anchor, Drawing
from daq.view.stroke_font import text_width
from model.prediction.prediction_map import Prediction


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
    lines = [f"# {_below_synchronous(update)}", "", "| | x | y |", "|---|---|---|"]
    if update.snapshot is not None:
        lines += _shaft(update, update.snapshot)
    lines += ["", *_system(update)]
    return replace_unprintable("\n".join(lines))


def _below_synchronous(update: LiveUpdate) -> str:
    """Return the measured and predicted components below 1X as text."""
    order_frame = update.snapshot.frame if update.snapshot is not None else None
    whirl = order_frame.whirl if order_frame is not None else None
    text = "nothing below 1X" if order_frame is not None else "no spectrum yet"
    if whirl is not None:
        way = "forward" if whirl.is_forward else "backward"
        text = f"{whirl.order:.2f}X {micrometres(whirl.amplitude)} {way}"
    for other in () if order_frame is None else order_frame.whirls[1:]:
        text += f", {other.order:.2f}X {micrometres(other.amplitude)} {'forward' if other.is_forward else 'backward'}"
    prediction = update.prediction
    if prediction is None:
        return text
    if prediction.whirl_amplitude > 0.0:
        return f"{text} (model {prediction.whirl_order:.2f}X {micrometres(prediction.whirl_amplitude)})"
    return f"{text} (model: none)"


def _shaft(update: LiveUpdate, snapshot: Snapshot) -> list[str]:
    rows = [_row("**peak-to-peak**", [micrometres(float(v)) for v in snapshot.peak_to_peak])]
    prediction = update.prediction
    if prediction is not None:
        rows.append(_row("model", [micrometres(float(v)) for v in prediction.peak_to_peak]))
    if snapshot.frame is not None:
        for order in (1, 2):
            rows.append(
                _row(f"**{order}X** peak, lag", [vector(complex(v)) for v in snapshot.frame.vectors[order - 1]])
            )
            if snapshot.frame.compensated is not None:
                compensated = [complex(v) for v in snapshot.frame.compensated[order - 1]]
                rows.append(_row("compensated", ["unknown" if cmath.isnan(v) else vector(v) for v in compensated]))
            if prediction is not None:
                rows.append(_row("model", [vector(complex(v)) for v in prediction.vectors[order - 1]]))
    gaps = [
        f"{volts:.2f} V {'ok' if ok else '**OUT OF WINDOW**'}"
        for volts, ok in zip(snapshot.gap_volts, snapshot.gap_in_window, strict=True)
    ]
    rows.append(_row("gap voltage", gaps))
    return rows


def _row(name: str, values: list[str]) -> str:
    return f"| {name} | {' | '.join(values)} |"


def _system(update: LiveUpdate) -> list[str]:
    status = update.status
    lines = [f"## {status.state.value} · {update.header.run}"]
    if status.detail:
        lines.append(f"**{status.detail}**")
    lines.append(
        f"- **{status.samples:,}** samples per channel, lost **{_lost(update)}**, backlog {status.backlog:.2f} s"
    )
    lines.append(
        f"- disk {disk_time(status.disk_left)}; not analysed live {status.skipped:,}; "
        f"not drawn {status.dropped_updates:,}"
    )
    if update.snapshot is not None:
        lines += _signals(update, update.snapshot)
    lines.append(f"- model: {status.model}{_model(update.prediction)}")
    return lines


def _lost(update: LiveUpdate) -> str:
    return f"{'' if update.status.lost_is_exact else 'at least '}{update.status.lost:,}"


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


BOUNDS = ((0.0, 300.0), (0.0, 200.0))
_SIZE = 8.0
_LEFT, _X, _Y = 4.0, 186.0, 296.0  # of the table: names, and the right ends of both columns


def signal_table(update: LiveUpdate) -> Drawing:
    """Return the signal table of a live update."""
    drawing = Drawing()
    order_frame = update.snapshot.frame if update.snapshot is not None else None
    whirl = order_frame.whirl if order_frame is not None else None
    text, color = "nothing below 1X" if order_frame is not None else "no spectrum yet", LABEL
    if whirl is not None:
        way = "forward" if whirl.is_forward else "backward"
        text, color = f"{whirl.order:.2f}X {micrometres(whirl.amplitude)} {way}", TEXT
    drawing.text(text, (_LEFT, 22.0), 13.0, color)
    if order_frame is not None and len(order_frame.whirls) > 1:
        others = ", ".join(f"{one.order:.2f}X {micrometres(one.amplitude)}" for one in order_frame.whirls[1:])
        text = f"also {others}"
        drawing.text(text, (_Y, 39.0), min(_SIZE, 124.0 / text_width(text)), TEXT, Anchor.RIGHT)
    drawing.text(_prediction_text(update.prediction), (_LEFT, 39.0), _SIZE, MODEL)
    drawing.line([(_LEFT, 46.0), (_Y, 46.0)], FRAME, 0.7)
    at = _vectors(drawing, update, 59.0) + 7.0
    drawing.line([(_LEFT, at - 13.0), (_Y, at - 13.0)], FRAME, 0.7)
    if update.snapshot is not None:
        at = _signal_rows(drawing, update, update.snapshot, at)
    status = update.status
    missed = f"not analysed live {status.skipped:,}   not drawn {status.dropped_updates:,}"
    _line(drawing, at, missed, ALARM if status.skipped else LABEL)
    basis_said = "" if update.prediction is None else f", {basis(update.prediction)}"
    _line(drawing, at + 14.0, f"model {status.model}{basis_said}", MODEL)
    return drawing


def _prediction_text(prediction: Prediction | None) -> str:
    if prediction is None:
        return "model: no prediction"
    stable = ", film unstable" if prediction.growth_rate > 0.0 else ", film stable"
    if math.isnan(prediction.growth_rate):
        stable = ""
    if prediction.whirl_amplitude > 0.0:
        return f"model {prediction.whirl_order:.2f}X {micrometres(prediction.whirl_amplitude)}{stable}"
    return f"model: nothing below 1X{stable}"


def _vectors(drawing: Drawing, update: LiveUpdate, at: float) -> float:
    """Draw the vectors from line ``at`` on; return the next line."""
    order_frame = update.snapshot.frame if update.snapshot is not None else None
    drawing.text(f"peak, lag{_uncertainty(order_frame)}", (_LEFT, at), _SIZE, LABEL)
    drawing.text("x", (_X, at), _SIZE, MEASURED_X, Anchor.RIGHT)
    drawing.text("y", (_Y, at), _SIZE, MEASURED_Y, Anchor.RIGHT)
    known = order_frame is not None and order_frame.runout is not None
    rows: list[tuple[str, Color, ComplexArray | None, tuple[Color, Color]]] = []
    for order in (1, 2):
        name = f"{order}X compensated" if known else f"{order}X"
        motion = None if order_frame is None else order_frame.motion[order - 1]
        rows.append((name, TEXT, motion, (MEASURED_X, MEASURED_Y)))
        if known and order == 1 and order_frame is not None:
            rows.append(("1X as measured", LABEL, order_frame.vectors[0], (LABEL, LABEL)))
        predicted = None if update.prediction is None else update.prediction.vectors[order - 1]
        rows.append((f"{order}X model", MODEL, predicted, (MODEL, MODEL)))
    for name, ink, vectors, colors in rows:
        at += 14.0
        drawing.text(name, (_LEFT, at), _SIZE, ink)
        if vectors is not None:
            for value, right, color in zip(vectors.tolist(), (_X, _Y), colors, strict=True):
                drawing.text(vector(value), (right, at), _SIZE, color, Anchor.RIGHT)
    return at + 14.0


def _uncertainty(order_frame: OrderFrame | None) -> str:
    """Return the standard deviations of 1X as text."""
    if order_frame is None or not math.isfinite(float(order_frame.compensated_sigma[0])):
        return ""
    amplitude, lag = order_frame.compensated_sigma[0] / MICROMETRE, order_frame.compensated_phase_sigma[0].max()
    return f"  ± {sigma(float(amplitude))} µm  ± {sigma(math.degrees(float(lag)))}°"


def _signal_rows(drawing: Drawing, update: LiveUpdate, snapshot: Snapshot, at: float) -> float:
    """Draw gap voltages, tacho and clipping from line ``at`` on; return the next line."""
    drawing.text("gap", (_LEFT, at), _SIZE, LABEL)
    for volts, ok, right in zip(snapshot.gap_volts, snapshot.gap_in_window, (_X, _Y), strict=True):
        text = f"{volts:.2f} V {'ok' if ok else 'OUT'}"
        drawing.text(text, (right, at), _SIZE, GOOD if ok else ALARM, Anchor.RIGHT)
    good = snapshot.tacho.state is TachoState.GOOD
    source = "" if snapshot.counter is None else f" by {update.header.acquisition.tacho.reference}"
    _line(drawing, at + 14.0, f"tacho {snapshot.tacho.state.value}{source}", GOOD if good else ALARM)
    clipped = [
        f"{channel.name} {count:,}"
        for channel, count in zip(update.header.acquisition.channels, snapshot.clipped, strict=True)
        if count
    ]
    text = f"CLIPPED {', '.join(clipped)}" if clipped else "no clipping"
    drawing.text(text, (_Y, at + 14.0), _SIZE, ALARM if clipped else GOOD, Anchor.RIGHT)
    return at + 28.0


def _line(drawing: Drawing, at: float, text: str, color: Color) -> None:
    drawing.text(text, (_LEFT, at), _SIZE, color)
