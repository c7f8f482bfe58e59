"""The simulated card as a source: at the pace of a real one, with its buffer, or as fast as it goes."""

import threading
import time
from collections.abc import Iterator

from analysis.run import Acquisition
from analysis.samples import EndReason, SampleBlock, SegmentEnd, SourceItem
from daq.drivers.simulated_card import SimulatedCard


class SimulatedSource:
    """Blocks of the simulated card.

    Parameters
    ----------
    card : SimulatedCard
        What is wired up.
    block : int
        Samples per channel in a block.
    buffer : int
        Samples per channel that the device holds for a late reader.
    real_time : bool
        Whether samples come at the card's rate; else as fast as they are taken.
    """

    def __init__(self, card: SimulatedCard, *, block: int, buffer: int, real_time: bool) -> None:
        self._card = card
        self._block = block
        self._buffer = buffer
        self._real_time = real_time
        self._stop = threading.Event()

    @property
    def acquisition(self) -> Acquisition:
        """The acquisition as the card's driver would report it."""
        return self._card.acquisition

    def blocks(self) -> Iterator[SourceItem]:
        """Start, and yield blocks until stopped, at the profile's end, or overrun by a reader that is too late.

        Deadlines are counted from the start, so that the pace does not drift.
        """
        started = time.monotonic()
        read = 0
        while not self._stop.is_set():
            codes = self._card.next_codes(self._block)
            end = read + codes.shape[1]
            if codes.shape[1] == 0:
                yield SegmentEnd(segment=0, samples=read, reason=EndReason.FINISHED)
                return
            lost = self._acquired(started) - read
            if lost > self._buffer:
                yield self._overrun(read, lost)
                return
            if self._real_time and self._stop.wait(max(started + end / self.acquisition.rate - time.monotonic(), 0.0)):
                break
            backlog = max(self._acquired(started) - end, 0)
            yield SampleBlock(codes, segment=0, first_sample=read, host_time_ns=time.time_ns(), backlog=backlog)
            read = end
        yield SegmentEnd(segment=0, samples=read, reason=EndReason.STOPPED)

    def stop(self) -> None:
        """Ask for the end, from any thread."""
        self._stop.set()

    def close(self) -> None:
        """Nothing is held; ask for the end."""
        self._stop.set()

    def _acquired(self, started: float) -> int:
        """Return how many samples per channel the card has digitised by now; 0 where it waits for its reader."""
        if not self._real_time:
            return 0
        return min(int((time.monotonic() - started) * self.acquisition.rate), self._card.n_samples)

    def _overrun(self, read: int, lost: int) -> SegmentEnd:
        rate = self.acquisition.rate
        return SegmentEnd(
            segment=0,
            samples=read,
            reason=EndReason.OVERRUN,
            lost=lost,
            detail=f"the reader was {lost / rate:.1f} s late, the card's buffer holds {self._buffer / rate:.1f} s",
        )
