"""The seam between whatever delivers samples and whatever takes them."""

from collections.abc import Iterator
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
