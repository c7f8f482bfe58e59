"""A source that replays a recorded run."""

import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd, SourceItem
from analysis.signals.header import Acquisition, RunHeader
from daq.stop_flag import StopFlag
from recordings.errors import RecordingError
from recordings.mcap.reader import RunReader


def open_replay(path: Path, pace: float | None = 1.0, *, block: int | None = None) -> "ReplaySource":
    """Return a recorded run, opened as a source.

    Parameters
    ----------
    path : Path
        The run's file.
    pace : float or None
        1.0 for the run's own pace, N for N times as fast, None for as fast as possible.
    block : int or None
        Samples per channel and block; None for the recorded blocks.

    Returns
    -------
    ReplaySource
        A `Source` with the recorded acquisition, including the device, bit for bit: the same samples must give the
        same results.

    Raises
    ------
    RecordingError
        The file cannot be opened or is not a run.
    ValueError
        `pace` or `block` is not positive.
    """
    if pace is not None and not pace > 0:
        raise ValueError(f"pace: {pace}, expected more than 0, or None for as fast as possible")
    if block is not None and block < 1:
        raise ValueError(f"block: {block} samples, expected at least 1")
    return ReplaySource(RunReader(path), pace, block)


class ReplaySource:
    """A `Source` that replays a recording.

    Parameters
    ----------
    reader : RunReader
        The opened run; closed by `close`.
    pace : float or None
        Speed relative to the recording; None for as fast as possible.
    block : int or None
        Samples per channel and block; None for the recorded blocks.
    """

    def __init__(self, reader: RunReader, pace: float | None, block: int | None) -> None:
        self._reader = reader
        self._pace = pace
        self._block = block
        self._stopped = StopFlag()

    @property
    def acquisition(self) -> Acquisition:
        """The recorded acquisition."""
        return self.header.acquisition

    @property
    def header(self) -> RunHeader:
        """The header of the replayed run."""
        return self._reader.header

    def blocks(self) -> Iterator[SourceItem]:
        """Yield the recorded blocks and segment ends, each at its time, until the end or until stopped."""
        rate = self.acquisition.rate
        started = time.monotonic()
        played = 0  # samples of the run before the current segment
        for item in self._reblocked():
            if isinstance(item, SegmentEnd):
                played += item.samples + item.lost
            elif not self._wait_until(started, (played + item.end) / rate):
                yield SegmentEnd(item.segment, item.first_sample, EndReason.STOPPED)
                return
            yield item

    def stop(self) -> None:
        """Request the stop, from any thread; a wait for the next block ends at once."""
        self._stopped.set()

    def close(self) -> None:
        """Close the file; may be called twice."""
        self._reader.close()

    def _wait_until(self, started: float, due: float) -> bool:
        """Wait until a time in the run, s; return False if the replay was stopped."""
        wait = 0.0 if self._pace is None else started + due / self._pace - time.monotonic()
        return not self._stopped.wait(wait)

    def _reblocked(self) -> Iterator[SourceItem]:
        if self._block is None:
            yield from self._recorded()
            return
        reblocker = _Reblocker(self._block, self.acquisition.ticks_per_sample)
        for item in self._recorded():
            if isinstance(item, SegmentEnd):
                yield from reblocker.rest()
                yield item
            else:
                yield from reblocker.add(item)

    def _recorded(self) -> Iterator[SourceItem]:
        """Yield the recorded items; an unreadable file ends the segment as a device error."""
        segment, samples = 0, 0
        try:
            for item in self._reader.items():
                segment, samples = (item.segment, item.end) if isinstance(item, SampleBlock) else (item.segment + 1, 0)
                yield item
        except RecordingError as error:
            yield SegmentEnd(segment, samples, EndReason.DEVICE_ERROR, 0, lost_is_exact=False, detail=str(error))


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
