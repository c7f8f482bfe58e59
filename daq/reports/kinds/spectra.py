"""Order, full and frequency spectra: at a time, over speed (cascade) and over time (waterfall)."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from analysis.signals.uncertainty import noise_floor_sigma, phase_sigma
from analysis.signals.units import MICROMETRE, RPM, phase_lag_degrees
from analysis.spectra.frequency_spectrum import frequency_map, frequency_spectrum
from analysis.spectra.full_spectrum import full_spectrum, probe_mismatch
from analysis.spectra.order_map import Scaling, order_map
from analysis.spectra.windows import WINDOWS, Window
from daq.reports.analysis_result import AnalysisResult, columns
from daq.reports.errors import InsufficientDataError, RequestTooLargeError, translated_errors
from daq.reports.parameters import (
    CascadeQuery,
    FrequencySpectrumQuery,
    FullSpectrumQuery,
    MapLines,
    MapQuery,
    OrderSpectrumQuery,
    WaterfallQuery,
)
from daq.reports.plots.layouts import FULL_SPECTRUM_LABEL, components, spectrum, stacked
from daq.reports.plots.panel import Curve, Style, Values
from daq.reports.run_samples import RunSamples, record_before_frame, record_over_interval

FloatArray = NDArray[np.float64]

MAX_PEAKS = 16  # lines shown in a terminal
UNITS = {
    Scaling.PEAK: "µm zero-to-peak",
    Scaling.PEAK_TO_PEAK: "µm peak-to-peak",
    Scaling.RMS: "µm RMS",
}


def analyse_order_spectrum(run: RunSamples, query: OrderSpectrumQuery) -> AnalysisResult:
    """Return the order spectrum of the last revolutions before a time."""
    prepared = record_before_frame(run, query, query.revolutions, query.highest_order)
    with translated_errors(f"run {run.header.run}"):
        spectra = order_map(
            prepared.record, revolutions=query.revolutions, overlap=0.0, highest_order=query.highest_order,
            window=WINDOWS[query.window],
        )  # fmt: skip
    size = spectra.amplitudes(query.scaling)[:, 0] / MICROMETRE
    sigma = float(noise_floor_sigma(spectra.noise)[0])
    vectors = spectra.spectrum[:, 0]
    lag = phase_lag_degrees(vectors)
    angle = spectra.orders * spectra.angle_sigma[0]  # the phase error of an order is the angle error times the order
    lag_sigma = np.degrees(phase_sigma(np.abs(vectors), np.full(vectors.shape, sigma), angle, 1.0))
    name = query.scaling.value.replace("-", "_")
    table = {
        "order": spectra.orders,
        f"amplitude_{name}_x_um": size[0],
        "lag_x_deg": lag[0],
        "lag_sigma_x_deg": lag_sigma[0],
        f"amplitude_{name}_y_um": size[1],
        "lag_y_deg": lag[1],
        "lag_sigma_y_deg": lag_sigma[1],
    }
    scaled = sigma / MICROMETRE * query.scaling.factor
    title = f"{run.header.run} · order spectrum{prepared.title_suffix} · {prepared.position}"
    caption = f"{query.window.value} window over {query.revolutions} revolutions; ± {scaled:.3g} µm (1 σ of the noise)"
    rows = list(zip("xy", size.tolist(), strict=True))
    return AnalysisResult(
        title=title,
        columns=columns(**table),
        panels=tuple(
            spectrum(
                title, "order", UNITS[query.scaling], spectra.orders.tolist(), rows, caption, WINDOWS[query.window]
            )
        ),
        scalars={f"sigma_{name}_um": scaled, "noise_peak_um": float(spectra.noise[0]) / MICROMETRE, **prepared.scalars},
        remarks=(
            *(_components(probe, spectra.orders.tolist(), row, WINDOWS[query.window]) for probe, row in rows),
            *prepared.remarks,
        ),
        representative_rows=peaks(size.max(axis=0)),
    )


def _components(probe: str, orders: Values, row: Values, window: Window) -> str:
    """Return the largest components of a spectrum, interpolated between its lines."""
    largest = ", ".join(f"{order:.3g}X {size:.3g} µm" for order, size in components(orders, row, window))
    return f"largest components at {probe}: {largest}"


def analyse_full_spectrum(run: RunSamples, query: FullSpectrumQuery) -> AnalysisResult:
    """Return the forward and backward components of the last revolutions before a time."""
    prepared = record_before_frame(run, query, query.revolutions, query.highest_order)
    with translated_errors(f"run {run.header.run}"):
        lines = order_map(
            prepared.record, revolutions=query.revolutions, overlap=0.0, highest_order=query.highest_order
        )
    mismatch = probe_mismatch(lines)
    spectra = full_spectrum(lines.orders, lines.spectrum[:, 0], lines.pair, mismatch)
    size = spectra.amplitudes / MICROMETRE
    smaller = spectra.uncertain & (np.abs(spectra.backward) <= np.abs(spectra.forward))
    larger = spectra.uncertain & ~smaller
    uncertain = np.where(np.concatenate([smaller[:0:-1], larger]), "yes", "no")
    sigma = float(noise_floor_sigma(lines.noise)[0]) / np.sqrt(2.0) / MICROMETRE
    scalars = {"sigma_peak_um": sigma, **prepared.scalars}
    if mismatch.is_determined:
        scalars["probe_gain_mismatch"] = mismatch.gain
    title = f"{run.header.run} · full spectrum{prepared.title_suffix} · {prepared.position}"
    caption = f"hann window over {query.revolutions} revolutions; ± {sigma:.3g} µm (1 σ of the noise)"
    return AnalysisResult(
        title=title,
        columns=columns(order=spectra.axis, amplitude_peak_um=size, uncertain=uncertain),
        panels=tuple(
            spectrum(
                title, FULL_SPECTRUM_LABEL, UNITS[Scaling.PEAK], spectra.axis.tolist(), [("", size.tolist())], caption
            )
        ),
        scalars=scalars,
        remarks=prepared.remarks,
        representative_rows=peaks(size),
    )


def analyse_frequency_spectrum(run: RunSamples, query: FrequencySpectrumQuery) -> AnalysisResult:
    """Return the frequency spectrum averaged over a time interval."""
    span = run.sample_range(query.segment, query.from_s, query.duration_s)
    displacement = run.displacement(span)
    run.report_progress("computing")
    with translated_errors(f"run {run.header.run}"):
        spectra = frequency_spectrum(displacement, run.rate, resolution=query.resolution_hz)
    is_shown = spectra.frequencies <= query.highest_hz
    frequencies, (x, y) = spectra.frequencies[is_shown], spectra.amplitudes[:, is_shown] / MICROMETRE
    begin, end = span.first / run.rate, span.stop / run.rate
    title = f"{run.header.run} · frequency spectrum · {begin:.1f} to {end:.1f} s"
    caption = (
        f"hann window, lines of {spectra.noise_bandwidth:.3g} Hz, mean of {spectra.frames}; "
        f"noise ± {100 * spectra.relative_sigma:.0f} % (1 σ)"
    )
    rows = [("x", x.tolist()), ("y", y.tolist())]
    return AnalysisResult(
        title=title,
        columns=columns(frequency_hz=frequencies, amplitude_peak_x_um=x, amplitude_peak_y_um=y),
        panels=tuple(spectrum(title, "frequency, Hz", UNITS[Scaling.PEAK], frequencies.tolist(), rows, caption)),
        scalars={
            "noise_bandwidth_hz": spectra.noise_bandwidth,
            "frames": float(spectra.frames),
            "relative_sigma": spectra.relative_sigma,
        },
        representative_rows=peaks(np.maximum(x, y)),
    )


def peaks(size: FloatArray) -> NDArray[np.intp]:
    """Return the indices of the largest local maxima in rising order."""
    inner = size[1:-1]
    tops = np.flatnonzero((inner > size[:-2]) & (inner >= size[2:])) + 1
    largest = tops[np.argsort(size[tops])[::-1][:MAX_PEAKS]]
    return np.sort(largest) if largest.size else np.array([int(np.argmax(size))])


MAX_ROWS = 400
Y_LABELS = {"speed_rpm": "speed, r/min", "time_s": "time, s"}
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
    spectra = _spectra(run, query)
    number = np.round(spectra.speeds / query.width_rpm)
    if not np.isfinite(number).any():
        raise InsufficientDataError(f"run {run.header.run}: the speed is unknown over the whole interval")
    feet, sizes = _largest(spectra, number)
    guides = _guides(query.lines, feet * query.width_rpm, float(spectra.axis[-1]))
    by_row = {"speed_rpm": feet * query.width_rpm}
    return _result(run, query, spectra, "cascade", by_row, sizes, guides)


def analyse_waterfall(run: RunSamples, query: WaterfallQuery) -> AnalysisResult:
    """Return the largest amplitudes of each time bin."""
    spectra = _spectra(run, query)
    width = max((spectra.times[-1] - spectra.times[0]) / query.rows, 1e-9)
    number = np.minimum(np.floor((spectra.times - spectra.times[0]) / width), query.rows - 1)
    feet, sizes = _largest(spectra, number)
    times = spectra.times[0] + (feet + 0.5) * width
    return _result(run, query, spectra, "waterfall", {"time_s": times}, sizes, ())


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
        spectra = frequency_map(displacement, run.rate, None, resolution=query.resolution_hz, highest=query.highest_hz)
    length = 1.0 / query.resolution_hz
    times = spectra.times + begin
    speeds = np.full(times.size, np.nan)
    if angle is not None:
        speeds = 60.0 * (angle.turns(times + 0.5 * length) - angle.turns(times - 0.5 * length)) / length
    caption = f"hann window, lines of {spectra.noise_bandwidth:.3g} Hz, µm zero-to-peak; a changing speed smears orders"
    sigma = spectra.sigma / MICROMETRE
    sizes = spectra.amplitudes.max(axis=0) / MICROMETRE
    return _Spectra(spectra.frequencies, sizes, times, speeds, sigma, "frequency {}", caption, remarks)


def _largest(spectra: _Spectra, number: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the bins with spectra and the largest amplitudes of each."""
    bins = np.unique(number[np.isfinite(number)])
    if bins.size > MAX_ROWS:
        raise RequestTooLargeError(f"{bins.size} spectra, expected at most {MAX_ROWS}: request wider bins")
    return bins, np.stack([spectra.sizes[number == one].max(axis=0) for one in bins])


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
    run: RunSamples, query: MapQuery, spectra: _Spectra, name: str, by_row: Mapping[str, FloatArray], sizes: FloatArray,
    guides: tuple[Curve, ...],
) -> AnalysisResult:  # fmt: skip
    scalars = {"sigma_peak_um": float(np.median(spectra.sigma)), "frames": float(spectra.times.size)}
    title = f"{run.header.run} · {spectra.title.format(name)}"
    result = map_result(title, query.lines, spectra.axis, by_row, sizes, spectra.caption, guides)
    return replace(result, scalars=scalars, remarks=spectra.remarks)


def map_result(
    title: str,
    lines: MapLines,
    axis: FloatArray,
    by_row: Mapping[str, FloatArray],
    sizes: FloatArray,
    caption: str,
    guides: tuple[Curve, ...] = (),
) -> AnalysisResult:
    """Return a map of spectra as a table and as stacked spectra.

    Parameters
    ----------
    title : str
        Displayed title.
    lines : MapLines
        Type of the spectra.
    axis : ndarray of float64, shape (n_lines,)
        Orders, or frequencies, Hz.
    by_row : mapping of str to ndarray, shape (n,)
        Columns with one value for each spectrum; the first, "speed_rpm" or "time_s", is its baseline.
    sizes : ndarray of float64, shape (n, n_lines)
        µm zero-to-peak.
    caption : str
        Settings.
    guides : tuple of Curve
        Guide lines.
    """
    column, feet = next(iter(by_row.items()))
    n_lines = axis.size
    is_order = lines is not MapLines.FREQUENCIES
    picked = np.unique(np.linspace(0, feet.size - 1, min(24, feet.size)).round().astype(np.intp))
    rows = axis.tolist(), feet.tolist(), sizes.tolist()
    return AnalysisResult(
        title=title,
        columns=columns(
            **{name: np.repeat(values, n_lines) for name, values in by_row.items()},
            **{"order" if is_order else "frequency_hz": np.tile(axis, feet.size)},
            amplitude_peak_um=sizes.ravel(),
        ),
        panels=(stacked(title, X_LABELS[lines], Y_LABELS[column], *rows, caption, guides),),
        representative_rows=picked * n_lines + sizes[picked].argmax(axis=1),
    )
