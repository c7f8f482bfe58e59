"""Results of a recorded run that are no analysis: its trend over time and its components below 1X."""

import numpy as np
from numpy.typing import NDArray

from daq.reports.parameters import TrendQuery
from daq.reports.run_history import RunHistory
from daq.schemas.results import TrendSchema, WhirlFindingsSchema
from daq.schemas.summary import SubSynchronousSchema
from daq.schemas.units import finite, lags_degrees, micrometres, rpm

FloatArray = NDArray[np.float64]


def findings_schema(history: RunHistory) -> WhirlFindingsSchema:
    """Return the components below 1X."""
    findings = tuple(map(SubSynchronousSchema.of, history.summary.whirls))
    return WhirlFindingsSchema(run=history.header.run, sub_synchronous=findings)


def trend_schema(history: RunHistory, query: TrendQuery) -> TrendSchema:
    """Return the trend over time; each segment begins a new entry."""
    end = np.inf if query.duration_s is None else query.from_s + query.duration_s
    chosen = (history.time >= query.from_s) & (history.time <= end)
    if query.segment is not None:
        chosen &= history.segment == query.segment
    index = np.flatnonzero(chosen)
    width = max(-(-index.size // query.entries), 1)
    position = np.arange(index.size)
    segments = history.segment[index]
    new_segment = np.flatnonzero(np.diff(segments, prepend=segments[:1] - 1))
    begun = new_segment[np.searchsorted(new_segment, position, side="right") - 1] if index.size else position
    starts = np.flatnonzero((position - begun) % width == 0)
    last = np.append(starts[1:], index.size) - 1 if index.size else starts
    one_x, one_y = np.abs(history.vectors)

    def minimum(values: FloatArray) -> list[float]:
        return np.fmin.reduceat(values[index], starts).tolist() if index.size else []

    def maximum(values: FloatArray) -> list[float]:
        return np.fmax.reduceat(values[index], starts).tolist() if index.size else []

    order, size = _largest_whirls(history.whirl_order[index], history.whirl_amplitude[index], starts)
    lag_x, lag_y = (lags_degrees(vector[index][last]) for vector in history.vectors)
    return TrendSchema(
        run=history.header.run,
        results_per_entry=width,
        segment=tuple(segments[last].tolist()),
        time_s=tuple(finite(value) for value in history.time[index][last].tolist()),
        speed_min_rpm=tuple(map(rpm, minimum(history.speed))),
        speed_max_rpm=tuple(map(rpm, maximum(history.speed))),
        peak_to_peak_min_x_um=tuple(map(micrometres, minimum(history.peak_to_peak[0]))),
        peak_to_peak_max_x_um=tuple(map(micrometres, maximum(history.peak_to_peak[0]))),
        peak_to_peak_min_y_um=tuple(map(micrometres, minimum(history.peak_to_peak[1]))),
        peak_to_peak_max_y_um=tuple(map(micrometres, maximum(history.peak_to_peak[1]))),
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
    largest_whirls = []
    for start, stop in zip(starts.tolist(), stops.tolist(), strict=False):
        largest = start + int(np.argmax(np.nan_to_num(amplitudes[start:stop], nan=-1.0)))
        largest_whirls.append((float(orders[largest]), float(amplitudes[largest])))
    return [order for order, _ in largest_whirls], [size for _, size in largest_whirls]
