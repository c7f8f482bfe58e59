"""An MCAP file as it lies on the disk, whole or cut short: its metadata, and its chunks by place.

A chunk is read only if its CRC fits, the index at the end is used only if its CRC fits, and without it the records are
walked from the start up to where they break off.
"""

import os
import struct
import threading
import zlib
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from io import BytesIO
from pathlib import Path
from typing import ClassVar

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Chunk, Metadata
from mcap.writer import MCAP0_MAGIC

from recordings.errors import DamagedError, NotFoundError, StorageError
from recordings.mcap.chunk_table import ChunkLocation, ChunkTable

MAGIC = MCAP0_MAGIC
"""What every MCAP file begins and, when it is whole, ends with."""
RECORD = struct.Struct("<BQ")  # opcode, length of the content
FOOTER = struct.Struct("<BQQQI")  # opcode, length, start of the summary, start of its offsets, CRC
MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
LARGEST_CHUNK = 256 << 20
LARGEST_METADATA = 16 << 20


@dataclass(frozen=True, slots=True)
class StoredMessage:
    """A message as it lies in a chunk."""

    channel: int
    log_time_ns: int
    data: bytes


@dataclass(frozen=True, slots=True)
class Record:
    """A record by its place, with the first bytes of its content.

    Parameters
    ----------
    opcode : int
        Its kind.
    offset, length : int
        Place of its content in the file, bytes.
    peek : bytes
        The first bytes of its content, fewer at the end of the file.
    """

    PEEK: ClassVar[int] = 8

    opcode: int
    offset: int
    length: int
    peek: bytes


class Container:
    """An open MCAP file; it may be read from several threads.

    Parameters
    ----------
    path : Path
        The file.

    Raises
    ------
    NotFoundError
        Where there is no such file.
    DamagedError
        Where it is empty or not MCAP.
    StorageError
        Where it cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._lock = threading.Lock()
        try:
            self._file = path.open("rb", buffering=0)
        except FileNotFoundError as error:
            raise NotFoundError(f"{path}: there is no such file") from error
        except OSError as error:
            raise StorageError(f"{path}: cannot be read: {error.strerror or error}") from error
        try:
            self.size = self._file.seek(0, os.SEEK_END)
            self._summary_start, self._summary_stop = self._find_summary()
            self._check_magic()
        except (DamagedError, StorageError):
            self.close()
            raise

    @property
    def is_finished(self) -> bool:
        """Whether the file has its index at the end, intact."""
        return self._summary_stop > 0

    @property
    def has_magic(self) -> bool:
        """Whether the file begins as MCAP does."""
        return self.read(0, len(MAGIC)) == MAGIC

    @property
    def data_stop(self) -> int:
        """Where the summary begins, bytes; the file's size where it has none that is intact."""
        return self._summary_start or self.size

    @cached_property
    def _metadata_records(self) -> list[Metadata]:
        places = [*self._metadata_at_start(), *self._metadata_in_summary()] if self.is_finished else self._walk[0]
        records = [self.metadata_at(offset, length) for offset, length in dict.fromkeys(places)]
        return [record for record in records if record is not None]

    def metadata(self, name: str) -> list[Mapping[str, str]]:
        """Return the entries of all metadata records of this name that can be read, in the order of the file."""
        return [record.metadata for record in self._metadata_records if record.name == name]

    @cached_property
    def chunks(self) -> ChunkTable:
        """All chunks in the order of the file."""
        return ChunkTable.from_index(list(self.summary(Opcode.CHUNK_INDEX))) if self.is_finished else self._walk[1]

    def messages(self, place: ChunkLocation) -> Iterator[StoredMessage]:
        """Yield the messages of a chunk in the order of writing.

        Raises
        ------
        DamagedError
            Where the chunk is not what its checksum says.
        """
        data = self._chunk_data(place)
        position = 0
        while position < len(data):
            if position + RECORD.size > len(data):
                raise self._damaged(place)
            opcode, length = RECORD.unpack_from(data, position)
            position += RECORD.size
            if position + length > len(data):
                raise self._damaged(place)
            if opcode == Opcode.MESSAGE:
                if length < MESSAGE.size:
                    raise self._damaged(place)
                channel, _, log_time, _ = MESSAGE.unpack_from(data, position)
                yield StoredMessage(channel, log_time, data[position + MESSAGE.size : position + length])
            position += length

    def close(self) -> None:
        """Close the file; harmless when closed already."""
        with self._lock:
            self._file.close()

    def read(self, offset: int, length: int) -> bytes:
        """Return bytes of the file, fewer at its end."""
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
        if not self.has_magic and not self.is_finished:  # an index that fits its checksum is proof enough
            raise DamagedError(f"{self.path}: is not an MCAP file (its first bytes are not MCAP's)")

    def _find_summary(self) -> tuple[int, int]:
        """Return start and end of the summary, or zeros where the file has none that is intact."""
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
        """Yield the records up to the end of the data; where they break off, on from the next that the index names."""
        return self._records(self._named)

    def _records(self, named: Sequence[int]) -> Iterator[Record]:
        """Yield records from the start on; `named` are places where one is known to begin, in order."""
        ahead = deque(named)
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
        """Return the record of the data that begins here, None where there is none that ends before `stop`."""
        head = self.read(offset, RECORD.size + Record.PEEK)
        if len(head) < RECORD.size:
            return None
        opcode, length = RECORD.unpack_from(head)
        if opcode in (0, Opcode.DATA_END) or offset + RECORD.size + length > stop:  # 0: a file system's filling
            return None
        return Record(opcode, offset + RECORD.size, length, head[RECORD.size :])

    @cached_property
    def _named(self) -> list[int]:
        """Where the records begin that the index names."""
        if not self.is_finished:
            return []
        places = [place.offset - RECORD.size for place in self.chunks]
        for kind in (Opcode.METADATA_INDEX, Opcode.ATTACHMENT_INDEX):
            places += [int.from_bytes(content[:8], "little") for content in self.summary(kind)]
        return sorted(places)

    def _metadata_at_start(self) -> Iterator[tuple[int, int]]:
        for record in self._records([]):
            if record.opcode == Opcode.CHUNK:
                return
            if record.opcode == Opcode.METADATA:
                yield record.offset, record.length

    @cached_property
    def _walk(self) -> tuple[list[tuple[int, int]], ChunkTable]:
        """Places of metadata, and chunks, found by walking the records."""
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
            channels[-1].clear()  # what the last chunk holds is not known: its index may be cut
        return metadata, ChunkTable.of(
            ChunkLocation(chunk.offset, chunk.length, int.from_bytes(chunk.peek, "little"), frozenset(indexed) or None)
            for chunk, indexed in zip(chunks, channels, strict=True)
        )

    def _metadata_in_summary(self) -> Iterator[tuple[int, int]]:
        for content in self.summary(Opcode.METADATA_INDEX):
            offset, length = struct.unpack_from("<QQ", content)
            yield offset + RECORD.size, length - RECORD.size

    def summary(self, wanted: Opcode) -> Iterator[bytes]:
        """Yield the contents of the summary's records of one kind; its CRC has been checked."""
        data = self.read(self._summary_start, self._summary_stop - self._summary_start)
        position = 0
        while position < len(data):
            opcode, length = RECORD.unpack_from(data, position)
            position += RECORD.size
            if opcode == wanted:
                yield data[position : position + length]
            position += length

    def metadata_at(self, offset: int, length: int) -> Metadata | None:
        """Return a metadata record, or None where it cannot be read."""
        if length > LARGEST_METADATA:
            return None
        try:
            record: Metadata = Metadata.read(ReadDataStream(BytesIO(self.read(offset, length))))
        except (McapError, struct.error, UnicodeDecodeError):
            return None
        return record

    def _chunk_data(self, place: ChunkLocation) -> bytes:
        """Return the uncompressed records of a chunk."""
        try:
            chunk = Chunk.read(ReadDataStream(BytesIO(self.read(place.offset, place.length))))
            data = self._uncompressed(place, chunk)
        except (McapError, struct.error, UnicodeDecodeError, zstandard.ZstdError) as error:
            raise self._damaged(place) from error
        if len(data) != chunk.uncompressed_size or zlib.crc32(data) != chunk.uncompressed_crc:
            raise self._damaged(place)
        return data

    def _uncompressed(self, place: ChunkLocation, chunk: Chunk) -> bytes:
        if chunk.compression == "":
            return chunk.data
        if chunk.compression != "zstd":
            raise DamagedError(f"{self.path}: a chunk is compressed as {chunk.compression!r}, expected zstd or nothing")
        declared = zstandard.frame_content_size(chunk.data)  # -1 where whoever rewrote the file left it out
        if declared not in (-1, chunk.uncompressed_size) or chunk.uncompressed_size > LARGEST_CHUNK:
            raise self._damaged(place)
        return zstandard.decompress(chunk.data, max_output_size=chunk.uncompressed_size)

    def _damaged(self, place: ChunkLocation) -> DamagedError:
        return DamagedError(f"{self.path}: the {place.length} bytes from byte {place.offset} on are damaged")


def has_end_magic(path: Path) -> bool:
    """Return whether a file ends as a finished MCAP file does."""
    try:
        with path.open("rb") as file:
            file.seek(-len(MAGIC), os.SEEK_END)
            return file.read() == MAGIC
    except OSError:
        return False
