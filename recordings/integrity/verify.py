"""Verification of a recording: every record, checksum, index, sample and count of the file."""

import zlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import islice
from pathlib import Path
from typing import Annotated

from mcap.opcode import Opcode

from analysis.signals.header import RunHeader
from analysis.signals.units import NUMBER
from recordings.errors import DamagedError, MessageError, RecordingError
from recordings.file_operations import Progress, ignore_progress
from recordings.integrity.file_checks import (
    Check,
    ContinuityCheck,
    Finding,
    IndexCheck,
    PulseCheck,
    check_acquisition,
)
from recordings.mcap.container import RECORD, Container, StoredMessage
from recordings.mcap.layout import CHANNEL_IDS, CONFIG_ATTACHMENT, END_RECORD, RUN_RECORD, TOPICS, decode_metadata
from recordings.mcap.messages import decode_block, decode_segment_end, parse_message
from recordings.mcap.reader import segment_end_from_json
from recordings.mcap.results import decode_marker
from recordings.mcap.rig_pb2 import Features, OrderFrame
from recordings.mcap.salvage import decode_header, read_header

WINDOW = 4 << 20  # bytes that are read at a time
RECORDS_SHARE = 0.9  # share of the work in reading the records; the rest is the checksum over the data section
SAMPLES_ID, END_ID, FEATURES_ID, FRAME_ID, MARKER_ID, PULSES_ID = CHANNEL_IDS.values()
RESULTS = {FEATURES_ID: Features, FRAME_ID: OrderFrame}
MAX_FINDINGS = 100


class Verdict(StrEnum):
    """Result of a verification."""

    INTACT = "intact"
    DAMAGED = "damaged"


@dataclass(frozen=True, slots=True)
class Verification:
    """Findings of a verification."""

    path: Annotated[Path, NUMBER.of("The file")]
    run: Annotated[str, NUMBER.of("Id of the run")]
    size: Annotated[int, NUMBER.of("Size of the file, bytes", "size_bytes")]
    chunks: Annotated[int, NUMBER.of("Intact chunks")]
    segments: Annotated[int, NUMBER.of("Segments with an end")]
    samples: Annotated[int, NUMBER.of("Samples per channel")]
    pulses: Annotated[int, NUMBER.of("Tacho edges with a timestamp of the counter")]
    findings: Annotated[tuple[Finding, ...], NUMBER.of("Faults and remarks, in file order")]

    @property
    def faults(self) -> tuple[Finding, ...]:
        """Findings for which the recording is not intact."""
        return tuple(finding for finding in self.findings if finding.is_fault)

    @property
    def is_intact(self) -> bool:
        """Whether the recording is intact."""
        return not self.faults

    @property
    def verdict(self) -> Annotated[Verdict, NUMBER.of("Verdict of the verification")]:
        """The result."""
        return Verdict.INTACT if self.is_intact else Verdict.DAMAGED


def verify(path: Path, on_progress: Progress = ignore_progress) -> Verification:
    """Return the findings of a complete check of a recording.

    Parameters
    ----------
    path : Path
        The file.
    on_progress : callable
        Called with the fraction done, 0 to 1.

    Raises
    ------
    NotFoundError, StorageError
        If there is no such file, or it cannot be read.
    DamagedError, UnknownFormatError
        If it is no recording, or no copy of its header is intact.
    """
    container = Container(path)
    try:
        return _Verifier(container, read_header(container), on_progress).verification()
    finally:
        container.close()


class _Verifier:
    """One pass through a file."""

    def __init__(self, container: Container, header: RunHeader, on_progress: Progress) -> None:
        self._file = container
        self._on_progress = on_progress
        self._header = header
        self._continuity = ContinuityCheck(header.acquisition)
        self._pulses = PulseCheck(header.acquisition)
        self._index = IndexCheck(container)
        self._chunk_index = {chunk.offset: chunk for chunk in container.chunks}
        self._n_chunks = 0
        self._n_messages: Counter[int] = Counter()
        self._names: set[str] = set()
        """Names of the metadata records, and of the configuration's attachment, that were read."""

    def verification(self) -> Verification:
        """Check the file and return the result."""
        findings = list(islice(self._findings(), MAX_FINDINGS + 1))
        if len(findings) > MAX_FINDINGS:
            findings[-1] = replace(
                findings[-1], what=f"more than {MAX_FINDINGS} findings: the list ends here", is_fault=True
            )
        return Verification(
            path=self._file.path,
            run=self._header.run,
            size=self._file.size,
            chunks=self._n_chunks,
            segments=len(self._continuity.ends),
            samples=self._continuity.samples,
            pulses=self._pulses.count,
            findings=tuple(findings),
        )

    def _findings(self) -> Iterator[Finding]:
        if not self._file.has_magic:
            yield Finding(Check.FILE, "byte 0", "the first bytes are not MCAP's")
        if not self._file.is_finished:
            yield Finding(Check.FILE, "end of file", "the index at the end is missing or does not match its checksum")
        yield from self._records()
        yield from self._continuity.finish()
        for name, kind in ((RUN_RECORD, "record"), (CONFIG_ATTACHMENT, "attachment")):
            if name not in self._names:
                yield Finding(Check.HEADER, "start of file", f"the {kind} {name} is missing")
        yield from check_acquisition(self._header.acquisition)
        if self._file.is_finished:
            yield from self._end_record()
            yield from self._index.finish(self._n_messages)

    def _records(self) -> Iterator[Finding]:
        """Yield faults of the records of the data section."""
        stop = 8
        for record in self._file.records():
            start = record.offset - RECORD.size
            if start > stop:
                yield Finding(
                    Check.FILE,
                    f"byte {stop}",
                    f"the records break off; the index lists the next one {start - stop} bytes later, at byte {start}",
                )
            where, stop = f"byte {start}", record.offset + record.length
            self._on_progress(RECORDS_SHARE * stop / self._file.size)
            if record.opcode == Opcode.CHUNK:
                yield from self._chunk(record.offset, record.length, where)
            elif record.opcode == Opcode.MESSAGE_INDEX:
                yield from self._index.check_message_index(self._file.read(record.offset, record.length), where)
            elif record.opcode == Opcode.METADATA:
                yield from self._metadata_record(record.offset, record.length, where)
            elif record.opcode == Opcode.ATTACHMENT:
                yield from self._attachment(record.offset, record.length, where)
            elif record.opcode not in (Opcode.HEADER, Opcode.SCHEMA, Opcode.CHANNEL):
                yield Finding(Check.FILE, where, f"a record of opcode {record.opcode}, which does not belong here")
        yield from self._data_end(stop)

    def _data_end(self, stop: int) -> Iterator[Finding]:
        """Check that the records reach the end of the data section, and its checksum."""
        head = self._file.read(stop, 13)
        if len(head) < 13 or RECORD.unpack_from(head) != (Opcode.DATA_END, 4):
            yield Finding(
                Check.FILE, f"byte {stop}", f"the records break off {self._file.size - stop} bytes before the end"
            )
            return
        expected, crc, offset = int.from_bytes(head[9:13], "little"), 0, 0
        while offset < stop:
            window = self._file.read(offset, min(WINDOW, stop - offset))
            crc = zlib.crc32(window, crc)
            offset += len(window)
            self._on_progress(RECORDS_SHARE + (1.0 - RECORDS_SHARE) * offset / stop)
        if crc != expected:
            yield Finding(Check.CRC, f"bytes 0 to {stop}", "the data do not match their checksum")

    def _chunk(self, offset: int, length: int, where: str) -> Iterator[Finding]:
        chunk = self._chunk_index.get(offset)
        if chunk is None or chunk.length != length:
            yield Finding(Check.INDEX, where, "a chunk that the index at the end does not list")
            return
        try:
            messages = list(self._file.messages(chunk))
        except DamagedError:
            yield Finding(Check.CRC, where, f"a chunk of {length} bytes does not match its checksum")
            self._index.skip_chunk()
            return
        self._n_chunks += 1
        yield from self._index.check_chunk(chunk, messages, where)
        for message in messages:
            self._n_messages[message.channel] += 1
            try:
                yield from self._message(message, where)
            except MessageError as error:
                yield Finding(Check.FILE, where, f"a message of channel {message.channel} cannot be read: {error}")

    def _message(self, message: StoredMessage, where: str) -> Iterator[Finding]:
        if message.channel == SAMPLES_ID:
            block = decode_block(message.data)
            yield from self._continuity.check_block(block, where)
            yield from self._pulses.check_block(block, where)
        elif message.channel == END_ID:
            yield from self._continuity.check_segment_end(decode_segment_end(message.data), where)
        elif message.channel in RESULTS:
            parse_message(RESULTS[message.channel](), message.data)
        elif message.channel == MARKER_ID:
            decode_marker(message.data)
        elif message.channel == PULSES_ID:
            yield from self._pulses.check_pulses(message.data, where)
        else:
            yield Finding(
                Check.INDEX,
                where,
                f"a message of channel {message.channel}, expected 1 to {len(TOPICS)}",
                is_fault=False,
            )

    def _metadata_record(self, offset: int, length: int, where: str) -> Iterator[Finding]:
        record = self._file.metadata_at(offset, length)
        if record is None:
            yield Finding(Check.HEADER, where, "a metadata record that cannot be read")
            return
        self._names.add(record.name)
        try:
            if record.name == RUN_RECORD and decode_header(self._file.path, record.metadata) != self._header:
                yield Finding(Check.HEADER, where, f"{RUN_RECORD} differs from the copy before")
            elif "crc32" in record.metadata:
                decode_metadata(self._file.path, record.name, record.metadata)
        except RecordingError as error:
            yield Finding(Check.CRC, where, str(error).removeprefix(f"{self._file.path}: "))

    def _attachment(self, offset: int, length: int, where: str) -> Iterator[Finding]:
        content = self._file.read(offset, length)
        if zlib.crc32(content[:-4]) != int.from_bytes(content[-4:], "little"):
            yield Finding(Check.CRC, where, "an attachment does not match its checksum")
        elif content[20 : 20 + len(CONFIG_ATTACHMENT)] == CONFIG_ATTACHMENT.encode():
            self._names.add(CONFIG_ATTACHMENT)
            if not content[:-4].endswith(self._header.config_toml.encode()):
                yield Finding(Check.HEADER, where, f"{CONFIG_ATTACHMENT} is not the configuration of the header")

    def _end_record(self) -> Iterator[Finding]:
        """Compare the end record with the samples and segments of the file."""
        entries = self._file.metadata(END_RECORD)
        try:
            record = decode_metadata(self._file.path, END_RECORD, entries[-1]) if entries else {}
        except RecordingError:
            record = {}  # reported as a metadata record already
        if not record:
            yield Finding(Check.COUNTS, "end of file", f"the record {END_RECORD} is missing")
            return
        ends = tuple(segment_end_from_json(end) for end in record["segments"])
        if record["samples"] != self._continuity.samples:
            yield Finding(
                Check.COUNTS,
                "whole file",
                f"{self._continuity.samples} samples per channel, expected {record['samples']}",
            )
        if record.get("pulses", 0) != self._pulses.count:  # missing in older files
            yield Finding(
                Check.COUNTS,
                "whole file",
                f"{self._pulses.count} timestamps of the tacho's counter, expected {record.get('pulses', 0)}",
            )
        if ends != self._continuity.ends:
            yield Finding(
                Check.COUNTS,
                "whole file",
                f"the {len(self._continuity.ends)} segment ends differ from the {len(ends)} of {END_RECORD}",
            )
        if not record["complete"]:
            yield Finding(Check.COUNTS, END_RECORD, "the file was closed before its last segment ended")
        if record["skipped_samples"]:
            yield Finding(
                Check.COUNTS,
                END_RECORD,
                f"the live analysis skipped {record['skipped_samples']} samples; they are in the file",
                is_fault=False,
            )
