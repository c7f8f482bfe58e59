"""Messages: the compiled schema matches rig.proto; codes, blocks and segment ends survive a round trip."""

import importlib.util
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from google.protobuf.descriptor_pb2 import FileDescriptorProto, FileDescriptorSet
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd
from recordings.errors import MessageError
from recordings.mcap import rig_pb2
from recordings.mcap.messages import (
    block_span,
    decode_block,
    decode_segment_end,
    encode_block,
    encode_segment_end,
    message_definitions,
    pack_codes,
    unpack_codes,
)
from recordings.mcap.rig_pb2 import CODEC_DELTA_SHUFFLE, CODEC_INT16, CODEC_UNSPECIFIED

SCHEMA_FOLDER = Path(rig_pb2.__file__).parent
SHAPES = st.tuples(st.integers(1, 4), st.integers(0, 50))


def test_committed_descriptor_matches_the_proto_file(tmp_path: Path) -> None:
    assert importlib.util.find_spec("grpc_tools") is not None
    out = tmp_path / "rig.descriptor"
    subprocess.run(
        [sys.executable, "-m", "grpc_tools.protoc", f"-I{SCHEMA_FOLDER}", f"--descriptor_set_out={out}", "rig.proto"],
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
    with pytest.raises(MessageError, match="not a "):
        decode(b"\xff\xff\xff")


def test_unknown_reason_is_an_error() -> None:
    with pytest.raises(MessageError, match="'bored' is not a valid EndReason"):
        decode_segment_end(rig_pb2.SegmentEnd(reason="bored").SerializeToString())


@given(arrays(np.int16, SHAPES))
def test_codes_survive_a_round_trip(codes: NDArray[np.int16]) -> None:
    back = unpack_codes(pack_codes(codes), CODEC_DELTA_SHUFFLE, *codes.shape)
    assert back.dtype == np.int16
    assert back.flags.c_contiguous
    np.testing.assert_array_equal(back, codes)


def test_jumps_between_the_rails_survive_a_round_trip() -> None:
    codes = np.array([[-32768, 32767, -32768, 0, 32767, -1]], dtype=np.int16)
    np.testing.assert_array_equal(unpack_codes(pack_codes(codes), CODEC_DELTA_SHUFFLE, 1, 6), codes)


def test_non_contiguous_codes_are_packed() -> None:
    codes = np.arange(60, dtype=np.int16).reshape(3, 20)[:, ::2]
    np.testing.assert_array_equal(unpack_codes(pack_codes(codes), CODEC_DELTA_SHUFFLE, 3, 10), codes)


def test_packed_bytes_follow_the_format() -> None:
    # differences 1, -2, 300 fold to 2, 3, 600 = 0x258: low bytes 02 03 58, high bytes 00 00 02
    assert pack_codes(np.array([[1, -1, 299]], dtype=np.int16)) == bytes([0x02, 0x03, 0x58, 0x00, 0x00, 0x02])


def test_plain_int16_is_unpacked() -> None:
    codes = np.array([[1, -2], [3, -4]], dtype="<i2")
    np.testing.assert_array_equal(unpack_codes(codes.tobytes(), CODEC_INT16, 2, 2), codes)


def test_bytes_that_do_not_fit_the_shape_are_an_error() -> None:
    with pytest.raises(MessageError, match="11 bytes, expected 12 for 2 x 3 samples"):
        unpack_codes(bytes(11), CODEC_DELTA_SHUFFLE, 2, 3)


def test_unknown_codec_is_an_error() -> None:
    with pytest.raises(MessageError, match="codec: 0"):
        unpack_codes(bytes(12), CODEC_UNSPECIFIED, 2, 3)
