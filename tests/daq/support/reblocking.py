"""The items of a source in blocks of another size, to show that results do not depend on it."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from analysis.signals.blocks import SampleBlock, SegmentEnd, SourceItem
from daq.drivers.source import Source


def reblocked(source: Source, size: int | None) -> Iterator[SourceItem]:
    """Yield a source's items with blocks of `size` samples per channel; None for its own blocks."""
    if size is None:
        yield from source.blocks()
        return
    reblocker = _Reblocker(size, source.acquisition.ticks_per_sample)
    for item in source.blocks():
        if isinstance(item, SegmentEnd):
            yield from reblocker.rest()
            yield item
        else:
            yield from reblocker.add(item)


class _Reblocker:
    """Cuts a segment into blocks of another size; each has the host time of its last sample's recorded block."""

    def __init__(self, size: int, ticks_per_sample: float) -> None:
        self._size = size
        self._ticks_per_sample = ticks_per_sample
        self._ticks: NDArray[np.int64] | None = None  # not yielded yet
        self._pending: list[NDArray[np.int16]] = []
        self._n_pending = 0
        self._last: SampleBlock | None = None

    def add(self, block: SampleBlock) -> Iterator[SampleBlock]:
        """Add a recorded block and yield the new blocks that are full.

        A late stamp lies before the recorded block that delivered it. It must not become known earlier than in the live
        run, so that block starts a new one; so does a block where stamps end or resume.
        """
        before = block.first_sample * self._ticks_per_sample
        came_late = block.ticks is not None and block.ticks.size > 0 and block.ticks[0] < before
        if came_late or (self._pending and (block.ticks is None) != (self._ticks is None)):
            yield from self.rest()
        self._last = block
        if block.ticks is None or self._ticks is None:
            self._ticks = block.ticks
        else:
            self._ticks = np.concatenate([self._ticks, block.ticks])
        used = 0
        while block.n_samples - used >= self._size - self._n_pending:
            stop = used + self._size - self._n_pending
            self._pending.append(block.codes[:, used:stop])
            yield self._joined(block, block.first_sample + stop)
            used = stop
        if used < block.n_samples:
            self._pending.append(block.codes[:, used:])
            self._n_pending += block.n_samples - used

    def rest(self) -> Iterator[SampleBlock]:
        """Yield the remaining samples of the segment, if any."""
        if self._pending and self._last is not None:
            yield self._joined(self._last, self._last.end)

    def _joined(self, last: SampleBlock, end: int) -> SampleBlock:
        codes = np.ascontiguousarray(np.concatenate(self._pending, axis=1))
        self._pending, self._n_pending = [], 0
        ticks = self._ticks
        if ticks is not None:
            ticks, self._ticks = np.split(ticks, [np.searchsorted(ticks, end * self._ticks_per_sample)])
        return SampleBlock(codes, last.segment, end - codes.shape[1], last.host_time_ns, last.backlog, ticks)
