"""The page of text beside the plots: everything that is known, in words."""

import cmath
import math

from analysis.signals.snapshot import Snapshot, TachoState
from daq.session.live_update import LiveFrame
from daq.view.wording import basis, hours, legible, micrometres, rpm, vector
from model.prediction.prediction import Prediction


def details(frame: LiveFrame) -> str:
    """Return the page for one moment, markdown."""
    lines = [f"# {_below_synchronous(frame)}", "", "| | x | y |", "|---|---|---|"]
    if frame.snapshot is not None:
        lines += _shaft(frame, frame.snapshot)
    lines += ["", *_system(frame)]
    return legible("\n".join(lines))


def _below_synchronous(frame: LiveFrame) -> str:
    """Say what moves below 1X, and what the model expects there."""
    order_frame = frame.snapshot.frame if frame.snapshot is not None else None
    whirl = order_frame.whirl if order_frame is not None else None
    said = "nothing below 1X" if order_frame is not None else "no spectrum yet"
    if whirl is not None:
        way = "forward" if whirl.is_forward else "backward"
        said = f"{whirl.order:.2f}X {micrometres(whirl.amplitude)} {way}"
    for other in () if order_frame is None else order_frame.whirls[1:]:
        said += f", {other.order:.2f}X {micrometres(other.amplitude)} {'forward' if other.is_forward else 'backward'}"
    prediction = frame.prediction
    if prediction is None:
        return said
    if prediction.whirl_amplitude > 0.0:
        return f"{said} (model {prediction.whirl_order:.2f}X {micrometres(prediction.whirl_amplitude)})"
    return f"{said} (model: none)"


def _shaft(frame: LiveFrame, snapshot: Snapshot) -> list[str]:
    rows = [_row("**peak-to-peak**", [micrometres(float(v)) for v in snapshot.peak_to_peak])]
    prediction = frame.prediction
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
        for volts, ok in zip(snapshot.gap_volts, snapshot.gap_ok, strict=True)
    ]
    rows.append(_row("gap voltage", gaps))
    return rows


def _row(name: str, values: list[str]) -> str:
    return f"| {name} | {' | '.join(values)} |"


def _system(frame: LiveFrame) -> list[str]:
    status = frame.status
    lines = [f"## {status.state.value} · {frame.header.run}"]
    if status.detail:
        lines.append(f"**{status.detail}**")
    lines.append(f"- **{status.samples:,}** samples a channel, lost **{_lost(frame)}**, backlog {status.backlog:.2f} s")
    lines.append(
        f"- disk {hours(status.disk_left)}; not analysed live {status.skipped:,}; not drawn {status.dropped_frames:,}"
    )
    if frame.snapshot is not None:
        lines += _signals(frame, frame.snapshot)
    lines.append(f"- model: {status.model}{_model(frame.prediction)}")
    return lines


def _lost(frame: LiveFrame) -> str:
    return f"{'' if frame.status.lost_is_exact else 'at least '}{frame.status.lost:,}"


def _signals(frame: LiveFrame, snapshot: Snapshot) -> list[str]:
    tacho = snapshot.tacho
    state = tacho.state.value if tacho.state is TachoState.GOOD else f"**{tacho.state.value.upper()}**"
    speed = f"{rpm(snapshot.speed)} r/min" if math.isfinite(snapshot.speed) else "no speed"
    lines = [f"- tacho {state}, {speed}, {tacho.pulses:,} pulses, {tacho.filled} filled in, {tacho.rejected} rejected"]
    if tacho.mark_is_arbitrary:
        lines.append("- its marks cannot be told apart: phases are from the first one seen")
    if snapshot.counter is not None:
        told = "; ".join(filter(None, (snapshot.counter.told, snapshot.counter.told_lately)))
        compared = f"**{told}**" if told else "counter and samples agree"
        lines.append(f"- speed and phase from the {frame.header.acquisition.tacho.reference}; {compared}")
    channels = frame.header.acquisition.channels
    clipped = [f"{channel.name} {count:,}" for channel, count in zip(channels, snapshot.clipped, strict=True) if count]
    lines.append(f"- **CLIPPED** {', '.join(clipped)} samples" if clipped else "- clipping none")
    return lines


def _model(prediction: Prediction | None) -> str:
    if prediction is None:
        return ""
    said = f"; {basis(prediction)}"
    if math.isfinite(prediction.growth_rate):
        said += "; film lets go at this speed" if prediction.growth_rate > 0.0 else "; film stable at this speed"
    return said
