"""Statistics of a recording in shared memory, and its health derived from them.

The recorder writes them, any process reads them, without a lock: a reader that is suspended or killed while it holds a
lock would block the recorder. Instead a counter is odd while related words change, and a reader repeats a read during
which the counter changed (a seqlock).
"""

import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from analysis.signals.blocks import SampleBlock, SegmentEnd
from analysis.signals.header import CODE_MAX, CODE_MIN, Acquisition
from daq.config.schema import TimingSection
from daq.drivers.factory import RECONNECT_REASONS
from daq.session.live_update import Clipping, RunState
from daq.session.recording.ring import SharedBytes, allocate_shared_bytes, byte_view

MAX_CHANNELS = 16  # of one card
# _CHANGES is odd while related words change, and rises by two with each change
_CHANGES, _SAMPLES, _SEGMENT, _LOST, _AT_LEAST, _BACKLOG, _DISK, _BLOCK_AT, _ARMED, _RPM, _NUMBER = range(11)
_CLIPPED = 11  # first of three words per channel: clipped samples, blocks with any, end of the last such block
_CLIPPED_WORDS = 3
_MAX_READS = 1000  # of words that keep changing: their writer may have been killed during a change


class RecorderStatistics:
    """Counts of a recording, written by one process and read by any.

    Parameters
    ----------
    memory : SharedBytes
        Shared memory from `allocate`.
    """

    def __init__(self, memory: SharedBytes) -> None:
        self._words = byte_view(memory).view(np.int64)

    @staticmethod
    def allocate() -> SharedBytes:
        """Return new shared memory for the statistics of a recording."""
        memory = allocate_shared_bytes(8 * (_CLIPPED + _CLIPPED_WORDS * MAX_CHANNELS))
        byte_view(memory).view(np.int64)[_DISK] = -1
        return memory

    @contextmanager
    def _changing(self) -> Iterator[None]:
        """Mark related words as changing."""
        self._words[_CHANGES] += 1
        try:
            yield
        finally:
            self._words[_CHANGES] += 1

    def _read_related(self, *at: int) -> tuple[int, ...]:
        """Return related words, all from the same change."""
        found: tuple[int, ...] = ()
        for _ in range(_MAX_READS):
            before = int(self._words[_CHANGES])
            found = tuple(int(self._words[word]) for word in at)
            if before % 2 == 0 and before == self._words[_CHANGES]:
                break
        return found

    def start(self) -> None:
        """Expect blocks from now on."""
        self._words[_BLOCK_AT] = time.monotonic_ns()

    def set_armed(self, event: int, speed: float) -> None:
        """Set the number of the event whose start condition is awaited, and the present speed, r/min."""
        with self._changing():
            self._words[_ARMED] = event
            self._words[_RPM] = round(speed)
            self._words[_BLOCK_AT] = time.monotonic_ns()

    def add_block(self, block: SampleBlock) -> None:
        """Count a recorded block."""
        rails = np.count_nonzero((block.codes == CODE_MIN) | (block.codes == CODE_MAX), axis=1)
        with self._changing():
            self._words[_SAMPLES] += block.n_samples
            self._words[_SEGMENT] = block.end
            self._words[_NUMBER] = block.segment
            self._words[_BACKLOG] = block.backlog
            self._words[_ARMED] = 0
            self._words[_BLOCK_AT] = time.monotonic_ns()
            for row in np.flatnonzero(rails):
                at = _CLIPPED + _CLIPPED_WORDS * int(row)
                self._words[at] += int(rails[row])
                self._words[at + 1] += 1
                self._words[at + 2] = self._words[_SAMPLES]

    def add_end(self, end: SegmentEnd) -> None:
        """Count the samples lost at the end of a segment."""
        with self._changing():
            self._words[_LOST] += end.lost
            self._words[_AT_LEAST] |= int(not end.lost_is_exact)
            self._words[_SEGMENT] = 0
            self._words[_NUMBER] = end.segment + 1
            self._words[_BACKLOG] = 0

    @property
    def samples(self) -> int:
        """Samples per channel recorded."""
        return int(self._words[_SAMPLES])

    @property
    def segment_samples(self) -> int:
        """Samples per channel recorded in the current segment."""
        return int(self._words[_SEGMENT])

    @property
    def position(self) -> tuple[int, int]:
        """The current segment and the samples per channel recorded in it."""
        segment, samples = self._read_related(_NUMBER, _SEGMENT)
        return segment, samples

    @property
    def lost(self) -> int:
        """Samples per channel known to be lost."""
        return int(self._words[_LOST])

    @property
    def lost_is_exact(self) -> bool:
        """Whether `lost` is exact, not a lower bound."""
        return not self._words[_AT_LEAST]

    def clipped(self, row: int) -> tuple[int, int, int]:
        """Return a channel's clipped samples, the blocks with any, and the samples up to the end of the last one."""
        at = _CLIPPED + _CLIPPED_WORDS * row
        samples, blocks, last = self._read_related(at, at + 1, at + 2)
        return samples, blocks, last

    @property
    def backlog(self) -> int:
        """Samples per channel that the device held at the last read."""
        return int(self._words[_BACKLOG])

    @property
    def armed_event(self) -> int:
        """Number, from 1, of the event whose start condition is awaited; 0 while samples are recorded."""
        return int(self._words[_ARMED])

    @property
    def speed_rpm(self) -> int:
        """Speed while the start condition is awaited, r/min."""
        return int(self._words[_RPM])

    @property
    def time_since_block(self) -> float:
        """Time since the last block, s; 0 before blocks are expected."""
        at = int(self._words[_BLOCK_AT])
        return (time.monotonic_ns() - at) / 1e9 if at else 0.0

    @property
    def disk_bytes_left(self) -> int:
        """Bytes that can be written until the disk reserve is reached; -1 before the first check."""
        return int(self._words[_DISK])

    @disk_bytes_left.setter
    def disk_bytes_left(self, value: int) -> None:
        self._words[_DISK] = value


MAX_BLOCK_DELAY = 1.0
"""Delay of a due block, s, above which a recording counts as interrupted."""
MAX_BUFFER_FILL = 0.5
"""Fill of the card's buffer, as a fraction, above which a recording counts as degraded."""


def loss_message(end: SegmentEnd) -> str:
    """Return a description of a segment end with lost samples or a device fault; empty for a normal end."""
    if end.is_gap_free and end.reason not in RECONNECT_REASONS:
        return ""
    lost = f"{'' if end.lost_is_exact else 'at least '}{end.lost:,} samples lost"
    return f"segment {end.segment} ended after {end.samples:,} samples: {end.reason.value}, {lost}; {end.detail}"


def reconnect_message(end: SegmentEnd, reconnect_s: float) -> str:
    """Return how long a disconnected device may take to return, s; empty where the run does not wait for it."""
    if end.reason not in RECONNECT_REASONS or reconnect_s <= 0:
        return ""
    return f"; reconnecting for {reconnect_s:g} s at most (session.reconnect_s)"


def recording_health(statistics: RecorderStatistics, rate: float, timing: TimingSection) -> tuple[RunState, str]:
    """Return the state of a recording and a message for the operator, empty where all is well.

    Parameters
    ----------
    statistics : RecorderStatistics
        The recorder's counts.
    rate : float
        Sample rate, Hz.
    timing : TimingSection
        Duration of a block and of the card's buffer.
    """
    if statistics.time_since_block > timing.block_s + MAX_BLOCK_DELAY:
        return RunState.INTERRUPTED, f"no samples for {statistics.time_since_block:.0f} s"
    if event := statistics.armed_event:
        recorded = f", {event - 1} recorded" if event > 1 else ""
        return RunState.ARMED, f"armed{recorded}: waiting for the start condition, {statistics.speed_rpm:,} r/min now"
    backlog = statistics.backlog / rate
    if backlog > MAX_BUFFER_FILL * timing.buffer_s:
        return RunState.DEGRADED, (
            f"the card's buffer of {timing.buffer_s:g} s holds {backlog:.1f} s: samples are about to be lost; "
            "close other programs or lower timing.rate_hz"
        )
    return RunState.RECORDING, ""


def clipped_channels(statistics: RecorderStatistics, acquisition: Acquisition) -> tuple[Clipping, ...]:
    """Return the channels that have been clipped, as counted by the recorder."""
    names = [channel.name for channel in acquisition.channels]
    counts = [(name, *statistics.clipped(row)) for row, name in enumerate(names)]
    return tuple(
        Clipping(name, samples, blocks, end / acquisition.rate) for name, samples, blocks, end in counts if samples
    )
