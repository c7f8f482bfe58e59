"""The simulated card as a source: in real time with the buffer of a real card, or as fast as possible."""

import time
from collections.abc import Generator, Iterator

import numpy as np
from numpy.typing import NDArray

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd, SourceItem
from analysis.signals.header import Acquisition
from daq.drivers.simulation.card import SimulatedCard
from daq.drivers.source import RestartLimiter
from daq.stop_flag import StopFlag
from model.errors import WallContactError


class SimulatedSource:
    """A `Source` that delivers the simulated card's blocks.

    A reader that is later than the buffer allows loses samples, as with a real card: the segment ends with the loss,
    and the acquisition continues as the next segment. The simulated bench does not wait for the reader.

    Parameters
    ----------
    card : SimulatedCard
        The card, from which no samples have been read.
    block : int
        Samples per channel and block.
    buffer : int
        Samples per channel that the card's buffer holds.
    real_time : bool
        Whether samples arrive at the card's rate; otherwise as fast as they are read.
    restarts : RestartLimiter
        Limits new segments after faults.
    """

    def __init__(
        self, card: SimulatedCard, *, block: int, buffer: int, real_time: bool, restarts: RestartLimiter
    ) -> None:
        self._card = card
        self._block = block
        self._buffer = buffer
        self._real_time = real_time
        self._restarts = restarts
        self._stopping = StopFlag()
        self._started = 0.0
        self._read = 0  # samples per channel delivered in this segment

    @property
    def acquisition(self) -> Acquisition:
        """The acquisition, as the driver of a real card would report it."""
        return self._card.acquisition

    def blocks(self) -> Iterator[SourceItem]:
        """Start, and yield blocks and segment ends until stopped or until the speed profile ends.

        Deadlines count from the start, so that the pace does not drift.
        """
        self._started = time.monotonic()
        lost, segment = 0, 0
        while True:
            self._read = 0
            try:
                self._card.skip(lost)
                end = yield from self._segment(segment)
            except WallContactError as error:
                end = SegmentEnd(segment, self._read, EndReason.DEVICE_ERROR, detail=str(error))
            lost = end.lost
            over = self._stopping.is_set() or self._card.n_read + lost >= self._card.n_samples
            goes_on = end.reason is EndReason.OVERRUN and not over
            if goes_on and not self._restarts.allow():
                goes_on, end = False, self._restarts.with_reason(end)
            yield end
            if not goes_on or self._stopping.is_set():
                return
            segment += 1

    def stop(self) -> None:
        """Request the stop, from any thread."""
        self._stopping.set()

    def close(self) -> None:
        """Request the stop; there is no device to release."""
        self._stopping.set()

    def _segment(self, segment: int) -> Generator[SampleBlock, None, SegmentEnd]:
        """Yield the blocks of a segment and return its end."""
        before = self._card.n_read
        while not self._stopping.is_set():
            late = self._acquired() - before - self._read
            if late > self._buffer:
                return self._overrun(segment, late)
            codes = self._card.next_codes(self._block)
            if codes.shape[1] == 0:
                return SegmentEnd(segment, self._read, EndReason.FINISHED)
            if not self._wait_for(self._card.n_read):
                break
            first, self._read = self._read, self._read + codes.shape[1]
            backlog = max(self._acquired() - self._card.n_read, 0)
            ticks = self._ticks(before, first)
            yield SampleBlock(codes, segment, first, host_time_ns=time.time_ns(), backlog=backlog, ticks=ticks)
        return SegmentEnd(segment, self._read, EndReason.STOPPED)

    def _ticks(self, before: int, first: int) -> NDArray[np.int64] | None:
        """Return the counter's stamps since the segment's sample `first`; the segment begins at the run's `before`."""
        if self.acquisition.tacho.counter is None:
            return None
        return self._card.ticks(before + first, self._card.n_read, before)

    def _wait_for(self, sample: int) -> bool:
        """Wait until the card has digitised a sample; return False if a stop was requested meanwhile."""
        if not self._real_time:
            return True
        due = self._started + sample / self.acquisition.rate
        return not self._stopping.wait(max(due - time.monotonic(), 0.0))

    def _acquired(self) -> int:
        """Return how many samples per channel the card has digitised by now; 0 if it does not run in real time."""
        if not self._real_time:
            return 0
        return min(int((time.monotonic() - self._started) * self.acquisition.rate), self._card.n_samples)

    def _overrun(self, segment: int, late: int) -> SegmentEnd:
        rate = self.acquisition.rate
        detail = f"the reader was {late / rate:.1f} s late, the card's buffer holds {self._buffer / rate:.1f} s"
        return SegmentEnd(segment, self._read, EndReason.OVERRUN, lost=late, detail=detail)
