"""Synchronous average of a revolution with its residual, and run-out of the slow roll."""

import numpy as np
from numpy.typing import NDArray

from analysis.resampling.angular_record import synchronous_average
from analysis.signals.units import MICROMETRE, RPM
from daq.reports.analysis_result import AnalysisResult
from daq.reports.columns import columns
from daq.reports.errors import translated_errors
from daq.reports.kinds.prepared_record import record_before_frame
from daq.reports.parameters import AverageQuery, SlowRollQuery
from daq.reports.plots.panel import Curve, Panel
from daq.reports.run_samples import MIN_POINTS, RunSamples

FloatArray = NDArray[np.float64]

ANGLE_LABEL = "shaft angle after the keyphasor mark, degrees"


def analyse_synchronous_average(run: RunSamples, query: AverageQuery) -> AnalysisResult:
    """Return the synchronous average before a time, and the RMS residual about it."""
    prepared = record_before_frame(run, query, query.revolutions)
    with translated_errors(f"run {run.header.run}"):
        found = synchronous_average(prepared.record)
    mean = (found.waveform - found.waveform.mean(axis=1, keepdims=True)) / MICROMETRE
    rest = (prepared.record.waveform - found.waveform[:, None]) / MICROMETRE
    residual = np.sqrt(np.mean(rest**2, axis=1))
    sigma = found.sigma / MICROMETRE
    degrees = np.arange(mean.shape[1]) * 360.0 / mean.shape[1]
    title = f"{run.header.run} · synchronous average{prepared.title_suffix} · {prepared.position}"
    caption = f"mean of {found.revolutions} turns; ± {sigma[0]:.2g} µm at x, ± {sigma[1]:.2g} µm at y (1 σ)"
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
    found = run.slow_roll(query.segment, query.slow_roll_rpm, MIN_POINTS)
    waveform, sigma = found.waveform / MICROMETRE, found.sigma / MICROMETRE
    degrees = np.arange(waveform.shape[1]) * 360.0 / waveform.shape[1]
    title = f"{run.header.run} · run-out · {found.slowest / RPM:,.0f} to {found.fastest / RPM:,.0f} r/min"
    x, y = found.peak_to_peak / MICROMETRE
    size = f"x {x:.3g} ± {sigma[0]:.2g}, y {y:.3g} ± {sigma[1]:.2g} µm peak-to-peak"
    verdict = "" if found.drift <= 0.2 else "; THE SHAFT MOVED: 1X drifted"
    one = found.vectors(1)
    return AnalysisResult(
        title=title,
        columns=columns(angle_deg=degrees, runout_x_um=waveform[0], runout_y_um=waveform[1]),
        panels=(_over_angle(title, "µm", degrees, waveform, f"{found.revolutions} turns; {size}{verdict}"),),
        scalars={
            "revolutions": float(found.revolutions),
            "speed_min_rpm": found.slowest / RPM,
            "speed_max_rpm": found.fastest / RPM,
            "runout_sigma_x_um": float(sigma[0]),
            "runout_sigma_y_um": float(sigma[1]),
            "amplitude_peak_x_um": abs(one[0]) / MICROMETRE,
            "amplitude_peak_y_um": abs(one[1]) / MICROMETRE,
            "slow_roll_drift": found.drift,
        },
        remarks=("amplitude: 1X of the run-out",),
    )


def _over_angle(title: str, unit: str, degrees: FloatArray, rows: FloatArray, caption: str) -> Panel:
    turn = [*degrees.tolist(), 360.0]
    curves = tuple(
        Curve(name, turn, [*row.tolist(), float(row[0])]) for name, row in zip(("x", "y"), rows, strict=True)
    )
    return Panel(title, ANGLE_LABEL, unit, curves, caption, x_is_angle=True, y_from_zero=bool((rows >= 0.0).all()))
