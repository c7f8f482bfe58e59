"""Spacing of several keyphasor marks on the shaft, learned from the pulses, and the mark at theta = 0."""

from collections import deque

import numpy as np

from analysis.signals import FloatArray, IntArray

MAX_INTERVAL_RATIO = 1.2  # of an interval to that of the same mark one revolution before, without missing pulses
MIN_LONGEST_INTERVAL_RATIO = 1.1  # of the longest interval to every other: then it identifies its mark
MIN_REVOLUTIONS, MIN_INTERVALS = 2, 16  # successive revolutions and intervals without a fault, to learn the spacing


def interval_ratios(numbers: IntArray, times: FloatArray, marks: int) -> FloatArray | None:
    """Return the interval before each keyphasor mark over the mean interval; None where one was never measured.

    Parameters
    ----------
    numbers : ndarray of int64, shape (n,)
        Number of each pulse, rising; equal modulo ``marks`` for the pulses of one mark.
    times : ndarray of float64, shape (n,)
        Their times, s.
    marks : int
        Keyphasor marks on the shaft.

    Returns
    -------
    ndarray of float64, shape (marks,), or None
        Medians over the revolutions, each interval over the mean of the revolution centred on it.

    Notes
    -----
    The mean of the revolution cancels a steady acceleration, as in the compensation of encoder geometry (B. Resor,
    M. Trethewey and K. Maynard, J. Sound Vib., 2005).
    """
    middles = 0.5 * (numbers[1:] + numbers[:-1])
    begin, end = (np.interp(middles + half, numbers, times) for half in (-0.5 * marks, 0.5 * marks))
    whole = (middles - 0.5 * marks >= numbers[0]) & (middles + 0.5 * marks <= numbers[-1]) & (np.diff(numbers) == 1)
    ratios, ends = (np.diff(times)[whole] * marks / (end - begin)[whole]), numbers[1:][whole] % marks
    if np.unique(ends).size < marks:
        return None
    medians = np.array([np.median(ratios[ends == mark]) for mark in range(marks)])
    return np.asarray(medians * marks / medians.sum(), dtype=np.float64)


def reference_mark(ratios: FloatArray) -> int | None:
    """Return the keyphasor mark at theta = 0: that after the longest interval; None where none is clearly the longest.

    Parameters
    ----------
    ratios : ndarray of float64, shape (marks,)
        From `interval_ratios`.

    Notes
    -----
    The gap of a toothed wheel with a missing tooth; the required ratio is a choice of this program.
    """
    if ratios.size == 1:
        return 0
    second, longest = np.sort(ratios)[-2:]
    return int(np.argmax(ratios)) if longest >= MIN_LONGEST_INTERVAL_RATIO * second else None


class MarkSpacing:
    """Spacing of the keyphasor marks, learned from the first revolutions without a missing or double pulse.

    Once learned, the spacing stays: the marks do not move. A single mark needs no learning.

    Parameters
    ----------
    marks : int
        Keyphasor marks on the shaft.
    """

    def __init__(self, marks: int) -> None:
        self._marks = marks
        self._needed = max(MIN_REVOLUTIONS * marks, MIN_INTERVALS)
        self._edges: deque[float] = deque(maxlen=3 * (self._needed + marks))
        self.is_known = marks == 1
        self.ratios = np.ones(marks)  # from theta = 0 on, where that mark is identified
        self.shortest_ratio = 1.0
        self.is_evenly_spaced = True
        self.has_reference = marks == 1

    def forget_edges(self) -> None:
        """Discard the edges so far: the next edge does not follow the last."""
        self._edges.clear()

    def add_edges(self, edges: FloatArray) -> bool:
        """Add edges, s, rising; return whether they completed the spacing."""
        if self.is_known:
            return False
        self._edges.extend(edges.tolist())
        stretch = self._longest_regular_series(np.array(self._edges))
        ratios = None if stretch is None else interval_ratios(np.arange(stretch.size), stretch, self._marks)
        if ratios is None:
            return False
        mark = reference_mark(ratios)
        self.is_known, self.has_reference = True, mark is not None
        self.is_evenly_spaced = bool(ratios.max() < MIN_LONGEST_INTERVAL_RATIO * ratios.min())
        if not self.is_evenly_spaced:
            self.ratios, self.shortest_ratio = np.roll(ratios, -(mark or 0)), float(ratios.min())
        self._edges.clear()
        return True

    def _longest_regular_series(self, times: FloatArray) -> FloatArray | None:
        """Return the longest series of edges whose intervals repeat from revolution to revolution."""
        intervals = np.diff(times)
        if intervals.size < self._needed + self._marks:
            return None
        later, before = intervals[self._marks :], intervals[: -self._marks]
        repeats = (later < MAX_INTERVAL_RATIO * before) & (before < MAX_INTERVAL_RATIO * later)
        bounds = np.flatnonzero(np.diff(np.concatenate([[False], repeats, [False]]).astype(np.int8)))
        lengths = bounds[1::2] - bounds[::2]
        if not lengths.size or lengths.max() < self._needed:
            return None
        first = int(bounds[::2][lengths.argmax()])
        return times[first : first + int(lengths.max()) + self._marks + 1]

    def first_mark(self, intervals: FloatArray, max_ratio: float) -> int | None:
        """Return the keyphasor mark at the end of the first of the intervals; None where they do not fit the spacing.

        Parameters
        ----------
        intervals : ndarray of float64, shape (n,)
            Between successive pulses, at least one revolution, s.
        max_ratio : float
            Largest ratio of successive intervals, each divided by its ratio in the spacing.
        """
        longest = int(np.argmax(intervals[: self._marks]))
        longest_parts = np.flatnonzero(self.ratios >= self.ratios.max() / MIN_LONGEST_INTERVAL_RATIO)
        for mark in longest_parts[:1].tolist() if self.is_evenly_spaced else longest_parts.tolist():
            first = (mark - longest) % self._marks
            even = intervals / self.ratios[(first + np.arange(intervals.size)) % self._marks]
            ratios = even[1:] / even[:-1]
            if ratios.max() <= max_ratio and ratios.min() >= 1.0 / max_ratio:
                return int(first)
        return None
