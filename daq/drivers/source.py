"""The seam between whatever delivers samples and whatever takes them.

How often a run may begin anew after a fault.
"""

import time
from collections import deque
from collections.abc import Iterator
from dataclasses import replace
from typing import Protocol

from analysis.signals.blocks import SampleBlock, SegmentEnd, SourceItem
from analysis.signals.header import Acquisition


class Source(Protocol):
    """A device, a simulated rig or a recording, opened and ready to deliver blocks.

    A source is opened by its constructor or `open_source`, which raise `DeviceError` (and leave nothing reserved).
    `blocks` may be iterated once. Every segment's blocks are followed by its `SegmentEnd`; a fault of the device in the
    midst of a run is such an end, not an exception.
    """

    @property
    def acquisition(self) -> Acquisition:
        """The acquisition as it really is, read back from the device."""
        ...

    def blocks(self) -> Iterator[SourceItem]:
        """Start, and yield blocks and segment ends until stopped, finished or failed."""
        ...

    def stop(self) -> None:
        """Ask for the end, from any thread; `blocks` ends soon, with every sample read until then delivered."""
        ...

    def close(self) -> None:
        """Release the device; harmless when already closed."""
        ...


class Sink(Protocol):
    """Whatever takes what a source yields."""

    def block(self, block: SampleBlock) -> None:
        """Take a block; it must not be changed."""
        ...

    def segment_end(self, end: SegmentEnd) -> None:
        """Take note of the end of a segment."""
        ...


WINDOW = 60.0  # s


class RestartLimiter:
    """Counts the new segments that a run begins after faults; one thread uses it.

    Parameters
    ----------
    per_minute : int
        New segments within any minute; 0 for none at all.
    """

    def __init__(self, per_minute: int) -> None:
        self._per_minute = per_minute
        self._begun: deque[float] = deque(maxlen=max(per_minute, 1))

    def take(self) -> bool:
        """Count a new segment and return True, or return False where there have been too many."""
        now = time.monotonic()
        full = len(self._begun) == self._per_minute
        if self._per_minute == 0 or (full and now - self._begun[0] < WINDOW):
            return False
        self._begun.append(now)
        return True

    def last(self, end: SegmentEnd) -> SegmentEnd:
        """Return the end of a segment after which none begins, with that said."""
        why = "every fault ends the run" if self._per_minute == 0 else f"{self._per_minute} new segments in a minute"
        return replace(end, detail=f"{end.detail}; the run ends here: {why} (session.restarts_per_minute)")
