"""Finding what is intact in a damaged file where its records do not lead from one to the next any more.

The header of a run, from whichever of its copies is intact.
"""

import struct
from collections.abc import Iterator, Mapping
from pathlib import Path

from mcap.opcode import Opcode

from analysis.signals.header import RunHeader
from recordings.errors import DamagedError, RecordingError, UnknownFormatError
from recordings.mcap.chunk_table import ChunkLocation
from recordings.mcap.container import RECORD, Container
from recordings.mcap.header import header_from_json
from recordings.mcap.layout import RUN_RECORD, decode_metadata

WINDOW = 16 << 20
COMPRESSION = struct.pack("<I", 4) + b"zstd"
BEFORE_COMPRESSION = struct.Struct("<BQQQQI")  # opcode, length, first and last time, size, CRC of a chunk
BEFORE_DATA = RECORD.size + 28 + len(COMPRESSION) + 8
"""From the start of a chunk's record to its compressed data, bytes."""


def search_chunks(container: Container) -> Iterator[ChunkLocation]:
    """Yield what looks like a compressed chunk, wherever it lies in the file; its checksum tells whether it is one."""
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
    """Yield the entries of what looks like a metadata record of this name, wherever it lies in the file."""
    pattern = struct.pack("<I", len(name)) + name.encode()
    for found in _positions(container, pattern):
        start = found - RECORD.size
        head = container.read(start, RECORD.size) if start >= 0 else b""
        if len(head) == RECORD.size and head[0] == Opcode.METADATA:
            record = container.metadata_at(found, RECORD.unpack(head)[1])
            if record is not None and record.name == name:
                yield record.metadata


def _positions(container: Container, pattern: bytes) -> Iterator[int]:
    """Yield where a pattern stands in a file."""
    offset = 0
    while window := container.read(offset, WINDOW + len(pattern) - 1):
        place = window.find(pattern)
        while place >= 0:
            yield offset + place
            place = window.find(pattern, place + 1)
        offset += WINDOW


def read_header(container: Container) -> RunHeader:
    """Return the header of a run; the whole file is searched for it where its records do not lead there.

    Raises
    ------
    DamagedError
        Where no copy is intact.
    UnknownFormatError
        Where the file is no run or of a format version that is not known here.
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
    raise DamagedError(f"{container.path}: cut short or damaged: the record {RUN_RECORD} at its start is missing")


def decode_header(path: Path, entries: Mapping[str, str]) -> RunHeader:
    """Return the header that one of its copies holds; DamagedError or UnknownFormatError where it holds none."""
    document = decode_metadata(path, RUN_RECORD, entries)
    try:
        return header_from_json(document)
    except DamagedError as error:
        raise DamagedError(f"{path}: {error}") from error
