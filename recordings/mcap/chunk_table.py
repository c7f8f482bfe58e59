"""Table of the chunks of an MCAP file, stored as columns: one hour of a run has some 20,000 chunks."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

INDEX = np.dtype([("start_ns", "<u8"), ("end_ns", "<u8"), ("offset", "<u8"), ("length", "<u8"), ("index_bytes", "<u4")])
"""First fields of a chunk index record; the id and the offset of each channel follow."""
CHANNEL_BYTES = 10
RECORD_HEAD = 9
"""Bytes of opcode and length before the content of a record."""
COLUMNS = ("offset", "length", "start_ns")

Channels = frozenset[int]


@dataclass(frozen=True, slots=True)
class ChunkLocation:
    """Position of a chunk in the file, and what it contains.

    Parameters
    ----------
    offset, length : int
        Position and length of the record's content in the file, bytes.
    start_ns : int
        Log time of the earliest message, ns.
    channels : frozenset of int or None
        Ids of the channels with messages in the chunk; None if only reading the chunk can show them.
    """

    offset: int
    length: int
    start_ns: int
    channels: Channels | None

    def may_contain(self, channels: Channels) -> bool:
        """Return whether the chunk may contain messages of any of these channels."""
        return self.channels is None or not self.channels.isdisjoint(channels)


class ChunkTable:
    """The chunks of a file, in file order.

    Parameters
    ----------
    offsets, lengths, starts_ns : array_like of int, shape (n,)
        As in `ChunkLocation`.
    channel_sets : array_like of int, shape (n,)
        Index into `channels` for each chunk.
    channels : sequence of frozenset of int or None
        The distinct channel sets, as in `ChunkLocation`.
    """

    def __init__(
        self,
        offsets: Sequence[int] | NDArray[np.uint64],
        lengths: Sequence[int] | NDArray[np.uint64],
        starts_ns: Sequence[int] | NDArray[np.uint64],
        channel_sets: Sequence[int] | NDArray[np.int64],
        channels: Sequence[Channels | None],
    ) -> None:
        self._columns = np.array([offsets, lengths, starts_ns], dtype=np.uint64)
        self._channel_sets = np.asarray(channel_sets, dtype=np.int64)
        self._channels = tuple(channels)

    @classmethod
    def from_locations(cls, locations: Iterable[ChunkLocation]) -> Self:
        """Return the table of these chunks."""
        chunks = list(locations)
        numbers: dict[Channels | None, int] = {}
        channel_sets = [numbers.setdefault(chunk.channels, len(numbers)) for chunk in chunks]
        offsets, lengths, starts_ns = ([getattr(chunk, name) for chunk in chunks] for name in COLUMNS)
        return cls(offsets, lengths, starts_ns, channel_sets, tuple(numbers))

    @classmethod
    def from_index(cls, contents: Sequence[bytes]) -> Self:
        """Return the table from the contents of a file's chunk index records.

        All records are decoded together: pass k adds the k-th channel of every record to that record's channel set,
        and merges sets that are equal, so that the work in Python grows with the distinct sets and not with the chunks.
        """
        sizes = np.array([len(content) for content in contents], dtype=np.int64)
        data = np.frombuffer(b"".join(contents), dtype=np.uint8)
        starts = np.cumsum(sizes) - sizes
        heads = data[starts[:, np.newaxis] + np.arange(INDEX.itemsize)].view(INDEX).reshape(-1)
        counts = np.minimum(heads["index_bytes"], sizes - INDEX.itemsize) // CHANNEL_BYTES
        channel_sets = np.zeros(len(contents), dtype=np.int64)
        channels = [Channels()]
        for k in range(int(counts.max(initial=0))):
            rows = np.flatnonzero(counts > k)
            position = starts[rows] + INDEX.itemsize + k * CHANNEL_BYTES
            added = data[position] | data[position + 1].astype(np.int64) << 8
            grown, channel_sets[rows] = np.unique(channel_sets[rows] << 16 | added, return_inverse=True)
            channel_sets[rows] += len(channels)
            channels += [channels[pair >> 16] | {pair & 0xFFFF} for pair in grown.tolist()]
        offsets, lengths = heads["offset"] + RECORD_HEAD, heads["length"] - RECORD_HEAD
        return cls(offsets, lengths, heads["start_ns"], channel_sets, channels)

    def __len__(self) -> int:
        return len(self._channel_sets)

    def __getitem__(self, number: int) -> ChunkLocation:
        offset, length, start_ns = self._columns[:, number].tolist()
        return ChunkLocation(offset, length, start_ns, self._channels[self._channel_sets[number]])

    def __iter__(self) -> Iterator[ChunkLocation]:
        return self.starting_at(0)

    def starting_at(self, number: int) -> Iterator[ChunkLocation]:
        """Yield the chunks from this number on."""
        return (self[k] for k in range(number, len(self)))

    def last_before(self, channels: Channels, time_ns: int) -> int:
        """Return the number of the last chunk with any of these channels that starts at or before a time.

        Chunks with these channels must be in time order. If none starts that early, the first of them is returned;
        without any, 0.
        """
        is_wanted = [found is not None and not found.isdisjoint(channels) for found in self._channels]
        numbers = np.flatnonzero(np.array(is_wanted)[self._channel_sets])
        if not len(numbers):
            return 0
        after = np.searchsorted(self._columns[2, numbers], np.uint64(max(time_ns, 0)), side="right")
        return int(numbers[max(int(after) - 1, 0)])
