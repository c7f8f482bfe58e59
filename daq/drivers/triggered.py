"""A source that is recorded from a condition on, with what came before it, and up to another."""

import math
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from analysis.edges import EdgeDetector
from analysis.run import Acquisition, Role
from analysis.samples import EndReason, SampleBlock, SegmentEnd, SourceItem
from daq.config.condition import SPEED, TIME, Condition
from daq.drivers.source import Source

RPM = 60.0  # revolutions a second to r/min
STANDSTILL = 1.0  # s without an edge after which the shaft is taken to stand
EDGES = 9  # that a speed is taken from, at most

Waiting = Callable[[float], None]


class SpeedEstimate:
    """A quick estimate of speed from the tacho's last edges; the analysis has the good one.

    Parameters
    ----------
    acquisition : Acquisition
        What the codes mean.
    """

    def __init__(self, acquisition: Acquisition) -> None:
        row = acquisition.row(Role.TACHO)
        self._row, self._channel = row, acquisition.channels[row]
        self._rate = acquisition.rate
        self._pulses = acquisition.tacho.pulses_per_revolution
        self._detector = EdgeDetector(acquisition.tacho)
        self._edges: deque[float] = deque(maxlen=EDGES)

    def block(self, block: SampleBlock) -> float:
        """Take a block of a segment and return the speed at its end, r/min; 0 where the shaft stands."""
        if block.first_sample == 0:
            self._edges.clear()
        volts = self._channel.volts(block.codes[self._row])
        self._edges.extend(self._detector.edges(volts, block.first_sample))
        while self._edges and block.end - self._edges[0] > 2 * STANDSTILL * self._rate:
            self._edges.popleft()
        if len(self._edges) < 2 or block.end - self._edges[-1] > STANDSTILL * self._rate:
            return 0.0
        turns = (len(self._edges) - 1) / self._pulses
        return float(turns * self._rate / (self._edges[-1] - self._edges[0]) * RPM)


class Triggered:
    """A `Source` that gives of another what lies between two conditions.

    Until the start condition has held for a while the latest samples are only kept; then they are given, as the
    beginning of a segment, and all that follows, until the stop condition has held for as long. That ends the run.

    Parameters
    ----------
    source : Source
        What is acquired all along.
    start, stop : Condition or None
        None to start at once, or to go on until stopped. A channel's voltage is above a value where any sample is.
    before : float
        Samples from at least so long before the condition began to hold are given too, s.
    hold : float
        How long a condition must hold, s: a single glitch starts nothing.
    waiting : callable
        Told the present speed, r/min, with every block that is not given.

    Raises
    ------
    ValueError
        A condition is on a channel that does not exist.
    """

    def __init__(
        self,
        source: Source,
        start: Condition | None,
        stop: Condition | None,
        *,
        before: float,
        hold: float,
        waiting: Waiting,
    ) -> None:
        self._source = source
        self._start, self._stop = start, stop
        self._hold = hold
        self._waiting = waiting
        rate = source.acquisition.rate
        self._rate = rate
        self._before = round((before + hold) * rate)
        self._speed = SpeedEstimate(source.acquisition)
        self._now = 0.0  # r/min
        self._seen = 0  # samples since a condition is awaited
        self._held_for = 0  # samples for which it has held
        self._rows = {channel.name: row for row, channel in enumerate(source.acquisition.channels)}
        for condition in (start, stop):
            if condition is not None and condition.quantity not in {SPEED, TIME, *self._rows}:
                raise ValueError(f"{condition}: expected speed, time or a channel, {', '.join(self._rows)}")

    @property
    def acquisition(self) -> Acquisition:
        """The acquisition of the source."""
        return self._source.acquisition

    def stop(self) -> None:
        """Ask for the end, from any thread."""
        self._source.stop()

    def close(self) -> None:
        """Release the device; harmless when closed."""
        self._source.close()

    def blocks(self) -> Iterator[SourceItem]:
        """Yield what lies between the conditions; one segment at least, which may be empty."""
        numbering = _Numbering()
        held: deque[SampleBlock] = deque()
        is_given, is_over = self._start is None, False
        for item in self._source.blocks():
            if isinstance(item, SegmentEnd):
                held.clear()
                self._held_for = 0
                if is_given:
                    yield numbering.end(item)
            elif is_given:
                yield numbering.block(item)
                if self._fires(self._stop, item):
                    yield numbering.end(SegmentEnd(0, 0, EndReason.FINISHED, detail=f"stopped by {self._stop}"))
                    is_given, is_over = False, True
                    self._source.stop()
            elif not is_over:  # what is read while the source stops lies behind the end
                held.append(item)
                if self._fires(self._start, item):
                    is_given = True
                    yield from map(numbering.block, held)
                    held.clear()
                else:
                    self._keep(held)
        if not numbering.has_ended:
            yield SegmentEnd(0, 0, EndReason.STOPPED, detail=f"{self._start} was not reached")

    def _keep(self, held: deque[SampleBlock]) -> None:
        """Forget what lies further back than is wanted, and tell that the start is waited for."""
        n = sum(block.n_samples for block in held)
        while held and n - held[0].n_samples >= self._before:
            n -= held.popleft().n_samples
        self._waiting(self._now)

    def _fires(self, awaited: Condition | None, block: SampleBlock) -> bool:
        """Take a block and return whether the awaited condition has held for long enough at its end."""
        self._seen += block.n_samples
        self._now = self._speed.block(block)
        if awaited is None:
            return False
        holds = awaited.holds(self._value(awaited, block))
        self._held_for = self._held_for + block.n_samples if holds else 0
        if not holds or self._held_for < self._hold * self._rate:
            return False
        self._seen = self._held_for = 0
        return True

    def _value(self, condition: Condition, block: SampleBlock) -> float:
        """Return a condition's quantity, in the condition's unit."""
        if condition.quantity == SPEED:
            return self._now
        if condition.quantity == TIME:
            return self._seen / self._rate
        row = self._rows[condition.quantity]
        codes = block.codes[row]
        extreme = codes.max(initial=np.iinfo(np.int16).min) if condition.is_above else codes.min(initial=32767)
        volts = self.acquisition.channels[row].volts(np.array([extreme], np.int16))
        return float(volts[0]) if codes.size else math.nan


class _Numbering:
    """Numbers what is given anew: segments from 0, samples of each from 0."""

    def __init__(self) -> None:
        self._segment = 0
        self._next = 0
        self.has_ended = False

    def block(self, block: SampleBlock) -> SampleBlock:
        numbered = replace(block, segment=self._segment, first_sample=self._next)
        self._next = numbered.end
        return numbered

    def end(self, end: SegmentEnd) -> SegmentEnd:
        numbered = replace(end, segment=self._segment, samples=self._next)
        self._segment += 1
        self._next = 0
        self.has_ended = True
        return numbered
