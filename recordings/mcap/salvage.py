"""Reading damaged files: search for intact chunks and header copies, and filtering of blocks after damage."""

import struct
from collections.abc import Iterator, Mapping
from pathlib import Path

from mcap.opcode import Opcode

from analysis.signals.blocks import EndReason, SegmentEnd, SourceItem
from analysis.signals.header import RunHeader
from recordings.errors import DamagedError, RecordingError, UnknownFormatError
from recordings.mcap.container import RECORD, ChunkLocation, Container
from recordings.mcap.header import header_from_json
from recordings.mcap.layout import RUN_RECORD, decode_metadata

WINDOW = 16 << 20  # bytes that are searched at a time
COMPRESSION = struct.pack("<I", 4) + b"zstd"
BEFORE_COMPRESSION = struct.Struct("<BQQQQI")  # opcode, length, first and last time, size, CRC of a chunk
BEFORE_DATA = RECORD.size + 28 + len(COMPRESSION) + 8
"""From the start of a chunk's record to its compressed data, bytes."""


def search_chunks(container: Container) -> Iterator[ChunkLocation]:
    """Yield what looks like a zstd-compressed chunk anywhere in the file; only its checksum shows whether it is one."""
    for found in _positions(container, COMPRESSION):
        start = found - BEFORE_COMPRESSION.size
        head = container.read(start, BEFORE_DATA) if start >= 0 else b""
        if len(head) < BEFORE_DATA:
            continue
        opcode, length, start_ns, *_ = BEFORE_COMPRESSION.unpack_from(head)
        data_length = int.from_bytes(head[-8:], "little")
        if opcode == Opcode.CHUNK and length == data_length + BEFORE_DATA - RECORD.size:
            yield ChunkLocation(start + RECORD.size, length, start_ns, None)


def search_metadata(container: Container, name: str) -> Iterator[Mapping[str, str]]:
    """Yield the entries of what looks like a metadata record of this name anywhere in the file."""
    pattern = struct.pack("<I", len(name)) + name.encode()
    for found in _positions(container, pattern):
        start = found - RECORD.size
        head = container.read(start, RECORD.size) if start >= 0 else b""
        if len(head) == RECORD.size and head[0] == Opcode.METADATA:
            record = container.metadata_at(found, RECORD.unpack(head)[1])
            if record is not None and record.name == name:
                yield record.metadata


def _positions(container: Container, pattern: bytes) -> Iterator[int]:
    """Yield the offsets of a byte pattern in a file."""
    offset = 0
    while window := container.read(offset, WINDOW + len(pattern) - 1):
        position = window.find(pattern)
        while position >= 0:
            yield offset + position
            position = window.find(pattern, position + 1)
        offset += WINDOW


def read_header(container: Container) -> RunHeader:
    """Return the header of a run from its first intact copy; a damaged file is searched for one.

    Raises
    ------
    DamagedError
        If no copy is intact.
    UnknownFormatError
        If the file is no run, or of a format version that this program does not read.
    """
    faults: list[RecordingError] = []
    for entries in container.metadata(RUN_RECORD) or search_metadata(container, RUN_RECORD):
        try:
            return decode_header(container.path, entries)
        except RecordingError as error:
            faults.append(error)
    if faults:
        raise faults[0]
    if container.is_finished:
        raise UnknownFormatError(f"{container.path}: an MCAP file, but no run: it lacks the record {RUN_RECORD}")
    raise DamagedError(f"{container.path}: truncated or damaged: the record {RUN_RECORD} at its start is missing")


def decode_header(path: Path, entries: Mapping[str, str]) -> RunHeader:
    """Return the header in a metadata record's entries; DamagedError, UnknownFormatError."""
    document = decode_metadata(path, RUN_RECORD, entries)
    try:
        return header_from_json(document)
    except DamagedError as error:
        raise DamagedError(f"{path}: {error}") from error


BREAKS_OFF = "the recording breaks off here"


class SequenceFilter:
    """Filter that passes on consecutive blocks; the rest of a segment after damage is dropped and counted as lost.

    Parameters
    ----------
    ends : mapping of int to SegmentEnd
        The recorded end of each segment, as far as known.
    """

    def __init__(self, ends: Mapping[int, SegmentEnd]) -> None:
        self._ends = ends
        self._segment = -1
        self._next_sample = 0
        self._is_open = False
        self._is_broken = False

    def add(self, item: SourceItem) -> Iterator[SourceItem]:
        """Take the next item of the file and yield it in sequence, after the end of the segment before.

        A segment end is yielded with what was dropped added to the loss.
        """
        if item.segment < self._segment or (item.segment == self._segment and not self._is_open):
            return
        if item.segment > self._segment:
            yield from self.finish()
            self._segment, self._next_sample = item.segment, 0
            self._is_open, self._is_broken = True, False
        if isinstance(item, SegmentEnd):
            self._is_open = False
            yield self._end(item)
        elif self._is_broken or item.first_sample != self._next_sample:
            self._is_broken = True
        else:
            self._next_sample = item.end
            yield item

    def finish(self) -> Iterator[SourceItem]:
        """Yield the end of the open segment, if there is one."""
        if self._is_open:
            self._is_open = False
            yield self._end(self._ends.get(self._segment))

    def _end(self, recorded: SegmentEnd | None) -> SegmentEnd:
        if recorded is None:
            return cut_end(self._segment, self._next_sample)
        missing = recorded.samples - self._next_sample
        if missing <= 0:
            return recorded
        return SegmentEnd(
            segment=self._segment,
            samples=self._next_sample,
            reason=EndReason.CUT,
            lost=missing + recorded.lost,
            lost_is_exact=recorded.lost_is_exact,
            detail=f"the recording is damaged after sample {self._next_sample} of {recorded.samples}",
        )


def cut_end(segment: int, samples: int) -> SegmentEnd:
    """Return the end of a segment whose recording breaks off: the loss is unknown."""
    return SegmentEnd(segment, samples, EndReason.CUT, lost=0, lost_is_exact=False, detail=BREAKS_OFF)
