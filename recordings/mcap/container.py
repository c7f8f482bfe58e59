"""Low-level reader of an MCAP file, finished or truncated: its records, metadata and chunks.

A chunk is read only if its CRC matches. The index at the end is used only if its CRC matches; without it the records
are read one after another from the start, up to the point where they break off. The chunks are a table of columns: one
hour of a run has some 20,000.
"""

import os
import struct
import threading
import zlib
from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from io import BytesIO
from itertools import takewhile
from pathlib import Path
from typing import ClassVar, Self

import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Chunk, Metadata
from mcap.writer import MCAP0_MAGIC
from numpy.typing import NDArray

from recordings.errors import DamagedError, NotFoundError, StorageError
from recordings.file_operations import storage_errors

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


MAGIC = MCAP0_MAGIC
"""First bytes of every MCAP file, and last bytes of a finished one."""
RECORD = struct.Struct("<BQ")  # opcode, length of the content
FOOTER = struct.Struct("<BQQQI")  # opcode, length, start of the summary, start of its offsets, CRC
MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
MAX_CHUNK_SIZE = 256 << 20
MAX_METADATA_SIZE = 16 << 20


@dataclass(frozen=True, slots=True)
class StoredMessage:
    """A message of a chunk: channel id, log time and serialised data."""

    channel: int
    log_time_ns: int
    data: bytes


@dataclass(frozen=True, slots=True)
class Record:
    """Position of a record in the file, with the first bytes of its content.

    Parameters
    ----------
    opcode : int
        MCAP opcode.
    offset, length : int
        Position and length of its content in the file, bytes.
    peek : bytes
        The first bytes of its content, fewer at the end of the file.
    """

    PEEK: ClassVar[int] = 8

    opcode: int
    offset: int
    length: int
    peek: bytes


class Container:
    """An open MCAP file; safe for several threads.

    Parameters
    ----------
    path : Path
        The file.

    Raises
    ------
    NotFoundError
        If there is no such file.
    DamagedError
        If it is empty or not MCAP.
    StorageError
        If it cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._lock = threading.Lock()
        with storage_errors(path, "cannot be read"):
            try:
                self._file = path.open("rb", buffering=0)
            except FileNotFoundError as error:
                raise NotFoundError(f"{path}: there is no such file") from error
        try:
            self.size = self._file.seek(0, os.SEEK_END)
            self._summary_start, self._summary_stop = self._find_summary()
            self._check_magic()
        except (DamagedError, StorageError):
            self.close()
            raise

    @property
    def is_finished(self) -> bool:
        """Whether the file ends with an intact index."""
        return self._summary_stop > 0

    @property
    def has_magic(self) -> bool:
        """Whether the file begins with MCAP's magic bytes."""
        return self.read(0, len(MAGIC)) == MAGIC

    @cached_property
    def _metadata_records(self) -> list[Metadata]:
        if not self.is_finished:
            locations = self._walk[0]
        else:
            before_chunks = takewhile(lambda record: record.opcode != Opcode.CHUNK, self._records([]))
            locations = [(each.offset, each.length) for each in before_chunks if each.opcode == Opcode.METADATA]
            for content in self.summary(Opcode.METADATA_INDEX):
                offset, length = struct.unpack_from("<QQ", content)
                locations.append((offset + RECORD.size, length - RECORD.size))
        records = [self.metadata_at(offset, length) for offset, length in dict.fromkeys(locations)]
        return [record for record in records if record is not None]

    def metadata(self, name: str) -> list[Mapping[str, str]]:
        """Return the entries of all readable metadata records of this name, in file order."""
        return [record.metadata for record in self._metadata_records if record.name == name]

    @cached_property
    def chunks(self) -> ChunkTable:
        """All chunks in file order."""
        return ChunkTable.from_index(list(self.summary(Opcode.CHUNK_INDEX))) if self.is_finished else self._walk[1]

    def messages(self, chunk: ChunkLocation) -> Iterator[StoredMessage]:
        """Yield the messages of a chunk in the order of writing; DamagedError if its checksum does not match."""
        try:
            for opcode, content in _split_records(self._chunk_data(chunk)):
                if opcode == Opcode.MESSAGE:
                    channel, _, log_time, _ = MESSAGE.unpack_from(content)
                    yield StoredMessage(channel, log_time, bytes(content[MESSAGE.size :]))
        except struct.error as error:
            raise self._damaged(chunk) from error

    def close(self) -> None:
        """Close the file; harmless when closed already."""
        with self._lock:
            self._file.close()

    def read(self, offset: int, length: int) -> bytes:
        """Return bytes of the file, fewer at its end; StorageError."""
        try:
            with self._lock:
                if self._file.closed:
                    raise StorageError(f"{self.path}: cannot be read: it has been closed")
                self._file.seek(offset)
                return self._file.read(length)
        except OSError as error:
            raise StorageError(f"{self.path}: cannot be read: {error.strerror or error}") from error

    def _check_magic(self) -> None:
        if self.size == 0:
            raise DamagedError(f"{self.path}: is empty")
        if not self.has_magic and not self.is_finished:  # an intact index is proof enough
            raise DamagedError(f"{self.path}: is not an MCAP file (its first bytes are not MCAP's)")

    def _find_summary(self) -> tuple[int, int]:
        """Return start and end of the summary; zeros if there is no intact summary."""
        nothing = (0, 0)
        stop = self.size - FOOTER.size - len(MAGIC)
        if stop < len(MAGIC):
            return nothing
        tail = self.read(stop, self.size - stop)
        opcode, _, start, _, crc = FOOTER.unpack_from(tail)
        if tail[FOOTER.size :] != MAGIC or opcode != Opcode.FOOTER or not 0 < start <= stop:
            return nothing
        return (start, stop) if zlib.crc32(self.read(start, stop - start + FOOTER.size - 4)) == crc else nothing

    def records(self) -> Iterator[Record]:
        """Yield the records of the data section; after damage, from the next record that the index lists."""
        return self._records(self._indexed_offsets)

    def _records(self, known_offsets: Sequence[int]) -> Iterator[Record]:
        """Yield records from the start on; `known_offsets`, sorted, are where to continue after damage."""
        ahead = deque(known_offsets)
        offset = len(MAGIC)
        while True:
            while ahead and ahead[0] <= offset:
                ahead.popleft()
            record = self._record_at(offset, ahead[0] if ahead else self.size)
            if record is not None:
                yield record
                offset = record.offset + record.length
            elif ahead:
                offset = ahead[0]
            else:
                return

    def _record_at(self, offset: int, stop: int) -> Record | None:
        """Return the record at an offset; None if there is none, or it would reach beyond `stop`."""
        head = self.read(offset, RECORD.size + Record.PEEK)
        if len(head) < RECORD.size:
            return None
        opcode, length = RECORD.unpack_from(head)
        if opcode in (0, Opcode.DATA_END) or offset + RECORD.size + length > stop:  # 0: zeros of allocated space
            return None
        return Record(opcode, offset + RECORD.size, length, head[RECORD.size :])

    @cached_property
    def _indexed_offsets(self) -> list[int]:
        """Sorted offsets of the records that the index lists."""
        if not self.is_finished:
            return []
        offsets = [chunk.offset - RECORD.size for chunk in self.chunks]
        for opcode in (Opcode.METADATA_INDEX, Opcode.ATTACHMENT_INDEX):
            offsets += [int.from_bytes(content[:8], "little") for content in self.summary(opcode)]
        return sorted(offsets)

    @cached_property
    def _walk(self) -> tuple[list[tuple[int, int]], ChunkTable]:
        """Metadata locations and chunks, found by reading the records one after another."""
        metadata, chunks, channels = [], list[Record](), list[set[int]]()
        for record in self.records():
            if record.opcode == Opcode.METADATA:
                metadata.append((record.offset, record.length))
            elif record.opcode == Opcode.CHUNK:
                chunks.append(record)
                channels.append(set())
            elif record.opcode == Opcode.MESSAGE_INDEX and channels:
                channels[-1].add(int.from_bytes(record.peek[:2], "little"))
        if channels:
            channels[-1].clear()  # unknown for the last chunk: its index may be cut off
        return metadata, ChunkTable.from_locations(
            ChunkLocation(chunk.offset, chunk.length, int.from_bytes(chunk.peek, "little"), frozenset(indexed) or None)
            for chunk, indexed in zip(chunks, channels, strict=True)
        )

    def summary(self, wanted: Opcode) -> Iterator[bytes]:
        """Yield the contents of the summary's records with this opcode."""
        data = self.read(self._summary_start, self._summary_stop - self._summary_start)
        return (bytes(content) for opcode, content in _split_records(data) if opcode == wanted)

    def metadata_at(self, offset: int, length: int) -> Metadata | None:
        """Return the metadata record at an offset; None if it cannot be read."""
        if length > MAX_METADATA_SIZE:
            return None
        try:
            record: Metadata = Metadata.read(ReadDataStream(BytesIO(self.read(offset, length))))
        except (McapError, struct.error, UnicodeDecodeError):
            return None
        return record

    def _chunk_data(self, chunk: ChunkLocation) -> bytes:
        """Return the uncompressed records of a chunk."""
        try:
            record = Chunk.read(ReadDataStream(BytesIO(self.read(chunk.offset, chunk.length))))
            data = self._uncompressed(chunk, record)
        except (McapError, struct.error, UnicodeDecodeError, zstandard.ZstdError) as error:
            raise self._damaged(chunk) from error
        if len(data) != record.uncompressed_size or zlib.crc32(data) != record.uncompressed_crc:
            raise self._damaged(chunk)
        return data

    def _uncompressed(self, chunk: ChunkLocation, record: Chunk) -> bytes:
        if record.compression == "":
            return record.data
        if record.compression != "zstd":
            raise DamagedError(f"{self.path}: a chunk is compressed with {record.compression!r}, expected zstd")
        declared = zstandard.frame_content_size(record.data)  # -1: omitted by another program that rewrote the file
        if declared not in (-1, record.uncompressed_size) or record.uncompressed_size > MAX_CHUNK_SIZE:
            raise self._damaged(chunk)
        return zstandard.decompress(record.data, max_output_size=record.uncompressed_size)

    def _damaged(self, chunk: ChunkLocation) -> DamagedError:
        return DamagedError(f"{self.path}: the {chunk.length} bytes from byte {chunk.offset} on are damaged")


def _split_records(data: bytes) -> Iterator[tuple[int, memoryview]]:
    """Yield opcode and content of each record; struct.error if the last is truncated."""
    view, position = memoryview(data), 0
    while position < len(data):
        opcode, length = RECORD.unpack_from(data, position)
        position += RECORD.size
        if position + length > len(data):
            raise struct.error(f"a record of {length} bytes, {len(data) - position} of them present")
        yield opcode, view[position : position + length]
        position += length


def has_end_magic(path: Path) -> bool:
    """Return whether a file ends with MCAP's magic bytes, as finished files do."""
    try:
        with path.open("rb") as file:
            file.seek(-len(MAGIC), os.SEEK_END)
            return file.read() == MAGIC
    except OSError:
        return False
