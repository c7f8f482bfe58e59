"""Overall, unfiltered vibration: live over the last intervals, and of a whole record."""

from collections import deque
from dataclasses import dataclass

import numpy as np

from analysis.signals import FloatArray
from analysis.signals.errors import RecordTooShortError
from analysis.signals.probes import require_displacement

SUBSAMPLING = 16  # one sample in this many is sorted first
SUBSAMPLE_MARGIN = 8  # subsamples, beyond the expected number of excluded samples
GLITCH_TIME = 2e-4  # s of samples excluded at either end of the range of an interval, as sensor glitches
MIN_SAMPLES_PER_GLITCH = 50  # at most one sample in this many is excluded


def glitch_samples(size: int, rate: float) -> int:
    """Return the number of samples to exclude as glitches at either end, for an interval of ``size`` samples."""
    return min(round(GLITCH_TIME * rate), size // MIN_SAMPLES_PER_GLITCH)


def trimmed_extremes(samples: FloatArray, excluded: int) -> tuple[FloatArray, FloatArray]:
    """Return the smallest and the largest sample of each row, without the most extreme ones at either end.

    Parameters
    ----------
    samples : ndarray of float64, shape (n_rows, n)
        Any unit, without NaN; n more than ``2 * excluded``.
    excluded : int
        Number of samples excluded at either end.

    Returns
    -------
    low, high : ndarray of float64, shape (n_rows,)
        The samples of rank ``excluded`` from below and from above, counted from 0, exactly.

    Notes
    -----
    Faster than sorting: a sorted subsample bounds the few values that must be ranked (R. Floyd and R. Rivest, Expected
    time bounds for selection, CACM 18, 1975).
    """
    if samples.ndim != 2 or not 0 <= 2 * excluded < samples.shape[1]:
        raise ValueError(
            f"samples, excluded: shape {samples.shape} and {excluded}, expected (n_rows, n) and less than n / 2"
        )
    low, high = np.empty(len(samples)), np.empty(len(samples))
    for row, values in enumerate(samples):
        subsample = np.sort(values[::SUBSAMPLING])
        place = min(2 * excluded // SUBSAMPLING + SUBSAMPLE_MARGIN, subsample.size - 1)
        few = values[values <= subsample[place]]
        low[row] = np.partition(few if few.size > excluded else values, excluded)[excluded]
        few = values[values >= subsample[-1 - place]]
        from_above = few if few.size > excluded else values
        high[row] = np.partition(from_above, from_above.size - 1 - excluded)[from_above.size - 1 - excluded]
    return low, high


class OverallWindow:
    """Overall vibration over the last hops that cover an update interval and a revolution.

    The range of a hop is taken without its extreme 0.2 ms (2 % at most) at either end, to exclude sensor glitches.

    Parameters
    ----------
    rate : float
        Sample rate, Hz.
    hop : int
        Samples of an update interval.
    max_hops : int
        Hops that are kept.
    """

    def __init__(self, rate: float, hop: int, max_hops: int) -> None:
        self._rate, self._hop = rate, hop
        self._hops: deque[_Hop] = deque(maxlen=max_hops)

    def clear(self) -> None:
        """Forget all hops."""
        self._hops.clear()

    def add(self, displacement: FloatArray, speed: float) -> FloatArray:
        """Add the displacement of a hop, shape (2, n), m; return the measures `OVERALL`, shape (n_measures, 2).

        ``speed`` is the shaft speed, rad/s, NaN where unknown: then the window is one update interval.
        """
        n = displacement.shape[1]
        mean = displacement.mean(axis=1)
        squares = np.sum((displacement - mean[:, None]) ** 2, axis=1)
        self._hops.append(_Hop(n, *trimmed_extremes(displacement, glitch_samples(n, self._rate)), mean, squares))
        turn = 0.0 if np.isnan(speed) else 2.0 * np.pi / speed * self._rate
        window = self._hops[-1]
        for hop in list(self._hops)[-2::-1]:
            if window.samples >= max(self._hop, turn):
                break
            window = window.joined(hop)
        return np.stack([window.high - window.low, np.sqrt(window.squares / window.samples)])


@dataclass(frozen=True, slots=True, eq=False)
class _Hop:
    """Consecutive samples: their number, and for each probe smallest, largest, mean (m) and squares about it (m²)."""

    samples: int
    low: FloatArray
    high: FloatArray
    mean: FloatArray
    squares: FloatArray

    def joined(self, other: "_Hop") -> "_Hop":
        samples = self.samples + other.samples
        share, apart = other.samples / samples, other.mean - self.mean
        return _Hop(
            samples,
            np.minimum(self.low, other.low),
            np.maximum(self.high, other.high),
            self.mean + share * apart,
            self.squares + other.squares + self.samples * share * apart**2,
        )


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
        Samples excluded as glitches at either end of an interval's range. A steady sine reads low by
        (pi excluded_samples / samples)² / 2.
    clearance : float
        Radius of the clearance circle, m.
    """

    peak_to_peak: FloatArray
    times: FloatArray
    excluded_samples: int
    clearance: float

    @property
    def clearance_fraction(self) -> FloatArray:
        """Vibration over the diameter of the clearance circle, shape (2, n)."""
        return np.asarray(self.peak_to_peak / (2.0 * self.clearance), dtype=np.float64)


def overall(displacement: FloatArray, rate: float, clearance: float, *, interval: float = 0.1) -> Overall:
    """Return the overall vibration of a record, unfiltered, as in standards.

    Parameters
    ----------
    displacement : ndarray of float64, shape (2, n)
        Towards the probes x and y, uniformly in time, m.
    rate : float
        Sample rate, Hz.
    clearance : float
        Radius of the clearance circle, m.
    interval : float
        Length of an interval, s; at least one revolution.

    Raises
    ------
    RecordTooShortError
        The record is shorter than an interval.

    Notes
    -----
    Standards limit the peak-to-peak of the waveform (API 670; ISO 20816-1), which equals twice the amplitude of a line
    only where the waveform contains a single line.
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
