"""The summary of a run as text for the terminal."""

from collections.abc import Iterator
from itertools import groupby

from analysis.signals.blocks import RampDirection
from analysis.signals.header import Severity
from daq.cli.terminal import print_json, print_lines
from daq.schemas.events import AlarmSchema
from daq.schemas.summary import SpeedRowSchema, SummarySchema, TachoSummarySchema
from daq.schemas.vibration import AgreementSchema
from daq.session.recording.statistics import MAX_BUFFER_FILL
from recordings.mcap.results import MarkerKind


def print_summary(summary: SummarySchema, *, as_json: bool) -> None:
    """Print a run's summary on standard output, as JSON or text."""
    if as_json:
        print_json(summary)
    else:
        print_lines(summary_lines(summary))


def summary_lines(summary: SummarySchema) -> Iterator[str]:
    """Yield a run's summary as text, line by line."""
    yield f"run {summary.run}  {summary.duration_s:.1f} s  {summary.samples:,} samples per channel" + (
        f"  “{summary.note}”" if summary.note else ""
    )
    if not summary.samples:
        yield f"{_verdict(summary)}  nothing was recorded"
        yield from _segments(summary)
        yield from _markers(summary)
        return
    yield "  ".join((_verdict(summary), _speeds(summary), _largest(summary)))
    yield from _segments(summary)
    if summary.clock_error_ppm is not None:
        uncertainty = _number(summary.clock_uncertainty_ppm, 1)
        yield f"clock            the card's {summary.clock_error_ppm:+,.1f} ± {uncertainty} ppm against this computer's"
    yield from _backlog(summary)
    yield from _tacho(summary)
    for alarm in summary.alarms:
        yield f"alarm            {_alarm(alarm)}"
    yield from _standards(summary)
    yield from _markers(summary)
    for warning in _warnings(summary):
        yield f"warning          {warning}"
    yield from _runout(summary)
    yield from _table(summary)
    if not summary.sub_synchronous:
        yield "sub-synchronous  none"
    for k, whirl in enumerate(summary.sub_synchronous):
        label = "sub-synchronous" if k == 0 else ""
        begin, end = (
            _speed(whirl.begin.speed_rpm, whirl.begin_ramp_direction),
            _speed(whirl.end.speed_rpm, whirl.end_ramp_direction),
        )
        order, size, way = _number(whirl.order, 2), _number(whirl.largest_peak_um, 1), whirl.direction.value
        yield f"{label:15}  {order}X from {begin} to {end} r/min, {way}, up to {size} µm"
    for each in summary.hysteresis:
        onset, end, width = _number(each.onset_rpm), _number(each.end_rpm), each.width_rpm or 0.0
        apart = f"{_number(abs(width))} r/min {'lower' if width >= 0.0 else 'higher'}"
        order = _number(each.order, 2)
        yield f"hysteresis       {order}X starts at {onset} on the run-up, ends at {end} on the run-down: {apart}"
    if summary.agreement is None:
        yield "model            not compared: its prediction was not ready"
    else:
        for k, line in enumerate(_model(summary.agreement)):
            yield f"{'model' if k == 0 else '':15}  {line}"


def _backlog(summary: SummarySchema) -> Iterator[str]:
    """Yield the largest backlog as a fraction of the card's buffer, which loses samples when full."""
    backlog, buffer = summary.largest_backlog_s, summary.buffer_s
    if backlog is not None and buffer:
        fraction = backlog / buffer
        advice = "; close other programs or lower timing.rate_hz" if fraction > MAX_BUFFER_FILL else ""
        filled = f"{100 * fraction:.0f} %{advice}"
        yield f"backlog          at most {backlog:.2f} s in the card's buffer of {buffer:.3g} s, {filled}"


def _tacho(summary: SummarySchema) -> Iterator[str]:
    """Yield the source of speed and phase, where a counter is connected."""
    if summary.tacho is not None and summary.tacho.counter is not None:
        compared = f"{summary.tacho.counter.compared:,} edges of counter and samples compared"
        yield f"tacho            speed and phase from the {summary.tacho.reference}; {compared}"


def _standards(summary: SummarySchema) -> Iterator[str]:
    """Yield the standards' limits at the speed of the largest vibration; scope and source are in the JSON summary."""
    known = [each for each in summary.standards if each.limit_peak_to_peak_um is not None]
    if known:
        limits = "; ".join(
            f"{standard} {', '.join(f'{each.name} {_number(each.limit_peak_to_peak_um)}' for each in figures)}"
            for standard, figures in groupby(known, key=lambda each: each.standard)
        ).replace("zone boundary ", "")
        yield f"for information  {limits} µm pp at that speed; no standard covers floating-ring bearings"


def _runout(summary: SummarySchema) -> Iterator[str]:
    """Yield the run-out that was subtracted, or why none was."""
    runout = summary.runout
    if runout is None:
        return
    below = "" if runout.slow_roll_rpm is None else f" up to {_number(runout.slow_roll_rpm)} r/min"
    if runout.order_1x is None:
        yield f"run-out          unknown: no {runout.source}{below}; 1X and 2X are as measured"
        return
    one = runout.order_1x
    x = f"x {_number(one.amplitude_peak_x_um, 1)} µm ∠{_number(one.lag_x_deg)}°"
    y = f"y {_number(one.amplitude_peak_y_um, 1)} µm ∠{_number(one.lag_y_deg)}°"
    yield f"run-out          at 1X {x}, {y}, from {runout.source}{below}; subtracted where marked compensated"


def _alarm(alarm: AlarmSchema) -> str:
    """Return an alarm's quantity, time, speed and largest value."""
    speed = "" if alarm.begin.speed_rpm is None else f", {_number(alarm.begin.speed_rpm)} r/min"
    end = "to the end" if alarm.end is None else f"until {_number(alarm.end.time_s, 1)} s"
    name = alarm.name.replace(alarm.severity.value, alarm.severity.value.upper())
    return f"{name} from {_number(alarm.begin.time_s, 1)} s{speed} {end}, up to {alarm.message}"


def _model(agreement: AgreementSchema) -> Iterator[str]:
    """Yield the comparison with the model: 1X, then each whirl."""
    one = agreement.synchronous
    if one is None:
        yield "1X not compared: no steady speed within the model's range"
    elif one.agrees_to_rpm is None:
        median, lag = _number(one.median_amplitude_ratio, 2), _number(one.median_lag_difference_deg)
        worst, at = _number(one.worst_amplitude_ratio, 2), _number(one.worst_amplitude_at_rpm)
        yield f"1X measured/predicted {median}, lag {lag}° larger (medians); worst {worst} at {at} r/min"
    else:
        part, lag = 100 * (one.within_amplitude_ratio or 0.0), _number(one.within_lag_difference_deg)
        yield f"1X within {part:.0f} % and {lag}° up to {_number(one.agrees_to_rpm)} r/min"
    for whirl in agreement.whirls:
        predicted = (
            "none predicted"
            if whirl.predicted_order is None
            else f"predicted from {_number(whirl.predicted_onset_rpm)} r/min ({_number(whirl.predicted_order, 2)}X)"
        )
        if whirl.measured_order is not None:
            measured = f"measured from {_number(whirl.measured_onset_rpm)} ({_number(whirl.measured_order, 2)}X)"
        else:
            measured = "not measured" if whirl.was_reached else "not reached"
        yield f"whirl {predicted}, {measured}"


def _table(summary: SummarySchema) -> Iterator[str]:
    """Yield up to ten rows of amplitude and phase by speed; the JSON summary has all."""
    up = [row for row in summary.by_speed if row.frames and row.ramp_direction is RampDirection.RUN_UP]
    down = [row for row in reversed(summary.by_speed) if row.frames and row.ramp_direction is RampDirection.RUN_DOWN]
    rows = _evenly_spread(up, 5) + _evenly_spread(down, 5) if up and down else _evenly_spread(up + down, 8)
    compensated = any(row.order_1x_compensated for row in rows)
    if rows:
        note = "   compensated: run-out subtracted" if compensated else ""
        yield f"   r/min     1X x µm∠lag   1X y µm∠lag   2X x, y µm   overall x, y µm pp{note}"
    for row in rows:
        one, two = row.order_1x_compensated or row.order_1x, row.order_2x_compensated or row.order_2x
        x = f"{_number(one.amplitude_peak_x_um, 1)}∠{_number(one.lag_x_deg)}°"
        y = f"{_number(one.amplitude_peak_y_um, 1)}∠{_number(one.lag_y_deg)}°"
        second = f"{_number(two.amplitude_peak_x_um, 1)}, {_number(two.amplitude_peak_y_um, 1)}"
        overall = f"{_number(row.largest_peak_to_peak_x_um)}, {_number(row.largest_peak_to_peak_y_um)}"
        which = "   compensated" if row.order_1x_compensated else "   as measured" if compensated else ""
        speed = _speed(row.speed_rpm, row.ramp_direction)
        yield f"{speed:>10}   {x:>11}   {y:>11}   {second:>10}   {overall:>18}{which}"


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


def _segments(summary: SummarySchema) -> Iterator[str]:
    """Yield why a complete run ended, or the segments of an incomplete one with their ends."""
    if summary.is_gap_free:
        yield from (f"{'end':15}  {segment.detail}" for segment in summary.segments if segment.detail)
        return
    for segment in summary.segments:
        bound = "" if segment.lost_is_exact else "at least "
        lost = f", {bound}{segment.lost_samples:,} lost" if segment.lost_samples or bound else ""
        detail = f": {segment.detail}" if segment.detail else ""
        yield f"segment {segment.segment:<8} {segment.samples:,} samples, then {segment.end_reason.value}{lost}{detail}"


def _markers(summary: SummarySchema) -> Iterator[str]:
    for marker in summary.markers:
        if marker.kind is MarkerKind.ALARM:  # printed as an alarm
            continue
        where = f"segment {marker.segment}, " if len(summary.segments) > 1 else ""
        yield f"marker           {where}{_number(marker.time_s, 1)} s  “{marker.text}”"


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
    return f"max {_number(worst.largest_peak_to_peak_um)} µm pp on {worst.name} {where}, {part}{verdict}"


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
