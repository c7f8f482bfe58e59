"""The numbers that the recorder keeps for whoever asks how the recording goes, in shared memory.

No lock is shared with the processes that ask: one that is frozen or killed while it asks must not hold the recorder up.
What belongs together is read again where it changed meanwhile.
"""

import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from analysis.signals.blocks import SampleBlock, SegmentEnd
from analysis.signals.header import CODE_MAX, CODE_MIN
from daq.session.recording.ring import SharedBytes, byte_view, shared_bytes

MAX_CHANNELS = 16  # of a card
# the first is odd while those that belong together change, and goes up by two each time
_CHANGES, _SAMPLES, _SEGMENT, _LOST, _AT_LEAST, _BACKLOG, _DISK, _BLOCK_AT, _ARMED, _RPM, _NUMBER = range(11)
_CLIPPED = 11  # from here on for each channel: samples at the converter's rails, blocks with any, the last one's end
_EACH = 3
_LOOKS = 1000  # at words that keep changing: their writer may have ended in the midst of it


class RecorderStatistics:
    """Counts of a recording: one process writes them, any may read.

    Parameters
    ----------
    memory : SharedBytes
        Shared memory from `shared`.
    """

    def __init__(self, memory: SharedBytes) -> None:
        self._words = byte_view(memory).view(np.int64)

    @staticmethod
    def allocate() -> SharedBytes:
        """Return fresh shared memory for a set of statistics."""
        memory = shared_bytes(8 * (_CLIPPED + _EACH * MAX_CHANNELS))
        byte_view(memory).view(np.int64)[_DISK] = -1
        return memory

    @contextmanager
    def _changing(self) -> Iterator[None]:
        """Change words that belong together."""
        self._words[_CHANGES] += 1
        try:
            yield
        finally:
            self._words[_CHANGES] += 1

    def _together(self, *at: int) -> tuple[int, ...]:
        """Return words that belong together."""
        found: tuple[int, ...] = ()
        for _ in range(_LOOKS):
            before = int(self._words[_CHANGES])
            found = tuple(int(self._words[word]) for word in at)
            if before % 2 == 0 and before == self._words[_CHANGES]:
                break
        return found

    def start(self) -> None:
        """Note that blocks are expected from now on."""
        self._words[_BLOCK_AT] = time.monotonic_ns()

    def set_armed(self, event: int, speed: float) -> None:
        """Note that the start of an event is waited for, at this speed, r/min."""
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
                at = _CLIPPED + _EACH * int(row)
                self._words[at] += int(rails[row])
                self._words[at + 1] += 1
                self._words[at + 2] = self._words[_SAMPLES]

    def add_end(self, end: SegmentEnd) -> None:
        """Count what was lost at the end of a segment."""
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
        """Samples per channel recorded of the present segment."""
        return int(self._words[_SEGMENT])

    @property
    def position(self) -> tuple[int, int]:
        """The present segment, and samples per channel recorded of it."""
        segment, samples = self._together(_NUMBER, _SEGMENT)
        return segment, samples

    @property
    def lost(self) -> int:
        """Samples per channel known to be lost."""
        return int(self._words[_LOST])

    @property
    def lost_is_exact(self) -> bool:
        """Whether no more than that can have been lost."""
        return not self._words[_AT_LEAST]

    def clipped(self, row: int) -> tuple[int, int, int]:
        """Return a channel's samples at the converter's rails, the blocks with any, and the samples up to the last."""
        at = _CLIPPED + _EACH * row
        samples, blocks, last = self._together(at, at + 1, at + 2)
        return samples, blocks, last

    @property
    def backlog(self) -> int:
        """Samples per channel that the device held at the last read."""
        return int(self._words[_BACKLOG])

    @property
    def armed_event(self) -> int:
        """Number of the event, from 1, whose start is waited for; 0 while samples are recorded."""
        return int(self._words[_ARMED])

    @property
    def speed_rpm(self) -> int:
        """Speed while the start is waited for, r/min."""
        return int(self._words[_RPM])

    @property
    def time_since_block(self) -> float:
        """Time since the last block, s; 0 before blocks are expected."""
        at = int(self._words[_BLOCK_AT])
        return (time.monotonic_ns() - at) / 1e9 if at else 0.0

    @property
    def disk_bytes_left(self) -> int:
        """Bytes that may still be written before the reserve is reached; -1 before it was looked at."""
        return int(self._words[_DISK])

    @disk_bytes_left.setter
    def disk_bytes_left(self, value: int) -> None:
        self._words[_DISK] = value
