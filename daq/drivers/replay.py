"""A recorded run as a source: the same blocks again, at the pace wanted."""

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
    """Open a recorded run as a source.

    Parameters
    ----------
    path : Path
        The run's file.
    pace : float or None
        1.0 for the run's own pace, N for N times as fast, None for as fast as it goes.
    block : int or None
        Samples per channel of the blocks yielded; None for those recorded.

    Returns
    -------
    ReplaySource
        A `Source` whose acquisition is the recorded one to the last bit, device included: the samples are that
        device's, and what is computed from them must not differ.

    Raises
    ------
    RecordingError
        Where the file cannot be opened or is no run.
    ValueError
        Where the pace or the block is not positive.
    """
    if pace is not None and not pace > 0:
        raise ValueError(f"pace: {pace}, expected more than 0, or None for as fast as it goes")
    if block is not None and block < 1:
        raise ValueError(f"block: {block} samples, expected at least 1")
    return ReplaySource(RunReader(path), pace, block)


class ReplaySource:
    """A `Source` that plays a recording.

    Parameters
    ----------
    reader : RunReader
        The opened run; closed with this source.
    pace : float or None
        How many times as fast as it was recorded; None for as fast as it goes.
    block : int or None
        Samples per channel of the blocks yielded; None for those recorded.
    """

    def __init__(self, reader: RunReader, pace: float | None, block: int | None) -> None:
        self._reader = reader
        self._pace = pace
        self._block = block
        self._stopped = StopFlag()

    @property
    def acquisition(self) -> Acquisition:
        """The acquisition as it was when the run was recorded."""
        return self.header.acquisition

    @property
    def header(self) -> RunHeader:
        """The header of the run that is played."""
        return self._reader.header

    def blocks(self) -> Iterator[SourceItem]:
        """Yield the recorded blocks and segment ends, each when it is due, until the end or until stopped."""
        rate = self.acquisition.rate
        begun = time.monotonic()
        played = 0  # samples of the run up to where the present segment began
        for item in self._chopped():
            if isinstance(item, SegmentEnd):
                played += item.samples + item.lost
            elif not self._wait_until(begun, (played + item.end) / rate):
                yield SegmentEnd(item.segment, item.first_sample, EndReason.STOPPED)
                return
            yield item

    def stop(self) -> None:
        """Ask for the end, from any thread; a wait for the next block ends at once."""
        self._stopped.set()

    def close(self) -> None:
        """Close the file; harmless when already closed."""
        self._reader.close()

    def _wait_until(self, begun: float, due: float) -> bool:
        """Wait until a moment of the run, s, is due; return False where the replay was stopped."""
        wait = 0.0 if self._pace is None else begun + due / self._pace - time.monotonic()
        return not self._stopped.wait(wait)

    def _chopped(self) -> Iterator[SourceItem]:
        if self._block is None:
            yield from self._recorded()
            return
        chopper = _Chopper(self._block, self.acquisition.ticks_per_sample)
        for item in self._recorded():
            if isinstance(item, SegmentEnd):
                yield from chopper.rest()
                yield item
            else:
                yield from chopper.chop(item)

    def _recorded(self) -> Iterator[SourceItem]:
        """Yield what was recorded; a file that can no longer be read is a device that failed."""
        segment, samples = 0, 0
        try:
            for item in self._reader.items():
                segment, samples = (item.segment, item.end) if isinstance(item, SampleBlock) else (item.segment + 1, 0)
                yield item
        except RecordingError as error:
            yield SegmentEnd(segment, samples, EndReason.DEVICE_ERROR, 0, lost_is_exact=False, detail=str(error))


class _Chopper:
    """Cuts the blocks of a segment anew; each new block knows what the recorded block of its last sample knew."""

    def __init__(self, size: int, ticks_per_sample: float) -> None:
        self._size = size
        self._ticks_per_sample = ticks_per_sample
        self._ticks: NDArray[np.int64] | None = None  # not given yet
        self._held: list[NDArray[np.int16]] = []
        self._n_held = 0
        self._last: SampleBlock | None = None

    def chop(self, block: SampleBlock) -> Iterator[SampleBlock]:
        """Take a recorded block and yield the new ones that are full.

        A stamp counts from the beginning of the block that it came with, where it does not lie later anyway: where one
        came late, or where stamps end, the recorded block begins a new one.
        """
        before = block.first_sample * self._ticks_per_sample
        came_late = block.ticks is not None and block.ticks.size > 0 and block.ticks[0] < before
        if came_late or (self._held and (block.ticks is None) != (self._ticks is None)):
            yield from self.rest()
        self._last = block
        if block.ticks is None or self._ticks is None:
            self._ticks = block.ticks
        else:
            self._ticks = np.concatenate([self._ticks, block.ticks])
        used = 0
        while block.n_samples - used >= self._size - self._n_held:
            stop = used + self._size - self._n_held
            self._held.append(block.codes[:, used:stop])
            yield self._joined(block, block.first_sample + stop)
            used = stop
        if used < block.n_samples:
            self._held.append(block.codes[:, used:])
            self._n_held += block.n_samples - used

    def rest(self) -> Iterator[SampleBlock]:
        """Yield what is left of the segment, if anything is."""
        if self._held and self._last is not None:
            yield self._joined(self._last, self._last.end)

    def _joined(self, known: SampleBlock, end: int) -> SampleBlock:
        codes = np.ascontiguousarray(np.concatenate(self._held, axis=1))
        self._held, self._n_held = [], 0
        ticks = self._ticks
        if ticks is not None:
            ticks, self._ticks = np.split(ticks, [np.searchsorted(ticks, end * self._ticks_per_sample)])
        return SampleBlock(codes, known.segment, end - codes.shape[1], known.host_time_ns, known.backlog, ticks)
