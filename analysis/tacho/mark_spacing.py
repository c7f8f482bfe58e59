"""How several marks lie on the shaft, learned from their pulses, and which of them is theta = 0."""

from collections import deque

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

MAX_INTERVAL_RATIO = 1.2  # ratio of a mark's successive intervals where nothing is missing or double
MIN_GAP_RATIO = 1.1  # than every other interval: so much longer is one that tells its mark from the others
MIN_TURNS, MIN_INTERVALS = 2, 16  # in a row without a fault that tell the spacing: revolutions, intervals at least


def interval_ratios(numbers: IntArray, times: FloatArray, marks: int) -> FloatArray | None:
    """Return how long the interval before each mark is, over the mean interval: around 1; None where one was not seen.

    Parameters
    ----------
    numbers : ndarray of int64, shape (n,)
        Number of each pulse, rising; equal modulo ``marks`` for the pulses of one mark.
    times : ndarray of float64, shape (n,)
        Their times, s.
    marks : int
        Marks on the shaft.

    Returns
    -------
    ndarray of float64, shape (marks,), or None
        Medians over the revolutions, each interval over the mean of the revolution about it.

    Notes
    -----
    Intervals over the mean of their revolution, so that a steady rise of speed cancels: as encoders' geometry is
    compensated (B. Resor, M. Trethewey and K. Maynard, J. Sound Vib., 2005).
    """
    middles = 0.5 * (numbers[1:] + numbers[:-1])
    begin, end = (np.interp(middles + half, numbers, times) for half in (-0.5 * marks, 0.5 * marks))
    whole = (middles - 0.5 * marks >= numbers[0]) & (middles + 0.5 * marks <= numbers[-1]) & (np.diff(numbers) == 1)
    ratios, ends = (np.diff(times)[whole] * marks / (end - begin)[whole]), numbers[1:][whole] % marks
    if np.unique(ends).size < marks:
        return None
    parts = np.array([np.median(ratios[ends == mark]) for mark in range(marks)])
    return np.asarray(parts * marks / parts.sum(), dtype=np.float64)


def reference_mark(parts: FloatArray) -> int | None:
    """Return which mark is theta = 0: the one after the longest interval; None where none is clearly the longest.

    Parameters
    ----------
    parts : ndarray of float64, shape (marks,)
        From `interval_parts`.

    Notes
    -----
    The once-per-turn gap of toothed wheels; how much longer it must be is this program's own rule.
    """
    if parts.size == 1:
        return 0
    second, longest = np.sort(parts)[-2:]
    return int(np.argmax(parts)) if longest >= MIN_GAP_RATIO * second else None


class MarkSpacing:
    """Learns the spacing of the marks from the first revolutions in which nothing is missing or double.

    What has been learned stays: the marks do not move. One mark a revolution needs no learning.

    Parameters
    ----------
    marks : int
        Marks on the shaft.
    """

    def __init__(self, marks: int) -> None:
        self._marks = marks
        self._needed = max(MIN_TURNS * marks, MIN_INTERVALS)
        self._edges: deque[float] = deque(maxlen=3 * (self._needed + marks))
        self.is_known = marks == 1
        self.ratios = np.ones(marks)  # from theta = 0 on, where that is told
        self.shortest_ratio = 1.0  # of the parts
        self.is_even = True
        self.has_reference = marks == 1

    def forget_edges(self) -> None:
        """Take what comes next as not following what came before."""
        self._edges.clear()

    def add_edges(self, edges: FloatArray) -> bool:
        """Take further edges, s, rising; return whether the spacing has just been learned."""
        if self.is_known:
            return False
        self._edges.extend(edges.tolist())
        stretch = self._clean_stretch(np.array(self._edges))
        parts = None if stretch is None else interval_ratios(np.arange(stretch.size), stretch, self._marks)
        if parts is None:
            return False
        mark = reference_mark(parts)
        self.is_known, self.has_reference = True, mark is not None
        self.is_even = bool(parts.max() < MIN_GAP_RATIO * parts.min())
        if not self.is_even:
            self.ratios, self.shortest_ratio = np.roll(parts, -(mark or 0)), float(parts.min())
        self._edges.clear()
        return True

    def _clean_stretch(self, times: FloatArray) -> FloatArray | None:
        """Return the longest row of edges in which each interval is like that of the same mark a revolution before."""
        intervals = np.diff(times)
        if intervals.size < self._needed + self._marks:
            return None
        later, before = intervals[self._marks :], intervals[: -self._marks]
        alike = (later < MAX_INTERVAL_RATIO * before) & (before < MAX_INTERVAL_RATIO * later)
        bounds = np.flatnonzero(np.diff(np.concatenate([[False], alike, [False]]).astype(np.int8)))
        lengths = bounds[1::2] - bounds[::2]
        if not lengths.size or lengths.max() < self._needed:
            return None
        first = int(bounds[::2][lengths.argmax()])
        return times[first : first + int(lengths.max()) + self._marks + 1]

    def first_mark(self, intervals: FloatArray, most: float) -> int | None:
        """Return which mark ends the first of some intervals of a revolution at least, s; None where they do not fit.

        Parameters
        ----------
        intervals : ndarray of float64, shape (n,)
            Between successive pulses.
        most : float
            Ratio of successive intervals, each over its part, up to which they fit.
        """
        longest = int(np.argmax(intervals[: self._marks]))
        longest_parts = np.flatnonzero(self.ratios >= self.ratios.max() / MIN_GAP_RATIO)
        for mark in longest_parts[:1].tolist() if self.is_even else longest_parts.tolist():
            first = (mark - longest) % self._marks
            even = intervals / self.ratios[(first + np.arange(intervals.size)) % self._marks]
            ratios = even[1:] / even[:-1]
            if ratios.max() <= most and ratios.min() >= 1.0 / most:
                return int(first)
        return None
