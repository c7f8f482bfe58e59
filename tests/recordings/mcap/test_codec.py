"""Packing and unpacking of codes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from recordings.mcap.messages import pack_codes, unpack_codes
from recordings.mcap.schema.rig_pb2 import CODEC_DELTA_SHUFFLE, CODEC_INT16, CODEC_UNSPECIFIED

shapes = st.tuples(st.integers(1, 4), st.integers(0, 50))


@given(arrays(np.int16, shapes))
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
    with pytest.raises(ValueError, match="11 bytes, expected 12 for 2 x 3 samples"):
        unpack_codes(bytes(11), CODEC_DELTA_SHUFFLE, 2, 3)


def test_unknown_codec_is_an_error() -> None:
    with pytest.raises(ValueError, match="codec: 0"):
        unpack_codes(bytes(12), CODEC_UNSPECIFIED, 2, 3)
