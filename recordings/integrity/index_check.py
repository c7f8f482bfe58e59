"""Whether the indexes of a file lead where they say."""

import struct
from collections import Counter
from collections.abc import Iterator, Mapping

from mcap.opcode import Opcode

from recordings.integrity.findings import Check, Finding
from recordings.mcap.chunk_table import ChunkPlace
from recordings.mcap.container import RECORD, Container, StoredMessage

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

    def chunk(self, place: ChunkPlace, messages: list[StoredMessage], where: str) -> Iterator[Finding]:
        """Take an intact chunk; the message indexes that follow it are its own."""
        self._times = {}
        for message in messages:
            self._times.setdefault(message.channel, []).append(message.log_time_ns)
        if self._file.is_finished and place.channels != frozenset(self._times):
            yield Finding(Check.INDEX, where, "the index at the end names other channels than the chunk holds")
        earliest = min((message.log_time_ns for message in messages), default=place.start_ns)
        if earliest != place.start_ns:
            yield Finding(Check.INDEX, where, f"a chunk that begins at {earliest} ns, expected {place.start_ns} ns")

    def pass_over(self) -> None:
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
