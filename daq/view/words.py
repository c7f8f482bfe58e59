"""The table beside the plots: what moves below 1X, 1X and 2X beside the model's, and the state of every signal."""

import math

from analysis.snapshot import Snapshot, TachoState
from daq.session.frame import LiveFrame
from daq.view.drawing import Anchor, Drawing
from daq.view.palette import ALARM, FRAME, GOOD, MEASURED_X, MEASURED_Y, MODEL, QUIET, TEXT, Color
from daq.view.wording import basis, micrometres, vector
from model.prediction import Prediction

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
    drawing.text(_expected(frame.prediction), (_LEFT, 39.0), _SIZE, MODEL)
    drawing.line([(_LEFT, 46.0), (_Y, 46.0)], FRAME, 0.7)
    at = _vectors(drawing, frame, 59.0)
    drawing.line([(_LEFT, at - 6.0), (_Y, at - 6.0)], FRAME, 0.7)
    if frame.snapshot is not None:
        at = _signals(drawing, frame, frame.snapshot, at + 7.0)
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
    drawing.text("peak, lag", (_LEFT, at), _SIZE, QUIET)
    drawing.text("x", (_X, at), _SIZE, MEASURED_X, Anchor.RIGHT)
    drawing.text("y", (_Y, at), _SIZE, MEASURED_Y, Anchor.RIGHT)
    order_frame = frame.snapshot.frame if frame.snapshot is not None else None
    for order in (1, 2):
        for name, ink, one, colors in (
            (f"{order}X", TEXT, order_frame, (MEASURED_X, MEASURED_Y)),
            (f"{order}X model", MODEL, frame.prediction, (MODEL, MODEL)),
        ):
            at += 14.0
            drawing.text(name, (_LEFT, at), _SIZE, ink)
            if one is None:
                continue
            for probe, (right, color) in enumerate(zip((_X, _Y), colors, strict=True)):
                drawing.text(vector(complex(one.vectors[order - 1, probe])), (right, at), _SIZE, color, Anchor.RIGHT)
    return at + 14.0


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
