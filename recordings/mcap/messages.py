"""Blocks and segment ends as the bytes of their messages, and the definitions that go into every file."""

from typing import TypeVar

from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.message import DecodeError

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd
from recordings.mcap.codec import pack, unpack
from recordings.mcap.schema import rig_pb2

Message = TypeVar(
    "Message",
    rig_pb2.SampleBlock,
    rig_pb2.SegmentEnd,
    rig_pb2.Features,
    rig_pb2.OrderFrame,
    rig_pb2.Mark,
    rig_pb2.Pulses,
)


def parsed(message: Message, data: bytes) -> Message:
    """Fill an empty message from bytes and return it; ValueError where the bytes are none."""
    try:
        message.ParseFromString(data)
    except DecodeError as error:
        raise ValueError(f"not a {type(message).__name__}: {error}") from error
    return message


def definitions() -> bytes:
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
        codes=pack(block.codes),
        host_time_ns=block.host_time_ns,
        backlog=block.backlog,
    )
    return message.SerializeToString()


def decode_block(data: bytes) -> SampleBlock:
    """Return the block of a message; ValueError where the bytes are none."""
    message = parsed(rig_pb2.SampleBlock(), data)
    codes = unpack(message.codes, message.codec, message.channels, message.samples)
    return SampleBlock(codes, message.segment, message.first_sample, message.host_time_ns, message.backlog)


def block_span(data: bytes) -> tuple[int, int]:
    """Return the segment of a block's message and the index one past its last sample, without unpacking the codes."""
    message = parsed(rig_pb2.SampleBlock(), data)
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
    message = parsed(rig_pb2.SegmentEnd(), data)
    return SegmentEnd(
        message.segment, message.samples, EndReason(message.reason), message.lost, message.lost_is_exact, message.detail
    )
