"""Finding what is intact in a damaged file where its records do not lead from one to the next any more."""

import struct
from collections.abc import Iterator, Mapping

from mcap.opcode import Opcode

from recordings.mcap.chunk_table import ChunkPlace
from recordings.mcap.container import RECORD, Container

WINDOW = 16 << 20
COMPRESSION = struct.pack("<I", 4) + b"zstd"
BEFORE_COMPRESSION = struct.Struct("<BQQQQI")  # opcode, length, first and last time, size, CRC of a chunk
BEFORE_DATA = RECORD.size + 28 + len(COMPRESSION) + 8
"""From the start of a chunk's record to its compressed data, bytes."""


def search_chunks(container: Container) -> Iterator[ChunkPlace]:
    """Yield what looks like a compressed chunk, wherever it lies in the file; its checksum tells whether it is one."""
    for found in _positions(container, COMPRESSION):
        start = found - BEFORE_COMPRESSION.size
        head = container.read(start, BEFORE_DATA) if start >= 0 else b""
        if len(head) < BEFORE_DATA:
            continue
        opcode, length, start_ns, *_ = BEFORE_COMPRESSION.unpack_from(head)
        data_length = int.from_bytes(head[-8:], "little")
        if opcode == Opcode.CHUNK and length == data_length + BEFORE_DATA - RECORD.size:
            yield ChunkPlace(start + RECORD.size, length, start_ns, None)


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
