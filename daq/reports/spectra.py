"""Many order spectra in one picture: against speed (cascade) or time (waterfall), thinned to what a screen shows."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from analysis.signals.header import Role, RunHeader
from analysis.signals.orbit import ProbePair
from analysis.signals.snapshot import OrderFrame, Snapshot
from analysis.spectra.full_spectrum import full_spectrum
from analysis.spectra.waterfall import order_axis
from daq.reports.questions import CascadeQuery, WaterfallQuery
from daq.reports.records import NoSuchMomentError, Records
from daq.schemas.results import CascadeDocument, Values, WaterfallDocument
from daq.schemas.units import finite, micrometres, rpm
from daq.session.offline import results
from recordings.mcap.reader import RunReader

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]


def cascade(path: Path, found: Records, query: CascadeQuery) -> CascadeDocument:
    """Return spectra over speed, from 0 to the highest."""
    has_frame = np.isfinite(found.frame_speed)
    if not has_frame.any():
        raise NoSuchMomentError("no order spectrum in the run")
    width = found.frame_speed[has_frame].max() / query.rows
    orders, amplitudes, rows = _largest(path, found, _bins(found.frame_speed, width, query.rows), query)
    return CascadeDocument(
        run=found.header.run,
        speeds_rpm=tuple(rpm(speed) for speed in ((rows + 0.5) * width).tolist()),
        orders=orders,
        amplitude_peak_um=amplitudes,
    )


def waterfall(path: Path, found: Records, query: WaterfallQuery) -> WaterfallDocument:
    """Return spectra over time, from the begin of the stretch that is asked for to its end."""
    of_segment = (found.segment == query.segment) & np.isfinite(found.frame_speed)
    end = np.inf if query.duration_s is None else query.from_s + query.duration_s
    chosen = of_segment & (found.time >= query.from_s) & (found.time <= end)
    if not chosen.any():
        raise NoSuchMomentError(f"no order spectrum in segment {query.segment} from {query.from_s:g} s")
    passed = np.where(chosen, found.time - query.from_s, np.nan)
    width = max(np.nanmax(passed) / query.rows, 1e-9)
    row_of = _bins(passed, width, query.rows)
    orders, amplitudes, rows = _largest(path, found, row_of, query)
    speeds = [found.frame_speed[row_of == row].mean() for row in rows]
    return WaterfallDocument(
        run=found.header.run,
        segment=query.segment,
        times_s=tuple(finite(time) for time in (query.from_s + (rows + 0.5) * width).tolist()),
        speeds_rpm=tuple(rpm(speed) for speed in speeds),
        orders=orders,
        amplitude_peak_um=amplitudes,
    )


def _bins(values: FloatArray, width: float, rows: int) -> IntArray:
    """Return the row that each value falls into, the highest into the last; -1 for NaN."""
    row = np.minimum(np.nan_to_num(values / width, nan=-1.0), rows - 1)
    return np.floor(row).astype(np.intp)


def _largest(
    path: Path, found: Records, row_of: IntArray, query: CascadeQuery | WaterfallQuery
) -> tuple[Values, tuple[Values, ...], IntArray]:
    """Return the orders of the columns, the largest amplitude of every cell, and which rows there are.

    Parameters
    ----------
    path : Path
        The run's file.
    found : Records
        Its results.
    row_of : ndarray of int, shape (n,)
        Row of each of its snapshots; -1 for none.
    query : CascadeQuery or WaterfallQuery
        How many rows and columns, and whether of full spectra.
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
    """Return the orders of a spectrum, and what gives a frame's amplitudes, m peak: the larger probe's, or circles."""
    orders = order_axis(header.settings)
    if not full:
        return orders, lambda frame: np.abs(frame.spectrum).max(axis=0)
    x, y = (header.acquisition.channels[header.acquisition.row(role)] for role in (Role.PROBE_X, Role.PROBE_Y))
    pair = ProbePair(x.angle, y.angle)
    axis = np.concatenate([-orders[:0:-1], orders])
    return axis, lambda frame: full_spectrum(frame.orders, frame.spectrum, pair).amplitudes
