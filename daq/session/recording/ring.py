"""The bounded ring of blocks in shared memory between the process that acquires and the one that watches.

One writer, any number of readers, each with its own place. The writer never waits: a reader that falls a whole ring
behind finds its place overwritten, moves on to the oldest block still there and is told how many samples it missed.

Memory that a process shares with those that it starts, and with nobody else.
"""

import json
from collections.abc import Iterator
from ctypes import Array, c_char
from dataclasses import asdict
from multiprocessing import get_context
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd, SourceItem

SharedBytes: TypeAlias = "Array[c_char]"
"""Given to a process when it is started, and in no other way."""


def shared_bytes(size: int) -> SharedBytes:
    """Return so many zeroed bytes, aligned to words."""
    return get_context("spawn").RawArray(c_char, size)


def byte_view(memory: SharedBytes) -> NDArray[np.uint8]:
    """Return shared memory as it is, not a copy."""
    return np.frombuffer(memoryview(memory), dtype=np.uint8)


_HEADER = 6  # int64 words at the front: published, closed, channels, slot capacity, slots, samples put
# int64 words before a slot's data: kind, segment, first, samples, host time, backlog, bytes, ticks, put before, ticket
_META = 10
_BEFORE = 8  # samples put before this item
_TICKET = 9  # written last: the index of the item that lies here, -1 while it changes
_BLOCK, _END = 0, 1
_END_BYTES = 4096  # a slot always holds the text of a segment end
_TICKS = 512  # and so many of a counter's stamps, in front of its codes
_NO_COUNTER = -1  # for their number, where no counter stamps


_Words = NDArray[np.int64]


def _slot_bytes(n_channels: int, capacity: int) -> int:
    data = max(n_channels * capacity * 2, _END_BYTES)
    return (_META + _TICKS) * 8 + (data + 7) // 8 * 8


class BlockRing:
    """Blocks and segment ends in shared memory.

    Parameters
    ----------
    memory : SharedBytes
        The memory; another process makes a ring of it to share it.

    Attributes
    ----------
    memory : SharedBytes
        The memory.
    """

    def __init__(self, memory: SharedBytes) -> None:
        self.memory = memory
        self._bytes = byte_view(memory)
        self._words: _Words = self._bytes[: _HEADER * 8].view(np.int64)
        self._slot = _slot_bytes(int(self._words[2]), int(self._words[3]))

    @classmethod
    def create(cls, n_channels: int, capacity: int, n_slots: int) -> "BlockRing":
        """Make a ring of `n_slots` blocks of up to `capacity` samples per channel."""
        if min(n_channels, capacity, n_slots) < 1:
            raise ValueError(f"ring of {n_slots} slots × {n_channels} channels × {capacity} samples: expected ≥ 1 each")
        memory = shared_bytes(_HEADER * 8 + n_slots * _slot_bytes(n_channels, capacity))
        byte_view(memory)[: _HEADER * 8].view(np.int64)[:] = (0, 0, n_channels, capacity, n_slots, 0)
        return cls(memory)

    @property
    def published(self) -> int:
        """Items put since the beginning."""
        return int(self._words[0])

    @property
    def n_slots(self) -> int:
        """Items that the ring holds."""
        return int(self._words[4])

    @property
    def is_closed(self) -> bool:
        """Whether the writer has put its last item."""
        return bool(self._words[1])

    def _place(self, index: int) -> tuple[_Words, int]:
        offset = _HEADER * 8 + (index % int(self._words[4])) * self._slot
        return np.ndarray((_META,), dtype=np.int64, buffer=self._bytes, offset=offset), offset + _META * 8

    def put(self, item: SourceItem) -> None:
        """Publish an item; blocks longer than a slot, or of more stamps than it holds, are published in pieces."""
        if isinstance(item, SegmentEnd):
            self._put_end(item)
            return
        capacity = int(self._words[3])
        if item.codes.shape[0] != self._words[2]:
            raise ValueError(f"block of {item.codes.shape[0]} channels: the ring holds {self._words[2]}")
        ticks = item.ticks
        while ticks is not None and ticks.size > _TICKS:  # the surplus goes ahead: samples wait for no stamps
            self._put_codes(item, 0, item.codes[:, :0], ticks[:_TICKS])
            ticks = ticks[_TICKS:]
        for start in range(0, item.n_samples, capacity):
            self._put_codes(item, start, item.codes[:, start : start + capacity], ticks)
            ticks = None if ticks is None else ticks[:0]

    def _put_codes(
        self, item: SampleBlock, start: int, codes: NDArray[np.int16], ticks: NDArray[np.int64] | None
    ) -> None:
        meta, data = self._begin()
        n_ticks = _NO_COUNTER if ticks is None else ticks.size
        if ticks is not None:
            np.ndarray(n_ticks, dtype=np.int64, buffer=self._bytes, offset=data)[:] = ticks
        np.ndarray(codes.shape, dtype=np.int16, buffer=self._bytes, offset=data + _TICKS * 8)[:] = codes
        first = item.first_sample + start
        self._publish(meta, _BLOCK, item.segment, first, codes.shape[1], item.host_time_ns, item.backlog, 0, n_ticks)

    def _put_end(self, end: SegmentEnd) -> None:
        document = asdict(end)
        document["detail"] = end.detail[:1000]
        text = json.dumps(document).encode()
        meta, data = self._begin()
        self._bytes[data : data + len(text)] = np.frombuffer(text, dtype=np.uint8)
        self._publish(meta, _END, end.segment, end.samples, 0, 0, 0, len(text), _NO_COUNTER)

    def _begin(self) -> tuple[_Words, int]:
        meta, data = self._place(self.published)
        meta[_TICKET] = -1  # a reader that is here has been lapped
        return meta, data

    def _publish(self, meta: _Words, *words: int) -> None:
        meta[:_BEFORE] = words
        meta[_BEFORE] = self._words[5]
        meta[_TICKET] = self._words[0]
        self._words[5] += words[3]
        self._words[0] += 1

    def finish(self) -> None:
        """Say that nothing more will come."""
        self._words[1] = 1

    def read(self, index: int) -> tuple[SourceItem, int] | None:
        """Return a copy of item `index` and the samples put before it, or None where it has been overwritten."""
        meta, data = self._place(index)
        kind, segment, first, n_samples, host_time, backlog, length, n_ticks, before, ticket = map(int, meta)
        if ticket != index:
            return None
        shape = (int(self._words[2]), n_samples)
        codes = np.ndarray(shape, dtype=np.int16, buffer=self._bytes, offset=data + _TICKS * 8).copy()
        ticks = None if n_ticks == _NO_COUNTER else self._ticks(data, n_ticks)
        text = self._bytes[data : data + length].tobytes()
        if int(meta[_TICKET]) != index:  # it changed while it was copied
            return None
        if kind == _BLOCK:
            return SampleBlock(codes, segment, first, host_time, backlog, ticks), before
        document = json.loads(text)
        return SegmentEnd(**{**document, "reason": EndReason(document["reason"])}), before

    def _ticks(self, data: int, n: int) -> NDArray[np.int64]:
        return np.ndarray(n, dtype=np.int64, buffer=self._bytes, offset=data).copy()

    def reader(self) -> "RingReader":
        """Return a reader placed at the oldest item still there."""
        return RingReader(self)


class RingReader:
    """One reader's place in a ring.

    Parameters
    ----------
    ring : BlockRing
        What is read.

    Attributes
    ----------
    skipped : int
        Samples per channel that were overwritten before they were read.
    """

    def __init__(self, ring: BlockRing) -> None:
        self._ring = ring
        self._next = max(0, ring.published - ring.n_slots)
        self._read = 0
        self.skipped = 0

    @property
    def lag(self) -> int:
        """Items published and not yet read."""
        return self._ring.published - self._next

    def available(self) -> Iterator[SourceItem]:
        """Yield what has been published and not yet read, as copies."""
        while self._next < self._ring.published:
            if self.lag > self._ring.n_slots:  # overwritten: go to where there is room again
                self._next = self._ring.published - self._ring.n_slots // 2
            found = self._ring.read(self._next)
            self._next += 1
            if found is not None:
                item, before = found
                self.skipped = before - self._read
                self._read += item.n_samples if isinstance(item, SampleBlock) else 0
                yield item
