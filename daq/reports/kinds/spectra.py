"""Order spectrum, full spectrum and frequency spectrum."""

import numpy as np
from numpy.typing import NDArray

from analysis.signals.uncertainty import noise_floor_sigma, phase_sigma
from analysis.signals.units import MICROMETRE, phase_lag_degrees
from analysis.spectra.frequency_spectrum import frequency_spectrum
from analysis.spectra.full_spectrum import full_spectrum, probe_mismatch
from analysis.spectra.order_map import Scaling, order_map
from analysis.spectra.windows import WINDOWS
from daq.reports.analysis_result import AnalysisResult
from daq.reports.columns import columns
from daq.reports.errors import translated_errors
from daq.reports.kinds.prepared_record import record_before_frame
from daq.reports.parameters import FrequencySpectrumQuery, FullSpectrumQuery, OrderSpectrumQuery
from daq.reports.plots.layouts import FULL_SPECTRUM_LABEL, spectrum
from daq.reports.run_samples import RunSamples

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
        found = order_map(
            prepared.record, revolutions=query.revolutions, overlap=0.0, highest_order=query.highest_order,
            window=WINDOWS[query.window],
        )  # fmt: skip
    size = found.amplitudes(query.scaling)[:, 0] / MICROMETRE
    sigma = float(noise_floor_sigma(found.noise)[0])
    vectors = found.spectrum[:, 0]
    lag = phase_lag_degrees(vectors)
    angle = found.orders * found.angle_sigma[0]  # the phase error of an order is the angle error times the order
    lag_sigma = np.degrees(phase_sigma(np.abs(vectors), np.full(vectors.shape, sigma), angle, 1.0))
    name = query.scaling.value.replace("-", "_")
    table = {
        "order": found.orders,
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
        panels=tuple(spectrum(title, "order", UNITS[query.scaling], found.orders.tolist(), rows, caption)),
        scalars={f"sigma_{name}_um": scaled, "noise_peak_um": float(found.noise[0]) / MICROMETRE, **prepared.scalars},
        remarks=prepared.remarks,
        representative_rows=peaks(size.max(axis=0)),
    )


def analyse_full_spectrum(run: RunSamples, query: FullSpectrumQuery) -> AnalysisResult:
    """Return the forward and backward components of the last revolutions before a time."""
    prepared = record_before_frame(run, query, query.revolutions, query.highest_order)
    with translated_errors(f"run {run.header.run}"):
        lines = order_map(
            prepared.record, revolutions=query.revolutions, overlap=0.0, highest_order=query.highest_order
        )
    mismatch = probe_mismatch(lines)
    found = full_spectrum(lines.orders, lines.spectrum[:, 0], lines.pair, mismatch)
    size = found.amplitudes / MICROMETRE
    smaller = found.uncertain & (np.abs(found.backward) <= np.abs(found.forward))
    larger = found.uncertain & ~smaller
    uncertain = np.where(np.concatenate([smaller[:0:-1], larger]), "yes", "no")
    sigma = float(noise_floor_sigma(lines.noise)[0]) / np.sqrt(2.0) / MICROMETRE
    scalars = {"sigma_peak_um": sigma, **prepared.scalars}
    if mismatch.is_determined:
        scalars["probe_gain_mismatch"] = mismatch.gain
    title = f"{run.header.run} · full spectrum{prepared.title_suffix} · {prepared.position}"
    caption = f"hann window over {query.revolutions} revolutions; ± {sigma:.3g} µm (1 σ of the noise)"
    return AnalysisResult(
        title=title,
        columns=columns(order=found.axis, amplitude_peak_um=size, uncertain=uncertain),
        panels=tuple(
            spectrum(
                title, FULL_SPECTRUM_LABEL, UNITS[Scaling.PEAK], found.axis.tolist(), [("", size.tolist())], caption
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
        found = frequency_spectrum(displacement, run.rate, resolution=query.resolution_hz)
    is_shown = found.frequencies <= query.highest_hz
    frequencies, (x, y) = found.frequencies[is_shown], found.amplitudes[:, is_shown] / MICROMETRE
    begin, end = span.first / run.rate, span.stop / run.rate
    title = f"{run.header.run} · frequency spectrum · {begin:.1f} to {end:.1f} s"
    caption = (
        f"hann window, lines of {found.noise_bandwidth:.3g} Hz, mean of {found.frames}; "
        f"noise ± {100 * found.relative_sigma:.0f} % (1 σ)"
    )
    rows = [("x", x.tolist()), ("y", y.tolist())]
    return AnalysisResult(
        title=title,
        columns=columns(frequency_hz=frequencies, amplitude_peak_x_um=x, amplitude_peak_y_um=y),
        panels=tuple(spectrum(title, "frequency, Hz", UNITS[Scaling.PEAK], frequencies.tolist(), rows, caption)),
        scalars={
            "noise_bandwidth_hz": found.noise_bandwidth,
            "frames": float(found.frames),
            "relative_sigma": found.relative_sigma,
        },
        representative_rows=peaks(np.maximum(x, y)),
    )


def peaks(size: FloatArray) -> NDArray[np.intp]:
    """Return the indices of the largest local maxima in rising order."""
    inner = size[1:-1]
    tops = np.flatnonzero((inner > size[:-2]) & (inner >= size[2:])) + 1
    largest = tops[np.argsort(size[tops])[::-1][:MAX_PEAKS]]
    return np.sort(largest) if largest.size else np.array([int(np.argmax(size))])
