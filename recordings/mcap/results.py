"""Messages added to the samples of a run file: snapshots of the analysis, bit for bit, and markers (notes, alarms)."""

import math
from collections.abc import Sequence, Sized
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from analysis.signals import ComplexArray
from analysis.signals.header import RunHeader
from analysis.signals.snapshot import (
    OVERALL,
    CounterReport,
    OrderFrame,
    RunOut,
    Snapshot,
    TachoReport,
    TachoState,
    Trace,
    Whirl,
)
from analysis.signals.units import MICROMETRE, RPM, phase_lag_degrees
from recordings.errors import MessageError
from recordings.mcap import rig_pb2
from recordings.mcap.layout import FEATURES, MARKER, NANOSECONDS, ORDER_FRAME, sample_time_ns
from recordings.mcap.messages import enumerator, parse_message


@dataclass(frozen=True, slots=True)
class EncodedResult:
    """A serialised message, ready to be written.

    Parameters
    ----------
    topic : str
        Its topic.
    log_time_ns : int
        Log time, ns since 1970, as if its segment had started with the run; the writer adds the segment's start.
    data : bytes
        The serialised message.
    segment : int
        Segment of the run.
    """

    topic: str
    log_time_ns: int
    data: bytes
    segment: int = 0


def encode_snapshot(snapshot: Snapshot, header: RunHeader) -> list[EncodedResult]:
    """Return a snapshot as messages, without its trace (the samples are in the same file).

    Parameters
    ----------
    snapshot : Snapshot
        Result of the analyser.
    header : RunHeader
        Header of the run.

    Returns
    -------
    list of EncodedResult
        The order frame, if any, and the features, in the order of writing.
    """
    messages: list[tuple[str, rig_pb2.OrderFrame | rig_pb2.Features]] = [(FEATURES, features_message(snapshot))]
    if snapshot.frame is not None:
        messages.insert(0, (ORDER_FRAME, _order_frame(snapshot, snapshot.frame)))
    log_time_ns = header.started_ns + round(snapshot.time * NANOSECONDS)
    return [
        EncodedResult(topic, log_time_ns, message.SerializeToString(), snapshot.segment) for topic, message in messages
    ]


def decode_snapshot(features: rig_pb2.Features, frame: rig_pb2.OrderFrame | None) -> Snapshot:
    """Return the snapshot of a pair of messages; its trace is empty.

    Raises
    ------
    MessageError
        If the messages do not belong together or have invalid values.
    """
    if features.has_order_frame != (frame is not None):
        raise MessageError(f"features of sample {features.sample}: the order frame is missing")
    return Snapshot(
        segment=features.segment,
        sample=features.sample,
        time=features.time_s,
        speed=features.speed_rad_per_s,
        tacho=TachoReport(
            state=enumerator(TachoState, features.tacho_state),
            pulses=features.tacho_pulses,
            filled=features.tacho_filled,
            rejected=features.tacho_rejected,
            jitter=features.tacho_jitter_s,
            phase_reference_is_arbitrary=features.tacho_mark_is_arbitrary,
        ),
        gap_volts=_floats([features.gap_x_v, features.gap_y_v]),
        gap_in_window=np.array([features.gap_x_ok, features.gap_y_ok], dtype=np.bool_),
        overall=np.array(
            [[stored_number(features, f"{row.name}_{probe}_m") for probe in "xy"] for row in OVERALL.rows]
        ),
        clipped=np.array(features.clipped, dtype=np.int64),
        frame=None if frame is None else _decoded_frame(frame),
        trace=Trace(time=np.empty(0), displacement=np.empty((2, 0)), tacho=np.empty(0)),
        outside_calibration=np.array(features.beyond_calibration or (0, 0), dtype=np.int64),  # older files have none
        counter=_decoded_check(features.counter) if features.HasField("counter") else None,
    )


def features_message(snapshot: Snapshot) -> rig_pb2.Features:
    """Return the numbers of a snapshot in the units of their names."""
    tacho = snapshot.tacho
    overall = [
        (f"{measure.name}_{probe}", value)
        for measure, values in zip(OVERALL.rows, snapshot.overall.tolist(), strict=True)
        for probe, value in zip("xy", values, strict=True)
    ]
    return rig_pb2.Features(
        segment=snapshot.segment,
        sample=snapshot.sample,
        time_s=snapshot.time,
        speed_rpm=snapshot.speed / RPM,
        speed_rad_per_s=snapshot.speed,
        tacho_state=tacho.state.value,
        tacho_pulses=tacho.pulses,
        tacho_filled=tacho.filled,
        tacho_rejected=tacho.rejected,
        tacho_jitter_s=tacho.jitter,
        tacho_mark_is_arbitrary=tacho.phase_reference_is_arbitrary,
        gap_x_v=snapshot.gap_volts[0],
        gap_y_v=snapshot.gap_volts[1],
        gap_x_ok=bool(snapshot.gap_in_window[0]),
        gap_y_ok=bool(snapshot.gap_in_window[1]),
        clipped=snapshot.clipped.tolist(),
        beyond_calibration=snapshot.outside_calibration.tolist(),
        has_order_frame=snapshot.frame is not None,
        counter=None if snapshot.counter is None else _check(snapshot.counter),
        **{f"{name}_m": value for name, value in overall},
        **{f"{name}_um": value / MICROMETRE for name, value in overall},
        **({} if snapshot.frame is None else _order_fields(snapshot.frame)),
    )


def stored_number(message: rig_pb2.Features, name: str) -> float:
    """Return a number of a message; NaN if it is missing, as in older files."""
    is_missing = message.DESCRIPTOR.fields_by_name[name].has_presence and not message.HasField(name)
    return math.nan if is_missing else float(getattr(message, name))


def _check(counter: CounterReport) -> rig_pb2.CounterCheck:
    return rig_pb2.CounterCheck(
        is_working=counter.is_working,
        compared=counter.compared,
        missing=counter.missing,
        extra=counter.extra,
        apart=counter.out_of_tolerance,
        mean_s=counter.mean_difference,
        largest_s=counter.largest_difference,
        recent=counter.recent,
        recent_odd=counter.recent_mismatches,
    )


def _decoded_check(message: rig_pb2.CounterCheck) -> CounterReport:
    return CounterReport(
        is_working=message.is_working,
        compared=message.compared,
        missing=message.missing,
        extra=message.extra,
        out_of_tolerance=message.apart,
        mean_difference=message.mean_s,
        largest_difference=message.largest_s,
        recent=message.recent,
        recent_mismatches=message.recent_odd,
    )


def _order_fields(frame: OrderFrame) -> dict[str, Any]:
    names = ("x_1x", "y_1x", "x_2x", "y_2x", "x_1x_compensated", "y_1x_compensated")
    vectors = frame.vectors.ravel().tolist()
    if frame.compensated is not None and np.isfinite(frame.compensated[0]).all():
        vectors += frame.compensated[0].tolist()
    x_sigma, y_sigma = np.degrees(frame.phase_sigma[0]).tolist()
    fields = {
        "noise_um": frame.noise / MICROMETRE,
        "sigma_1x_um": frame.sigma[0] / MICROMETRE,
        "sigma_2x_um": frame.sigma[1] / MICROMETRE,
        "x_1x_lag_sigma_deg": x_sigma,
        "y_1x_lag_sigma_deg": y_sigma,
        "whirls": len(frame.whirls),
    }
    for name, vector in zip(names, vectors, strict=False):
        fields |= {f"{name}_um": abs(vector) / MICROMETRE, f"{name}_lag_deg": phase_lag_degrees(vector)}
    if frame.whirl is not None:
        fields |= {
            "whirl_order": frame.whirl.order,
            "whirl_um": frame.whirl.amplitude / MICROMETRE,
            "whirl_is_forward": frame.whirl.is_forward,
            "whirl_sigma_um": frame.whirl.sigma / MICROMETRE,
        }
    return fields


def _order_frame(snapshot: Snapshot, frame: OrderFrame) -> rig_pb2.OrderFrame:
    (x_1x, y_1x), (x_2x, y_2x) = frame.vectors.tolist()
    message = rig_pb2.OrderFrame(
        segment=snapshot.segment,
        sample=snapshot.sample,
        time_s=snapshot.time,
        speed_rad_per_s=frame.speed,
        acceleration_rad_per_s2=frame.acceleration,
        orders=frame.orders.tolist(),
        spectrum_x_real_m=frame.spectrum[0].real.tolist(),
        spectrum_x_imag_m=frame.spectrum[0].imag.tolist(),
        spectrum_y_real_m=frame.spectrum[1].real.tolist(),
        spectrum_y_imag_m=frame.spectrum[1].imag.tolist(),
        x_1x=_vector(x_1x),
        y_1x=_vector(y_1x),
        x_2x=_vector(x_2x),
        y_2x=_vector(y_2x),
        noise_m=frame.noise,
        whirl=None if frame.whirl is None else _whirl(frame.whirl),
        orbit_x_m=frame.orbit[0].tolist(),
        orbit_y_m=frame.orbit[1].tolist(),
        weaker_whirls=[_whirl(whirl) for whirl in frame.whirls[1:]],
        sigma_1x_m=frame.sigma[0],
        sigma_2x_m=frame.sigma[1],
        angle_sigma_rad=frame.angle_sigma,
        runout=None if frame.runout is None else _runout(frame.runout),
        spectrum_x_um=(np.abs(frame.spectrum[0]) / MICROMETRE).tolist(),
        spectrum_y_um=(np.abs(frame.spectrum[1]) / MICROMETRE).tolist(),
        orbit_x_um=(frame.orbit[0] / MICROMETRE).tolist(),
        orbit_y_um=(frame.orbit[1] / MICROMETRE).tolist(),
    )
    if frame.compensated_orbit is not None:
        message.compensated_orbit_x_m.extend(frame.compensated_orbit[0].tolist())
        message.compensated_orbit_y_m.extend(frame.compensated_orbit[1].tolist())
    return message


def _runout(runout: RunOut) -> rig_pb2.RunOut:
    x, y = ([_vector(value) for value in of_probe] for of_probe in runout.vectors.T.tolist())
    return rig_pb2.RunOut(x=x, y=y, sigma_1x_m=runout.sigma[0], sigma_2x_m=runout.sigma[1])


def _whirl(whirl: Whirl) -> rig_pb2.Whirl:
    x, y = whirl.vectors.tolist()
    return rig_pb2.Whirl(
        order=whirl.order,
        forward_m=whirl.forward,
        backward_m=whirl.backward,
        x=_vector(x),
        y=_vector(y),
        order_sigma=whirl.order_sigma,
        sigma_m=whirl.sigma,
    )


def _vector(value: complex) -> rig_pb2.Vector:
    return rig_pb2.Vector(real_m=value.real, imag_m=value.imag)


def _decoded_frame(message: rig_pb2.OrderFrame) -> OrderFrame:
    whirls = [*([message.whirl] if message.HasField("whirl") else []), *message.weaker_whirls]
    has_sigma = message.HasField("sigma_1x_m")  # missing in older files
    has_orbit = len(message.compensated_orbit_x_m) > 0
    return OrderFrame(
        speed=message.speed_rad_per_s,
        acceleration=message.acceleration_rad_per_s2,
        orders=_floats(message.orders),
        spectrum=_stacked(
            _complex(message.spectrum_x_real_m, message.spectrum_x_imag_m),
            _complex(message.spectrum_y_real_m, message.spectrum_y_imag_m),
        ),
        vectors=_vectors([message.x_1x, message.y_1x, message.x_2x, message.y_2x]).reshape(2, 2),
        noise=message.noise_m,
        whirls=tuple(_decoded_whirl(whirl) for whirl in whirls),
        orbit=_rows(message.orbit_x_m, message.orbit_y_m),
        sigma=_floats([message.sigma_1x_m, message.sigma_2x_m]) if has_sigma else np.full(2, np.nan),
        angle_sigma=message.angle_sigma_rad if has_sigma else math.nan,
        runout=_decoded_runout(message.runout) if message.HasField("runout") else None,
        compensated_orbit=_rows(message.compensated_orbit_x_m, message.compensated_orbit_y_m) if has_orbit else None,
    )


def _decoded_whirl(message: rig_pb2.Whirl) -> Whirl:
    has_sigma = message.HasField("sigma_m")
    return Whirl(
        order=message.order,
        forward=message.forward_m,
        backward=message.backward_m,
        vectors=_vectors([message.x, message.y]),
        order_sigma=message.order_sigma if has_sigma else math.nan,
        sigma=message.sigma_m if has_sigma else math.nan,
    )


def _decoded_runout(message: rig_pb2.RunOut) -> RunOut:
    vectors = np.ascontiguousarray(_stacked(_vectors(message.x), _vectors(message.y)).T)
    if len(vectors) < 2:
        raise MessageError(f"run-out of {len(vectors)} orders, expected at least 2")
    return RunOut(vectors, _floats([message.sigma_1x_m, message.sigma_2x_m]))


def _vectors(messages: Sequence[rig_pb2.Vector]) -> ComplexArray:
    return np.array([complex(message.real_m, message.imag_m) for message in messages], dtype=np.complex128)


def _complex(real: Sequence[float], imag: Sequence[float]) -> ComplexArray:
    _require_equal_lengths(real, imag)
    values = np.empty(len(real), dtype=np.complex128)  # set by parts: real + 1j * imag would lose the sign of a zero
    values.real, values.imag = real, imag
    return values


def _rows(x: Sequence[float], y: Sequence[float]) -> NDArray[np.float64]:
    return _stacked(_floats(x), _floats(y))


Number = TypeVar("Number", np.float64, np.complex128)


def _stacked(x: NDArray[Number], y: NDArray[Number]) -> NDArray[Number]:
    _require_equal_lengths(x, y)
    return np.stack([x, y])


def _require_equal_lengths(first: Sized, second: Sized) -> None:
    if len(first) != len(second):
        raise MessageError(f"lists of {len(first)} and {len(second)} numbers, expected equal lengths")


def _floats(values: Sequence[float]) -> NDArray[np.float64]:
    return np.array(values, dtype=np.float64)


MAX_MARKER_LENGTH = 200
"""Characters; longer texts are cut off."""
DEFAULT_TEXT = "marker"
"""Text of a marker that is added without one."""


class MarkerKind(StrEnum):
    """Origin of a marker."""

    NOTE = "word"  # a note by the operator
    ALARM = "alarm"  # a limit was exceeded for the alarm's hold time
    ACKNOWLEDGED = "acknowledged"  # the operator acknowledged the alarms up to here


@dataclass(frozen=True, slots=True)
class Marker:
    """A note at a sample of a run.

    Parameters
    ----------
    segment : int
        Segment of the run.
    sample : int
        Samples per channel of the segment that had been recorded when the marker was added: accurate to one block and
        the card's backlog.
    text : str
        The note.
    host_time_ns : int
        The host's wall clock when the marker was added, ns since 1970.
    kind : MarkerKind
        Origin.
    """

    segment: int
    sample: int
    text: str
    host_time_ns: int
    kind: MarkerKind = MarkerKind.NOTE


def encode_marker(marker: Marker, header: RunHeader) -> EncodedResult:
    """Return a marker as a message for the run's file."""
    rate = header.acquisition.rate
    message = rig_pb2.Mark(
        segment=marker.segment,
        sample=marker.sample,
        time_s=marker.sample / rate,
        text=marker.text[:MAX_MARKER_LENGTH],
        host_time_ns=marker.host_time_ns,
        kind=marker.kind.value,
    )
    log_time_ns = header.started_ns + sample_time_ns(marker.sample, rate)
    return EncodedResult(MARKER, log_time_ns, message.SerializeToString(), marker.segment)


def decode_marker(data: bytes) -> Marker:
    """Return the marker of a serialised message; MessageError."""
    message = parse_message(rig_pb2.Mark(), data)
    kind = enumerator(MarkerKind, message.kind or MarkerKind.NOTE)
    return Marker(message.segment, message.sample, message.text, message.host_time_ns, kind)
