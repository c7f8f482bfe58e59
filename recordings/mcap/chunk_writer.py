"""MCAP writer in chunks that the caller composes, on a file that is only appended to.

The mcap library's own writer holds about 0.8 kB of objects for each chunk, which is 15 MB an hour at five chunks a
second. Here a chunk costs the 100 bytes that it takes in the index. The records are encoded by the library.
"""

import io
import os
import threading
import zlib
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Message,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.writer import MCAP0_MAGIC

from recordings.errors import StorageError
from recordings.file_operations import storage_errors

SYNC_INTERVAL = 1.0
"""Seconds between two fsync calls: a power failure loses at most so much of a run."""
ALLOCATION_STEP = 1 << 20
"""Bytes of disk space that are allocated ahead."""
ZSTD_LEVEL = 2
"""Measured with noise of 0 to 100 codes: as fast as the usual 3 or up to five times faster, and never 2 % larger."""
FOOTER_CRC_BYTES = 4
TAIL_RESERVE = 1 << 16
"""Bytes beside the summary that stay allocated so that the file can be finished when the disk is full."""


class AppendOnlyFile:
    """A new, unbuffered file that can be rolled back to its last commit.

    On POSIX, disk space is allocated ahead of the data, so that the file can still be finished when the disk is full.
    Until it is closed the file therefore ends in zeros.

    A separate thread calls fsync every second, so that a power failure costs about a second of a run and the writing
    thread never waits for the disk.

    Parameters
    ----------
    path : Path
        The file; it must not exist, its folder must.

    Attributes
    ----------
    length : int
        Bytes written.

    Raises
    ------
    StorageError
        If it cannot be created.
    """

    def __init__(self, path: Path) -> None:
        with storage_errors(path, "cannot be created"):
            try:
                self._file = io.FileIO(path, "xb")
            except FileExistsError as error:
                raise StorageError(f"{path}: exists already; runs are never overwritten") from error
            except FileNotFoundError as error:
                raise StorageError(f"{path}: cannot be created: there is no folder {path.parent}") from error
        self._path = path
        self.length = 0
        self._committed = 0
        self._allocated = 0
        self._closing = threading.Event()
        self._syncer = threading.Thread(target=self._sync, name=f"sync {path.name}", daemon=True)
        self._syncer.start()

    def write(self, data: bytes, reserve: int = 0) -> None:
        """Append all of the data; OSError if the disk is full, and then nothing is appended.

        Parameters
        ----------
        data : bytes
            The data.
        reserve : int
            Bytes of free space required after it.
        """
        self._allocate(self.length + len(data) + reserve)
        remaining = memoryview(data)
        try:
            while remaining:
                remaining = remaining[self._file.write(remaining) :]
        except OSError:
            self._file.seek(self.length)
            raise
        self.length += len(data)

    def commit(self) -> None:
        """Record that the file is complete up to here."""
        self._committed = self.length

    def roll_back(self) -> None:
        """Truncate to the last commit and close; without a commit, remove the file."""
        self._stop_syncing()
        with suppress(OSError):  # the disk is gone: readers find the last complete chunk of what it has
            self._file.truncate(self._committed)
        with suppress(OSError):
            self._file.close()
        if self._committed == 0:
            with suppress(OSError):
                self._path.unlink()

    def close(self) -> None:
        """Flush to the disk and close the file; OSError if the system reports only now that it could not write."""
        self._stop_syncing()
        self._file.truncate(self.length)
        os.fsync(self._file.fileno())
        self._file.close()

    def _allocate(self, stop: int) -> None:
        """Allocate disk space up to an offset in the file; OSError if the disk is full."""
        if stop <= self._allocated or not hasattr(os, "posix_fallocate"):  # Windows has no such call
            return
        for target in (max(stop, self._allocated + ALLOCATION_STEP), stop):
            try:
                os.posix_fallocate(self._file.fileno(), self._allocated, target - self._allocated)
            except OSError:
                if target == stop:
                    raise
            else:
                self._allocated = target
                return

    def _stop_syncing(self) -> None:
        self._closing.set()
        self._syncer.join()

    def _sync(self) -> None:
        synced = 0
        while not self._closing.wait(SYNC_INTERVAL):
            length = self.length
            if length > synced:
                with suppress(OSError):  # the next write or the close fails too, and reports it
                    os.fsync(self._file.fileno())
                synced = length


class ChunkWriter:
    """Writer of the records of an MCAP file; every method raises OSError if the disk is full or fails.

    Parameters
    ----------
    file : AppendOnlyFile
        The file.
    profile, library : str
        Fields of the MCAP header.
    """

    def __init__(self, file: AppendOnlyFile, profile: str, library: str) -> None:
        self._file = file
        self._crc = 0
        self._compressor = zstandard.ZstdCompressor(level=ZSTD_LEVEL)
        self._summary: dict[Opcode, bytearray] = defaultdict(bytearray)
        self._records: Counter[Opcode] = Counter()
        self._messages: Counter[int] = Counter()
        self._start_ns, self._end_ns = 0, 0
        self._append(MCAP0_MAGIC + encode_records(Header(profile=profile, library=library)))

    def add_metadata(self, name: str, entries: Mapping[str, str], *, is_tail: bool = False) -> None:
        """Write a metadata record; with `is_tail` it may use the reserved space at the end."""
        offset, record = self._file.length, encode_records(Metadata(name=name, metadata=dict(entries)))
        self._append(record, is_tail=is_tail)
        self._add_to_summary(MetadataIndex(offset=offset, length=len(record), name=name), Opcode.METADATA_INDEX)

    def add_attachment(self, name: str, media_type: str, time_ns: int, data: bytes) -> None:
        """Write an attachment."""
        offset = self._file.length
        record = encode_records(Attachment(time_ns, time_ns, name, media_type, data))
        self._append(record)
        index = AttachmentIndex(offset, len(record), time_ns, time_ns, len(data), name, media_type)
        self._add_to_summary(index, Opcode.ATTACHMENT_INDEX)

    def add_channel(self, channel: Channel, schema: Schema) -> None:
        """Write a schema and its channel, before the first chunk and once more in the summary."""
        self._append(encode_records(schema, channel))
        self._add_to_summary(schema, Opcode.SCHEMA)
        self._add_to_summary(channel, Opcode.CHANNEL)

    def add_chunk(self, messages: Iterable[Message], *, is_tail: bool = False) -> None:
        """Write messages as a chunk with its index; nothing if there are none.

        With `is_tail` the chunk may use the reserved space at the end.
        """
        builder: Any = RecordBuilder()
        indexes: dict[int, MessageIndex] = {}
        times = []
        for message in messages:
            index = indexes.setdefault(message.channel_id, MessageIndex(channel_id=message.channel_id, records=[]))
            index.records.append((message.log_time, builder.count))
            times.append(message.log_time)
            message.write(builder)
        if not times:
            return
        data: bytes = builder.end()
        chunk = Chunk(
            compression="zstd",
            data=self._compressor.compress(data),
            message_start_time=min(times),
            message_end_time=max(times),
            uncompressed_crc=zlib.crc32(data),
            uncompressed_size=len(data),
        )
        offset, record = self._file.length, encode_records(chunk)
        index_offsets, index_records = {}, b""
        for channel, index in indexes.items():
            index_offsets[channel] = offset + len(record) + len(index_records)
            index_records += encode_records(index)
        self._append(record + index_records, is_tail=is_tail)
        self._add_to_summary(
            ChunkIndex(
                message_start_time=chunk.message_start_time,
                message_end_time=chunk.message_end_time,
                chunk_start_offset=offset,
                chunk_length=len(record),
                message_index_offsets=index_offsets,
                message_index_length=len(index_records),
                compression=chunk.compression,
                compressed_size=len(chunk.data),
                uncompressed_size=len(data),
            ),
            Opcode.CHUNK_INDEX,
        )
        self._start_ns = min(self._start_ns or chunk.message_start_time, chunk.message_start_time)
        self._end_ns = max(self._end_ns, chunk.message_end_time)
        self._messages.update({channel: len(index.records) for channel, index in indexes.items()})

    def finish(self) -> None:
        """Write the summary and the end of the file."""
        self._append(encode_records(DataEnd(data_section_crc=self._crc)), is_tail=True)
        self._add_to_summary(self._statistics(), Opcode.STATISTICS)
        start = self._file.length
        summary, offsets = b"", []
        for opcode, records in self._summary.items():
            offsets.append(SummaryOffset(opcode, start + len(summary), len(records)))
            summary += records
        offset_start = start + len(summary)
        summary += encode_records(*offsets)
        footer = encode_records(Footer(summary_start=start, summary_offset_start=offset_start, summary_crc=0))
        crc = zlib.crc32(summary + footer[:-FOOTER_CRC_BYTES])
        footer = encode_records(Footer(summary_start=start, summary_offset_start=offset_start, summary_crc=crc))
        self._append(summary + footer + MCAP0_MAGIC, is_tail=True)

    def _statistics(self) -> Statistics:
        return Statistics(
            attachment_count=self._records[Opcode.ATTACHMENT_INDEX],
            channel_count=self._records[Opcode.CHANNEL],
            channel_message_counts=dict(self._messages),
            chunk_count=self._records[Opcode.CHUNK_INDEX],
            message_count=self._messages.total(),
            metadata_count=self._records[Opcode.METADATA_INDEX],
            message_start_time=self._start_ns,
            message_end_time=self._end_ns,
            schema_count=self._records[Opcode.SCHEMA],
        )

    def _append(self, data: bytes, *, is_tail: bool = False) -> None:
        reserve = 0 if is_tail else TAIL_RESERVE + sum(map(len, self._summary.values()))
        self._file.write(data, reserve)
        self._crc = zlib.crc32(data, self._crc)

    def _add_to_summary(self, record: McapRecord, opcode: Opcode) -> None:
        """Add a record to the summary that `finish` writes."""
        self._summary[opcode] += encode_records(record)
        self._records[opcode] += 1


def encode_records(*records: McapRecord) -> bytes:
    """Return records as the bytes of the file."""
    builder: Any = RecordBuilder()  # not all of its methods are annotated
    for record in records:
        record.write(builder)
    data: bytes = builder.end()
    return data
