"""Blocks and segment ends as the bytes of their messages, and the definitions that go into every file.

How a block's codes become bytes that compress well: differences, folded to small numbers, low bytes first.
"""

from typing import TypeVar

import numpy as np
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.message import DecodeError
from numpy.typing import NDArray

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd
from recordings.mcap.schema import rig_pb2
from recordings.mcap.schema.rig_pb2 import CODEC_DELTA_SHUFFLE, CODEC_INT16

BYTES_PER_CODE = 2


def pack_codes(codes: NDArray[np.int16]) -> bytes:
    """Return the codes as CODEC_DELTA_SHUFFLE bytes.

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
    folded ^= signs  # 0, -1, 1, -2 … become 0, 1, 2, 3 …
    planes = np.empty((BYTES_PER_CODE, *codes.shape), dtype=np.uint8)
    planes[0] = folded & np.uint16(0xFF)
    planes[1] = folded >> np.uint16(8)
    return planes.tobytes()


def unpack_codes(data: bytes, codec: int, n_channels: int, n_samples: int) -> NDArray[np.int16]:
    """Return the codes that `pack` (or a writer of plain int16) made into bytes.

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
    ValueError
        Where the codec is not known or the number of bytes does not fit the shape.
    """
    expected = BYTES_PER_CODE * n_channels * n_samples
    if len(data) != expected:
        raise ValueError(f"codes: {len(data)} bytes, expected {expected} for {n_channels} x {n_samples} samples")
    shape = (n_channels, n_samples)
    if codec == CODEC_INT16:
        return np.frombuffer(data, dtype="<i2").reshape(shape).astype(np.int16)
    if codec != CODEC_DELTA_SHUFFLE:
        raise ValueError(f"codec: {codec}, expected {CODEC_INT16} or {CODEC_DELTA_SHUFFLE}")
    low, high = np.frombuffer(data, dtype=np.uint8).reshape(BYTES_PER_CODE, *shape)
    deltas = high.astype(
        np.uint16
    )  # folded as yet; arithmetic on whole planes is four times as fast as shuffling bytes
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


def parse_message(message: Message, data: bytes) -> Message:
    """Fill an empty message from bytes and return it; ValueError where the bytes are none."""
    try:
        message.ParseFromString(data)
    except DecodeError as error:
        raise ValueError(f"not a {type(message).__name__}: {error}") from error
    return message


def message_definitions() -> bytes:
    """Return the definitions of all messages as a serialised FileDescriptorSet."""
    files = FileDescriptorSet()
    rig_pb2.DESCRIPTOR.CopyToProto(files.file.add())
    return files.SerializeToString(deterministic=True)


def encode_block(block: SampleBlock) -> bytes:
    """Return the message of a block."""
    message = rig_pb2.SampleBlock(
        segment=block.segment,
        first_sample=block.first_sample,
        channels=block.codes.shape[0],
        samples=block.n_samples,
        codec=rig_pb2.CODEC_DELTA_SHUFFLE,
        codes=pack_codes(block.codes),
        host_time_ns=block.host_time_ns,
        backlog=block.backlog,
    )
    return message.SerializeToString()


def decode_block(data: bytes) -> SampleBlock:
    """Return the block of a message; ValueError where the bytes are none."""
    message = parse_message(rig_pb2.SampleBlock(), data)
    codes = unpack_codes(message.codes, message.codec, message.channels, message.samples)
    return SampleBlock(codes, message.segment, message.first_sample, message.host_time_ns, message.backlog)


def block_span(data: bytes) -> tuple[int, int]:
    """Return the segment of a block's message and the index one past its last sample, without unpacking the codes."""
    message = parse_message(rig_pb2.SampleBlock(), data)
    return message.segment, message.first_sample + message.samples


def encode_segment_end(end: SegmentEnd) -> bytes:
    """Return the message of a segment's end."""
    message = rig_pb2.SegmentEnd(
        segment=end.segment,
        samples=end.samples,
        reason=end.reason.value,
        lost=end.lost,
        lost_is_exact=end.lost_is_exact,
        detail=end.detail,
    )
    return message.SerializeToString()


def decode_segment_end(data: bytes) -> SegmentEnd:
    """Return the segment's end of a message; ValueError where the bytes are none."""
    message = parse_message(rig_pb2.SegmentEnd(), data)
    return SegmentEnd(
        message.segment, message.samples, EndReason(message.reason), message.lost, message.lost_is_exact, message.detail
    )
