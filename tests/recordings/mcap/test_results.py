"""Snapshots survive a round trip through their messages bit for bit."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from analysis.signals.header import RunHeader
from analysis.signals.snapshot import Snapshot
from analysis.signals.units import MICROMETRE, RPM
from recordings.errors import MessageError
from recordings.mcap import rig_pb2
from recordings.mcap.results import decode_snapshot, encode_snapshot

MakeSnapshot = Callable[..., Snapshot]


def bits(value: object) -> object:
    """Return a value in a form in which == compares bits; the trace is left out."""
    if isinstance(value, np.ndarray):
        return (value.dtype.str, value.shape, value.tobytes())
    if isinstance(value, float):
        return np.float64(value).tobytes()
    if isinstance(value, tuple):
        return tuple(map(bits, value))
    slots = getattr(type(value), "__dataclass_fields__", None)
    if slots is not None:
        return {name: bits(getattr(value, name)) for name in slots if name != "trace"}
    return value


@pytest.fixture
def decode() -> Callable[[Snapshot, RunHeader], Snapshot]:
    def through_messages(snapshot: Snapshot, header: RunHeader) -> Snapshot:
        results = encode_snapshot(snapshot, header)
        features = rig_pb2.Features.FromString(results[-1].data)
        frame = rig_pb2.OrderFrame.FromString(results[0].data) if len(results) > 1 else None
        return decode_snapshot(features, frame)

    return through_messages


@pytest.mark.parametrize(("with_frame", "with_whirl"), [(True, True), (True, False), (False, False)])
def test_snapshot_survives_a_round_trip_bit_for_bit(
    header: RunHeader,
    make_snapshot: MakeSnapshot,
    decode: Callable[[Snapshot, RunHeader], Snapshot],
    *,
    with_frame: bool,
    with_whirl: bool,
) -> None:
    snapshot = make_snapshot(2, 66_667, with_frame=with_frame, with_whirl=with_whirl)
    assert bits(decode(snapshot, header)) == bits(snapshot)


def test_trace_is_not_encoded(
    header: RunHeader, make_snapshot: MakeSnapshot, decode: Callable[[Snapshot, RunHeader], Snapshot]
) -> None:
    trace = decode(make_snapshot(0, 2000), header).trace
    assert (trace.time.size, trace.displacement.shape, trace.tacho.size) == (0, (2, 0), 0)


def test_features_are_in_display_units(header: RunHeader, make_snapshot: MakeSnapshot) -> None:
    snapshot = make_snapshot(0, 2000)
    features = rig_pb2.Features.FromString(encode_snapshot(snapshot, header)[-1].data)
    assert snapshot.frame is not None
    assert snapshot.frame.whirl is not None
    vector = snapshot.frame.vectors[0, 0]
    assert features.speed_rpm == pytest.approx(snapshot.speed / RPM)
    assert features.x_1x_um == pytest.approx(abs(vector) / MICROMETRE)
    assert features.x_1x_lag_deg == pytest.approx(-math.degrees(np.angle(vector)) % 360)
    assert features.y_1x_lag_deg == pytest.approx(180.0)
    assert features.peak_to_peak_y_um == pytest.approx(snapshot.peak_to_peak[1] / MICROMETRE)
    assert features.whirl_um == pytest.approx(snapshot.frame.whirl.amplitude / MICROMETRE)
    assert features.whirl_order == snapshot.frame.whirl.order
    assert features.whirls == 2
    assert snapshot.frame.compensated is not None
    assert features.x_1x_compensated_um == pytest.approx(abs(snapshot.frame.compensated[0, 0]) / MICROMETRE)
    assert features.sigma_1x_um == pytest.approx(1e-2 / 3)
    assert features.x_1x_lag_sigma_deg == pytest.approx(np.degrees(snapshot.frame.phase_sigma[0, 0]))


def test_features_without_an_order_frame_have_no_orders(header: RunHeader, make_snapshot: MakeSnapshot) -> None:
    (result,) = encode_snapshot(make_snapshot(0, 2000, with_frame=False), header)
    features = rig_pb2.Features.FromString(result.data)
    assert not features.HasField("x_1x_um")
    assert math.isnan(features.speed_rpm)


def test_features_with_a_missing_order_frame_are_an_error(header: RunHeader, make_snapshot: MakeSnapshot) -> None:
    features = rig_pb2.Features.FromString(encode_snapshot(make_snapshot(0, 2000), header)[-1].data)
    with pytest.raises(MessageError, match="sample 2000: the order frame is missing"):
        decode_snapshot(features, None)


@pytest.mark.parametrize("field", ["spectrum_x_imag_m", "orbit_y_m"])
def test_lists_of_different_lengths_are_an_error(header: RunHeader, make_snapshot: MakeSnapshot, field: str) -> None:
    frame, features = (result.data for result in encode_snapshot(make_snapshot(0, 2000), header))
    cut = rig_pb2.OrderFrame.FromString(frame)
    del getattr(cut, field)[1:]
    with pytest.raises(MessageError, match="and 1 numbers, expected equal lengths"):
        decode_snapshot(rig_pb2.Features.FromString(features), cut)


def test_unknown_tacho_state_is_an_error(header: RunHeader, make_snapshot: MakeSnapshot) -> None:
    features = rig_pb2.Features.FromString(encode_snapshot(make_snapshot(0, 2000, with_frame=False), header)[0].data)
    features.tacho_state = "tired"
    with pytest.raises(MessageError, match="'tired' is not a valid TachoState"):
        decode_snapshot(features, None)


def test_defect_of_the_decoder_is_not_reported_as_a_fault_of_the_message(
    header: RunHeader, make_snapshot: MakeSnapshot, monkeypatch: pytest.MonkeyPatch
) -> None:
    features = rig_pb2.Features.FromString(encode_snapshot(make_snapshot(0, 2000, with_frame=False), header)[0].data)
    monkeypatch.setattr("recordings.mcap.results.stored_number", lambda *_: float("nothing"))
    with pytest.raises(ValueError, match="could not convert"):
        decode_snapshot(features, None)
