"""A source that replays a recorded run."""

import time
from collections.abc import Iterator
from pathlib import Path

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd, SourceItem
from daq.stop_flag import StopFlag
from recordings.errors import RecordingError
from recordings.mcap.reader import RunReader


class ReplaySource:
    """A `Source` that replays a recorded run, bit for bit: the same samples must give the same results.

    Parameters
    ----------
    path : Path
        The run's file.
    pace : float or None
        1.0 for the run's own pace, N for N times as fast, None for as fast as possible.

    Attributes
    ----------
    header : RunHeader
        The header of the replayed run.
    acquisition : Acquisition
        The recorded acquisition, including the device.

    Raises
    ------
    RecordingError
        The file cannot be opened or is not a run.
    ValueError
        `pace` is not positive.
    """

    def __init__(self, path: Path, pace: float | None = 1.0) -> None:
        if pace is not None and not pace > 0:
            raise ValueError(f"pace: {pace}, expected more than 0, or None for as fast as possible")
        self._pace = pace
        self._reader = RunReader(path)
        self._stopped = StopFlag()
        self.header = self._reader.header
        self.acquisition = self.header.acquisition

    def blocks(self) -> Iterator[SourceItem]:
        """Yield the recorded blocks and segment ends, each at its time, until the end or until stopped."""
        rate = self.acquisition.rate
        started = time.monotonic()
        played = 0  # samples of the run before the current segment
        for item in self._recorded():
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

    def _recorded(self) -> Iterator[SourceItem]:
        """Yield the recorded items; an unreadable file ends the segment as a device error."""
        segment, samples = 0, 0
        try:
            for item in self._reader.items():
                segment, samples = (item.segment, item.end) if isinstance(item, SampleBlock) else (item.segment + 1, 0)
                yield item
        except RecordingError as error:
            yield SegmentEnd(segment, samples, EndReason.DEVICE_ERROR, 0, lost_is_exact=False, detail=str(error))
