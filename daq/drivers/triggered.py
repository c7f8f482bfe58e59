"""A source that delivers the samples between a start and a stop condition, with pre-trigger, once or repeatedly."""

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd, SourceItem
from analysis.signals.header import Acquisition, Role
from analysis.tacho.edges import edge_detector
from daq.config.schema import SPEED, TIME, TriggerCondition, TriggerSection, parse_condition
from daq.drivers.source import Source

STANDSTILL_TIMEOUT = 1.0  # s without an edge after which the speed is 0
MAX_REVOLUTIONS = 8  # averaged for a speed
MIN_REVOLUTIONS = 2  # that must agree: two edges alone may be a glitch
MAX_TURN_DEVIATION = 0.25  # of the median turn; a doubled or missing edge makes a turn differ by more


class SpeedEstimator:
    """A quick estimate of the speed from the last tacho edges, for triggers; the analysis computes the accurate speed.

    The edges are those of the tacho's reference. If that is the card's counter, its timestamps are used at once, while
    the analysis waits for late ones. If the counter fails, the waveform is used for the rest of the segment.

    Parameters
    ----------
    acquisition : Acquisition
        Acquisition of the source.
    """

    def __init__(self, acquisition: Acquisition) -> None:
        self._acquisition = acquisition
        self._row = acquisition.row(Role.TACHO)
        self._pulses = acquisition.tacho.pulses_per_revolution
        self._edges: deque[float] = deque(maxlen=MAX_REVOLUTIONS * self._pulses + 1)  # in samples
        self._reset()

    def _reset(self) -> None:
        self._by_counter = self._acquisition.tacho.reference == "counter"
        self._detector = edge_detector(self._acquisition.tacho)
        self._edges.clear()

    def update(self, block: SampleBlock) -> float:
        """Return the speed at the end of the next block, r/min; 0 at standstill."""
        if block.first_sample == 0:
            self._reset()
        if self._by_counter and block.ticks is None:
            self._by_counter = False
            self._edges.clear()
        self._edges.extend(self._edges_of(block))
        rate = self._acquisition.rate
        while self._edges and block.end - self._edges[0] > 2 * STANDSTILL_TIMEOUT * rate:
            self._edges.popleft()
        if not self._edges or block.end - self._edges[-1] > STANDSTILL_TIMEOUT * rate:
            return 0.0
        edges = np.array(self._edges)
        turns = edges[self._pulses :] - edges[: -self._pulses]
        agreeing = (
            turns[np.abs(turns - np.median(turns)) <= MAX_TURN_DEVIATION * np.median(turns)] if turns.size else turns
        )
        return 60.0 * rate / float(agreeing.mean()) if agreeing.size >= MIN_REVOLUTIONS else 0.0

    def _edges_of(self, block: SampleBlock) -> NDArray[np.float64]:
        """Return the block's edges from the reference, in samples of the segment."""
        if self._by_counter and block.ticks is not None:
            return block.ticks / self._acquisition.ticks_per_sample
        volts = self._acquisition.channels[self._row].volts(block.codes[self._row])
        return self._detector.edges(volts, block.first_sample)


NORMAL_END_REASONS = frozenset({EndReason.STOPPED, EndReason.FINISHED})


@dataclass(frozen=True, slots=True)
class TriggerStart:
    """The start of an event.

    Parameters
    ----------
    event : int
        Number of the event, from 1.
    condition : TriggerCondition
        The start condition that is met.
    segment, sample : int
        Position in the delivered samples at which the condition began to hold.
    """

    event: int
    condition: TriggerCondition
    segment: int
    sample: int


class TriggerListener(Protocol):
    """Receives the events of a trigger, between the items of its source."""

    def on_waiting(self, event: int, speed: float) -> None:
        """Handle a wait for the start of an event; `speed` is the current speed, r/min."""
        ...

    def on_skipped(self, samples: int) -> None:
        """Handle a number of samples per channel that are not delivered, before the next delivered item."""
        ...

    def on_start(self, start: TriggerStart) -> None:
        """Handle the start of an event, before its first block."""
        ...


class TriggeredSource:
    """A `Source` that delivers another source's samples between start and stop conditions.

    Until the start condition has held for the hold time, the latest samples are only buffered. Then they begin a
    segment, and all further samples follow until the stop condition has held. That ends the segment, and the trigger is
    rearmed or the run ends. No sample is delivered twice: the pre-trigger samples reach back to the previous stop at
    most. Skipped samples are counted. A loss during the wait for a start is reported by an empty segment.

    Parameters
    ----------
    source : Source
        The source, which acquires continuously.
    section : TriggerSection
        The conditions and their timing. A channel's voltage is above a value if any sample of a block is.
    listener : TriggerListener
        Receives the trigger's events.
    """

    def __init__(self, source: Source, section: TriggerSection, listener: TriggerListener) -> None:
        self.acquisition = source.acquisition
        self._source = source
        self._section = section
        self._listener = listener
        self._rate = source.acquisition.rate
        self._before = round((section.pre_s + section.hold_s) * self._rate)
        self._speed_estimator = SpeedEstimator(source.acquisition)
        self._speed = 0.0  # r/min
        self._numbering = _Numbering(source.acquisition.ticks_per_sample)
        self._pre_trigger: deque[SampleBlock] = deque()
        self._events = 0  # started so far
        self._hold_off = 0  # samples left in which no start is detected
        self._start = _ConditionHold(parse_condition(section.start), section.hold_s, source.acquisition)
        self._stop = _ConditionHold(parse_condition(section.stop), section.hold_s, source.acquisition)

    def stop(self) -> None:
        """Request the stop, from any thread."""
        self._source.stop()

    def close(self) -> None:
        """Release the device; may be called twice."""
        self._source.close()

    def blocks(self) -> Iterator[SourceItem]:
        """Yield the segments between the conditions; at least one, which may be empty."""
        is_active, is_over = self._start.condition is None, False
        self._events = int(is_active)
        for item in self._source.blocks():
            if is_over:
                continue  # samples read while the source stops come after the end
            if isinstance(item, SegmentEnd):
                yield from self._ended(item, is_active=is_active)
                continue
            self._speed = self._speed_estimator.update(item)
            if is_active:
                yield self._numbering.block(item)
                if self._stop.fires(item, self._speed):
                    detail = f"stopped by {self._stop.condition}"
                    yield self._numbering.end(SegmentEnd(0, 0, EndReason.FINISHED, detail=detail))
                    is_active, is_over = False, self._events == self._section.events
                    self._hold_off = round(self._section.hold_off_s * self._rate)
                    if is_over:
                        self._source.stop()
            else:
                self._pre_trigger.append(item)
                if self._starts(item):
                    is_active = True
                    yield from self._start_event()
                else:
                    self._wait()
        if self._events == 0:
            detail = f"{self._start.condition} was not reached"
            yield self._numbering.end(SegmentEnd(0, 0, EndReason.STOPPED, detail=detail))

    def _starts(self, block: SampleBlock) -> bool:
        """Return whether this block starts an event."""
        if self._hold_off > 0:
            self._hold_off -= block.n_samples
            return False
        return self._start.fires(block, self._speed)

    def _start_event(self) -> Iterator[SampleBlock]:
        """Start an event: yield the pre-trigger samples."""
        self._events += 1
        n = sum(block.n_samples for block in self._pre_trigger)
        if self._start.condition is not None:
            segment, sample = self._numbering.segment, max(n - self._start.held_for, 0)
            self._listener.on_start(TriggerStart(self._events, self._start.condition, segment, sample))
        self._start.reset()
        self._stop.reset()
        while self._pre_trigger:
            yield self._numbering.block(self._pre_trigger.popleft())

    def _wait(self) -> None:
        """Discard samples older than the pre-trigger time, and report that the trigger is waiting."""
        n = sum(block.n_samples for block in self._pre_trigger)
        while self._pre_trigger and n - self._pre_trigger[0].n_samples >= self._before:
            n -= self._discard()
        self._listener.on_waiting(self._events + 1, self._speed)

    def _discard(self) -> int:
        samples = self._pre_trigger.popleft().n_samples
        self._listener.on_skipped(samples)
        return samples

    def _ended(self, end: SegmentEnd, *, is_active: bool) -> Iterator[SegmentEnd]:
        """Yield the end of the source's segment if it ends an event or reports a loss."""
        self._start.interrupt()
        self._stop.interrupt()
        while self._pre_trigger:
            self._discard()
        if is_active:
            yield self._numbering.end(end)
        elif end.reason not in NORMAL_END_REASONS or not end.is_gap_free:
            detail = f"while waiting for {self._start.condition}: {end.detail or end.reason.value}"
            yield self._numbering.end(replace(end, detail=detail))


def apply_trigger(source: Source, section: TriggerSection, listener: TriggerListener) -> Source:
    """Return a source limited to the samples between start and stop condition, or unchanged without conditions."""
    if not section.start.strip() and not section.stop.strip():
        return source
    return TriggeredSource(source, section, listener)


class _ConditionHold:
    """Detects when a condition has held for the hold time; without a condition it never fires."""

    def __init__(self, condition: TriggerCondition | None, hold: float, acquisition: Acquisition) -> None:
        self.condition = condition
        self._rate = acquisition.rate
        self._hold = hold * acquisition.rate
        self._channels = {channel.name: (row, channel) for row, channel in enumerate(acquisition.channels)}
        self._seen = 0  # samples since the reset
        self.held_for = 0
        """Number of samples for which the condition has held."""

    def reset(self) -> None:
        """Restart the detection."""
        self._seen = self.held_for = 0

    def interrupt(self) -> None:
        """Handle a gap: the hold time starts again after it."""
        self.held_for = 0

    def fires(self, block: SampleBlock, speed: float) -> bool:
        """Return whether, at the end of a block and at its speed, r/min, the condition has held for the hold time."""
        self._seen += block.n_samples
        if self.condition is None:
            return False
        holds = self.condition.holds(self._value(self.condition, block, speed))
        self.held_for = self.held_for + block.n_samples if holds else 0
        return holds and self.held_for >= self._hold

    def _value(self, condition: TriggerCondition, block: SampleBlock, speed: float) -> float:
        """Return the value of the condition's quantity, in the condition's unit."""
        if condition.quantity == SPEED:
            return speed
        if condition.quantity == TIME:
            return self._seen / self._rate
        row, channel = self._channels[condition.quantity]
        codes = block.codes[row]
        extreme = codes.max(initial=np.iinfo(np.int16).min) if condition.is_above else codes.min(initial=32767)
        return float(channel.volts(np.array([extreme], np.int16))[0]) if codes.size else math.nan


class _Numbering:
    """Renumbers the delivered items: segments from 0, samples of each from 0."""

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
