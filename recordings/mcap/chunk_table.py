"""Where the chunks of a file lie. An hour has twenty thousand of them: they are kept as columns."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

INDEX = np.dtype([("start_ns", "<u8"), ("end_ns", "<u8"), ("offset", "<u8"), ("length", "<u8"), ("index_bytes", "<u4")])
"""How a chunk index begins; a channel's number and place follow for every channel."""
CHANNEL_BYTES = 10
RECORD_HEAD = 9
"""Bytes of opcode and length in front of a record's content."""
COLUMNS = ("offset", "length", "start_ns")

Channels = frozenset[int]


@dataclass(frozen=True, slots=True)
class ChunkLocation:
    """Where a chunk lies and what it holds.

    Parameters
    ----------
    offset, length : int
        Place of its record's content in the file, bytes.
    start_ns : int
        Log time of its earliest message, ns.
    channels : frozenset of int or None
        Channels of its messages; None where that is not known without reading it.
    """

    offset: int
    length: int
    start_ns: int
    channels: Channels | None

    def may_hold(self, channels: Channels) -> bool:
        """Whether any message of these channels may be in it."""
        return self.channels is None or not self.channels.isdisjoint(channels)


class ChunkTable:
    """The chunks of a file in its order.

    Parameters
    ----------
    offsets, lengths, starts_ns : array_like of int, shape (n,)
        As in `ChunkLocation`.
    kinds : array_like of int, shape (n,)
        Which of `channels` each chunk holds.
    channels : sequence of frozenset of int or None
        As in `ChunkLocation`.
    """

    def __init__(
        self,
        offsets: Sequence[int] | NDArray[np.uint64],
        lengths: Sequence[int] | NDArray[np.uint64],
        starts_ns: Sequence[int] | NDArray[np.uint64],
        kinds: Sequence[int] | NDArray[np.int64],
        channels: Sequence[Channels | None],
    ) -> None:
        self._columns = np.array([offsets, lengths, starts_ns], dtype=np.uint64)
        self._kinds = np.asarray(kinds, dtype=np.int64)
        self._channels = tuple(channels)

    @classmethod
    def of(cls, places: Iterable[ChunkLocation]) -> Self:
        """Return the table of places that were found one by one."""
        found = list(places)
        kinds: dict[Channels | None, int] = {}
        numbers = [kinds.setdefault(place.channels, len(kinds)) for place in found]
        offsets, lengths, starts_ns = ([getattr(place, name) for place in found] for name in COLUMNS)
        return cls(offsets, lengths, starts_ns, numbers, tuple(kinds))

    @classmethod
    def from_index(cls, contents: Sequence[bytes]) -> Self:
        """Return the table that the contents of a file's chunk indexes make."""
        sizes = np.array([len(content) for content in contents], dtype=np.int64)
        data = np.frombuffer(b"".join(contents), dtype=np.uint8)
        places = np.cumsum(sizes) - sizes
        heads = data[places[:, np.newaxis] + np.arange(INDEX.itemsize)].view(INDEX).reshape(-1)
        counts = np.minimum(heads["index_bytes"], sizes - INDEX.itemsize) // CHANNEL_BYTES
        kinds = np.zeros(len(contents), dtype=np.int64)
        channels = [Channels()]
        for k in range(int(counts.max(initial=0))):  # sets grow by one channel at a time; equal ones stay one
            rows = np.flatnonzero(counts > k)
            number = places[rows] + INDEX.itemsize + k * CHANNEL_BYTES
            added = data[number] | data[number + 1].astype(np.int64) << 8
            grown, kinds[rows] = np.unique(kinds[rows] << 16 | added, return_inverse=True)
            kinds[rows] += len(channels)
            channels += [channels[pair >> 16] | {pair & 0xFFFF} for pair in grown.tolist()]
        return cls(heads["offset"] + RECORD_HEAD, heads["length"] - RECORD_HEAD, heads["start_ns"], kinds, channels)

    def __len__(self) -> int:
        return len(self._kinds)

    def __getitem__(self, number: int) -> ChunkLocation:
        offset, length, start_ns = self._columns[:, number].tolist()
        return ChunkLocation(offset, length, start_ns, self._channels[self._kinds[number]])

    def __iter__(self) -> Iterator[ChunkLocation]:
        return self.starting_at(0)

    def starting_at(self, number: int) -> Iterator[ChunkLocation]:
        """Yield the chunks from this one on."""
        return (self[k] for k in range(number, len(self)))

    def last_before(self, channels: Channels, time_ns: int) -> int:
        """Return the number of the last chunk known to hold any of these channels that begins at this time or before.

        The chunks that hold them must lie in the order of time. Where none begins so early it is the first of them, and
        0 where there are none.
        """
        is_wanted = [found is not None and not found.isdisjoint(channels) for found in self._channels]
        numbers = np.flatnonzero(np.array(is_wanted)[self._kinds])
        if not len(numbers):
            return 0
        after = np.searchsorted(self._columns[2, numbers], np.uint64(max(time_ns, 0)), side="right")
        return int(numbers[max(int(after) - 1, 0)])
