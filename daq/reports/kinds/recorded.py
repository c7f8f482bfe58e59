"""Analyses as the live analysis recorded them: spectra and orbits of frames, vectors over speed, maps of spectra.

Maps are thinned to the resolution of a screen: each cell holds the largest amplitude of its frames and orders.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from analysis.signals.snapshot import OrderFrame, Snapshot
from analysis.signals.units import MICROMETRE, RPM, phase_lag_degrees
from analysis.spectra.full_spectrum import full_spectrum
from analysis.spectra.waterfall import order_axis
from analysis.vectors.speed_curve import SpeedRow
from daq.reports.analysis_result import AnalysisResult, columns
from daq.reports.errors import DataNotFoundError
from daq.reports.kinds.spectra import map_result, peaks
from daq.reports.kinds.vectors import ARROWS, PEAK_UNIT
from daq.reports.parameters import (
    CascadeQuery,
    FullSpectrumQuery,
    MapLines,
    OrbitQuery,
    OrderSpectrumQuery,
    VectorsQuery,
    WaterfallQuery,
)
from daq.reports.plots.layouts import FULL_SPECTRUM_LABEL, RampCurve, bode, orbit, polar, spectrum
from daq.reports.plots.panel import Panel, Values
from daq.reports.run_samples import RunSamples

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
RECORDED_ORDERS = (1.0, 2.0)


def recorded_order_spectrum(run: RunSamples, query: OrderSpectrumQuery) -> AnalysisResult:
    """Return the order spectrum of the frame nearest to a time or speed."""
    snapshot, frame = run.recorded_frame(query)
    sizes, lags = np.abs(frame.spectrum) / MICROMETRE, phase_lag_degrees(frame.spectrum)
    title = _title(run, "order spectrum", snapshot, frame)
    rows = list(zip("xy", sizes.tolist(), strict=True))
    return AnalysisResult(
        title=title,
        columns=columns(
            order=frame.orders,
            amplitude_peak_x_um=sizes[0],
            lag_x_deg=lags[0],
            amplitude_peak_y_um=sizes[1],
            lag_y_deg=lags[1],
        ),
        panels=tuple(spectrum(title, "order", PEAK_UNIT, frame.orders.tolist(), rows)),
        scalars={**_frame_scalars(snapshot, frame), "noise_peak_um": frame.noise / MICROMETRE},
        representative_rows=peaks(sizes.max(axis=0)),
    )


def recorded_full_spectrum(run: RunSamples, query: FullSpectrumQuery) -> AnalysisResult:
    """Return the forward and backward components of the frame nearest to a time or speed."""
    snapshot, frame = run.recorded_frame(query)
    sides = full_spectrum(frame.orders, frame.spectrum, run.pair)
    sizes, forward, backward = sides.amplitudes / MICROMETRE, np.abs(sides.forward), np.abs(sides.backward)
    uncertain = np.concatenate(
        [(sides.uncertain & (backward <= forward))[:0:-1], sides.uncertain & (forward <= backward)]
    )
    title = _title(run, "full spectrum", snapshot, frame)
    axis = sides.axis.tolist()
    return AnalysisResult(
        title=title,
        columns=columns(order=sides.axis, amplitude_peak_um=sizes, uncertain=np.where(uncertain, "yes", "no")),
        panels=tuple(spectrum(title, FULL_SPECTRUM_LABEL, PEAK_UNIT, axis, [("", sizes.tolist())])),
        scalars=_frame_scalars(snapshot, frame),
        representative_rows=peaks(sizes),
    )


def recorded_orbit(run: RunSamples, query: OrbitQuery) -> AnalysisResult:
    """Return the orbit of the frame nearest to a time or speed, also minus run-out where that is known."""
    snapshot, frame = run.recorded_frame(query)
    points, title = run.header.settings.points_per_revolution, _title(run, "orbit", snapshot, frame)
    index = np.arange(frame.orbit.shape[1])
    motion = frame.orbit / MICROMETRE
    table = {
        "revolution": index // points,
        "angle_deg": index % points * 360.0 / points,
        "X_um": motion[0],
        "Y_um": motion[1],
    }
    panels = [orbit(title, _turns(motion, points), run.probe_angles)]
    if frame.compensated_orbit is not None:
        compensated = frame.compensated_orbit / MICROMETRE
        table |= {"compensated_X_um": compensated[0], "compensated_Y_um": compensated[1]}
        turns = _turns(compensated, points)
        panels.insert(0, orbit(title, turns, run.probe_angles, "compensated: minus run-out"))
    return AnalysisResult(
        title=title,
        columns=columns(**table),
        panels=tuple(panels),
        scalars={**_frame_scalars(snapshot, frame), "clearance_um": run.header.limits.clearance / MICROMETRE},
    )


def _title(run: RunSamples, name: str, snapshot: Snapshot, frame: OrderFrame) -> str:
    return f"{run.header.run} · recorded {name} · {frame.speed / RPM:,.0f} r/min at {snapshot.time:.1f} s"


def _frame_scalars(snapshot: Snapshot, frame: OrderFrame) -> dict[str, float]:
    """Return the position of a frame in the run."""
    return {
        "segment": float(snapshot.segment),
        "sample": float(snapshot.sample),
        "time_s": snapshot.time,
        "speed_rpm": frame.speed / RPM,
        "acceleration_rpm_per_s": frame.acceleration / RPM,
    }


def _turns(motion: FloatArray, points: int) -> list[tuple[Values, Values]]:
    """Return the revolutions of an orbit, shape (2, n)."""
    xs, ys = motion.tolist()
    return [(xs[k : k + points], ys[k : k + points]) for k in range(0, len(xs), points)]


def recorded_bode(run: RunSamples, query: VectorsQuery) -> AnalysisResult:
    """Return the vectors of 1X or 2X over speed as a Bode plot."""
    return _vectors(run, query, lambda title, what, ramps: bode(title, what, PEAK_UNIT, ramps))


def recorded_polar(run: RunSamples, query: VectorsQuery) -> AnalysisResult:
    """Return the vectors of 1X or 2X over speed as a polar plot; a lag of 0 points to the probe."""
    zeros = run.probe_angles
    return _vectors(run, query, lambda title, what, ramps: polar(title, what, PEAK_UNIT, ramps, zeros))


def _vectors(
    run: RunSamples, query: VectorsQuery, drawn: Callable[[str, str, list[RampCurve]], list[Panel]]
) -> AnalysisResult:
    if query.order not in RECORDED_ORDERS:
        raise DataNotFoundError(f"order: {query.order:g}, recorded are 1 and 2; source=samples computes any order")
    rows, order = run.history().summary.rows, int(query.order)
    vectors, compensated = _of_order(rows, order)
    scatter = np.array([row.scatter[order - 1] for row in rows]).reshape(-1, 2).T / MICROMETRE
    table = _by_probe("amplitude_peak_{}_um", np.abs(vectors) / MICROMETRE)
    table |= _by_probe("scatter_peak_{}_um", scatter) | _by_probe("lag_{}_deg", phase_lag_degrees(vectors))
    if np.isfinite(compensated).any():
        table |= _by_probe("compensated_peak_{}_um", np.abs(compensated) / MICROMETRE)
        table |= _by_probe("compensated_lag_{}_deg", phase_lag_degrees(compensated))
    what, ramps = ramp_curves(rows, order)
    return AnalysisResult(
        title=f"{run.header.run} · recorded {what}",
        columns=columns(
            ramp_direction=np.array([row.direction.value for row in rows], dtype=np.str_),
            speed_rpm=np.array([row.speed for row in rows]) / RPM,
            **{name: table[name] for name in sorted(table, key=lambda name: "_y_" in name)},
            frames=np.array([row.frames for row in rows], dtype=np.int64),
        ),
        panels=tuple(drawn(run.header.run, what, ramps)),
    )


def _of_order(rows: Sequence[SpeedRow], order: int) -> tuple[ComplexArray, ComplexArray]:
    """Return the vectors of an order, as measured and minus run-out, shape (2, n), m peak."""
    vectors, compensated = ([getattr(row, name)[order - 1] for row in rows] for name in ("vectors", "compensated"))
    return np.array(vectors).reshape(-1, 2).T, np.array(compensated).reshape(-1, 2).T


def _by_probe(name: str, values: FloatArray) -> dict[str, FloatArray]:
    return {name.format(probe): row for probe, row in zip("xy", values, strict=True)}


def ramp_curves(rows: Sequence[SpeedRow], order: int) -> tuple[str, list[RampCurve]]:
    """Return the name and the curves of 1X or 2X over speed, run-up and run-down separately.

    Where the run-out is known, only compensated vectors are shown.
    """
    vectors, compensated = _of_order(rows, order)
    known = np.isfinite(compensated).all(axis=0)
    is_compensated = bool(known.any())
    shown = compensated if is_compensated else vectors
    directions = np.array([row.direction.value for row in rows], dtype=np.str_)
    curves = []
    for direction, arrow in ARROWS.items():
        index = np.flatnonzero((directions == direction.value) & (known | (not is_compensated)))
        if index.size:
            speeds = [rows[k].speed / RPM for k in index.tolist()]
            sizes, lags = np.abs(shown[:, index]) / MICROMETRE, phase_lag_degrees(shown[:, index])
            curves.append(RampCurve(arrow, speeds, _values(sizes), _values(lags)))
    if len(curves) == 1:
        curves = [replace(curves[0], arrow="")]
    return f"{order}X{' compensated' if is_compensated else ''}", curves


def _values(by_probe: FloatArray) -> tuple[Values, Values]:
    """Return the values at both probes, None where unknown."""
    x, y = ([value if math.isfinite(value) else None for value in row] for row in by_probe.tolist())
    return x, y


def recorded_cascade(run: RunSamples, query: CascadeQuery) -> AnalysisResult:
    """Return order spectra over speed, from 0 to the highest speed."""
    history = run.history()
    if not np.isfinite(history.frame_speed).any():
        raise DataNotFoundError("no order spectrum in the run")
    width = np.nanmax(history.frame_speed) / query.rows
    row_of = _bins(history.frame_speed, width, query.rows)
    feet = (np.unique(row_of[row_of >= 0]) + 0.5) * width / RPM
    orders, sizes = _largest(run, query, row_of)
    title = f"{run.header.run} · recorded cascade"
    return map_result(title, query.lines, orders, {"speed_rpm": feet}, sizes, PEAK_UNIT)


def recorded_waterfall(run: RunSamples, query: WaterfallQuery) -> AnalysisResult:
    """Return order spectra over a time interval, by default of the longest segment."""
    history = run.history()
    has_frame = np.isfinite(history.frame_speed)
    longest = int(np.bincount(history.segment[has_frame]).argmax()) if has_frame.any() else 0
    segment = longest if query.segment is None else query.segment
    end = np.inf if query.duration_s is None else query.from_s + query.duration_s
    chosen = has_frame & (history.segment == segment) & (history.time >= query.from_s) & (history.time <= end)
    if not chosen.any():
        raise DataNotFoundError(f"no order spectrum in segment {segment} from {query.from_s:g} s")
    passed = np.where(chosen, history.time - query.from_s, np.nan)
    width = max(np.nanmax(passed) / query.rows, 1e-9)
    row_of = _bins(passed, width, query.rows)
    rows = np.unique(row_of[row_of >= 0])
    speeds = np.array([history.frame_speed[row_of == row].mean() for row in rows]) / RPM
    feet = query.from_s + (rows + 0.5) * width
    orders, sizes = _largest(run, query, row_of)
    title = f"{run.header.run} · recorded waterfall"
    return map_result(title, query.lines, orders, {"time_s": feet, "speed_rpm": speeds}, sizes, PEAK_UNIT)


def _bins(values: FloatArray, width: float, rows: int) -> NDArray[np.intp]:
    """Return the row of each value; the highest value falls into the last row, NaN gives -1."""
    row = np.minimum(np.nan_to_num(values / width, nan=-1.0), rows - 1)
    return np.floor(row).astype(np.intp)


def _largest(
    run: RunSamples, query: CascadeQuery | WaterfallQuery, row_of: NDArray[np.intp]
) -> tuple[FloatArray, FloatArray]:
    """Return the lowest order of each column, and the largest amplitude of each cell of the rows with frames, µm."""
    orders = order_axis(run.header.settings)
    axis = np.concatenate([-orders[:0:-1], orders]) if query.lines is MapLines.FULL else orders
    cells = np.zeros((query.rows, axis.size))
    for row, snapshot in zip(row_of.tolist(), run.snapshots(), strict=False):
        if row >= 0 and snapshot.frame is not None:
            np.maximum(cells[row], _amplitudes(run, query, snapshot.frame), out=cells[row])
    shown = np.abs(axis) <= query.highest_order
    axis, cells = axis[shown], cells[np.unique(row_of[row_of >= 0])][:, shown]
    starts = np.arange(0, axis.size, -(-axis.size // query.columns))
    return axis[starts], np.maximum.reduceat(cells, starts, axis=1) / MICROMETRE


def _amplitudes(run: RunSamples, query: CascadeQuery | WaterfallQuery, frame: OrderFrame) -> FloatArray:
    """Return the amplitudes of a frame, m peak: of the larger probe, or the radii of the full spectrum."""
    if query.lines is MapLines.FULL:
        return full_spectrum(frame.orders, frame.spectrum, run.pair).amplitudes
    amplitudes: FloatArray = np.abs(frame.spectrum).max(axis=0)
    return amplitudes
