"""Checks of a recording: findings, continuity of blocks and counter timestamps, calibrations, indexes."""

import math
import struct
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated

import numpy as np
from mcap.opcode import Opcode

from analysis.signals.blocks import SampleBlock, SegmentEnd
from analysis.signals.header import CODE_MAX, CODE_MIN, Acquisition, Calibration, Channel, Role
from analysis.signals.units import NUMBER
from recordings.mcap import rig_pb2
from recordings.mcap.container import RECORD, ChunkLocation, Container, StoredMessage
from recordings.mcap.messages import parse_message

N_CALIBRATION_POINTS = 501  # of the calibrated span, at which the calibration must be monotonic
STATISTICS = struct.Struct("<QHIIIIQQ")
"""Messages, schemas, channels, attachments, metadata records, chunks, first and last time."""
COUNTED = {
    Opcode.SCHEMA: "schemas",
    Opcode.CHANNEL: "channels",
    Opcode.ATTACHMENT: "attachments",
    Opcode.METADATA: "metadata records",
    Opcode.CHUNK: "chunks",
}


class Check(StrEnum):
    """Subject of a finding."""

    FILE = "file"  # start, end and sequence of records
    CRC = "crc"
    INDEX = "index"
    HEADER = "header"
    CONTINUITY = "continuity"
    COUNTS = "counts"
    CALIBRATION = "calibration"


@dataclass(frozen=True, slots=True)
class Finding:
    """A fault or a remark on a file."""

    check: Annotated[Check, NUMBER.of("Subject")]
    where: Annotated[str, NUMBER.of("Position, as byte 1234 or segment 0", "location")]
    what: Annotated[str, NUMBER.of("What is there, and what was expected", "description")]
    is_fault: Annotated[bool, NUMBER.of("Whether the recording is not intact; otherwise for information")] = True


def check_acquisition(acquisition: Acquisition) -> Iterator[Finding]:
    """Yield faults of rates, channels, scalings and calibrations in a header."""
    for name, rate in (("rate", acquisition.rate), ("convert rate", acquisition.convert_rate)):
        if not 0 < rate < math.inf:
            yield Finding(Check.CALIBRATION, "header", f"{name} of {rate} Hz, expected a positive one")
    for role in Role:
        names = [channel.name for channel in acquisition.channels if channel.role is role]
        if len(names) != 1:
            yield Finding(Check.CALIBRATION, "header", f"{len(names)} channels have the role {role.value}, expected 1")
    for channel in acquisition.channels:
        where = f"channel {channel.name}"
        for what in _channel_faults(channel):
            yield Finding(Check.CALIBRATION, where, what)
        if channel.calibration is not None and not channel.calibration.date:
            yield Finding(Check.CALIBRATION, where, "the calibration has no date", is_fault=False)


def _channel_faults(channel: Channel) -> Iterator[str]:
    if not channel.scaling or not np.isfinite(channel.scaling).all():
        yield f"scaling {channel.scaling}, expected finite coefficients"
        return
    volts = channel.volts(np.array([CODE_MIN, CODE_MAX], dtype=np.int16))
    if not volts[0] < volts[1]:
        yield f"the scaling gives {volts[0]:g} V at the lowest code and {volts[1]:g} V at the highest, expected more"
    if channel.role is Role.TACHO:
        return
    if channel.calibration is None:
        yield "a probe without calibration: its samples cannot be converted to micrometres"
    else:
        yield from _calibration_faults(channel.calibration)


def _calibration_faults(calibration: Calibration) -> Iterator[str]:
    if not calibration.coefficients or not np.isfinite(calibration.coefficients).all():
        yield f"calibration {calibration.coefficients}, expected finite coefficients"
    elif not calibration.volts_low < calibration.volts_high:
        yield f"calibrated from {calibration.volts_low:g} to {calibration.volts_high:g} V, expected a rising span"
    else:
        volts = np.linspace(calibration.volts_low, calibration.volts_high, N_CALIBRATION_POINTS)
        steps = np.diff(np.polynomial.polynomial.polyval(volts, calibration.coefficients))
        if not ((steps > 0).all() or (steps < 0).all()):
            yield "the calibration is not monotonic: two voltages within its span have the same gap"


class ContinuityCheck:
    """Check that blocks and segment ends, taken in file order, follow one another without a gap.

    Parameters
    ----------
    acquisition : Acquisition
        The header's channels.
    """

    def __init__(self, acquisition: Acquisition) -> None:
        self._channels = acquisition.channels
        self._segment, self._next_sample = 0, 0
        self._is_open = False
        self._ends: list[SegmentEnd] = []
        self.samples = 0
        """Samples per channel in all blocks."""
        self._at_rails = np.zeros(len(self._channels), dtype=np.int64)
        self._uncalibrated = np.zeros(len(self._channels), dtype=np.int64)
        # for each of the 65536 codes, whether it lies outside the channel's calibrated span
        codes = np.arange(2**16, dtype=np.uint16).view(np.int16)
        self._is_outside = []
        for channel in self._channels:
            calibration, volts = channel.calibration, channel.volts(codes)
            low, high = (-np.inf, np.inf) if calibration is None else (calibration.volts_low, calibration.volts_high)
            self._is_outside.append((volts < low) | (volts > high))

    @property
    def ends(self) -> tuple[SegmentEnd, ...]:
        """The segment ends so far."""
        return tuple(self._ends)

    def check_block(self, block: SampleBlock, where: str) -> Iterator[Finding]:
        """Take the next block and yield its faults."""
        if block.codes.shape[0] != len(self._channels):
            yield Finding(
                Check.CONTINUITY, where, f"a block of {block.codes.shape[0]} channels, expected {len(self._channels)}"
            )
            return
        if (block.segment, block.first_sample) != (self._segment, self._next_sample):
            yield Finding(
                Check.CONTINUITY,
                where,
                f"samples from {block.first_sample} of segment {block.segment}, "
                f"expected sample {self._next_sample} of segment {self._segment}",
            )
        self._segment, self._next_sample, self._is_open = block.segment, block.end, True
        self.samples += block.n_samples
        self._at_rails += np.count_nonzero((block.codes == CODE_MAX) | (block.codes == CODE_MIN), axis=1)
        for row, is_outside in enumerate(self._is_outside):
            self._uncalibrated[row] += np.count_nonzero(is_outside[block.codes[row].view(np.uint16)])

    def check_segment_end(self, end: SegmentEnd, where: str) -> Iterator[Finding]:
        """Take the next segment end and yield its faults."""
        if (end.segment, end.samples) != (self._segment, self._next_sample):
            yield Finding(
                Check.CONTINUITY,
                where,
                f"segment {end.segment} ends after {end.samples} samples, "
                f"expected the end of segment {self._segment} after {self._next_sample}",
            )
        self._segment, self._next_sample, self._is_open = end.segment + 1, 0, False
        self._ends.append(end)

    def finish(self) -> Iterator[Finding]:
        """Yield what is missing at the end of the file, and remarks on losses, clipping and calibrated spans."""
        if self._is_open or not self._ends:
            yield Finding(
                Check.CONTINUITY,
                "end of file",
                f"segment {self._segment} has no end: the recording breaks off after {self._next_sample} samples",
            )
        for end in self._ends:
            if not end.is_gap_free:
                lost = f"{'' if end.lost_is_exact else 'at least '}{end.lost} samples lost"
                yield Finding(
                    Check.CONTINUITY,
                    f"segment {end.segment}",
                    f"{lost} after sample {end.samples}: {end.reason.value}" + (end.detail and f", {end.detail}"),
                    is_fault=False,
                )
        for channel, at_rails, uncalibrated in zip(self._channels, self._at_rails, self._uncalibrated, strict=True):
            where = f"channel {channel.name}"
            if at_rails:
                yield Finding(Check.CALIBRATION, where, f"{at_rails} samples at the converter's rails", is_fault=False)
            if uncalibrated and channel.calibration is not None:
                low, high = channel.calibration.volts_low, channel.calibration.volts_high
                yield Finding(
                    Check.CALIBRATION,
                    where,
                    f"{uncalibrated / self.samples:.2%} of the samples outside the calibrated {low:g} to {high:g} V",
                    is_fault=False,
                )


class PulseCheck:
    """Check that counter timestamps, taken with the blocks in file order, are consecutive and belong to their blocks.

    Parameters
    ----------
    acquisition : Acquisition
        The header's counter.
    """

    def __init__(self, acquisition: Acquisition) -> None:
        self._acquisition = acquisition
        self._segment, self._next, self._last = -1, 0, -1
        self._expected_block: tuple[int, int] | None = None  # segment and first sample, from the last pulse message
        self.count = 0
        """Timestamps in all messages."""

    def check_pulses(self, data: bytes, where: str) -> Iterator[Finding]:
        """Take the next pulse message and yield its faults; MessageError if the bytes are not such a message."""
        message = parse_message(rig_pb2.Pulses(), data)
        position, ticks = f"{where}, segment {message.segment}", np.array(message.ticks, dtype=np.int64)
        self.count += ticks.size
        if self._acquisition.tacho.counter is None:
            yield Finding(Check.CONTINUITY, position, "counter timestamps, but the header has no counter")
        if message.segment != self._segment:
            self._segment, self._next, self._last = message.segment, 0, -1
        if message.first_pulse != self._next:
            yield Finding(
                Check.CONTINUITY,
                position,
                f"counter timestamps from number {message.first_pulse} on, expected number {self._next}",
            )
        if (np.diff(ticks, prepend=self._last) <= 0).any():
            yield Finding(
                Check.CONTINUITY, position, f"counter timestamps from number {message.first_pulse} on do not increase"
            )
        if ticks.size:
            self._last = int(ticks[-1])
        self._next = message.first_pulse + ticks.size
        if message.has_failed:
            yield Finding(
                Check.CONTINUITY,
                position,
                f"the tacho's counter failed after {self._next} timestamps, before sample {message.first_sample}",
                is_fault=False,
            )
        self._expected_block = (message.segment, message.first_sample)

    def check_block(self, block: SampleBlock, where: str) -> Iterator[Finding]:
        """Take the next block and yield faults of the timestamps that precede it."""
        if self._expected_block is None:
            return
        (segment, first_sample), self._expected_block = self._expected_block, None
        if (segment, first_sample) != (block.segment, block.first_sample):
            yield Finding(
                Check.CONTINUITY,
                where,
                f"counter timestamps of the block from sample {first_sample} of segment {segment}, which is missing",
            )
        elif self._last >= block.end * self._acquisition.ticks_per_sample + 1:
            yield Finding(
                Check.CONTINUITY,
                where,
                f"a counter timestamp of {self._last} ticks, expected one before the end of its block at {block.end}",
            )


class IndexCheck:
    """Check of a file's indexes and statistics against its records.

    Parameters
    ----------
    container : Container
        The file.
    """

    def __init__(self, container: Container) -> None:
        self._file = container
        self._times: dict[int, list[int]] = {}  # log times by channel, of the chunk before

    def check_chunk(self, chunk: ChunkLocation, messages: list[StoredMessage], where: str) -> Iterator[Finding]:
        """Take an intact chunk, which its own message indexes follow, and yield its faults."""
        self._times = {}
        for message in messages:
            self._times.setdefault(message.channel, []).append(message.log_time_ns)
        if self._file.is_finished and chunk.channels != frozenset(self._times):
            yield Finding(Check.INDEX, where, "the index at the end lists other channels than the chunk contains")
        earliest = min((message.log_time_ns for message in messages), default=chunk.start_ns)
        if earliest != chunk.start_ns:
            yield Finding(Check.INDEX, where, f"a chunk that starts at {earliest} ns, expected {chunk.start_ns} ns")

    def skip_chunk(self) -> None:
        """Take a damaged chunk, whose message indexes cannot be checked."""
        self._times = {}

    def check_message_index(self, content: bytes, where: str) -> Iterator[Finding]:
        """Take a message index and yield its faults."""
        if len(content) < 6:
            yield Finding(Check.INDEX, where, f"a message index of {len(content)} bytes, expected 6 or more")
            return
        channel, length = struct.unpack_from("<HI", content)
        if length != len(content) - 6 or length % 16:
            yield Finding(
                Check.INDEX,
                where,
                f"a message index that declares {length} bytes, expected {len(content) - 6}, a multiple of 16",
            )
            return
        times = [time for time, _ in struct.iter_unpack("<QQ", content[6:])]
        if self._times and self._times.get(channel) != times:
            yield Finding(Check.INDEX, where, f"the message index of channel {channel} does not match its chunk")

    def finish(self, messages: Mapping[int, int]) -> Iterator[Finding]:
        """Yield faults of the index and the statistics of a finished file; `messages` are counts by channel.

        An index entry is right if it is the offset of a record that was found by reading the records in sequence.
        """
        found = {(record.offset, record.opcode) for record in self._file.records()}
        opcodes = Counter(opcode for _, opcode in found)
        listed = [(chunk.offset, Opcode.CHUNK, "chunk") for chunk in self._file.chunks]
        for content in self._file.summary(Opcode.METADATA_INDEX):
            offset = int.from_bytes(content[:8], "little") + RECORD.size
            listed.append((offset, Opcode.METADATA, "metadata record"))
        for offset, opcode, name in listed:
            if (offset, opcode) not in found:
                where = f"byte {offset - RECORD.size}"
                yield Finding(Check.INDEX, where, f"the index lists a {name} that is not there")
        for content in self._file.summary(Opcode.STATISTICS):
            total, *counts = STATISTICS.unpack_from(content)[:6]
            if total != sum(messages.values()):
                yield Finding(Check.COUNTS, "whole file", f"{sum(messages.values())} messages, expected {total}")
            for (opcode, name), count in zip(COUNTED.items(), counts, strict=True):
                if opcodes[opcode] != count:
                    yield Finding(Check.COUNTS, "whole file", f"{opcodes[opcode]} {name}, expected {count}")
