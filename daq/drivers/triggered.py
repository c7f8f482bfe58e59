"""A source that is recorded from one condition, with what came before it, up to another; once or again and again.

A quick estimate of speed, for triggers; the analysis has the good one.
"""

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd, SourceItem
from analysis.signals.header import Acquisition, Role
from analysis.tacho.edges import EdgeDetector
from daq.config.schema import SPEED, TIME, TriggerCondition
from daq.drivers.source import Source

RPM = 60.0  # revolutions a second to r/min
STANDSTILL = 1.0  # s without an edge after which the shaft is taken to stand
TURNS = 8  # that a speed is taken from, at most
LEAST_TURNS = 2  # that must agree: two edges alone may be a glitch
ALIKE = 0.25  # of the median turn by which a turn may differ: one with a doubled or missing edge differs by more


class SpeedEstimator:
    """Follows the speed by the tacho's last edges, from the reference that the rig declares.

    Where that is the card's counter, its stamps are taken at once, without the waiting of the analysis for late ones;
    where it fails, the waveform is taken for the rest of the segment.

    Parameters
    ----------
    acquisition : Acquisition
        What the codes mean.
    """

    def __init__(self, acquisition: Acquisition) -> None:
        self._acquisition = acquisition
        self._row = acquisition.row(Role.TACHO)
        self._pulses = acquisition.tacho.pulses_per_revolution
        self._edges: deque[float] = deque(maxlen=TURNS * self._pulses + 1)  # in samples
        self._begin()

    def _begin(self) -> None:
        self._by_counter = self._acquisition.tacho.reference == "counter"
        self._detector = EdgeDetector(self._acquisition.tacho)
        self._edges.clear()

    def block(self, block: SampleBlock) -> float:
        """Take a block of a segment and return the speed at its end, r/min; 0 where the shaft stands."""
        if block.first_sample == 0:
            self._begin()
        if self._by_counter and block.ticks is None:
            self._by_counter = False
            self._edges.clear()
        self._edges.extend(self._found(block))
        rate = self._acquisition.rate
        while self._edges and block.end - self._edges[0] > 2 * STANDSTILL * rate:
            self._edges.popleft()
        if not self._edges or block.end - self._edges[-1] > STANDSTILL * rate:
            return 0.0
        edges = np.array(self._edges)
        turns = edges[self._pulses :] - edges[: -self._pulses]
        alike = turns[np.abs(turns - np.median(turns)) <= ALIKE * np.median(turns)] if turns.size else turns
        return RPM * rate / float(alike.mean()) if alike.size >= LEAST_TURNS else 0.0

    def _found(self, block: SampleBlock) -> NDArray[np.float64]:
        """Return the block's edges by the reference, in samples of the segment."""
        if self._by_counter and block.ticks is not None:
            return block.ticks / self._acquisition.ticks_per_sample
        volts = self._acquisition.channels[self._row].volts(block.codes[self._row])
        return self._detector.edges(volts, block.first_sample)


NORMAL = frozenset({EndReason.STOPPED, EndReason.FINISHED})


@dataclass(frozen=True, slots=True)
class Trigger:
    """From when to when, and how often.

    Parameters
    ----------
    start, stop : Condition or None
        None to start at once, or to go on until stopped. A channel's voltage is above a value where any sample is.
    before : float
        Samples from at least so long before the start condition began to hold are given too, s.
    hold : float
        How long a condition must hold, s: a single glitch starts nothing.
    hold_off : float
        For so long after a stop no start is looked for, s.
    events : int
        After so many the run ends; 0 for no end.
    """

    start: TriggerCondition | None
    stop: TriggerCondition | None
    before: float = 0.0
    hold: float = 0.0
    hold_off: float = 0.0
    events: int = 1


@dataclass(frozen=True, slots=True)
class TriggerStart:
    """An event that begins with the next block.

    Parameters
    ----------
    event : int
        Its number, from 1.
    start : Condition
        What holds.
    segment, sample : int
        Where in what is given it began to hold.
    """

    event: int
    condition: TriggerCondition
    segment: int
    sample: int


class TriggerListener(Protocol):
    """Who is told what a trigger does, between the items."""

    def on_waiting(self, event: int, speed: float) -> None:
        """Take note that the start of an event is waited for, at this speed, r/min."""
        ...

    def on_skipped(self, samples: int) -> None:
        """Count samples per channel that are not given, before the next item that is."""
        ...

    def on_start(self, start: TriggerStart) -> None:
        """Take note of an event, before its first block."""
        ...


class TriggeredSource:
    """A `Source` that gives of another what lies between two conditions, as often as is wanted.

    Until the start condition has held for a while the latest samples are only kept; then they are given, as the
    beginning of a segment, and all that follows, until the stop condition has held for as long. That finishes the
    segment, and the start is waited for again or the run ends. No sample is given twice, and what is not given is
    counted: what came before a start reaches back to the stop before it at most. Whatever is lost while a start is
    waited for is told by a segment without samples.

    Parameters
    ----------
    source : Source
        What is acquired all along.
    trigger : Trigger
        What of it is given.
    watch : TriggerListener
        Who is told.

    Raises
    ------
    ValueError
        A condition is on a channel that does not exist, or there is none to begin or end several events.
    """

    def __init__(self, source: Source, trigger: Trigger, watch: TriggerListener) -> None:
        self._source = source
        self._trigger = trigger
        self._watch = watch
        self._rate = source.acquisition.rate
        self._before = round((trigger.before + trigger.hold) * self._rate)
        self._speed = SpeedEstimator(source.acquisition)
        self._now = 0.0  # r/min
        self._numbering = _Numbering(source.acquisition.ticks_per_sample)
        self._held: deque[SampleBlock] = deque()
        self._events = 0  # that have begun
        self._off = 0  # samples for which no start is looked for
        names = [channel.name for channel in source.acquisition.channels]
        for condition in (trigger.start, trigger.stop):
            if condition is not None and condition.quantity not in {SPEED, TIME, *names}:
                raise ValueError(f"{condition}: expected speed, time or a channel, {', '.join(names)}")
        if trigger.events != 1 and (trigger.start is None or trigger.stop is None):
            raise ValueError(f"events: {trigger.events}, expected 1 without a start and a stop condition")
        self._start = _Awaited(trigger.start, trigger.hold, source.acquisition)
        self._stop = _Awaited(trigger.stop, trigger.hold, source.acquisition)

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
        is_given, is_over = self._trigger.start is None, False
        self._events = int(is_given)
        for item in self._source.blocks():
            if is_over:
                continue  # what is read while the source stops lies behind the end
            if isinstance(item, SegmentEnd):
                yield from self._ended(item, is_given=is_given)
                continue
            self._now = self._speed.block(item)
            if is_given:
                yield self._numbering.block(item)
                if self._stop.fires(item, self._now):
                    yield self._numbering.end(self._finished())
                    is_given, is_over = False, self._events == self._trigger.events
                    self._off = round(self._trigger.hold_off * self._rate)
                    if is_over:
                        self._source.stop()
            else:
                self._held.append(item)
                if self._starts(item):
                    is_given = True
                    yield from self._begin()
                else:
                    self._keep()
        if self._events == 0:
            detail = f"{self._trigger.start} was not reached"
            yield self._numbering.end(SegmentEnd(0, 0, EndReason.STOPPED, detail=detail))

    def _starts(self, block: SampleBlock) -> bool:
        """Return whether an event starts with this block."""
        if self._off > 0:
            self._off -= block.n_samples
            return False
        return self._start.fires(block, self._now)

    def _begin(self) -> Iterator[SampleBlock]:
        """Give what was kept as the beginning of an event."""
        self._events += 1
        n = sum(block.n_samples for block in self._held)
        if self._trigger.start is not None:
            segment, sample = self._numbering.segment, max(n - self._start.held_for, 0)
            self._watch.on_start(TriggerStart(self._events, self._trigger.start, segment, sample))
        self._start.reset()
        self._stop.reset()
        while self._held:
            yield self._numbering.block(self._held.popleft())

    def _keep(self) -> None:
        """Forget what lies further back than is wanted, and tell that the start is waited for."""
        n = sum(block.n_samples for block in self._held)
        while self._held and n - self._held[0].n_samples >= self._before:
            n -= self._forget()
        self._watch.on_waiting(self._events + 1, self._now)

    def _forget(self) -> int:
        samples = self._held.popleft().n_samples
        self._watch.on_skipped(samples)
        return samples

    def _finished(self) -> SegmentEnd:
        return SegmentEnd(0, 0, EndReason.FINISHED, detail=f"stopped by {self._trigger.stop}")

    def _ended(self, end: SegmentEnd, *, is_given: bool) -> Iterator[SegmentEnd]:
        """Give the end of a segment of the source, where it ends what was given or tells of a loss."""
        self._start.interrupt()
        self._stop.interrupt()
        while self._held:
            self._forget()
        if is_given:
            yield self._numbering.end(end)
        elif end.reason not in NORMAL or not end.is_gap_free:
            detail = f"while {self._trigger.start} was waited for: {end.detail or end.reason.value}"
            yield self._numbering.end(replace(end, detail=detail))


class _Awaited:
    """A condition that is waited for; none, which never fires."""

    def __init__(self, condition: TriggerCondition | None, hold: float, acquisition: Acquisition) -> None:
        self._condition = condition
        self._rate = acquisition.rate
        self._least = hold * acquisition.rate
        self._channels = {channel.name: (row, channel) for row, channel in enumerate(acquisition.channels)}
        self._seen = 0  # samples since it is awaited
        self.held_for = 0
        """Samples for which it has held."""

    def reset(self) -> None:
        """Begin to wait."""
        self._seen = self.held_for = 0

    def interrupt(self) -> None:
        """Take note of a gap, over which nothing holds."""
        self.held_for = 0

    def fires(self, block: SampleBlock, speed: float) -> bool:
        """Take a block, with the speed at its end, r/min, and return whether the condition has held for long enough."""
        self._seen += block.n_samples
        if self._condition is None:
            return False
        holds = self._condition.holds(self._value(self._condition, block, speed))
        self.held_for = self.held_for + block.n_samples if holds else 0
        return holds and self.held_for >= self._least

    def _value(self, condition: TriggerCondition, block: SampleBlock, speed: float) -> float:
        """Return the condition's quantity, in the condition's unit."""
        if condition.quantity == SPEED:
            return speed
        if condition.quantity == TIME:
            return self._seen / self._rate
        row, channel = self._channels[condition.quantity]
        codes = block.codes[row]
        extreme = codes.max(initial=np.iinfo(np.int16).min) if condition.is_above else codes.min(initial=32767)
        return float(channel.volts(np.array([extreme], np.int16))[0]) if codes.size else math.nan


class _Numbering:
    """Numbers what is given anew: segments from 0, samples of each from 0."""

    def __init__(self, ticks_per_sample: float) -> None:
        self._ticks_per_sample = ticks_per_sample
        self.segment = 0
        self._next = 0

    def block(self, block: SampleBlock) -> SampleBlock:
        numbered = block.relocated(self.segment, self._next, self._ticks_per_sample)
        self._next = numbered.end
        return numbered

    def end(self, end: SegmentEnd) -> SegmentEnd:
        numbered = replace(end, segment=self.segment, samples=self._next)
        self.segment += 1
        self._next = 0
        return numbered
