"""Overall vibration: the peak-to-peak of the waveform as it is, all orders together, and the room that it takes.

The extremes of many samples but for a few at either end, sooner than by ranking all of them.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.signals.errors import RecordTooShortError
from analysis.signals.probes import require_displacement

FloatArray = NDArray[np.float64]

SUBSAMPLING = 16  # of so many samples one is looked at first
SUBSAMPLE_MARGIN = 8  # samples of that sketch, beyond those that belong to the few
GLITCH_TIME = 2e-4  # s at either extreme of an interval that does not count as the shaft's: a sensor's glitches,
MIN_SAMPLES_PER_GLITCH = 50  # and at most one sample in so many


def glitch_samples(size: int, rate: float) -> int:
    """Return how many of so many samples at a rate, Hz, do not count at either extreme, as glitches lie there."""
    return min(round(GLITCH_TIME * rate), size // MIN_SAMPLES_PER_GLITCH)


def trimmed_extremes(samples: FloatArray, spare: int) -> tuple[FloatArray, FloatArray]:
    """Return the smallest and the largest sample of each row that are left without the few at either end.

    Parameters
    ----------
    samples : ndarray of float64, shape (n_rows, n)
        Any unit, without NaN; n more than ``2 * spare``.
    spare : int
        So many at either end do not count.

    Returns
    -------
    low, high : ndarray of float64, shape (n_rows,)
        The samples of rank ``spare`` from below and from above, counted from 0, exactly.

    Notes
    -----
    A sample of the values bounds the few that are ranked: R. Floyd and R. Rivest, Expected time bounds for selection,
    CACM 18, 1975.
    """
    if samples.ndim != 2 or not 0 <= 2 * spare < samples.shape[1]:
        raise ValueError(f"samples, spare: shape {samples.shape} and {spare}, expected (n_rows, n) and less than n / 2")
    low, high = np.empty(len(samples)), np.empty(len(samples))
    for row, values in enumerate(samples):
        sketch = np.sort(values[::SUBSAMPLING])
        place = min(2 * spare // SUBSAMPLING + SUBSAMPLE_MARGIN, sketch.size - 1)
        few = values[values <= sketch[place]]
        low[row] = np.partition(few if few.size > spare else values, spare)[spare]
        few = values[values >= sketch[-1 - place]]
        from_above = few if few.size > spare else values
        high[row] = np.partition(from_above, from_above.size - 1 - spare)[from_above.size - 1 - spare]
    return low, high


@dataclass(frozen=True, slots=True, eq=False)
class Overall:
    """Overall vibration of successive intervals.

    Parameters
    ----------
    peak_to_peak : ndarray of float64, shape (2, n)
        At the probes x and y, m peak-to-peak.
    times : ndarray of float64, shape (n,)
        Middle of each interval, s.
    excluded_samples : int
        Samples at either extreme of an interval that do not count, where a sensor's glitches lie: a steady sine reads
        low by (pi left_out / samples)² / 2 for it.
    clearance : float
        Radius of the circle that the shaft can move in, m.
    """

    peak_to_peak: FloatArray
    times: FloatArray
    excluded_samples: int
    clearance: float

    @property
    def clearance_fraction(self) -> FloatArray:
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
        excluded_samples=left_out,
        clearance=clearance,
    )
