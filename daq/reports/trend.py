"""A run's values over time, thinned so that no extreme is lost."""

import numpy as np
from numpy.typing import NDArray

from daq.reports.records import Records
from daq.schemas.results import TrendDocument, Values
from daq.schemas.units import finite, lag_degrees, micrometres, rpm

FloatArray = NDArray[np.float64]


def trend_document(found: Records, segment: int | None, begin: float, end: float, entries: int) -> TrendDocument:
    """Return values over time as a document.

    Parameters
    ----------
    found : Records
        The run's results.
    segment : int or None
        Only this segment.
    begin, end : float
        Only results of this time in their segment, s.
    entries : int
        About so many at most; a segment begins one of its own.
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

    def least(values: FloatArray) -> list[float]:
        return np.fmin.reduceat(values[index], starts).tolist() if index.size else []

    def most(values: FloatArray) -> list[float]:
        return np.fmax.reduceat(values[index], starts).tolist() if index.size else []

    order, size = _largest_whirls(found.whirl_order[index], found.whirl_amplitude[index], starts)
    lag_x, lag_y = (_all_lags(vector[index][last]) for vector in found.vectors)
    return TrendDocument(
        run=found.header.run,
        results_per_entry=width,
        segment=tuple(segments[last].tolist()),
        time_s=tuple(finite(value) for value in found.time[index][last].tolist()),
        speed_least_rpm=tuple(map(rpm, least(found.speed))),
        speed_most_rpm=tuple(map(rpm, most(found.speed))),
        peak_to_peak_least_x_um=tuple(map(micrometres, least(found.peak_to_peak[0]))),
        peak_to_peak_most_x_um=tuple(map(micrometres, most(found.peak_to_peak[0]))),
        peak_to_peak_least_y_um=tuple(map(micrometres, least(found.peak_to_peak[1]))),
        peak_to_peak_most_y_um=tuple(map(micrometres, most(found.peak_to_peak[1]))),
        order_1x_least_x_um=tuple(map(micrometres, least(one_x))),
        order_1x_most_x_um=tuple(map(micrometres, most(one_x))),
        order_1x_least_y_um=tuple(map(micrometres, least(one_y))),
        order_1x_most_y_um=tuple(map(micrometres, most(one_y))),
        order_1x_lag_x_deg=lag_x,
        order_1x_lag_y_deg=lag_y,
        whirl_order=tuple(map(finite, order)),
        whirl_peak_um=tuple(map(micrometres, size)),
    )


def _all_lags(vectors: NDArray[np.complex128]) -> Values:
    return tuple(map(lag_degrees, vectors.tolist()))


def _largest_whirls(
    orders: FloatArray, amplitudes: FloatArray, starts: NDArray[np.intp]
) -> tuple[list[float], list[float]]:
    """Return order and size of the largest whirl of each stretch; NaN where there is none."""
    stops = np.append(starts[1:], orders.size)
    found = []
    for start, stop in zip(starts.tolist(), stops.tolist(), strict=False):
        largest = start + int(np.argmax(np.nan_to_num(amplitudes[start:stop], nan=-1.0)))
        found.append((float(orders[largest]), float(amplitudes[largest])))
    return [order for order, _ in found], [size for _, size in found]
