"""Cascade and waterfall: order, full or frequency spectra over speed or time."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.signals.uncertainty import noise_floor_sigma
from analysis.signals.units import MICROMETRE, RPM
from analysis.spectra.frequency_spectrum import frequency_map
from analysis.spectra.full_spectrum import full_spectrum, probe_mismatch
from analysis.spectra.order_map import order_map
from daq.reports.analysis_result import AnalysisResult
from daq.reports.columns import columns
from daq.reports.errors import InsufficientDataError, RequestTooLargeError, translated_errors
from daq.reports.kinds.prepared_record import record_over_interval
from daq.reports.parameters import CascadeQuery, MapLines, MapQuery, WaterfallQuery
from daq.reports.plots.layouts import FULL_SPECTRUM_LABEL, stacked
from daq.reports.plots.panel import Curve, Style
from daq.reports.run_samples import RunSamples

FloatArray = NDArray[np.float64]

MAX_ROWS = 400
X_LABELS = {MapLines.ORDERS: "order", MapLines.FULL: FULL_SPECTRUM_LABEL, MapLines.FREQUENCIES: "frequency, Hz"}


@dataclass(frozen=True, slots=True, eq=False)
class _Spectra:
    """Spectra of successive frames.

    Parameters
    ----------
    axis : ndarray of float64, shape (n_lines,)
        Orders, or frequencies, Hz.
    sizes : ndarray of float64, shape (n, n_lines)
        µm zero-to-peak.
    times, speeds, sigma : ndarray of float64, shape (n,)
        s, r/min and µm; NaN where the speed is unknown.
    title, caption : str
        Title with a placeholder for the kind of map, and settings.
    remarks : tuple of str
        Notes on the spectra.
    """

    axis: FloatArray
    sizes: FloatArray
    times: FloatArray
    speeds: FloatArray
    sigma: FloatArray
    title: str
    caption: str
    remarks: tuple[str, ...]


def analyse_cascade(run: RunSamples, query: CascadeQuery) -> AnalysisResult:
    """Return the largest amplitudes of each speed bin."""
    found = _spectra(run, query)
    number = np.round(found.speeds / query.width_rpm)
    if not np.isfinite(number).any():
        raise InsufficientDataError(f"run {run.header.run}: the speed is unknown over the whole interval")
    feet, sizes = _largest(found, number)
    guides = _guides(query.lines, feet * query.width_rpm, float(found.axis[-1]))
    return _result(run, query, found, "cascade", feet * query.width_rpm, sizes, "r/min", guides)


def analyse_waterfall(run: RunSamples, query: WaterfallQuery) -> AnalysisResult:
    """Return the largest amplitudes of each time bin."""
    found = _spectra(run, query)
    width = max((found.times[-1] - found.times[0]) / query.rows, 1e-9)
    number = np.minimum(np.floor((found.times - found.times[0]) / width), query.rows - 1)
    feet, sizes = _largest(found, number)
    times = found.times[0] + (feet + 0.5) * width
    return _result(run, query, found, "waterfall", times, sizes, "s", ())


def _spectra(run: RunSamples, query: MapQuery) -> _Spectra:
    if query.lines is MapLines.FREQUENCIES:
        return _of_frequencies(run, query)
    prepared = record_over_interval(run, query, query.highest_order)
    run.report_progress("computing")
    with translated_errors(f"run {run.header.run}"):
        lines = order_map(prepared.record, revolutions=query.revolutions, highest_order=query.highest_order)
    sigma = noise_floor_sigma(lines.noise) / MICROMETRE
    axis, sizes = lines.orders, lines.amplitudes().max(axis=0)
    if query.lines is MapLines.FULL:
        full = full_spectrum(lines.orders, lines.spectrum, lines.pair, probe_mismatch(lines))
        axis, sizes, sigma = full.axis, full.amplitudes, sigma / np.sqrt(2.0)
    title = f"{'full ' if query.lines is MapLines.FULL else ''}{{}}{prepared.title_suffix}"
    caption = f"hann window over {query.revolutions} revolutions, µm zero-to-peak; ± {np.median(sigma):.2g} µm (1 σ)"
    return _Spectra(axis, sizes / MICROMETRE, lines.times, lines.speeds / RPM, sigma, title, caption, prepared.remarks)


def _of_frequencies(run: RunSamples, query: MapQuery) -> _Spectra:
    span = run.sample_range(query.segment, query.from_s, query.duration_s)
    remarks: tuple[str, ...] = ()
    try:
        angle = run.shaft_angle(span)[1]
    except InsufficientDataError as error:
        angle, remarks = None, (f"speeds are unknown: {error}",)
    displacement = run.displacement(span)
    run.report_progress("computing")
    begin = span.first / run.rate
    with translated_errors(f"run {run.header.run}"):
        found = frequency_map(displacement, run.rate, None, resolution=query.resolution_hz, highest=query.highest_hz)
    length = 1.0 / query.resolution_hz
    times = found.times + begin
    speeds = np.full(times.size, np.nan)
    if angle is not None:
        speeds = 60.0 * (angle.turns(times + 0.5 * length) - angle.turns(times - 0.5 * length)) / length
    caption = f"hann window, lines of {found.noise_bandwidth:.3g} Hz, µm zero-to-peak; a changing speed smears orders"
    sigma = found.sigma / MICROMETRE
    sizes = found.amplitudes.max(axis=0) / MICROMETRE
    return _Spectra(found.frequencies, sizes, times, speeds, sigma, "frequency {}", caption, remarks)


def _largest(found: _Spectra, number: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the bins with spectra and the largest amplitudes of each."""
    bins = np.unique(number[np.isfinite(number)])
    if bins.size > MAX_ROWS:
        raise RequestTooLargeError(f"{bins.size} spectra, expected at most {MAX_ROWS}: request wider bins")
    return bins, np.stack([found.sizes[number == one].max(axis=0) for one in bins])


def _guides(lines: MapLines, speeds: FloatArray, highest: float) -> tuple[Curve, ...]:
    """Return guide lines at 0.5X, 1X and 2X in frequency spectra."""
    if lines is not MapLines.FREQUENCIES:
        return ()
    ends = np.array([speeds.min(), speeds.max()])
    curves = []
    for order in (0.5, 1.0, 2.0):
        at = order * ends / 60.0
        if at[1] <= highest:
            curves.append(Curve(f"{order:g}X", at.tolist(), ends.tolist(), Style.GUIDE))
    return tuple(curves)


def _result(
    run: RunSamples, query: MapQuery, found: _Spectra, name: str, feet: FloatArray, sizes: FloatArray, unit: str,
    guides: tuple[Curve, ...],
) -> AnalysisResult:  # fmt: skip
    is_order = query.lines is not MapLines.FREQUENCIES
    across = {MapLines.ORDERS: "order", MapLines.FULL: FULL_SPECTRUM_LABEL, MapLines.FREQUENCIES: "frequency, Hz"}[
        query.lines
    ]
    title = f"{run.header.run} · {found.title.format(name)}"
    rows, lines = sizes.shape
    table = {
        "speed_rpm" if unit == "r/min" else "time_s": np.repeat(feet, lines),
        "order" if is_order else "frequency_hz": np.tile(found.axis, rows),
        "amplitude_peak_um": sizes.ravel(),
    }
    label = f"speed, {unit}" if unit == "r/min" else f"time, {unit}"
    panel = stacked(title, across, label, found.axis.tolist(), feet.tolist(), sizes.tolist(), found.caption, guides)
    picked = np.unique(np.linspace(0, rows - 1, min(24, rows)).round().astype(np.intp))
    return AnalysisResult(
        title=title,
        columns=columns(**table),
        panels=(panel,),
        scalars={"sigma_peak_um": float(np.median(found.sigma)), "frames": float(found.times.size)},
        remarks=found.remarks,
        representative_rows=picked * lines + sizes[picked].argmax(axis=1),
    )
