"""The simulated card as a source: at the pace of a real one, with its buffer, or as fast as it goes."""

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
    """Blocks of the simulated card.

    A reader that is later than the buffer allows loses samples, as it would with the card: the segment ends with the
    loss, and the acquisition goes on as the next segment. The bench does not wait meanwhile.

    Parameters
    ----------
    card : SimulatedCard
        What is wired up; nothing has been taken from it.
    block : int
        Samples per channel in a block.
    buffer : int
        Samples per channel that the device holds for a late reader.
    real_time : bool
        Whether samples come at the card's rate; else as fast as they are taken.
    restarts : RestartLimiter
        How often a new segment may begin.
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
        self._read = 0  # samples per channel given in this segment

    @property
    def acquisition(self) -> Acquisition:
        """The acquisition as the card's driver would report it."""
        return self._card.acquisition

    def blocks(self) -> Iterator[SourceItem]:
        """Start, and yield blocks until stopped or at the profile's end.

        Deadlines are counted from the start, so that the pace does not drift.
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
            over = self._stopping.is_set() or self._card.taken + lost >= self._card.n_samples
            goes_on = end.reason is EndReason.OVERRUN and not over
            if goes_on and not self._restarts.take():
                goes_on, end = False, self._restarts.last(end)
            yield end
            if not goes_on or self._stopping.is_set():
                return
            segment += 1

    def stop(self) -> None:
        """Ask for the end, from any thread."""
        self._stopping.set()

    def close(self) -> None:
        """Ask for the end; nothing is held."""
        self._stopping.set()

    def _segment(self, segment: int) -> Generator[SampleBlock, None, SegmentEnd]:
        """Yield the blocks of a segment and return its end."""
        before = self._card.taken
        while not self._stopping.is_set():
            late = self._acquired() - before - self._read
            if late > self._buffer:
                return self._overrun(segment, late)
            codes = self._card.next_codes(self._block)
            if codes.shape[1] == 0:
                return SegmentEnd(segment, self._read, EndReason.FINISHED)
            if not self._wait_for(self._card.taken):
                break
            first, self._read = self._read, self._read + codes.shape[1]
            backlog = max(self._acquired() - self._card.taken, 0)
            ticks = self._ticks(before, first)
            yield SampleBlock(codes, segment, first, host_time_ns=time.time_ns(), backlog=backlog, ticks=ticks)
        return SegmentEnd(segment, self._read, EndReason.STOPPED)

    def _ticks(self, before: int, first: int) -> NDArray[np.int64] | None:
        """Return what the card's counter stamped since a sample of the segment, which began at a sample of the run."""
        if self.acquisition.tacho.counter is None:
            return None
        return self._card.ticks(before + first, self._card.taken, before)

    def _wait_for(self, sample: int) -> bool:
        """Wait until the card has digitised a sample; return whether nobody asked for the end meanwhile."""
        if not self._real_time:
            return True
        due = self._started + sample / self.acquisition.rate
        return not self._stopping.wait(max(due - time.monotonic(), 0.0))

    def _acquired(self) -> int:
        """Return how many samples per channel the card has digitised by now; 0 where it waits for its reader."""
        if not self._real_time:
            return 0
        return min(int((time.monotonic() - self._started) * self.acquisition.rate), self._card.n_samples)

    def _overrun(self, segment: int, late: int) -> SegmentEnd:
        rate = self.acquisition.rate
        detail = f"the reader was {late / rate:.1f} s late, the card's buffer holds {self._buffer / rate:.1f} s"
        return SegmentEnd(segment, self._read, EndReason.OVERRUN, lost=late, detail=detail)
