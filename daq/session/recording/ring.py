"""Ring buffer of blocks in shared memory, from the recorder process to the live analysis.

One writer, any number of readers, each with its own position. The writer never waits: a reader that falls a whole ring
behind finds its item overwritten, moves on to the oldest items left and counts the samples that it skipped.
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
"""Shared memory; a process can only get it as an argument when it is started."""


def allocate_shared_bytes(size: int) -> SharedBytes:
    """Return `size` zeroed bytes of shared memory, aligned to words."""
    return get_context("spawn").RawArray(c_char, size)


def byte_view(memory: SharedBytes) -> NDArray[np.uint8]:
    """Return shared memory as an array, without a copy."""
    return np.frombuffer(memoryview(memory), dtype=np.uint8)


_HEADER = 6  # int64 words of the header: published, closed, channels, slot capacity, slots, samples put
# int64 words before a slot's data: kind, segment, first, samples, host time, backlog, bytes, ticks, put before, index
_META = 10
_BEFORE = 8  # samples put before this item
_INDEX = 9  # written last: the index of the item in this slot, -1 while the slot changes
_BLOCK, _END = 0, 1
_END_BYTES = 4096  # every slot can hold the JSON of a segment end
_TICKS = 512  # counter stamps per slot, before the codes
_NO_COUNTER = -1  # number of stamps where there is no counter


_Words = NDArray[np.int64]


def _slot_bytes(n_channels: int, capacity: int) -> int:
    data = max(n_channels * capacity * 2, _END_BYTES)
    return (_META + _TICKS) * 8 + (data + 7) // 8 * 8


class BlockRing:
    """Ring buffer of blocks and segment ends in shared memory.

    Parameters
    ----------
    memory : SharedBytes
        Memory of a ring from `create`, also in another process.

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
        """Create a ring of `n_slots` blocks of up to `capacity` samples per channel."""
        if min(n_channels, capacity, n_slots) < 1:
            raise ValueError(f"ring of {n_slots} slots × {n_channels} channels × {capacity} samples: expected ≥ 1 each")
        memory = allocate_shared_bytes(_HEADER * 8 + n_slots * _slot_bytes(n_channels, capacity))
        byte_view(memory)[: _HEADER * 8].view(np.int64)[:] = (0, 0, n_channels, capacity, n_slots, 0)
        return cls(memory)

    @property
    def published(self) -> int:
        """Number of items published so far."""
        return int(self._words[0])

    @property
    def n_slots(self) -> int:
        """Number of items that the ring holds."""
        return int(self._words[4])

    @property
    def is_closed(self) -> bool:
        """Whether the writer has published its last item."""
        return bool(self._words[1])

    def _locate(self, index: int) -> tuple[_Words, int]:
        offset = _HEADER * 8 + (index % int(self._words[4])) * self._slot
        return np.ndarray((_META,), dtype=np.int64, buffer=self._bytes, offset=offset), offset + _META * 8

    def put(self, item: SourceItem) -> None:
        """Publish an item, in pieces where a block has more samples or stamps than a slot holds."""
        if isinstance(item, SegmentEnd):
            self._put_end(item)
            return
        capacity = int(self._words[3])
        if item.codes.shape[0] != self._words[2]:
            raise ValueError(f"block of {item.codes.shape[0]} channels: the ring holds {self._words[2]}")
        ticks = item.ticks
        while (
            ticks is not None and ticks.size > _TICKS
        ):  # surplus stamps go first, without samples, so that samples are never late
            self._put_codes(item, 0, item.codes[:, :0], ticks[:_TICKS])
            ticks = ticks[_TICKS:]
        for start in range(0, item.n_samples, capacity):
            self._put_codes(item, start, item.codes[:, start : start + capacity], ticks)
            ticks = None if ticks is None else ticks[:0]

    def _put_codes(
        self, item: SampleBlock, start: int, codes: NDArray[np.int16], ticks: NDArray[np.int64] | None
    ) -> None:
        meta, data = self._next_slot()
        n_ticks = _NO_COUNTER if ticks is None else ticks.size
        if ticks is not None:
            np.ndarray(n_ticks, dtype=np.int64, buffer=self._bytes, offset=data)[:] = ticks
        np.ndarray(codes.shape, dtype=np.int16, buffer=self._bytes, offset=data + _TICKS * 8)[:] = codes
        first = item.first_sample + start
        self._publish(meta, _BLOCK, item.segment, first, codes.shape[1], item.host_time_ns, item.backlog, 0, n_ticks)

    def _put_end(self, end: SegmentEnd) -> None:
        fields = asdict(end)
        fields["detail"] = end.detail[:1000]
        text = json.dumps(fields).encode()
        meta, data = self._next_slot()
        self._bytes[data : data + len(text)] = np.frombuffer(text, dtype=np.uint8)
        self._publish(meta, _END, end.segment, end.samples, 0, 0, 0, len(text), _NO_COUNTER)

    def _next_slot(self) -> tuple[_Words, int]:
        meta, data = self._locate(self.published)
        meta[_INDEX] = -1  # a reader of this slot sees that its item is overwritten
        return meta, data

    def _publish(self, meta: _Words, *words: int) -> None:
        meta[:_BEFORE] = words
        meta[_BEFORE] = self._words[5]
        meta[_INDEX] = self._words[0]
        self._words[5] += words[3]
        self._words[0] += 1

    def finish(self) -> None:
        """Mark the ring as closed: no more items follow."""
        self._words[1] = 1

    def read(self, index: int) -> tuple[SourceItem, int] | None:
        """Return a copy of item `index` and the number of samples before it; None where it has been overwritten."""
        meta, data = self._locate(index)
        kind, segment, first, n_samples, host_time, backlog, length, n_ticks, before, slot_index = map(int, meta)
        if slot_index != index:
            return None
        shape = (int(self._words[2]), n_samples)
        codes = np.ndarray(shape, dtype=np.int16, buffer=self._bytes, offset=data + _TICKS * 8).copy()
        ticks = None if n_ticks == _NO_COUNTER else self._ticks(data, n_ticks)
        text = self._bytes[data : data + length].tobytes()
        if int(meta[_INDEX]) != index:  # overwritten during the copy
            return None
        if kind == _BLOCK:
            return SampleBlock(codes, segment, first, host_time, backlog, ticks), before
        fields = json.loads(text)
        return SegmentEnd(**{**fields, "reason": EndReason(fields["reason"])}), before

    def _ticks(self, data: int, n: int) -> NDArray[np.int64]:
        return np.ndarray(n, dtype=np.int64, buffer=self._bytes, offset=data).copy()

    def reader(self) -> "RingReader":
        """Return a reader at the oldest item in the ring."""
        return RingReader(self)


class RingReader:
    """Reader of a ring with its own position.

    Parameters
    ----------
    ring : BlockRing
        The ring.

    Attributes
    ----------
    skipped : int
        Samples per channel overwritten before they were read.
    """

    def __init__(self, ring: BlockRing) -> None:
        self._ring = ring
        self._next = max(0, ring.published - ring.n_slots)
        self._read = 0
        self.skipped = 0

    @property
    def lag(self) -> int:
        """Number of items published and not yet read."""
        return self._ring.published - self._next

    def available(self) -> Iterator[SourceItem]:
        """Yield copies of the items published and not yet read."""
        while self._next < self._ring.published:
            if self.lag > self._ring.n_slots:  # overwritten: continue half a ring behind the writer
                self._next = self._ring.published - self._ring.n_slots // 2
            found = self._ring.read(self._next)
            self._next += 1
            if found is not None:
                item, before = found
                self.skipped = before - self._read
                self._read += item.n_samples if isinstance(item, SampleBlock) else 0
                yield item
