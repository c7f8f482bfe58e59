"""Whether what a counter stamped follows as a recording's must, and belongs to the samples beside it.

What an inspection of a recording's file found.
Whether a header can turn codes into volts and micrometres: its scalings and calibrations are sane.
Whether the indexes of a file lead where they say.
"""

import math
import struct
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from mcap.opcode import Opcode

from analysis.signals.blocks import SampleBlock
from analysis.signals.header import CODE_MAX, CODE_MIN, Acquisition, Calibration, Channel, Role
from recordings.mcap.chunk_table import ChunkLocation
from recordings.mcap.container import RECORD, Container, StoredMessage
from recordings.mcap.messages import parse_message
from recordings.mcap.schema import rig_pb2


class Check(StrEnum):
    """What was looked at."""

    FILE = "file"  # beginning, end, records that lead from one to the next
    CRC = "crc"
    INDEX = "index"
    HEADER = "header"
    CONTINUITY = "continuity"
    COUNTS = "counts"
    CALIBRATION = "calibration"


@dataclass(frozen=True, slots=True)
class Finding:
    """Something found in a file.

    Parameters
    ----------
    check : Check
        What was looked at.
    where : str
        Where it is, as "byte 1234" or "segment 0".
    what : str
        What is there, and what was expected.
    is_fault : bool
        Whether the recording is not whole for it; else it is worth knowing.
    """

    check: Check
    where: str
    what: str
    is_fault: bool = True


POINTS = 501


def check_acquisition(acquisition: Acquisition) -> Iterator[Finding]:
    """Yield what is wrong with rates, channels, scalings and calibrations."""
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
        yield f"the scaling gives {volts[0]:g} V at the lowest code and {volts[1]:g} V at the highest"
    if channel.role is Role.TACHO:
        return
    if channel.calibration is None:
        yield "a probe without calibration: its samples cannot become micrometres"
    else:
        yield from _calibration_faults(channel.calibration)


def _calibration_faults(calibration: Calibration) -> Iterator[str]:
    if not calibration.coefficients or not np.isfinite(calibration.coefficients).all():
        yield f"calibration {calibration.coefficients}, expected finite coefficients"
    elif not calibration.volts_low < calibration.volts_high:
        yield f"calibrated from {calibration.volts_low:g} to {calibration.volts_high:g} V, expected a rising span"
    else:
        volts = np.linspace(calibration.volts_low, calibration.volts_high, POINTS)
        steps = np.diff(np.polynomial.polynomial.polyval(volts, calibration.coefficients))
        if not ((steps > 0).all() or (steps < 0).all()):
            yield "the calibration gives one gap for two voltages within its span"


STATISTICS = struct.Struct(
    "<QHIIIIQQ"
)  # messages, schemas, channels, attachments, metadata, chunks, first and last time
COUNTED = {
    Opcode.SCHEMA: "schemas",
    Opcode.CHANNEL: "channels",
    Opcode.ATTACHMENT: "attachments",
    Opcode.METADATA: "metadata records",
    Opcode.CHUNK: "chunks",
}


class IndexCheck:
    """Compares what the indexes of a file say with what is in it.

    Parameters
    ----------
    container : Container
        The file.
    """

    def __init__(self, container: Container) -> None:
        self._file = container
        self._times: dict[int, list[int]] = {}

    def chunk(self, place: ChunkLocation, messages: list[StoredMessage], where: str) -> Iterator[Finding]:
        """Take an intact chunk; the message indexes that follow it are its own."""
        self._times = {}
        for message in messages:
            self._times.setdefault(message.channel, []).append(message.log_time_ns)
        if self._file.is_finished and place.channels != frozenset(self._times):
            yield Finding(Check.INDEX, where, "the index at the end names other channels than the chunk holds")
        earliest = min((message.log_time_ns for message in messages), default=place.start_ns)
        if earliest != place.start_ns:
            yield Finding(Check.INDEX, where, f"a chunk that begins at {earliest} ns, expected {place.start_ns} ns")

    def skip_chunk(self) -> None:
        """Take a damaged chunk; nothing can be said of the message indexes that follow it."""
        self._times = {}

    def message_index(self, content: bytes, where: str) -> Iterator[Finding]:
        """Take a message index."""
        if len(content) < 6:
            yield Finding(Check.INDEX, where, "a message index that is too short")
            return
        channel, length = struct.unpack_from("<HI", content)
        if length != len(content) - 6 or length % 16:
            yield Finding(Check.INDEX, where, "a message index whose length is not what it says")
            return
        times = [time for time, _ in struct.iter_unpack("<QQ", content[6:])]
        if self._times and self._times.get(channel) != times:
            yield Finding(Check.INDEX, where, f"the message index of channel {channel} is not that of its chunk")

    def finish(self, messages: Mapping[int, int]) -> Iterator[Finding]:
        """Compare the statistics of a finished file with what was found, `messages` by channel.

        The places in the index are those of the records that were walked, where every one of them is a record.
        """
        kinds: Counter[int] = Counter(record.opcode for record in self._file.records())
        places = {(record.opcode, record.offset) for record in self._file.records()}
        for place in self._file.chunks:
            if (Opcode.CHUNK, place.offset) not in places:
                where = f"byte {place.offset - RECORD.size}"
                yield Finding(Check.INDEX, where, "the index names a chunk that is not there")
        for content in self._file.summary(Opcode.METADATA_INDEX):
            offset = int.from_bytes(content[:8], "little")
            if (Opcode.METADATA, offset + RECORD.size) not in places:
                yield Finding(Check.INDEX, f"byte {offset}", "the index names a metadata record that is not there")
        for content in self._file.summary(Opcode.STATISTICS):
            total, *counts = STATISTICS.unpack_from(content)[:6]
            if total != sum(messages.values()):
                yield Finding(Check.COUNTS, "whole file", f"{sum(messages.values())} messages, expected {total}")
            for (opcode, name), count in zip(COUNTED.items(), counts, strict=True):
                if kinds[opcode] != count:
                    yield Finding(Check.COUNTS, "whole file", f"{kinds[opcode]} {name}, expected {count}")


class PulseCheck:
    """Takes the stamps and blocks of a file in their order and says where they do not fit.

    Parameters
    ----------
    acquisition : Acquisition
        What the header says of the counter.
    """

    def __init__(self, acquisition: Acquisition) -> None:
        self._acquisition = acquisition
        self._segment, self._next, self._last = -1, 0, -1
        self._waiting: tuple[int, int] | None = None  # place of the block whose stamps have come
        self.stamps = 0
        """Stamps in all messages."""

    def pulses(self, data: bytes, where: str) -> Iterator[Finding]:
        """Take the next message of stamps and yield what is wrong with it; ValueError where the bytes are none."""
        message = parse_message(rig_pb2.Pulses(), data)
        place, ticks = f"{where}, segment {message.segment}", np.array(message.ticks, dtype=np.int64)
        self.stamps += ticks.size
        if self._acquisition.tacho.counter is None:
            yield Finding(Check.CONTINUITY, place, "stamps of a counter, and none in the header")
        if message.segment != self._segment:
            self._segment, self._next, self._last = message.segment, 0, -1
        if message.first_pulse != self._next:
            what = f"stamps from number {message.first_pulse} on, expected number {self._next}"
            yield Finding(Check.CONTINUITY, place, what)
        if (np.diff(ticks, prepend=self._last) <= 0).any():
            yield Finding(Check.CONTINUITY, place, f"stamps from number {message.first_pulse} on do not rise")
        if ticks.size:
            self._last = int(ticks[-1])
        self._next = message.first_pulse + ticks.size
        if message.has_failed:
            what = f"the tacho's counter failed after {self._next} stamps, before sample {message.first_sample}"
            yield Finding(Check.CONTINUITY, place, what, is_fault=False)
        self._waiting = (message.segment, message.first_sample)

    def block(self, block: SampleBlock, where: str) -> Iterator[Finding]:
        """Take the next block and yield what is wrong with the stamps that came before it."""
        if self._waiting is None:
            return
        place, self._waiting = self._waiting, None
        if place != (block.segment, block.first_sample):
            what = f"stamps of the block from sample {place[1]} of segment {place[0]}, which does not follow"
            yield Finding(Check.CONTINUITY, where, what)
        elif self._last >= block.end * self._acquisition.ticks_per_sample + 1:
            what = f"a stamp of {self._last} ticks lies behind sample {block.end - 1}, the last that it came with"
            yield Finding(Check.CONTINUITY, where, what)
