"""Overall vibration over time, compared with the limits and the clearance."""

import numpy as np

from analysis.shaft.overall import Overall, overall
from analysis.signals.units import MICROMETRE, RPM
from daq.reports.analysis_result import AnalysisResult
from daq.reports.columns import columns
from daq.reports.errors import InsufficientDataError, RequestTooLargeError, translated_errors
from daq.reports.parameters import OverallQuery
from daq.reports.plots.layouts import SPEED_COLOUR
from daq.reports.plots.panel import Curve, Panel, Style
from daq.reports.run_samples import RunSamples, SampleRange

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
    found = []
    for low in range(0, count, together):
        first = span.first + low * size
        piece = SampleRange(span.segment, first, span.first + min(low + together, count) * size)
        with translated_errors(f"run {run.header.run}"):
            part = overall(
                run.displacement(piece, task=""), run.rate, run.header.limits.clearance, interval=size / run.rate
            )
        found.append((part, first / run.rate))
        run.report_progress("reading samples", min(low + together, count) / count)
    return found
