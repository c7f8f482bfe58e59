"""Encoding and decoding of sample blocks, segment ends and counter pulses; the message definitions of a file."""

from dataclasses import asdict, replace
from enum import StrEnum
from typing import TypeVar

import numpy as np
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.message import DecodeError
from numpy.typing import NDArray

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd, SourceItem
from analysis.signals.header import Acquisition
from recordings.errors import MessageError
from recordings.mcap import rig_pb2
from recordings.mcap.layout import CHANNEL_IDS, PULSES, SAMPLES, SEGMENT_END
from recordings.mcap.rig_pb2 import CODEC_DELTA_SHUFFLE, CODEC_INT16

BYTES_PER_CODE = 2


def pack_codes(codes: NDArray[np.int16]) -> bytes:
    """Return the codes as CODEC_DELTA_SHUFFLE bytes, which compress well.

    Differences along each channel are folded (0, -1, 1, -2 … to 0, 1, 2, 3 …), so that small changes of either sign
    become small numbers; then come all low bytes, then all high bytes, which are nearly all zero.

    Parameters
    ----------
    codes : ndarray of int16, shape (n_channels, n_samples)
        Converter codes.

    Returns
    -------
    bytes
        ``2 * n_channels * n_samples`` bytes: all low bytes, then all high bytes, channel after channel.
    """
    values = np.ascontiguousarray(codes).view(np.uint16)
    folded = values.copy()
    folded[:, 1:] -= values[:, :-1]  # differences modulo 65536
    signs = np.negative(folded >> np.uint16(15))
    folded <<= np.uint16(1)
    folded ^= signs
    planes = np.empty((BYTES_PER_CODE, *codes.shape), dtype=np.uint8)
    planes[0] = folded & np.uint16(0xFF)
    planes[1] = folded >> np.uint16(8)
    return planes.tobytes()


def unpack_codes(data: bytes, codec: int, n_channels: int, n_samples: int) -> NDArray[np.int16]:
    """Return the codes from the bytes of `pack_codes` or of plain int16.

    Parameters
    ----------
    data : bytes
        The packed codes.
    codec : int
        A value of ``rig.Codec``.
    n_channels, n_samples : int
        The block's shape.

    Returns
    -------
    ndarray of int16, shape (n_channels, n_samples)
        Converter codes, C-contiguous.

    Raises
    ------
    MessageError
        If the codec is unknown, or the number of bytes does not fit the shape.
    """
    expected = BYTES_PER_CODE * n_channels * n_samples
    if len(data) != expected:
        raise MessageError(f"codes: {len(data)} bytes, expected {expected} for {n_channels} x {n_samples} samples")
    shape = (n_channels, n_samples)
    if codec == CODEC_INT16:
        return np.frombuffer(data, dtype="<i2").reshape(shape).astype(np.int16)
    if codec != CODEC_DELTA_SHUFFLE:
        raise MessageError(f"codec: {codec}, expected {CODEC_INT16} or {CODEC_DELTA_SHUFFLE}")
    low, high = np.frombuffer(data, dtype=np.uint8).reshape(BYTES_PER_CODE, *shape)
    # still folded; arithmetic on whole planes is four times as fast as shuffling bytes
    deltas = high.astype(np.uint16)
    deltas <<= np.uint16(8)
    deltas |= low
    is_odd = deltas & np.uint16(1)
    deltas >>= np.uint16(1)
    deltas ^= np.negative(is_odd, out=is_odd)  # modulo 65536
    return np.add.accumulate(deltas, axis=1, out=deltas).view(np.int16)


Message = TypeVar(
    "Message",
    rig_pb2.SampleBlock,
    rig_pb2.SegmentEnd,
    rig_pb2.Features,
    rig_pb2.OrderFrame,
    rig_pb2.Mark,
    rig_pb2.Pulses,
)


Enumerator = TypeVar("Enumerator", bound=StrEnum)


def enumerator(kind: type[Enumerator], text: str) -> Enumerator:
    """Return the enumerator that a message names; MessageError if there is none of this name."""
    try:
        return kind(text)
    except ValueError as error:
        raise MessageError(str(error)) from error


def parse_message(message: Message, data: bytes) -> Message:
    """Parse bytes into an empty message and return it; MessageError if the bytes are not such a message."""
    try:
        message.ParseFromString(data)
    except DecodeError as error:
        raise MessageError(f"not a {type(message).__name__}: {error}") from error
    return message


def message_definitions() -> bytes:
    """Return the definitions of all message types as a serialised FileDescriptorSet."""
    files = FileDescriptorSet()
    rig_pb2.DESCRIPTOR.CopyToProto(files.file.add())
    return files.SerializeToString(deterministic=True)


def encode_block(block: SampleBlock) -> bytes:
    """Return a block as a serialised message."""
    return rig_pb2.SampleBlock(
        segment=block.segment,
        first_sample=block.first_sample,
        channels=block.codes.shape[0],
        samples=block.n_samples,
        codec=rig_pb2.CODEC_DELTA_SHUFFLE,
        codes=pack_codes(block.codes),
        host_time_ns=block.host_time_ns,
        backlog=block.backlog,
    ).SerializeToString()


def decode_block(data: bytes) -> SampleBlock:
    """Return the block of a serialised message; MessageError."""
    message = parse_message(rig_pb2.SampleBlock(), data)
    codes = unpack_codes(message.codes, message.codec, message.channels, message.samples)
    return SampleBlock(codes, message.segment, message.first_sample, message.host_time_ns, message.backlog)


def block_span(data: bytes) -> tuple[int, int]:
    """Return segment and end (one past the last sample) of a serialised block, without unpacking the codes."""
    message = parse_message(rig_pb2.SampleBlock(), data)
    return message.segment, message.first_sample + message.samples


def encode_segment_end(end: SegmentEnd) -> bytes:
    """Return a segment end as a serialised message."""
    return rig_pb2.SegmentEnd(**asdict(end)).SerializeToString()


def decode_segment_end(data: bytes) -> SegmentEnd:
    """Return the segment end of a serialised message; MessageError."""
    message = parse_message(rig_pb2.SegmentEnd(), data)
    return SegmentEnd(
        message.segment,
        message.samples,
        enumerator(EndReason, message.reason),
        message.lost,
        message.lost_is_exact,
        message.detail,
    )


class PulseEncoder:
    """Encoder of the counter's pulse messages, which numbers the pulses of each segment.

    Parameters
    ----------
    acquisition : Acquisition
        Whether there is a counter.
    """

    def __init__(self, acquisition: Acquisition) -> None:
        self._has_counter = acquisition.tacho.counter is not None
        self._segment = -1
        self._next, self._has_failed = 0, False
        self.count = 0
        """Pulses in all messages."""

    def encode(self, block: SampleBlock) -> bytes | None:
        """Return the message that precedes a block's; None without a counter, without pulses, or after a failure."""
        if block.segment != self._segment:
            self._segment, self._next, self._has_failed = block.segment, 0, False
        if not self._has_counter or self._has_failed:
            return None
        if block.ticks is None:
            self._has_failed = True
        elif block.ticks.size == 0:
            return None
        ticks = [] if block.ticks is None else block.ticks.tolist()
        message = rig_pb2.Pulses(
            segment=block.segment,
            first_sample=block.first_sample,
            first_pulse=self._next,
            ticks=ticks,
            has_failed=self._has_failed,
        )
        self._next += len(ticks)
        self.count += len(ticks)
        return message.SerializeToString()


class ItemDecoder:
    """Decoder of the blocks of a file, with their pulses, and of its segment ends.

    Parameters
    ----------
    acquisition : Acquisition
        Number of channels, and whether there was a counter.
    """

    def __init__(self, acquisition: Acquisition) -> None:
        self._n_channels = len(acquisition.channels)
        self._has_counter = acquisition.tacho.counter is not None
        self._pending: dict[tuple[int, int], rig_pb2.Pulses] = {}
        self._failed_segment = -1

    def decode(self, channel: int, data: bytes) -> SourceItem | None:
        """Return the block or segment end of a message, None for other messages; MessageError."""
        if channel == CHANNEL_IDS[PULSES]:
            self.add_pulses(data)
        elif channel == CHANNEL_IDS[SEGMENT_END]:
            return decode_segment_end(data)
        elif channel == CHANNEL_IDS[SAMPLES]:
            block = decode_block(data)
            if block.codes.shape[0] != self._n_channels:
                raise MessageError(f"block of {block.codes.shape[0]} channels, expected {self._n_channels}")
            return self.merge(block)
        return None

    def add_pulses(self, data: bytes) -> None:
        """Take a serialised pulse message; MessageError."""
        message = parse_message(rig_pb2.Pulses(), data)
        self._pending[message.segment, message.first_sample] = message

    def merge(self, block: SampleBlock) -> SampleBlock:
        """Return a block with its pulses, whose message must have been taken before."""
        if not self._has_counter:
            return block
        key = (block.segment, block.first_sample)
        message = self._pending.get(key)
        # messages of earlier blocks stay only if those blocks were damaged
        self._pending = {later: pending for later, pending in self._pending.items() if later > key}
        if message is not None and message.has_failed:
            self._failed_segment = block.segment
        if block.segment == self._failed_segment:
            return block
        ticks = np.array([] if message is None else message.ticks, dtype=np.int64)
        return replace(block, ticks=ticks)
