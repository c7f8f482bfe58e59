"""Tacho edges: detection in the waveform, timestamps of a counter, and the comparison of the two.

`edge_detector` returns the detector of a tacho. A further type of tacho needs a class with the method `edges` and its
line in `edge_detector`; the callers do not name a type.
"""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.signals import BoolArray, FloatArray, IntArray
from analysis.signals.blocks import SampleBlock
from analysis.signals.header import Acquisition, Edge, Role, Tacho, TachoCounter
from analysis.signals.snapshot import RECENT_TIME, CounterReport

SETTLING_TIME = 0.5  # s: edges are compared with this delay, so that late timestamps are included
START_MARGIN = 5e-3  # s after the start of the waveform: an edge there may be incomplete
MAX_TIMESTAMP_DELAY = 0.5  # s: after this time without a timestamp there was no edge


class SchmittTrigger:
    """Schmitt trigger that finds the tacho edges of a waveform given in consecutive pieces.

    An edge needs a waveform below the lower level that then reaches the upper level (mirrored for falling edges). The
    time of the edge is the last crossing of the middle level before that, interpolated linearly between two samples.

    Parameters
    ----------
    tacho : Tacho
        Threshold, hysteresis and edge.

    Notes
    -----
    O. Schmitt, A thermionic trigger, J. Sci. Instrum. 15, 1938; interpolation of the edge time: A. Brandt, Noise and
    Vibration Analysis, 2011, ch. 12.
    """

    def __init__(self, tacho: Tacho) -> None:
        if not tacho.hysteresis >= 0.0:
            raise ValueError(f"hysteresis: {tacho.hysteresis} V, expected 0 or more")
        self._sign = 1.0 if tacho.edge is Edge.RISING else -1.0
        self._middle = self._sign * tacho.threshold
        self._low = self._middle - 0.5 * tacho.hysteresis
        self._high = self._middle + 0.5 * tacho.hysteresis
        self._last: FloatArray = np.empty(0)
        self._state = 0  # 1 above the upper level, -1 below the lower, 0 not yet known
        self._crossing = 0.0

    def edges(self, volts: FloatArray, first: int) -> FloatArray:
        """Return the positions of the edges in the next piece of the waveform.

        Parameters
        ----------
        volts : ndarray of float64, shape (n,)
            Samples that follow the previous piece, V.
        first : int
            Index of the first sample of the piece.

        Returns
        -------
        ndarray of float64, shape (n_edges,)
            Positions in samples, on the same axis as ``first``, rising.

        Raises
        ------
        ValueError
            The samples are not finite.
        """
        if not np.isfinite(volts).all():
            raise ValueError("volts: holds values that are not finite")
        wave = np.concatenate([self._last, self._sign * volts])
        if wave.size == 0:
            return np.empty(0)
        origin = first - self._last.size
        self._last = wave[-1:].copy()

        above = wave >= self._middle
        after = np.flatnonzero(above[1:] & ~above[:-1]) + 1
        start, stop = wave[after - 1], wave[after]
        crossings = origin + after - 1 + (self._middle - start) / (stop - start)

        level = np.where(wave >= self._high, 1, np.where(wave < self._low, -1, 0))
        known = np.flatnonzero(level)
        states = np.concatenate([[self._state], level[known]])
        flips = known[(states[1:] == 1) & (states[:-1] == -1)]
        self._state = int(states[-1])

        candidates = np.concatenate([[self._crossing], crossings])
        edges = candidates[np.searchsorted(after, flips, side="right")]
        self._crossing = float(candidates[-1])
        return np.asarray(edges, dtype=np.float64)


def edge_detector(tacho: Tacho) -> SchmittTrigger:
    """Return a new detector of the edges in the waveform of a tacho, with the settings of the tacho."""
    return SchmittTrigger(tacho)


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


def _within(times: FloatArray, begin: float, end: float) -> BoolArray:
    return np.asarray((times > begin) & (times <= end))


def _nearest(times: FloatArray, others: FloatArray) -> NDArray[np.intp]:
    """Return the index of the nearest of the others for each time; -1 where there are none."""
    if others.size == 0:
        return np.full(times.size, -1)
    after = np.clip(np.searchsorted(others, times), 0, others.size - 1)
    before = np.maximum(after - 1, 0)
    return np.where(np.abs(others[before] - times) <= np.abs(others[after] - times), before, after)


def _mutual(nearest: NDArray[np.intp], of_others: NDArray[np.intp]) -> BoolArray:
    """Return which elements are themselves the nearest of their nearest."""
    if of_others.size == 0:
        return np.zeros(nearest.size, dtype=np.bool_)
    return np.asarray(of_others[nearest] == np.arange(nearest.size))


@dataclass(frozen=True, slots=True, eq=False)
class TachoEdges:
    """Edges of one stretch of time, the input of `PulseTrain.advance`.

    Parameters
    ----------
    edges : ndarray of float64, shape (n,)
        Times in the segment at which a keyphasor mark passed, s, rising.
    known : float
        Time up to which all edges are known, s.
    elapsed : float
        Length of the stretch, s.
    """

    edges: FloatArray
    known: float
    elapsed: float


class TachoEdgeReader:
    """Reads tacho edges in the order of time, independent of the block size.

    With a counter as the reference, its timestamps are the edges. A timestamp takes effect at its own sample or, if
    late, at the block that contains it. After the counter fails, the waveform is used for the rest of the segment.

    Parameters
    ----------
    acquisition : Acquisition
        Settings of the tacho and its counter.
    """

    def __init__(self, acquisition: Acquisition) -> None:
        tacho, row = acquisition.tacho, acquisition.row(Role.TACHO)
        self._rate = acquisition.rate
        self._tacho = tacho
        self._skew = row / acquisition.convert_rate
        self._counter = tacho.counter
        self._comparison = None if tacho.counter is None else CounterComparison(tacho.counter)
        self.restart(0)

    def restart(self, first: int) -> None:
        """Start a segment, or continue one after a gap, at a sample."""
        self._detector = edge_detector(self._tacho)
        self._stamps: list[tuple[int, IntArray]] = []  # first sample of the block, and its timestamps
        self._fails_from: int | None = None
        self._last = -np.inf
        if self._comparison is not None:
            self._comparison.restart(first / self._rate)

    def add_block(self, block: SampleBlock) -> None:
        """Add the timestamps of a block; call it before `read` for the samples of the block."""
        if self._counter is None:
            return
        if block.ticks is None:
            self._fails_from = block.first_sample if self._fails_from is None else self._fails_from
        elif block.ticks.size:
            self._stamps.append((block.first_sample, block.ticks))

    def read(self, volts: FloatArray, first: int) -> TachoEdges:
        """Return the edges of the next stretch of the waveform.

        Parameters
        ----------
        volts : ndarray of float64, shape (n,)
            Consecutive samples, V.
        first : int
            Index of the first sample in its segment.
        """
        end, elapsed = (first + volts.size) / self._rate, volts.size / self._rate
        found, delay = self._detector.edges(volts, first) / self._rate, self._tacho.delay
        if self._counter is None:
            return TachoEdges(found + (self._skew - delay), end, elapsed)
        sampled = found + self._skew
        stamped = np.concatenate([np.empty(0), *self._due_stamps(first + volts.size)])
        is_working = self._is_working(first + volts.size)
        if self._comparison is not None and is_working:
            self._comparison.advance(sampled, stamped, end)
        if not (self._counter.is_reference and is_working):
            return TachoEdges(self._new_edges(sampled) - delay, end, elapsed)
        edges = self._new_edges(stamped)
        if edges.size:
            elapsed = max(elapsed, float(edges[-1] - edges[0]))
        return TachoEdges(edges - delay, max(end - MAX_TIMESTAMP_DELAY, self._last), elapsed)

    def report(self, end: int) -> CounterReport | None:
        """Return the comparison of counter and waveform up to a sample; None without a counter."""
        return None if self._comparison is None else self._comparison.report(is_working=self._is_working(end))

    def _is_working(self, end: int) -> bool:
        return self._fails_from is None or end <= self._fails_from

    def _new_edges(self, edges: FloatArray) -> FloatArray:
        """Return the edges after the last one returned: at a change of source both may contain the same edge."""
        edges = edges[edges > self._last]
        if edges.size:
            self._last = float(edges[-1])
        return edges

    def _due_stamps(self, end: int) -> Iterator[FloatArray]:
        """Yield the times, s, of timestamps before a sample, from blocks that begin before it."""
        if self._counter is None:
            return
        timebase, waiting = self._counter.timebase, []
        for first, ticks in self._stamps:
            known = int(np.searchsorted(ticks, end / self._rate * timebase)) if first < end else 0
            yield ticks[:known] / timebase
            if known < ticks.size:
                waiting.append((first, ticks[known:]))
        self._stamps = waiting
