"""Ring buffer of blocks in shared memory, from the recorder process to the live analysis.

One writer, any number of readers, each with its own position. The writer never waits: a reader that falls a whole ring
behind finds its item overwritten, moves on to the oldest items left and counts the samples that it skipped.
"""

import json
from collections.abc import Iterator
from ctypes import Array, Structure, c_char, c_int64, sizeof
from dataclasses import asdict, replace
from multiprocessing import get_context
from typing import Any, ClassVar, TypeAlias

import numpy as np
from numpy.typing import NDArray

from analysis.signals.blocks import SampleBlock, SegmentEnd, SourceItem
from recordings.mcap.reader import segment_end_from_json

SharedBytes: TypeAlias = "Array[c_char]"
"""Shared memory; a process can only get it as an argument when it is started."""

_END_BYTES = 4096  # of the JSON of a segment end
_TICKS = 512  # counter timestamps per slot
_NO_COUNTER = -1  # number of timestamps where there is no counter


class _Header(Structure):
    published: int
    is_closed: int
    channels: int
    capacity: int
    slots: int
    samples: int  # in all items published
    _fields_: ClassVar[Any] = [
        (name, c_int64) for name in ("published", "is_closed", "channels", "capacity", "slots", "samples")
    ]


def _slot_type(n_channels: int, capacity: int) -> np.dtype[np.void]:
    """Return the memory layout of a slot, which holds a block or a segment end."""
    fields = [
        ("index", np.int64),  # written last: the number of the item in this slot, -1 while the slot changes
        (
            "meta",
            np.int64,
            7,
        ),  # segment, first sample, samples, host time, backlog, timestamps, earlier samples
        ("ticks", np.int64, _TICKS),
        ("end", f"S{_END_BYTES}"),  # empty for a block
        ("codes", np.int16, (n_channels, capacity)),
    ]
    return np.dtype(fields, align=True)


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
        self._header = header = _Header.from_buffer(memory)
        slot = _slot_type(header.channels, header.capacity)
        self._slots = np.frombuffer(memoryview(memory), slot, header.slots, offset=sizeof(_Header))

    @classmethod
    def create(cls, n_channels: int, capacity: int, n_slots: int) -> "BlockRing":
        """Create a ring of `n_slots` blocks of up to `capacity` samples per channel."""
        if min(n_channels, capacity, n_slots) < 1:
            raise ValueError(f"ring of {n_slots} slots × {n_channels} channels × {capacity} samples: expected ≥ 1 each")
        size = sizeof(_Header) + n_slots * _slot_type(n_channels, capacity).itemsize
        memory = get_context("spawn").RawArray(c_char, size)
        header = _Header.from_buffer(memory)
        header.channels, header.capacity, header.slots = n_channels, capacity, n_slots
        return cls(memory)

    @property
    def published(self) -> int:
        """Number of items published so far."""
        return self._header.published

    @property
    def n_slots(self) -> int:
        """Number of items that the ring holds."""
        return self._header.slots

    @property
    def is_closed(self) -> bool:
        """Whether the writer has published its last item."""
        return bool(self._header.is_closed)

    def put(self, item: SourceItem) -> None:
        """Publish an item, in pieces where a block has more samples or timestamps than a slot holds."""
        n_channels, capacity = self._header.channels, self._header.capacity
        if isinstance(item, SegmentEnd):
            end = json.dumps(asdict(replace(item, detail=item.detail[:1000]))).encode()
            self._publish((item.segment, item.samples, 0, 0, 0), np.empty((n_channels, 0), np.int16), None, end)
            return
        if item.codes.shape[0] != n_channels:
            raise ValueError(f"block of {item.codes.shape[0]} channels: the ring holds {n_channels}")
        ticks = item.ticks
        while ticks is not None and ticks.size > _TICKS:  # surplus timestamps go first: samples are never late
            self._publish_samples(item, 0, item.codes[:, :0], ticks[:_TICKS])
            ticks = ticks[_TICKS:]
        for start in range(0, item.n_samples, capacity):
            self._publish_samples(item, start, item.codes[:, start : start + capacity], ticks)
            ticks = None if ticks is None else ticks[:0]

    def _publish_samples(
        self, block: SampleBlock, start: int, codes: NDArray[np.int16], ticks: NDArray[np.int64] | None
    ) -> None:
        first = block.first_sample + start
        self._publish((block.segment, first, codes.shape[1], block.host_time_ns, block.backlog), codes, ticks)

    def _publish(
        self, meta: tuple[int, ...], codes: NDArray[np.int16], ticks: NDArray[np.int64] | None, end: bytes = b""
    ) -> None:
        header = self._header
        slot = self._slots[header.published % header.slots]
        slot["index"] = -1  # a reader of this slot sees that its item is overwritten
        slot["meta"] = (*meta, _NO_COUNTER if ticks is None else ticks.size, header.samples)
        slot["end"] = end
        slot["codes"][:, : codes.shape[1]] = codes
        if ticks is not None:
            slot["ticks"][: ticks.size] = ticks
        slot["index"] = header.published
        header.samples += codes.shape[1]
        header.published += 1

    def finish(self) -> None:
        """Mark the ring as closed: no more items follow."""
        self._header.is_closed = 1

    def read(self, index: int) -> tuple[SourceItem, int] | None:
        """Return a copy of item `index` and the number of samples before it; None where it has been overwritten."""
        slot = self._slots[index % self._header.slots]
        if slot["index"] != index:
            return None
        copied = slot.copy()
        if slot["index"] != index:  # overwritten during the copy
            return None
        segment, first, n_samples, host_time, backlog, n_ticks, before = copied["meta"].tolist()
        if copied["end"]:
            return segment_end_from_json(json.loads(copied["end"])), before
        ticks = None if n_ticks == _NO_COUNTER else copied["ticks"][:n_ticks].copy()
        codes = np.ascontiguousarray(copied["codes"][:, :n_samples])
        return SampleBlock(codes, segment, first, host_time, backlog, ticks), before


class RingReader:
    """Reader of a ring with its own position, which begins at the oldest item in the ring.

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
            copied = self._ring.read(self._next)
            self._next += 1
            if copied is not None:
                item, before = copied
                self.skipped = before - self._read
                self._read += item.n_samples if isinstance(item, SampleBlock) else 0
                yield item
