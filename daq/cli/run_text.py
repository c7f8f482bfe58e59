"""A run as text for the terminal: the status line while it records, and its summary."""

import math
from collections.abc import Iterator
from itertools import groupby

from rich.table import Table
from rich.text import Text

from analysis.signals.blocks import RampDirection
from analysis.signals.header import Severity
from analysis.signals.snapshot import LARGEST_OVERALL, Snapshot
from analysis.signals.units import MICROMETRE, RPM
from daq.cli.terminal import labelled, print_json, print_output, text_table
from daq.schemas.events import AlarmSchema
from daq.schemas.runs import RunOutSchema
from daq.schemas.summary import SpeedRowSchema, SummarySchema, TachoSummarySchema
from daq.schemas.vibration import AgreementSchema
from daq.session.live_update import LiveUpdate, Status
from daq.session.recording.statistics import MAX_BUFFER_FILL
from model.prediction.prediction_map import Prediction
from recordings.mcap.results import MarkerKind

_MAX_STEADY_ACCELERATION = 20 * RPM  # rad/s²; up to it the speed is shown as steady

_ALERT = "bold red"

Labelled = tuple[str, str]


def status_line(update: LiveUpdate) -> str:
    """Return a live update as one line, most important parts first, because narrow terminals cut off the rest."""
    status, snapshot = update.status, update.snapshot
    minutes, seconds = divmod(int(status.elapsed), 60)
    parts = [f"{minutes:02d}:{seconds:02d}"]
    if snapshot is None:
        parts.append("waiting for the first samples")
    else:
        parts.append(_live_speed(snapshot))
        x, y = snapshot.peak_to_peak / MICROMETRE
        parts.append(f"x {x:.0f} µm  y {y:.0f} µm pp{_live_alarms(status)}")
    parts += [f"{each.channel} CLIPPED {each.samples:,} in {each.blocks:,} blocks" for each in status.clipped]
    parts.append(f"lost {'' if status.lost_is_exact else '≥ '}{status.lost:,}")
    parts.append(status.detail)
    if snapshot is not None:
        parts += [_counter(snapshot), *_live_whirl(snapshot, update.prediction)]
    if status.skipped:
        parts.append(f"live analysis skipped {status.skipped:,}")
    parts.append(f"backlog {status.backlog:.1f} s")
    if math.isfinite(status.disk_left):
        parts.append(f"disk {format_duration(status.disk_left)}")
    if status.model != "ready":
        parts.append(f"model {status.model}")
    return "  ".join(part for part in parts if part)


def _counter(snapshot: Snapshot) -> str:
    """Return how the tacho counter disagrees with the samples; empty where it agrees."""
    counter = snapshot.counter
    if counter is None or not counter.message:
        return ""
    return f"tacho counter: {', '.join(filter(None, (counter.state.value, counter.recent_message)))}"


def _live_alarms(status: Status) -> str:
    """Return the worst alarm severity shown and the quantities at it."""
    if status.latched is Severity.NORMAL:
        return ""
    worst = dict.fromkeys(alarm.quantity.value for alarm in status.alarms if alarm.severity is status.latched)
    return f"  {status.latched.value.upper()} {', '.join(worst)}"


def _live_speed(snapshot: Snapshot) -> str:
    if math.isnan(snapshot.speed):
        return f"speed ? ({snapshot.tacho.state.value})"
    trend = " "
    if snapshot.frame is not None and abs(snapshot.frame.acceleration) > _MAX_STEADY_ACCELERATION:
        trend = "▲" if snapshot.frame.acceleration > 0 else "▼"
    return f"{snapshot.speed / RPM:6,.0f} r/min {trend}"


def _live_whirl(snapshot: Snapshot, prediction: Prediction | None) -> list[str]:
    """Return the strongest component below 1X, measured and predicted."""
    whirl = None if snapshot.frame is None else snapshot.frame.whirl
    parts = [] if whirl is None else [f"{whirl.order:.2f}X {whirl.amplitude / MICROMETRE:.0f} µm"]
    if prediction is not None and not math.isnan(prediction.whirl_order):
        parts.append(f"(model {prediction.whirl_order:.2f}X {prediction.whirl_amplitude / MICROMETRE:.0f} µm)")
    return parts


def format_duration(seconds: float) -> str:
    """Return a duration with a suitable unit, such as "41 h"."""
    if seconds < 120:
        return f"{seconds:.0f} s"
    if seconds < 7200:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.0f} h"


def print_summary(summary: SummarySchema, *, as_json: bool) -> None:
    """Print a run's summary on standard output, as JSON or text."""
    if as_json:
        print_json(summary)
    else:
        print_output(*summary_parts(summary))


def summary_parts(summary: SummarySchema) -> Iterator[Table | Text | str]:
    """Yield a run's summary as text and tables."""
    note = f"  “{summary.note}”" if summary.note else ""
    yield f"run {summary.run}  {summary.duration_s:.1f} s  {summary.samples:,} samples per channel{note}"
    verdict = _verdict(summary), "" if summary.is_gap_free else _ALERT
    if not summary.samples:
        yield Text.assemble(verdict, "  nothing was recorded")
        yield labelled((*_segments(summary), *_markers(summary)))
        return
    largest = _largest(summary), "" if summary.severity is Severity.NORMAL else _ALERT
    yield Text.assemble(verdict, f"  {_speeds(summary)}  ", largest)
    yield labelled(_circumstances(summary))
    rows = _table_rows(summary)
    if rows:
        yield _table(rows)
    yield labelled((*_whirls(summary), *_model(summary.agreement)))


def _circumstances(summary: SummarySchema) -> Iterator[Labelled]:
    """Yield how the run was recorded: segments, clock, tacho, alarms, limits, markers, warnings, run-out."""
    yield from _segments(summary)
    if summary.clock_error_ppm is not None:
        uncertainty = _number(summary.clock_uncertainty_ppm, 1)
        yield "clock", f"the card's {summary.clock_error_ppm:+,.1f} ± {uncertainty} ppm against this computer's"
    if summary.largest_backlog_s is not None and summary.buffer_s:  # the card loses samples when its buffer is full
        fraction = summary.largest_backlog_s / summary.buffer_s
        advice = "; close other programs or lower timing.rate_hz" if fraction > MAX_BUFFER_FILL else ""
        buffer = f"the card's buffer of {summary.buffer_s:.3g} s, {100 * fraction:.0f} %{advice}"
        yield "backlog", f"at most {summary.largest_backlog_s:.2f} s in {buffer}"
    if summary.tacho is not None and summary.tacho.counter is not None:
        compared = f"{summary.tacho.counter.compared:,} edges of counter and samples compared"
        yield "tacho", f"speed and phase from the {summary.tacho.reference}; {compared}"
    yield from (("alarm", _alarm(alarm)) for alarm in summary.alarms)
    yield from _standards(summary)
    yield from _markers(summary)
    yield from (("warning", warning) for warning in _warnings(summary))
    if summary.runout is not None:
        yield "run-out", _runout(summary.runout)


def _whirls(summary: SummarySchema) -> Iterator[Labelled]:
    """Yield the components below 1X and their hysteresis between run-up and run-down."""
    if not summary.sub_synchronous:
        yield "sub-synchronous", "none"
    for k, whirl in enumerate(summary.sub_synchronous):
        begin = _speed(whirl.begin.speed_rpm, whirl.begin_ramp_direction)
        end = _speed(whirl.end.speed_rpm, whirl.end_ramp_direction)
        size = f"{whirl.direction.value}, up to {_number(whirl.largest_peak_um, 1)} µm"
        yield "" if k else "sub-synchronous", f"{_number(whirl.order, 2)}X from {begin} to {end} r/min, {size}"
    for each in summary.hysteresis:
        onset, end, width = _number(each.onset_rpm), _number(each.end_rpm), each.width_rpm or 0.0
        apart = f"{_number(abs(width))} r/min {'lower' if width >= 0.0 else 'higher'}"
        text = f"starts at {onset} on the run-up, ends at {end} on the run-down: {apart}"
        yield "hysteresis", f"{_number(each.order, 2)}X {text}"


def _standards(summary: SummarySchema) -> Iterator[Labelled]:
    """Yield the standards' limits at the speed of the largest vibration; scope and source are in the JSON summary."""
    known = [each for each in summary.standards if each.limit_peak_to_peak_um is not None]
    if known:
        limits = "; ".join(
            f"{standard} {', '.join(f'{each.name} {_number(each.limit_peak_to_peak_um)}' for each in figures)}"
            for standard, figures in groupby(known, key=lambda each: each.standard)
        ).replace("zone boundary ", "")
        yield "for information", f"{limits} µm pp at that speed; no standard covers floating-ring bearings"


def _runout(runout: RunOutSchema) -> str:
    """Return the run-out that was subtracted, or why none was."""
    below = "" if runout.slow_roll_rpm is None else f" up to {_number(runout.slow_roll_rpm)} r/min"
    one = runout.order_1x
    if one is None:
        return f"unknown: no {runout.source}{below}; 1X and 2X are as measured"
    x = f"x {_number(one.amplitude_peak_x_um, 1)} µm ∠{_number(one.lag_x_deg)}°"
    y = f"y {_number(one.amplitude_peak_y_um, 1)} µm ∠{_number(one.lag_y_deg)}°"
    return f"at 1X {x}, {y}, from {runout.source}{below}; subtracted where marked compensated"


def _alarm(alarm: AlarmSchema) -> str:
    """Return an alarm's quantity, time, speed and largest value."""
    speed = "" if alarm.begin.speed_rpm is None else f", {_number(alarm.begin.speed_rpm)} r/min"
    end = "to the end" if alarm.end is None else f"until {_number(alarm.end.time_s, 1)} s"
    name = alarm.name.replace(alarm.severity.value, alarm.severity.value.upper())
    return f"{name} from {_number(alarm.begin.time_s, 1)} s{speed} {end}, up to {alarm.message}"


def _model(agreement: AgreementSchema | None) -> Iterator[Labelled]:
    """Yield the comparison with the model: 1X, then each whirl."""
    if agreement is None:
        yield "model", "not compared: its prediction was not ready"
        return
    one = agreement.synchronous
    if one is None:
        text = "not compared: no steady speed within the model's range"
    elif one.agrees_to_rpm is None:
        median, lag = _number(one.median_amplitude_ratio, 2), _number(one.median_lag_difference_deg)
        worst, at = _number(one.worst_amplitude_ratio, 2), _number(one.worst_amplitude_at_rpm)
        text = f"measured/predicted {median}, lag {lag}° larger (medians); worst {worst} at {at} r/min"
    else:
        part, lag = 100 * (one.within_amplitude_ratio or 0.0), _number(one.within_lag_difference_deg)
        text = f"within {part:.0f} % and {lag}° up to {_number(one.agrees_to_rpm)} r/min"
    yield "model", f"1X {text}"
    for whirl in agreement.whirls:
        predicted = "none predicted"
        if whirl.predicted_order is not None:
            onset = _number(whirl.predicted_onset_rpm)
            predicted = f"predicted from {onset} r/min ({_number(whirl.predicted_order, 2)}X)"
        measured = "not measured" if whirl.was_reached else "not reached"
        if whirl.measured_order is not None:
            measured = f"measured from {_number(whirl.measured_onset_rpm)} ({_number(whirl.measured_order, 2)}X)"
        yield "", f"whirl {predicted}, {measured}"


def _table_rows(summary: SummarySchema) -> list[SpeedRowSchema]:
    """Return up to ten rows over speed, run-up and run-down; the JSON summary has all."""
    up = [row for row in summary.by_speed if row.frames and row.ramp_direction is RampDirection.RUN_UP]
    down = [row for row in reversed(summary.by_speed) if row.frames and row.ramp_direction is RampDirection.RUN_DOWN]
    return _evenly_spread(up, 5) + _evenly_spread(down, 5) if up and down else _evenly_spread(up + down, 8)


def _table(rows: list[SpeedRowSchema]) -> Table:
    """Return the table of amplitude and phase over speed."""
    compensated = any(row.order_1x_compensated for row in rows)
    cells = []
    for row in rows:
        one, two = row.order_1x_compensated or row.order_1x, row.order_2x_compensated or row.order_2x
        cells.append(
            (
                _speed(row.speed_rpm, row.ramp_direction),
                f"{_number(one.amplitude_peak_x_um, 1)}∠{_number(one.lag_x_deg)}°",
                f"{_number(one.amplitude_peak_y_um, 1)}∠{_number(one.lag_y_deg)}°",
                f"{_number(two.amplitude_peak_x_um, 1)}, {_number(two.amplitude_peak_y_um, 1)}",
                f"{_number(row.largest_peak_to_peak_x_um)}, {_number(row.largest_peak_to_peak_y_um)}",
                "compensated" if row.order_1x_compensated else "as measured" if compensated else "",
            )
        )
    headings = ("r/min", "1X x µm∠lag", "1X y µm∠lag", "2X x, y µm", "overall x, y µm pp")
    return text_table((*headings, "compensated: run-out subtracted" if compensated else ""), cells, n_left=1)


def _speed(speed_rpm: float | None, direction: RampDirection) -> str:
    """Return a speed with an arrow for run-up or run-down."""
    return f"{_number(speed_rpm)} {'▲' if direction is RampDirection.RUN_UP else '▼'}"


def _verdict(summary: SummarySchema) -> str:
    """Return whether the recording is complete, and how many samples are lost."""
    if summary.is_gap_free:
        return "complete, no samples lost"
    if not summary.segments:
        return "INCOMPLETE: the recording breaks off"
    bound = "" if summary.lost_is_exact else "at least "
    return f"INCOMPLETE: {bound}{summary.lost_samples:,} samples lost"


def _segments(summary: SummarySchema) -> Iterator[Labelled]:
    """Yield why a complete run ended, or the segments of an incomplete one with their ends."""
    if summary.is_gap_free:
        yield from (("end", segment.detail) for segment in summary.segments if segment.detail)
        return
    for segment in summary.segments:
        bound = "" if segment.lost_is_exact else "at least "
        lost = f", {bound}{segment.lost_samples:,} lost" if segment.lost_samples or bound else ""
        detail = f": {segment.detail}" if segment.detail else ""
        text = f"{segment.samples:,} samples, then {segment.end_reason.value}{lost}{detail}"
        yield f"segment {segment.segment}", text


def _markers(summary: SummarySchema) -> Iterator[Labelled]:
    for marker in summary.markers:
        if marker.kind is MarkerKind.ALARM:  # printed as an alarm
            continue
        where = f"segment {marker.segment}, " if len(summary.segments) > 1 else ""
        yield "marker", f"{where}{_number(marker.time_s, 1)} s  “{marker.text}”"


def _speeds(summary: SummarySchema) -> str:
    if summary.lowest_speed_rpm is None:
        return "speed unknown: the tacho gave no speed"
    return f"{_number(summary.lowest_speed_rpm)}–{_number(summary.highest_speed_rpm)} r/min"


def _largest(summary: SummarySchema) -> str:
    worst = max(summary.probes, key=lambda probe: probe.largest_peak_to_peak_um or 0.0, default=None)
    if worst is None or worst.largest_at is None:
        return "no vibration measured"
    at = worst.largest_at
    where = f"at {_number(at.speed_rpm)} r/min" if at.speed_rpm is not None else f"at {at.time_s:.1f} s"
    verdict = "" if summary.severity is Severity.NORMAL else f" ({summary.severity.value.upper()})"
    part = f"{100.0 * (worst.largest_clearance_fraction or 0.0):.0f} % of the clearance"
    others = ((getattr(summary, measure.full_name), measure.unit) for measure in LARGEST_OVERALL.rows[1:])
    also = "".join(f", {value:.3g} {unit}" for value, unit in others if value is not None)
    return f"max {_number(worst.largest_peak_to_peak_um)} µm pp on {worst.name} {where}, {part}{verdict}{also}"


def _tacho_warnings(tacho: TachoSummarySchema) -> Iterator[str]:
    others = {state: count for state, count in tacho.snapshots_by_state.items() if state.value != "good"}
    total = sum(tacho.snapshots_by_state.values())
    for state, count in others.items():
        if count > 0.02 * total:
            yield f"tacho: {state.value} for {100 * count / total:.0f} % of the run"
    if tacho.filled or tacho.rejected:
        yield f"tacho: {tacho.pulses:,} pulses, {tacho.filled:,} filled in, {tacho.rejected:,} edges rejected"
    if tacho.phase_reference_is_arbitrary:
        yield "tacho: marks are indistinguishable: phases refer to the first seen and cannot be compared between runs"
    if tacho.counter is not None and tacho.counter.message:
        yield f"tacho: {tacho.counter.message}"


def _warnings(summary: SummarySchema) -> Iterator[str]:
    for probe in summary.probes:
        if not probe.gap_ok:
            low, high = _number(probe.gap_min_v, 2), _number(probe.gap_max_v, 2)
            yield f"probe {probe.name}: gap voltage {low} to {high} V left its window"
        if probe.samples_beyond_calibration:
            part = 100 * probe.samples_beyond_calibration / max(summary.samples, 1)
            yield f"probe {probe.name}: {part:.2g} % of the samples are outside its calibrated range (extrapolated)"
    if any(summary.clipped_samples):
        yield f"clipped samples by channel: {', '.join(f'{n:,}' for n in summary.clipped_samples)}"
    if summary.tacho is not None:
        yield from _tacho_warnings(summary.tacho)


def _evenly_spread(rows: list[SpeedRowSchema], max_rows: int) -> list[SpeedRowSchema]:
    """Return at most `max_rows` rows, evenly spread, first and last included."""
    if len(rows) <= max_rows:
        return rows
    return [rows[round(k * (len(rows) - 1) / (max_rows - 1))] for k in range(max_rows)]


def _number(value: float | None, decimals: int = 0) -> str:
    return "?" if value is None else f"{value:,.{decimals}f}"
