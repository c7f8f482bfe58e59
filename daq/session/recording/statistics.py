"""Statistics of a recording in shared memory, and its health derived from them.

The recorder writes them, any process reads them, without a lock: a reader that is suspended or killed while it holds a
lock would block the recorder. Instead a counter is odd while related words change, and a reader repeats a read during
which the counter changed (a seqlock).
"""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from ctypes import Array, Structure, c_int64
from multiprocessing import get_context
from typing import Any, ClassVar, TypeVar

import numpy as np

from analysis.signals.blocks import SampleBlock, SegmentEnd
from analysis.signals.header import CODE_MAX, CODE_MIN, Acquisition
from daq.config.schema import TimingSection
from daq.drivers.factory import RECONNECT_REASONS
from daq.session.live_update import Clipping, RunState

MAX_CHANNELS = 16  # of one card
_MAX_READS = 1000  # of counts that keep changing: their writer may have been killed during a change

_COUNTS = (
    "changes",
    "samples",
    "segment_samples",
    "segment",
    "lost",
    "lost_is_lower_bound",
    "backlog",
    "disk_bytes_left",
    "block_at",
    "armed_event",
    "speed_rpm",
)

Found = TypeVar("Found")


class _ClippedChannel(Structure):
    samples: int
    blocks: int
    end: int  # samples of the run up to the end of the last block with clipped samples
    _fields_: ClassVar[Any] = [("samples", c_int64), ("blocks", c_int64), ("end", c_int64)]


class RecorderStatistics(Structure):
    """Counts of a recording in shared memory from `allocate`, written by one process and read by any.

    Attributes
    ----------
    changes : int
        Odd while related counts change; rises by two with each change.
    samples, segment_samples : int
        Samples per channel recorded, in all and in the current segment.
    segment : int
        The current segment.
    lost : int
        Samples per channel known to be lost.
    lost_is_lower_bound : int
        Whether more than that may be lost.
    backlog : int
        Samples per channel that the device held at the last read.
    disk_bytes_left : int
        Bytes that can be written until the disk reserve is reached; -1 before the first check.
    block_at : int
        Monotonic clock at the last block, ns; 0 before blocks are expected.
    armed_event, speed_rpm : int
        Number, from 1, of the event whose start condition is awaited, and the speed meanwhile, r/min; 0 while samples
        are recorded.
    """

    changes: int
    samples: int
    segment_samples: int
    segment: int
    lost: int
    lost_is_lower_bound: int
    backlog: int
    disk_bytes_left: int
    block_at: int
    armed_event: int
    speed_rpm: int
    _clipping: "Array[_ClippedChannel]"
    _fields_: ClassVar[Any] = [
        *((name, c_int64) for name in _COUNTS),
        ("_clipping", _ClippedChannel * MAX_CHANNELS),
    ]

    @staticmethod
    def allocate() -> "RecorderStatistics":
        """Return the statistics of a new recording; another process gets them as an argument when it is started."""
        statistics = get_context("spawn").RawValue(RecorderStatistics)
        statistics.disk_bytes_left = -1
        return statistics

    @contextmanager
    def _changing(self) -> Iterator[None]:
        """Mark related counts as changing."""
        self.changes += 1
        try:
            yield
        finally:
            self.changes += 1

    def _consistent(self, read: Callable[[], Found]) -> Found:
        """Return related counts, all from the same change."""
        for _ in range(_MAX_READS):
            before, found = self.changes, read()
            if before % 2 == 0 and before == self.changes:
                break
        return found

    def start(self) -> None:
        """Expect blocks from now on."""
        self.block_at = time.monotonic_ns()

    def set_armed(self, event: int, speed: float) -> None:
        """Set the number of the event whose start condition is awaited, and the present speed, r/min."""
        with self._changing():
            self.armed_event = event
            self.speed_rpm = round(speed)
            self.block_at = time.monotonic_ns()

    def add_block(self, block: SampleBlock) -> None:
        """Count a recorded block."""
        rails = np.count_nonzero((block.codes == CODE_MIN) | (block.codes == CODE_MAX), axis=1).tolist()
        with self._changing():
            self.samples += block.n_samples
            self.segment_samples = block.end
            self.segment = block.segment
            self.backlog = block.backlog
            self.armed_event = 0
            self.block_at = time.monotonic_ns()
            for channel, clipped in zip(self._clipping, rails, strict=False):
                if clipped:
                    channel.samples += clipped
                    channel.blocks += 1
                    channel.end = self.samples

    def add_end(self, end: SegmentEnd) -> None:
        """Count the samples lost at the end of a segment."""
        with self._changing():
            self.lost += end.lost
            self.lost_is_lower_bound |= not end.lost_is_exact
            self.segment_samples = 0
            self.segment = end.segment + 1
            self.backlog = 0

    @property
    def position(self) -> tuple[int, int]:
        """The current segment and the samples per channel recorded in it."""
        return self._consistent(lambda: (self.segment, self.segment_samples))

    def clipped(self, row: int) -> tuple[int, int, int]:
        """Return a channel's clipped samples, the blocks with any, and the samples up to the end of the last one."""
        channel = self._clipping[row]
        return self._consistent(lambda: (channel.samples, channel.blocks, channel.end))

    @property
    def time_since_block(self) -> float:
        """Time since the last block, s; 0 before blocks are expected."""
        at = self.block_at
        return (time.monotonic_ns() - at) / 1e9 if at else 0.0


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
