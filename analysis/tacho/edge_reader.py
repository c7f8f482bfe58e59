"""Tacho edges for the analysis, from the sampled waveform or from the timestamps of a counter."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.signals.blocks import SampleBlock
from analysis.signals.header import Acquisition, Role
from analysis.signals.snapshot import CounterReport
from analysis.tacho.counter_comparison import CounterComparison
from analysis.tacho.edges import edge_detector

FloatArray = NDArray[np.float64]

MAX_TIMESTAMP_DELAY = 0.5  # s: after this time without a timestamp there was no edge


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
        self._stamps: list[tuple[int, NDArray[np.int64]]] = []  # first sample of the block, and its timestamps
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
