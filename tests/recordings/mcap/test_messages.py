"""The compiled messages match rig.proto; blocks and segment ends survive a round trip."""

import importlib.util
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from google.protobuf.descriptor_pb2 import FileDescriptorProto, FileDescriptorSet

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd
from recordings.mcap.messages import (
    block_span,
    decode_block,
    decode_segment_end,
    encode_block,
    encode_segment_end,
    message_definitions,
)
from recordings.mcap.schema import rig_pb2

SCHEMA_FOLDER = Path(rig_pb2.__file__).parent


def test_committed_descriptor_matches_the_proto_file(tmp_path: Path) -> None:
    assert importlib.util.find_spec("grpc_tools") is not None
    out = tmp_path / "rig.descriptor"
    subprocess.run(
        [
            sys.executable,
            "-m",
            "grpc_tools.protoc",
            "-I",
            str(SCHEMA_FOLDER),
            f"--descriptor_set_out={out}",
            "rig.proto",
        ],
        check=True,
        timeout=60,
    )
    compiled = FileDescriptorSet.FromString(out.read_bytes()).file[0]
    committed = FileDescriptorProto()
    rig_pb2.DESCRIPTOR.CopyToProto(committed)
    for file in (compiled, committed):  # only the compiler sets the JSON names
        for message in file.message_type:
            for field in message.field:
                field.ClearField("json_name")
    assert committed == compiled


def test_definitions_have_every_message() -> None:
    (file,) = FileDescriptorSet.FromString(message_definitions()).file
    assert {"SampleBlock", "SegmentEnd", "Features", "OrderFrame"} <= {message.name for message in file.message_type}


def test_block_survives_a_round_trip(make_block: Callable[..., SampleBlock]) -> None:
    block = make_block(3, 123_456_789_012, 777)
    back = decode_block(encode_block(block))
    np.testing.assert_array_equal(back.codes, block.codes)
    assert (back.segment, back.first_sample) == (3, 123_456_789_012)
    assert (back.host_time_ns, back.backlog) == (block.host_time_ns, block.backlog)
    assert block_span(encode_block(block)) == (3, 123_456_789_012 + 777)


@pytest.mark.parametrize("reason", list(EndReason))
def test_segment_end_survives_a_round_trip(reason: EndReason) -> None:
    end = SegmentEnd(2, 1 << 40, reason, lost=17, lost_is_exact=False, detail="−200279 “overrun”")
    assert decode_segment_end(encode_segment_end(end)) == end


@pytest.mark.parametrize("decode", [decode_block, decode_segment_end, block_span])
def test_bytes_that_are_no_message_are_an_error(decode: Callable[[bytes], object]) -> None:
    with pytest.raises(ValueError, match="not a "):
        decode(b"\xff\xff\xff")


def test_unknown_reason_is_an_error() -> None:
    with pytest.raises(ValueError, match="'bored' is not a valid EndReason"):
        decode_segment_end(rig_pb2.SegmentEnd(reason="bored").SerializeToString())
