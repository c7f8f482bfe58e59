"""Schemas of the live run: recording status, measured vibration and prediction."""

from datetime import datetime
from typing import Annotated

import numpy as np
from pydantic import Field

from analysis.signals.header import Role, RunHeader, Severity
from analysis.signals.snapshot import OrderFrame, Snapshot, TachoState, Whirl
from analysis.signals.units import MICROSECOND
from daq.schemas.events import AlarmSchema, LiveMarkerSchema, alarm_schema, live_marker_schema
from daq.schemas.runs import (
    DeviceSchema,
    LimitsSchema,
    RunOutSchema,
    device_schema,
    limits_schema,
    runout_schema,
)
from daq.schemas.units import Schema, finite, micrometres, rpm, utc_time
from daq.schemas.vibration import (
    CounterSchema,
    Direction,
    MeasuredProbeVectorsSchema,
    ProbeVectorsSchema,
    counter_schema,
    direction,
    measured_probe_vectors_schema,
    probe_vectors_schema,
)
from daq.session.live_update import LiveUpdate, RunState, Status
from model.prediction.prediction_map import Prediction

Count = Annotated[int, Field(ge=0)]
Speed = Annotated[float | None, Field(description="Shaft speed, r/min", examples=[11042.1])]


class ClippingSchema(Schema):
    """Clipped samples of a channel since the start of the run."""

    channel: str = Field(description="Name of the channel", examples=["x"])
    samples: Count = Field(description="Samples at either end of the converter's range", examples=[12])
    blocks: Count = Field(description="Blocks with clipped samples", examples=[2])
    last_s: float | None = Field(
        description="End of the last such block, sample time since the start of the run, s", examples=[131.2]
    )


class StatusSchema(Schema):
    """Status of the recording."""

    state: RunState = Field(description="State of the run", examples=["recording"])
    elapsed_s: float = Field(description="Sample time since the start of the run, s", examples=[161.2])
    samples: Count = Field(description="Samples per channel recorded or replayed", examples=[32_240_000])
    lost_samples: Count = Field(description="Lost samples per channel", examples=[0])
    lost_is_exact: bool = Field(description="False where `lost_samples` is a lower bound", examples=[True])
    backlog_s: float | None = Field(description="Unread samples in the device at the last read, s", examples=[0.1])
    disk_left_s: float | None = Field(
        description="Time until the disk is full at this rate, s; null where nothing is written", examples=[147_600.0]
    )
    skipped_samples: Count = Field(
        description="Samples per channel that the live analysis skipped; they are recorded", examples=[0]
    )
    dropped_updates: Count = Field(description="Live updates that the viewer could not draw in time", examples=[0])
    severity: Severity = Field(description="Highest severity of the present alarms", examples=["normal"])
    latched_severity: Severity = Field(description="Highest severity of the displayed alarms", examples=["normal"])
    alarms: tuple[AlarmSchema, ...] = Field(
        description="Displayed alarms: present, or latched and not yet acknowledged"
    )
    acknowledged_alarm: Count = Field(description="Number of the last acknowledged alarm; 0 for none", examples=[0])
    markers: tuple[LiveMarkerSchema, ...] = Field(description="The latest markers in order of time")
    model: str = Field(
        description='"ready", "ready, not exact: " with the reason, "computing 34 %", or why there is no prediction',
        examples=["ready"],
    )
    clipped: tuple[ClippingSchema, ...] = Field(
        description="Clipped channels, counted while recording; empty in a replay"
    )
    last_loss: str = Field(
        description="End of the last segment that ended with a fault; empty without any",
        examples=["segment 0 ended after 20,000 samples: overrun, at least 451,609 samples lost; …"],
    )
    detail: str = Field(description="Error message; empty without an error", examples=[""])


class TachoSchema(Schema):
    """State and statistics of the tacho since the start of the run."""

    state: TachoState = Field(description="State over the last update interval", examples=["good"])
    pulses: Count = Field(description="Pulses accepted", examples=[24_310])
    filled: Count = Field(description="Missing pulses that were filled in", examples=[0])
    rejected: Count = Field(description="Edges rejected as doubles or noise", examples=[0])
    jitter_us: float | None = Field(
        description="Robust scatter (median absolute deviation) of the edges about the smooth angle, µs", examples=[4.8]
    )
    phase_reference_is_arbitrary: bool = Field(
        description="Whether several keyphasor marks are indistinguishable, so that phases refer to the first one of "
        "each pulse train and cannot be compared between trains or runs",
        examples=[False],
    )
    reference: str = Field(
        description='Source of speed and phase: "samples" of the tacho, or a "counter" that time-stamps its edges',
        examples=["samples"],
    )
    counter: CounterSchema | None = Field(description="Comparison of counter and samples; null without a counter")


class WhirlSchema(Schema):
    """A measured component below 1X."""

    order: float = Field(description="Frequency over shaft frequency", examples=[0.49])
    order_sigma: float | None = Field(description="Standard deviation of the order", examples=[0.0004])
    frequency_hz: float | None = Field(description="Frequency, Hz", examples=[90.2])
    amplitude_peak_um: float | None = Field(
        description="Half the major axis of the ellipse, µm zero-to-peak", examples=[12.1]
    )
    amplitude_sigma_um: float | None = Field(
        description="Standard deviation of the amplitude, from the noise between the lines, µm", examples=[0.05]
    )
    direction: Direction = Field(description="Sense of the whirl relative to the rotation", examples=["forward"])


class PredictedWhirlSchema(Schema):
    """The strongest predicted component below 1X."""

    order: float = Field(description="Frequency over shaft frequency", examples=[0.7])
    frequency_hz: float | None = Field(description="Frequency, Hz", examples=[128.8])
    amplitude_peak_um: float | None = Field(
        description="Half the major axis of the ellipse, µm zero-to-peak", examples=[22.0]
    )


class ProbeSchema(Schema):
    """Present state of a probe."""

    name: str = Field(description="Name of the channel", examples=["x"])
    gap_v: float | None = Field(description="Mean (gap) voltage over the last update interval, V", examples=[5.02])
    gap_ok: bool = Field(description="Whether the gap voltage lies in the probe's window", examples=[True])
    clipped_samples: Count = Field(description="Clipped samples since the start of the run", examples=[0])


class MeasurementSchema(Schema):
    """Vibration and speed measured by the probes and the tacho."""

    segment: Count = Field(description="Gap-free stretch of the run, from 0", examples=[0])
    sample: Count = Field(description="Index in the segment, one past the last sample used", examples=[32_230_000])
    time_s: float = Field(description="Sample time in the segment, s", examples=[161.15])
    speed_rpm: Speed
    acceleration_rpm_per_s: float | None = Field(
        description="Mean rate of change of speed over the order frame, r/min per s", examples=[48.5]
    )
    tacho: TachoSchema
    probe_x: ProbeSchema
    probe_y: ProbeSchema
    peak_to_peak_x_um: float | None = Field(description="Overall at probe x, µm peak-to-peak", examples=[38.4])
    peak_to_peak_y_um: float | None = Field(description="Overall at probe y, µm peak-to-peak", examples=[41.0])
    peak_to_peak_clearance_fraction: float | None = Field(
        description="Larger of both as a fraction of the diametral clearance", examples=[0.205]
    )
    order_1x: MeasuredProbeVectorsSchema | None = Field(
        description="1X as measured; null until there are enough revolutions"
    )
    order_2x: MeasuredProbeVectorsSchema | None = Field(description="2X as measured; null likewise")
    order_1x_compensated: MeasuredProbeVectorsSchema | None = Field(
        description="1X minus run-out; null where no run-out is known"
    )
    order_2x_compensated: MeasuredProbeVectorsSchema | None = Field(
        description="2X minus run-out; null where no run-out is known"
    )
    noise_peak_um: float | None = Field(
        description="Noise floor of the order spectrum, µm zero-to-peak", examples=[0.05]
    )
    whirl: WhirlSchema | None = Field(description="Strongest component below 1X; null where none exceeds the noise")
    whirls: tuple[WhirlSchema, ...] = Field(
        description="Components below 1X above the noise, at most four, the strongest first"
    )


class PredictedVibrationSchema(Schema):
    """Vibration predicted at the probes for the measured speed."""

    speed_rpm: Speed
    is_exact: bool = Field(
        description="True where the motion is integrated at this speed, false where interpolated between speeds",
        examples=[True],
    )
    peak_to_peak_x_um: float | None = Field(description="Overall at probe x, µm peak-to-peak", examples=[52.0])
    peak_to_peak_y_um: float | None = Field(description="Overall at probe y, µm peak-to-peak", examples=[53.1])
    order_1x: ProbeVectorsSchema = Field(description="Predicted 1X")
    order_2x: ProbeVectorsSchema = Field(description="Predicted 2X")
    whirl: PredictedWhirlSchema | None = Field(description="Strongest component below 1X; null where none is predicted")
    growth_rate_per_s: float | None = Field(
        description="Growth rate of the least stable whirl about the 1X motion, 1/s; positive: unstable",
        examples=[14.2],
    )


class LiveSchema(Schema):
    """Latest state of the live run, or of the last one since the service started."""

    run: str = Field(description="Id of the run", examples=["2026-11-24T09-12-07-gj90c"])
    rig: str = Field(description="Name of the rig", examples=["gj90c"])
    started_at: datetime = Field(description="Wall clock at the start, UTC", examples=["2026-11-24T09:12:07.250000Z"])
    device: DeviceSchema
    limits: LimitsSchema
    runout: RunOutSchema | None = Field(description="Run-out; null without compensation")
    status: StatusSchema
    measured: MeasurementSchema | None = Field(description="Measured vibration; null before the first result")
    predicted: PredictedVibrationSchema | None = Field(
        description="Prediction at the measured speed; null where speed or prediction is unknown"
    )


def live_schema(update: LiveUpdate) -> LiveSchema:
    """Return the schema of a live update."""
    header, snapshot, prediction = update.header, update.snapshot, update.prediction
    return LiveSchema(
        run=header.run,
        rig=header.rig,
        started_at=utc_time(header.started_ns),
        device=device_schema(header.acquisition.device),
        limits=limits_schema(header.limits),
        runout=runout_schema(header.settings.runout, update.runout),
        status=_status(update.status),
        measured=None if snapshot is None else _measured(snapshot, header),
        predicted=None if prediction is None else predicted_vibration_schema(prediction),
    )


def _status(status: Status) -> StatusSchema:
    return StatusSchema(
        state=status.state,
        elapsed_s=finite(status.elapsed) or 0.0,
        samples=status.samples,
        lost_samples=status.lost,
        lost_is_exact=status.lost_is_exact,
        backlog_s=finite(status.backlog),
        disk_left_s=finite(status.disk_left),
        skipped_samples=status.skipped,
        dropped_updates=status.dropped_updates,
        severity=status.severity,
        latched_severity=status.latched,
        alarms=tuple(alarm_schema(alarm) for alarm in status.alarms),
        acknowledged_alarm=status.acknowledged,
        markers=tuple(live_marker_schema(marker) for marker in status.markers),
        model=status.model,
        clipped=tuple(
            ClippingSchema(channel=each.channel, samples=each.samples, blocks=each.blocks, last_s=finite(each.last))
            for each in status.clipped
        ),
        last_loss=status.last_loss,
        detail=status.detail,
    )


def _measured(snapshot: Snapshot, header: RunHeader) -> MeasurementSchema:
    frame = snapshot.frame
    tacho = snapshot.tacho
    return MeasurementSchema(
        segment=snapshot.segment,
        sample=snapshot.sample,
        time_s=finite(snapshot.time) or 0.0,
        speed_rpm=rpm(snapshot.speed),
        acceleration_rpm_per_s=None if frame is None else rpm(frame.acceleration),
        tacho=TachoSchema(
            state=tacho.state,
            pulses=tacho.pulses,
            filled=tacho.filled,
            rejected=tacho.rejected,
            jitter_us=finite(tacho.jitter / MICROSECOND),
            phase_reference_is_arbitrary=tacho.phase_reference_is_arbitrary,
            reference=header.acquisition.tacho.reference,
            counter=counter_schema(snapshot.counter),
        ),
        probe_x=_probe(snapshot, header, 0),
        probe_y=_probe(snapshot, header, 1),
        peak_to_peak_x_um=micrometres(snapshot.peak_to_peak[0]),
        peak_to_peak_y_um=micrometres(snapshot.peak_to_peak[1]),
        peak_to_peak_clearance_fraction=finite(header.limits.clearance_fraction(float(snapshot.peak_to_peak.max()))),
        order_1x=None if frame is None else _line(frame, 1),
        order_2x=None if frame is None else _line(frame, 2),
        order_1x_compensated=None if frame is None else _compensated_line(frame, 1),
        order_2x_compensated=None if frame is None else _compensated_line(frame, 2),
        noise_peak_um=None if frame is None else micrometres(frame.noise),
        whirl=None if frame is None or frame.whirl is None else _whirl(frame.whirl, frame),
        whirls=() if frame is None else _whirls(frame),
    )


def _line(frame: OrderFrame, order: int) -> MeasuredProbeVectorsSchema:
    which = order - 1
    return measured_probe_vectors_schema(frame.vectors[which], frame.sigma[which], frame.phase_sigma[which])


def _compensated_line(frame: OrderFrame, order: int) -> MeasuredProbeVectorsSchema | None:
    which, compensated = order - 1, frame.compensated
    if compensated is None or np.isnan(compensated[which]).any():
        return None
    sigma, phase = frame.compensated_sigma[which], frame.compensated_phase_sigma[which]
    return measured_probe_vectors_schema(compensated[which], sigma, phase)


def _whirls(frame: OrderFrame) -> tuple[WhirlSchema, ...]:
    return tuple(schema for whirl in frame.whirls if (schema := _whirl(whirl, frame)) is not None)


def _probe(snapshot: Snapshot, header: RunHeader, probe: int) -> ProbeSchema:
    row = header.acquisition.row((Role.PROBE_X, Role.PROBE_Y)[probe])
    return ProbeSchema(
        name=header.acquisition.channels[row].name,
        gap_v=finite(snapshot.gap_volts[probe]),
        gap_ok=bool(snapshot.gap_in_window[probe]),
        clipped_samples=int(snapshot.clipped[row]),
    )


def _whirl(whirl: Whirl, frame: OrderFrame) -> WhirlSchema | None:
    order = finite(whirl.order)
    if order is None:
        return None
    return WhirlSchema(
        order=order,
        order_sigma=finite(whirl.order_sigma),
        frequency_hz=_frequency(whirl.order, frame.speed),
        amplitude_peak_um=micrometres(whirl.amplitude),
        amplitude_sigma_um=micrometres(whirl.sigma),
        direction=direction(is_forward=whirl.is_forward),
    )


def predicted_vibration_schema(prediction: Prediction) -> PredictedVibrationSchema:
    """Return the schema of a prediction."""
    order = finite(prediction.whirl_order)
    whirl = None
    if order is not None:
        whirl = PredictedWhirlSchema(
            order=order,
            frequency_hz=_frequency(order, prediction.speed),
            amplitude_peak_um=micrometres(prediction.whirl_amplitude),
        )
    return PredictedVibrationSchema(
        speed_rpm=rpm(prediction.speed),
        is_exact=prediction.is_exact,
        peak_to_peak_x_um=micrometres(prediction.peak_to_peak[0]),
        peak_to_peak_y_um=micrometres(prediction.peak_to_peak[1]),
        order_1x=probe_vectors_schema(prediction.vectors[0]),
        order_2x=probe_vectors_schema(prediction.vectors[1]),
        whirl=whirl,
        growth_rate_per_s=finite(prediction.growth_rate),
    )


def _frequency(order: float, speed: float) -> float | None:
    return finite(order * speed / (2 * np.pi))
