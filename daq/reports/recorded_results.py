"""Trend, cascade and waterfall of the recorded results of a run, thinned to the resolution of a screen."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from analysis.signals.header import Role, RunHeader
from analysis.signals.probes import ProbePair
from analysis.signals.snapshot import OrderFrame, Snapshot
from analysis.spectra.full_spectrum import full_spectrum
from analysis.spectra.waterfall import order_axis
from daq.reports.errors import DataNotFoundError
from daq.reports.parameters import RecordedCascadeQuery, RecordedWaterfallQuery
from daq.reports.run_history import RunHistory
from daq.schemas.results import CascadeSchema, TrendSchema, Values, WaterfallSchema
from daq.schemas.units import finite, lags_degrees, micrometres, rpm
from daq.session.offline import results
from recordings.mcap.reader import RunReader

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]


def cascade(path: Path, found: RunHistory, query: RecordedCascadeQuery) -> CascadeSchema:
    """Return order spectra over speed, from 0 to the highest speed."""
    has_frame = np.isfinite(found.frame_speed)
    if not has_frame.any():
        raise DataNotFoundError("no order spectrum in the run")
    width = found.frame_speed[has_frame].max() / query.rows
    orders, amplitudes, rows = _largest(path, found, _bins(found.frame_speed, width, query.rows), query)
    return CascadeSchema(
        run=found.header.run,
        speeds_rpm=tuple(rpm(speed) for speed in ((rows + 0.5) * width).tolist()),
        orders=orders,
        amplitude_peak_um=amplitudes,
    )


def waterfall(path: Path, found: RunHistory, query: RecordedWaterfallQuery) -> WaterfallSchema:
    """Return order spectra over the requested time interval."""
    of_segment = (found.segment == query.segment) & np.isfinite(found.frame_speed)
    end = np.inf if query.duration_s is None else query.from_s + query.duration_s
    chosen = of_segment & (found.time >= query.from_s) & (found.time <= end)
    if not chosen.any():
        raise DataNotFoundError(f"no order spectrum in segment {query.segment} from {query.from_s:g} s")
    passed = np.where(chosen, found.time - query.from_s, np.nan)
    width = max(np.nanmax(passed) / query.rows, 1e-9)
    row_of = _bins(passed, width, query.rows)
    orders, amplitudes, rows = _largest(path, found, row_of, query)
    speeds = [found.frame_speed[row_of == row].mean() for row in rows]
    return WaterfallSchema(
        run=found.header.run,
        segment=query.segment,
        times_s=tuple(finite(time) for time in (query.from_s + (rows + 0.5) * width).tolist()),
        speeds_rpm=tuple(rpm(speed) for speed in speeds),
        orders=orders,
        amplitude_peak_um=amplitudes,
    )


def _bins(values: FloatArray, width: float, rows: int) -> IntArray:
    """Return the row of each value; the highest value falls into the last row, NaN gives -1."""
    row = np.minimum(np.nan_to_num(values / width, nan=-1.0), rows - 1)
    return np.floor(row).astype(np.intp)


def _largest(
    path: Path, found: RunHistory, row_of: IntArray, query: RecordedCascadeQuery | RecordedWaterfallQuery
) -> tuple[Values, tuple[Values, ...], IntArray]:
    """Return the orders of the columns, the largest amplitude of each cell, and the rows with frames.

    Parameters
    ----------
    path : Path
        The run's file.
    found : RunHistory
        Results of the run.
    row_of : ndarray of int, shape (n,)
        Row of each snapshot; -1 for none.
    query : RecordedCascadeQuery or RecordedWaterfallQuery
        Number of rows and columns, and type of the spectra.
    """
    orders, amplitude = _spectrum_of(found.header, full=query.full)
    cells = np.zeros((query.rows, orders.size))
    with RunReader(path) as reader:
        snapshots = (item for item in results(reader) if isinstance(item, Snapshot))
        for row, snapshot in zip(row_of.tolist(), snapshots, strict=False):
            if row >= 0 and snapshot.frame is not None:
                np.maximum(cells[row], amplitude(snapshot.frame), out=cells[row])
    rows = np.unique(row_of[row_of >= 0])
    shown = np.abs(orders) <= (np.inf if query.highest_order is None else query.highest_order)
    orders, cells = orders[shown], cells[:, shown]
    starts = np.arange(0, orders.size, -(-orders.size // query.columns))
    thinned = np.maximum.reduceat(cells[rows], starts, axis=1)
    table = tuple(tuple(micrometres(value) for value in row) for row in thinned.tolist())
    return tuple(finite(order) for order in orders[starts].tolist()), table, rows


def _spectrum_of(header: RunHeader, *, full: bool) -> tuple[FloatArray, Callable[[OrderFrame], FloatArray]]:
    """Return the order axis and a function for a frame's amplitudes, m peak: larger probe, or radius if ``full``."""
    orders = order_axis(header.settings)
    if not full:
        return orders, lambda frame: np.abs(frame.spectrum).max(axis=0)
    x, y = (header.acquisition.channels[header.acquisition.row(role)] for role in (Role.PROBE_X, Role.PROBE_Y))
    pair = ProbePair(x.angle, y.angle)
    axis = np.concatenate([-orders[:0:-1], orders])
    return axis, lambda frame: full_spectrum(frame.orders, frame.spectrum, pair).amplitudes


def trend_schema(found: RunHistory, segment: int | None, begin: float, end: float, entries: int) -> TrendSchema:
    """Return the trend over time.

    Parameters
    ----------
    found : RunHistory
        Results of the run.
    segment : int or None
        Only this segment.
    begin, end : float
        Only results between these times in their segment, s.
    entries : int
        Approximate maximum number of entries; each segment begins a new entry.
    """
    chosen = (found.time >= begin) & (found.time <= end)
    if segment is not None:
        chosen &= found.segment == segment
    index = np.flatnonzero(chosen)
    width = max(-(-index.size // entries), 1)
    position = np.arange(index.size)
    segments = found.segment[index]
    new_segment = np.flatnonzero(np.diff(segments, prepend=segments[:1] - 1))
    begun = new_segment[np.searchsorted(new_segment, position, side="right") - 1] if index.size else position
    starts = np.flatnonzero((position - begun) % width == 0)
    last = np.append(starts[1:], index.size) - 1 if index.size else starts
    one_x, one_y = np.abs(found.vectors)

    def minimum(values: FloatArray) -> list[float]:
        return np.fmin.reduceat(values[index], starts).tolist() if index.size else []

    def maximum(values: FloatArray) -> list[float]:
        return np.fmax.reduceat(values[index], starts).tolist() if index.size else []

    order, size = _largest_whirls(found.whirl_order[index], found.whirl_amplitude[index], starts)
    lag_x, lag_y = (lags_degrees(vector[index][last]) for vector in found.vectors)
    return TrendSchema(
        run=found.header.run,
        results_per_entry=width,
        segment=tuple(segments[last].tolist()),
        time_s=tuple(finite(value) for value in found.time[index][last].tolist()),
        speed_min_rpm=tuple(map(rpm, minimum(found.speed))),
        speed_max_rpm=tuple(map(rpm, maximum(found.speed))),
        peak_to_peak_min_x_um=tuple(map(micrometres, minimum(found.peak_to_peak[0]))),
        peak_to_peak_max_x_um=tuple(map(micrometres, maximum(found.peak_to_peak[0]))),
        peak_to_peak_min_y_um=tuple(map(micrometres, minimum(found.peak_to_peak[1]))),
        peak_to_peak_max_y_um=tuple(map(micrometres, maximum(found.peak_to_peak[1]))),
        order_1x_min_x_um=tuple(map(micrometres, minimum(one_x))),
        order_1x_max_x_um=tuple(map(micrometres, maximum(one_x))),
        order_1x_min_y_um=tuple(map(micrometres, minimum(one_y))),
        order_1x_max_y_um=tuple(map(micrometres, maximum(one_y))),
        order_1x_lag_x_deg=lag_x,
        order_1x_lag_y_deg=lag_y,
        whirl_order=tuple(map(finite, order)),
        whirl_peak_um=tuple(map(micrometres, size)),
    )


def _largest_whirls(
    orders: FloatArray, amplitudes: FloatArray, starts: NDArray[np.intp]
) -> tuple[list[float], list[float]]:
    """Return order and amplitude of the largest whirl of each entry; NaN without one."""
    stops = np.append(starts[1:], orders.size)
    found = []
    for start, stop in zip(starts.tolist(), stops.tolist(), strict=False):
        largest = start + int(np.argmax(np.nan_to_num(amplitudes[start:stop], nan=-1.0)))
        found.append((float(orders[largest]), float(amplitudes[largest])))
    return [order for order, _ in found], [size for _, size in found]
