"""Comparison of the tacho edges from a counter with those in the sampled waveform."""

from collections import deque

import numpy as np
from numpy.typing import NDArray

from analysis.signals.header import TachoCounter
from analysis.signals.snapshot import RECENT_TIME, CounterReport

FloatArray = NDArray[np.float64]

SETTLING_TIME = 0.5  # s: edges are compared with this delay, so that late timestamps are included
START_MARGIN = 5e-3  # s after the start of the waveform: an edge there may be incomplete


class CounterComparison:
    """Running comparison of the timestamps and the sampled edges of a run.

    An edge and a timestamp match where each is the nearest to the other.

    Parameters
    ----------
    counter : TachoCounter
        Counter with its allowed time difference.
    """

    def __init__(self, counter: TachoCounter) -> None:
        self._max_difference = counter.max_difference
        self._compared = self._missing = self._extra = self._out_of_tolerance = 0
        self._sum, self._largest = 0.0, 0.0
        self.restart(0.0)

    def restart(self, begin: float) -> None:
        """Discard the edges not yet compared and continue from a new time, s; the counts stay."""
        self._recent: deque[tuple[float, int, int]] = deque()  # end time, s; edges of either; mismatches
        self._sampled = self._stamped = np.empty(0)
        self._done = begin + START_MARGIN  # time up to which edges have been compared, s

    def advance(self, sampled: FloatArray, stamped: FloatArray, now: float) -> None:
        """Add the edges of the next stretch of a segment and compare those older than the settling time.

        Parameters
        ----------
        sampled, stamped : ndarray of float64, shape (n,)
            Times in the segment from the waveform and from the counter, s, rising.
        now : float
            End of the stretch, s.
        """
        self._sampled = np.concatenate([self._sampled, sampled])
        self._stamped = np.concatenate([self._stamped, stamped])
        until = now - SETTLING_TIME
        if until > self._done:
            self._recent.append((until, *self._compare(self._done, until)))
            while self._recent[0][0] <= until - RECENT_TIME:
                self._recent.popleft()
            self._done = until
            self._sampled = self._sampled[self._sampled > until - SETTLING_TIME]
            self._stamped = self._stamped[self._stamped > until - SETTLING_TIME]

    def report(self, *, is_working: bool) -> CounterReport:
        """Return the counts since the start of the run."""
        has_compared = self._compared > 0
        return CounterReport(
            is_working=is_working,
            compared=self._compared,
            missing=self._missing,
            extra=self._extra,
            out_of_tolerance=self._out_of_tolerance,
            mean_difference=self._sum / self._compared if has_compared else np.nan,
            largest_difference=self._largest if has_compared else np.nan,
            recent=sum(edges for _, edges, _ in self._recent),
            recent_mismatches=sum(mismatches for _, _, mismatches in self._recent),
        )

    def _compare(self, begin: float, end: float) -> tuple[int, int]:
        """Compare the edges of a time span; return the number of edges of either and of mismatches.

        Edges outside the span are searched too: they may be the nearest.
        """
        to_stamp, to_edge = _nearest(self._sampled, self._stamped), _nearest(self._stamped, self._sampled)
        of_edge = _mutual(to_stamp, to_edge) & _within(self._sampled, begin, end)
        distances = self._stamped[to_stamp[of_edge]] - self._sampled[of_edge]
        missing = int(np.count_nonzero(_within(self._sampled, begin, end))) - distances.size
        extra = int(np.count_nonzero(_within(self._stamped, begin, end) & ~_mutual(to_edge, to_stamp)))
        out_of_tolerance = int(np.count_nonzero(np.abs(distances) > self._max_difference))
        self._compared += distances.size
        self._missing += missing
        self._extra += extra
        self._out_of_tolerance += out_of_tolerance
        self._sum += float(distances.sum())
        self._largest = max(self._largest, float(np.abs(distances).max(initial=0.0)))
        return distances.size + missing + extra, missing + extra + out_of_tolerance


def _within(times: FloatArray, begin: float, end: float) -> NDArray[np.bool_]:
    return np.asarray((times > begin) & (times <= end))


def _nearest(times: FloatArray, others: FloatArray) -> NDArray[np.intp]:
    """Return the index of the nearest of the others for each time; -1 where there are none."""
    if others.size == 0:
        return np.full(times.size, -1)
    after = np.clip(np.searchsorted(others, times), 0, others.size - 1)
    before = np.maximum(after - 1, 0)
    return np.where(np.abs(others[before] - times) <= np.abs(others[after] - times), before, after)


def _mutual(nearest: NDArray[np.intp], of_others: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Return which elements are themselves the nearest of their nearest."""
    if of_others.size == 0:
        return np.zeros(nearest.size, dtype=np.bool_)
    return np.asarray(of_others[nearest] == np.arange(nearest.size))
