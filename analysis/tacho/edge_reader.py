"""The edges of the tacho as the analysis takes them: from its waveform, or from a counter that stamps them."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.signals.blocks import SampleBlock
from analysis.signals.header import Acquisition, Role
from analysis.signals.snapshot import CounterReport
from analysis.tacho.counter_comparison import CounterComparison
from analysis.tacho.edges import EdgeDetector

FloatArray = NDArray[np.float64]

MAX_STAMP_DELAY = 0.5  # s that a stamp may come late before its absence is taken for the shaft's


@dataclass(frozen=True, slots=True, eq=False)
class TachoEdges:
    """The edges of a further stretch of time, as `PulseTrain.advance` takes them.

    Parameters
    ----------
    edges : ndarray of float64, shape (n,)
        Times at which the mark passed, in the segment, s, rising.
    known : float
        Time up to which all edges are known, s.
    elapsed : float
        Length of the time in which they lie, s.
    """

    edges: FloatArray
    known: float
    elapsed: float


class TachoEdgeReader:
    """Finds the passings of the mark in the order of time, in whatever blocks they come.

    Where the acquisition has a counter that is the reference, its stamps are taken, and each counts from its own sample
    on, or where it came late from the block that it came with; where the counter fails, the waveform is taken for the
    rest of the segment.

    Parameters
    ----------
    acquisition : Acquisition
        How the tacho is read.
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
        """Begin a segment, or go on in one after a gap, at a sample."""
        self._detector = EdgeDetector(self._tacho)
        self._stamps: list[tuple[int, NDArray[np.int64]]] = []  # first sample of the block, and what came with it
        self._fails_from: int | None = None
        self._last = -np.inf
        if self._comparison is not None:
            self._comparison.restart(first / self._rate)

    def add_block(self, block: SampleBlock) -> None:
        """Take note of what the counter stamped, before the samples of its block."""
        if self._counter is None:
            return
        if block.ticks is None:
            self._fails_from = block.first_sample if self._fails_from is None else self._fails_from
        elif block.ticks.size:
            self._stamps.append((block.first_sample, block.ticks))

    def read(self, volts: FloatArray, first: int) -> TachoEdges:
        """Return the edges of a further stretch of the waveform.

        Parameters
        ----------
        volts : ndarray of float64, shape (n,)
            Consecutive samples, V.
        first : int
            Index of the first in its segment.
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
        return TachoEdges(edges - delay, max(end - MAX_STAMP_DELAY, self._last), elapsed)

    def report(self, end: int) -> CounterReport | None:
        """Return how counter and waveform compare, up to a sample; None without a counter."""
        return None if self._comparison is None else self._comparison.report(is_working=self._is_working(end))

    def _is_working(self, end: int) -> bool:
        return self._fails_from is None or end <= self._fails_from

    def _new_edges(self, edges: FloatArray) -> FloatArray:
        """Return the edges behind the last that was given: counter and waveform may both have the one at a change."""
        edges = edges[edges > self._last]
        if edges.size:
            self._last = float(edges[-1])
        return edges

    def _due_stamps(self, end: int) -> Iterator[FloatArray]:
        """Yield the times, s, of stamps that lie before a sample and came with a block that begins before it."""
        if self._counter is None:
            return
        timebase, waiting = self._counter.timebase, []
        for first, ticks in self._stamps:
            known = int(np.searchsorted(ticks, end / self._rate * timebase)) if first < end else 0
            yield ticks[:known] / timebase
            if known < ticks.size:
                waiting.append((first, ticks[known:]))
        self._stamps = waiting
