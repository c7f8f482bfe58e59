"""Analyses of the waveform: overall vibration, synchronous average of a revolution, and run-out of the slow roll."""

import numpy as np
from numpy.typing import NDArray

from analysis.resampling.angular_record import synchronous_average
from analysis.shaft.overall import Overall, overall
from analysis.signals.units import MICROMETRE, RPM
from daq.reports.analysis_result import AnalysisResult, columns
from daq.reports.errors import InsufficientDataError, RequestTooLargeError, translated_errors
from daq.reports.parameters import AverageQuery, OverallQuery, SlowRollQuery
from daq.reports.plots.layouts import SPEED_COLOUR
from daq.reports.plots.panel import Curve, Panel, Style
from daq.reports.run_samples import MIN_POINTS, RunSamples, SampleRange, record_before_frame

MAX_INTERVALS = 100_000


def analyse_overall(run: RunSamples, query: OverallQuery) -> AnalysisResult:
    """Return the overall peak-to-peak vibration and the mean speed of each interval."""
    span, limits = run.sample_range(query.segment, query.from_s, query.duration_s), run.header.limits
    parts = list(_parts(run, span, query.interval_s))
    sizes = np.concatenate([part.peak_to_peak for part, _ in parts], axis=1)
    times = np.concatenate([part.times + begin for part, begin in parts])
    remarks: tuple[str, ...] = ()
    speeds = np.full(times.size, np.nan)
    try:
        angle = run.shaft_angle(span)[1]
        half = 0.5 * query.interval_s
        speeds = 2.0 * np.pi * (angle.turns(times + half) - angle.turns(times - half)) / query.interval_s / RPM
    except InsufficientDataError as error:
        remarks = (f"speeds are unknown: {error}",)
    larger = sizes.max(axis=0)
    severity = np.array([limits.severity(value).value for value in larger.tolist()])
    x, y = sizes / MICROMETRE
    at = int(np.argmax(larger))
    title = f"{run.header.run} · overall vibration · {times[0]:.1f} to {times[-1]:.1f} s"
    speed_text = f", {speeds[at]:,.0f} r/min" if np.isfinite(speeds[at]) else ""
    left_out = parts[0][0].excluded_samples
    caption = (
        f"largest {larger[at] / MICROMETRE:.3g} µm at {times[at]:.1f} s{speed_text}, "
        f"{100 * larger[at] / (2.0 * limits.clearance):.0f} % of the clearance; the {left_out} samples at either "
        "extreme are excluded"
    )
    ends = [float(times[0]), float(times[-1])]
    limit_lines = [
        Curve(f"{name} {limit / MICROMETRE:g}", ends, [limit / MICROMETRE] * 2, Style.GUIDE)
        for name, limit in (("alarm", limits.peak_to_peak_alarm), ("danger", limits.peak_to_peak_danger))
    ]
    curves = (Curve("x", times.tolist(), x.tolist()), Curve("y", times.tolist(), y.tolist()), *limit_lines)
    rpm = [None if np.isnan(value) else value for value in speeds.tolist()]
    speed_curve = Curve("", times.tolist(), rpm, colour=SPEED_COLOUR)
    return AnalysisResult(
        title=title,
        columns=columns(
            time_s=times, speed_rpm=speeds, peak_to_peak_x_um=x, peak_to_peak_y_um=y,
            clearance_fraction_x=sizes[0] / (2.0 * limits.clearance),
            clearance_fraction_y=sizes[1] / (2.0 * limits.clearance),
            severity=severity,
        ),
        panels=(
            Panel(title, "time, s", "displacement, µm peak-to-peak", curves, caption),
            Panel("speed", "time, s", "speed, r/min", (speed_curve,), x_range=(ends[0], ends[1])),
        ),
        scalars={"peak_to_peak_max_um": float(larger[at]) / MICROMETRE},
        remarks=remarks,
    )  # fmt: skip


def _parts(run: RunSamples, span: SampleRange, interval: float) -> list[tuple[Overall, float]]:
    """Return the levels of successive chunks of whole intervals, each with its start time in the segment, s."""
    size = max(round(interval * run.rate), 2)
    count = (span.stop - span.first) // size
    if count > MAX_INTERVALS:
        raise RequestTooLargeError(f"{count:,} intervals, expected at most {MAX_INTERVALS:,}: request longer intervals")
    if count == 0:
        raise InsufficientDataError(f"run {run.header.run}: the requested time is shorter than {interval:g} s")
    together = max(run.chunk_size // size, 1)
    parts = []
    for low in range(0, count, together):
        first = span.first + low * size
        piece = SampleRange(span.segment, first, span.first + min(low + together, count) * size)
        with translated_errors(f"run {run.header.run}"):
            part = overall(
                run.displacement(piece, task=""), run.rate, run.header.limits.clearance, interval=size / run.rate
            )
        parts.append((part, first / run.rate))
        run.report_progress("reading samples", min(low + together, count) / count)
    return parts


FloatArray = NDArray[np.float64]

ANGLE_LABEL = "shaft angle after the keyphasor mark, degrees"


def analyse_synchronous_average(run: RunSamples, query: AverageQuery) -> AnalysisResult:
    """Return the synchronous average before a time, and the RMS residual about it."""
    prepared = record_before_frame(run, query, query.revolutions)
    with translated_errors(f"run {run.header.run}"):
        average = synchronous_average(prepared.record)
    mean = (average.waveform - average.waveform.mean(axis=1, keepdims=True)) / MICROMETRE
    rest = (prepared.record.waveform - average.waveform[:, None]) / MICROMETRE
    residual = np.sqrt(np.mean(rest**2, axis=1))
    sigma = average.sigma / MICROMETRE
    degrees = np.arange(mean.shape[1]) * 360.0 / mean.shape[1]
    title = f"{run.header.run} · synchronous average{prepared.title_suffix} · {prepared.position}"
    caption = f"mean of {average.revolutions} turns; ± {sigma[0]:.2g} µm at x, ± {sigma[1]:.2g} µm at y (1 σ)"
    return AnalysisResult(
        title=title,
        columns=columns(
            angle_deg=degrees,
            average_x_um=mean[0],
            average_y_um=mean[1],
            residual_rms_x_um=residual[0],
            residual_rms_y_um=residual[1],
        ),
        panels=(
            _over_angle(title, "µm", degrees, mean, caption),
            _over_angle("RMS residual", "µm RMS", degrees, residual, ""),
        ),
        scalars={"average_sigma_x_um": float(sigma[0]), "average_sigma_y_um": float(sigma[1]), **prepared.scalars},
        remarks=prepared.remarks,
    )


def analyse_slow_roll(run: RunSamples, query: SlowRollQuery) -> AnalysisResult:
    """Return the run-out measured in the slow roll of the run."""
    slow_roll = run.slow_roll(query.segment, query.slow_roll_rpm, MIN_POINTS)
    waveform, sigma = slow_roll.waveform / MICROMETRE, slow_roll.sigma / MICROMETRE
    degrees = np.arange(waveform.shape[1]) * 360.0 / waveform.shape[1]
    title = f"{run.header.run} · run-out · {slow_roll.slowest / RPM:,.0f} to {slow_roll.fastest / RPM:,.0f} r/min"
    x, y = slow_roll.peak_to_peak / MICROMETRE
    size = f"x {x:.3g} ± {sigma[0]:.2g}, y {y:.3g} ± {sigma[1]:.2g} µm peak-to-peak"
    verdict = "" if slow_roll.drift <= 0.2 else "; THE SHAFT MOVED: 1X drifted"
    one = slow_roll.vectors(1)
    return AnalysisResult(
        title=title,
        columns=columns(angle_deg=degrees, runout_x_um=waveform[0], runout_y_um=waveform[1]),
        panels=(_over_angle(title, "µm", degrees, waveform, f"{slow_roll.revolutions} turns; {size}{verdict}"),),
        scalars={
            "revolutions": float(slow_roll.revolutions),
            "speed_min_rpm": slow_roll.slowest / RPM,
            "speed_max_rpm": slow_roll.fastest / RPM,
            "runout_sigma_x_um": float(sigma[0]),
            "runout_sigma_y_um": float(sigma[1]),
            "amplitude_peak_x_um": abs(one[0]) / MICROMETRE,
            "amplitude_peak_y_um": abs(one[1]) / MICROMETRE,
            "slow_roll_drift": slow_roll.drift,
        },
        remarks=("amplitude: 1X of the run-out",),
    )


def _over_angle(title: str, unit: str, degrees: FloatArray, rows: FloatArray, caption: str) -> Panel:
    turn = [*degrees.tolist(), 360.0]
    curves = tuple(
        Curve(name, turn, [*row.tolist(), float(row[0])]) for name, row in zip(("x", "y"), rows, strict=True)
    )
    return Panel(title, ANGLE_LABEL, unit, curves, caption, x_is_angle=True, y_from_zero=bool((rows >= 0.0).all()))
