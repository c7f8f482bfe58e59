"""Overall vibration: the peak-to-peak of the waveform as it is, all orders together, and the room that it takes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.shaft.extremes import glitch_samples, trimmed_extremes
from analysis.signals.displacement import require_displacement
from analysis.signals.errors import RecordTooShortError

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Overall:
    """Overall vibration of successive intervals.

    Parameters
    ----------
    peak_to_peak : ndarray of float64, shape (2, n)
        At the probes x and y, m peak-to-peak.
    times : ndarray of float64, shape (n,)
        Middle of each interval, s.
    left_out : int
        Samples at either extreme of an interval that do not count, where a sensor's glitches lie: a steady sine reads
        low by (pi left_out / samples)² / 2 for it.
    clearance : float
        Radius of the circle that the shaft can move in, m.
    """

    peak_to_peak: FloatArray
    times: FloatArray
    left_out: int
    clearance: float

    @property
    def clearance_part(self) -> FloatArray:
        """Vibration over the clearance's diameter, shape (2, n): 1 is all the room there is."""
        return np.asarray(self.peak_to_peak / (2.0 * self.clearance), dtype=np.float64)


def overall(displacement: FloatArray, rate: float, clearance: float, *, interval: float = 0.1) -> Overall:
    """Return the overall vibration of a record, unfiltered, as standards judge it.

    Parameters
    ----------
    displacement : ndarray of float64, shape (2, n)
        Towards the probes x and y, uniformly in time, m.
    rate : float
        Sample rate, Hz.
    clearance : float
        Radius of the circle that the shaft can move in, m.
    interval : float
        s; a turn at least.

    Raises
    ------
    RecordTooShortError
        Where the record is shorter than an interval.

    Notes
    -----
    Twice a line's amplitude is its peak-to-peak for a single line alone; limits are set to the waveform's (API 670;
    ISO 20816-1).
    """
    require_displacement(displacement, rate)
    if not (clearance > 0.0 and interval * rate >= 2.0):
        raise ValueError(f"clearance {clearance} m, interval {interval} s: expected above 0, two samples or more")
    size = round(interval * rate)
    count = displacement.shape[1] // size
    if count == 0:
        raise RecordTooShortError(f"{displacement.shape[1]} samples, expected at least {size} for an interval")
    intervals = displacement[:, : count * size].reshape(2, count, size)
    left_out = glitch_samples(size, rate)
    low, high = trimmed_extremes(intervals.reshape(-1, size), left_out)
    return Overall(
        peak_to_peak=(high - low).reshape(2, count),
        times=(np.arange(count) + 0.5) * size / rate,
        left_out=left_out,
        clearance=clearance,
    )
