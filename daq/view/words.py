"""The table beside the plots: what moves below 1X, 1X and 2X beside the model's, and the state of every signal."""

import math

from analysis.signals.snapshot import ComplexArray, OrderFrame, Snapshot, TachoState
from daq.session.live_update import LiveFrame
from daq.view.drawing import Anchor, Drawing
from daq.view.lettering import text_width
from daq.view.palette import ALARM, FRAME, GOOD, MEASURED_X, MEASURED_Y, MODEL, QUIET, TEXT, Color
from daq.view.wording import basis, micrometres, sigma, vector
from model.prediction.prediction import Prediction

BOUNDS = ((0.0, 300.0), (0.0, 200.0))
_SIZE = 8.0
_LEFT, _X, _Y = 4.0, 186.0, 296.0  # of the table: names, and the right ends of both columns


def words(frame: LiveFrame) -> Drawing:
    """Return the table for one moment."""
    drawing = Drawing()
    order_frame = frame.snapshot.frame if frame.snapshot is not None else None
    whirl = order_frame.whirl if order_frame is not None else None
    said, color = "nothing below 1X" if order_frame is not None else "no spectrum yet", QUIET
    if whirl is not None:
        way = "forward" if whirl.is_forward else "backward"
        said, color = f"{whirl.order:.2f}X {micrometres(whirl.amplitude)} {way}", TEXT
    drawing.text(said, (_LEFT, 22.0), 13.0, color)
    if order_frame is not None and len(order_frame.whirls) > 1:
        others = ", ".join(f"{one.order:.2f}X {micrometres(one.amplitude)}" for one in order_frame.whirls[1:])
        text = f"also {others}"
        drawing.text(text, (_Y, 39.0), min(_SIZE, 124.0 / text_width(text)), TEXT, Anchor.RIGHT)
    drawing.text(_expected(frame.prediction), (_LEFT, 39.0), _SIZE, MODEL)
    drawing.line([(_LEFT, 46.0), (_Y, 46.0)], FRAME, 0.7)
    at = _vectors(drawing, frame, 59.0) + 7.0
    drawing.line([(_LEFT, at - 13.0), (_Y, at - 13.0)], FRAME, 0.7)
    if frame.snapshot is not None:
        at = _signals(drawing, frame, frame.snapshot, at)
    status = frame.status
    missed = f"not analysed live {status.skipped:,}   not drawn {status.dropped_frames:,}"
    _line(drawing, at, missed, ALARM if status.skipped else QUIET)
    basis_said = "" if frame.prediction is None else f", {basis(frame.prediction)}"
    _line(drawing, at + 14.0, f"model {status.model}{basis_said}", MODEL)
    return drawing


def _expected(prediction: Prediction | None) -> str:
    if prediction is None:
        return "model: no prediction"
    stable = ", film let go" if prediction.growth_rate > 0.0 else ", film stable"
    if math.isnan(prediction.growth_rate):
        stable = ""
    if prediction.whirl_amplitude > 0.0:
        return f"model {prediction.whirl_order:.2f}X {micrometres(prediction.whirl_amplitude)}{stable}"
    return f"model: nothing below 1X{stable}"


def _vectors(drawing: Drawing, frame: LiveFrame, at: float) -> float:
    """Write the vectors' table from line ``at`` on; return the line after it."""
    order_frame = frame.snapshot.frame if frame.snapshot is not None else None
    drawing.text(f"peak, lag{_sure(order_frame)}", (_LEFT, at), _SIZE, QUIET)
    drawing.text("x", (_X, at), _SIZE, MEASURED_X, Anchor.RIGHT)
    drawing.text("y", (_Y, at), _SIZE, MEASURED_Y, Anchor.RIGHT)
    known = order_frame is not None and order_frame.runout is not None
    rows: list[tuple[str, Color, ComplexArray | None, tuple[Color, Color]]] = []
    for order in (1, 2):
        name = f"{order}X compensated" if known else f"{order}X"
        motion = None if order_frame is None else order_frame.motion[order - 1]
        rows.append((name, TEXT, motion, (MEASURED_X, MEASURED_Y)))
        if known and order == 1 and order_frame is not None:
            rows.append(("1X as measured", QUIET, order_frame.vectors[0], (QUIET, QUIET)))
        predicted = None if frame.prediction is None else frame.prediction.vectors[order - 1]
        rows.append((f"{order}X model", MODEL, predicted, (MODEL, MODEL)))
    for name, ink, vectors, colors in rows:
        at += 14.0
        drawing.text(name, (_LEFT, at), _SIZE, ink)
        if vectors is not None:
            for value, right, color in zip(vectors.tolist(), (_X, _Y), colors, strict=True):
                drawing.text(vector(value), (right, at), _SIZE, color, Anchor.RIGHT)
    return at + 14.0


def _sure(order_frame: OrderFrame | None) -> str:
    """Say how sure 1X is, in standard deviations."""
    if order_frame is None or not math.isfinite(float(order_frame.compensated_sigma[0])):
        return ""
    amplitude, lag = order_frame.compensated_sigma[0] * 1e6, order_frame.compensated_phase_sigma[0].max()
    return f"  ± {sigma(float(amplitude))} µm  ± {sigma(math.degrees(float(lag)))}°"


def _signals(drawing: Drawing, frame: LiveFrame, snapshot: Snapshot, at: float) -> float:
    """Write what is to be said of gaps, tacho and clipping from line ``at`` on; return the line after it."""
    drawing.text("gap", (_LEFT, at), _SIZE, QUIET)
    for volts, ok, right in zip(snapshot.gap_volts, snapshot.gap_ok, (_X, _Y), strict=True):
        text = f"{volts:.2f} V {'ok' if ok else 'OUT'}"
        drawing.text(text, (right, at), _SIZE, GOOD if ok else ALARM, Anchor.RIGHT)
    good = snapshot.tacho.state is TachoState.GOOD
    source = "" if snapshot.counter is None else f" by {frame.header.acquisition.tacho.reference}"
    _line(drawing, at + 14.0, f"tacho {snapshot.tacho.state.value}{source}", GOOD if good else ALARM)
    clipped = [
        f"{channel.name} {count:,}"
        for channel, count in zip(frame.header.acquisition.channels, snapshot.clipped, strict=True)
        if count
    ]
    text = f"CLIPPED {', '.join(clipped)}" if clipped else "no clipping"
    drawing.text(text, (_Y, at + 14.0), _SIZE, ALARM if clipped else GOOD, Anchor.RIGHT)
    return at + 28.0


def _line(drawing: Drawing, at: float, text: str, color: Color) -> None:
    drawing.text(text, (_LEFT, at), _SIZE, color)
