"""Schemas of the live run: recording status, measured vibration and prediction."""

from datetime import datetime

import numpy as np
from pydantic import Field

from analysis.signals.header import Role, RunHeader, Severity
from analysis.signals.snapshot import OrderFrame, Snapshot, TachoReport, TachoState, Whirl, WhirlDirection
from daq.schemas.events import AlarmSchema, LiveMarkerSchema, alarm_schema, live_marker_schema
from daq.schemas.runs import (
    DeviceSchema,
    LimitsSchema,
    RunOutSchema,
    runout_schema,
)
from daq.schemas.units import Count, Number, Schema, finite, micrometres, utc_time
from daq.schemas.vibration import (
    CounterSchema,
    MeasuredProbeVectorsSchema,
    OverallSchema,
    ProbeVectorsSchema,
    measured_probe_vectors_schema,
    probe_vectors_schema,
)
from daq.session.live_update import Clipping, LiveUpdate, RunState, Status
from model.prediction.prediction_map import Prediction


class ClippingSchema(Schema, of=(Clipping,)):
    """Clipped samples of a channel since the start of the run."""

    channel: str = Field(examples=["x"])
    samples: Count = Field(examples=[12])
    blocks: Count = Field(examples=[2])
    last_s: Number = Field(examples=[131.2])


class StatusSchema(Schema, of=(Status,)):
    """Status of the recording."""

    state: RunState = Field(examples=["recording"])
    elapsed_s: float = Field(examples=[161.2])
    samples: Count = Field(examples=[32_240_000])
    lost_samples: Count = Field(examples=[0])
    lost_is_exact: bool = Field(examples=[True])
    backlog_s: Number = Field(examples=[0.1])
    disk_left_s: Number = Field(examples=[147_600.0])
    skipped_samples: Count = Field(examples=[0])
    dropped_updates: Count = Field(examples=[0])
    severity: Severity = Field(examples=["normal"])
    latched_severity: Severity = Field(examples=["normal"])
    alarms: tuple[AlarmSchema, ...] = Field()
    acknowledged_alarm: Count = Field(examples=[0])
    markers: tuple[LiveMarkerSchema, ...] = Field()
    model: str = Field(examples=["ready"])
    clipped: tuple[ClippingSchema, ...] = Field()
    last_loss: str = Field(examples=["segment 0 ended after 20,000 samples: overrun, at least 451,609 samples lost; …"])
    detail: str = Field(examples=[""])


class TachoSchema(Schema, of=(TachoReport,)):
    """State and statistics of the tacho since the start of the run."""

    state: TachoState = Field(examples=["good"])
    pulses: Count = Field(examples=[24_310])
    filled: Count = Field(examples=[0])
    rejected: Count = Field(examples=[0])
    jitter_us: Number = Field(examples=[4.8])
    phase_reference_is_arbitrary: bool = Field(examples=[False])
    reference: str = Field(
        description='Source of speed and phase: "samples" of the tacho, or a "counter" that timestamps its edges',
        examples=["samples"],
    )
    counter: CounterSchema | None = Field(description="Comparison of counter and samples; null without a counter")


class WhirlSchema(Schema, of=(Whirl,)):
    """A measured component below 1X."""

    order: float = Field(examples=[0.49])
    order_sigma: Number = Field(examples=[0.0004])
    frequency_hz: Number = Field(description="Frequency, Hz", examples=[90.2])
    amplitude_peak_um: Number = Field(examples=[12.1])
    amplitude_sigma_um: Number = Field(examples=[0.05])
    direction: WhirlDirection = Field(examples=["forward"])


class PredictedWhirlSchema(Schema, of=(Whirl,)):
    """The strongest predicted component below 1X."""

    order: float = Field(examples=[0.7])
    frequency_hz: Number = Field(description="Frequency, Hz", examples=[128.8])
    amplitude_peak_um: Number = Field(examples=[22.0])


class ProbeSchema(Schema):
    """Present state of a probe."""

    name: str = Field(description="Name of the channel", examples=["x"])
    gap_v: Number = Field(description="Mean (gap) voltage over the last update interval, V", examples=[5.02])
    gap_ok: bool = Field(description="Whether the gap voltage lies in the probe's window", examples=[True])
    clipped_samples: Count = Field(description="Clipped samples since the start of the run", examples=[0])


class MeasurementSchema(OverallSchema, of=(OrderFrame, Snapshot)):
    """Vibration and speed measured by the probes and the tacho."""

    segment: Count = Field(examples=[0])
    sample: Count = Field(examples=[32_230_000])
    time_s: float = Field(examples=[161.15])
    speed_rpm: Number = Field(examples=[11042.1])
    acceleration_rpm_per_s: Number = Field(examples=[48.5])
    tacho: TachoSchema
    probe_x: ProbeSchema
    probe_y: ProbeSchema
    peak_to_peak_clearance_fraction: Number = Field(
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
    noise_peak_um: Number = Field(examples=[0.05])
    whirl: WhirlSchema | None = Field(description="Strongest component below 1X; null where none exceeds the noise")
    whirls: tuple[WhirlSchema, ...] = Field(
        description="Components below 1X above the noise, at most four, the strongest first"
    )


class PredictedVibrationSchema(Schema, of=(Prediction,)):
    """Vibration predicted at the probes for the measured speed."""

    speed_rpm: Number = Field(examples=[11042.1])
    is_exact: bool = Field(examples=[True])
    peak_to_peak_x_um: Number = Field(examples=[52.0])
    peak_to_peak_y_um: Number = Field(examples=[53.1])
    order_1x: ProbeVectorsSchema = Field(description="Predicted 1X")
    order_2x: ProbeVectorsSchema = Field(description="Predicted 2X")
    whirl: PredictedWhirlSchema | None = Field(description="Strongest component below 1X; null where none is predicted")
    growth_rate_per_s: Number = Field(examples=[14.2])


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
    header, status = update.header, update.status
    return LiveSchema.of(
        header,
        started_at=utc_time(header.started_ns),
        device=header.acquisition.device,
        runout=runout_schema(header.settings.runout, update.runout),
        status=StatusSchema.of(
            status,
            alarms=tuple(map(alarm_schema, status.alarms)),
            markers=tuple(map(live_marker_schema, status.markers)),
        ),
        measured=None if update.snapshot is None else _measured(update.snapshot, header),
        predicted=None if update.prediction is None else predicted_vibration_schema(update.prediction),
    )


def _measured(snapshot: Snapshot, header: RunHeader) -> MeasurementSchema:
    frame, tacho = snapshot.frame, header.acquisition.tacho
    whirls = () if frame is None else tuple(_whirl(whirl, frame) for whirl in frame.whirls if np.isfinite(whirl.order))
    return MeasurementSchema.of(
        frame,
        snapshot,
        tacho=TachoSchema.of(snapshot.tacho, reference=tacho.reference, counter=snapshot.counter),
        probe_x=_probe(snapshot, header, 0),
        probe_y=_probe(snapshot, header, 1),
        peak_to_peak_clearance_fraction=finite(header.limits.clearance_fraction(float(snapshot.peak_to_peak.max()))),
        order_1x=None if frame is None else _line(frame, 1),
        order_2x=None if frame is None else _line(frame, 2),
        order_1x_compensated=None if frame is None else _compensated_line(frame, 1),
        order_2x_compensated=None if frame is None else _compensated_line(frame, 2),
        whirl=next(iter(whirls), None),
        whirls=tuple(whirls),
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


def _probe(snapshot: Snapshot, header: RunHeader, probe: int) -> ProbeSchema:
    row = header.acquisition.row((Role.PROBE_X, Role.PROBE_Y)[probe])
    return ProbeSchema(
        name=header.acquisition.channels[row].name,
        gap_v=finite(snapshot.gap_volts[probe]),
        gap_ok=bool(snapshot.gap_in_window[probe]),
        clipped_samples=int(snapshot.clipped[row]),
    )


def _whirl(whirl: Whirl, frame: OrderFrame) -> WhirlSchema:
    return WhirlSchema.of(whirl, frequency_hz=_frequency(whirl.order, frame.speed))


def predicted_vibration_schema(prediction: Prediction) -> PredictedVibrationSchema:
    """Return the schema of a prediction."""
    order = prediction.whirl_order
    return PredictedVibrationSchema.of(
        prediction,
        order_1x=probe_vectors_schema(prediction.vectors[0]),
        order_2x=probe_vectors_schema(prediction.vectors[1]),
        whirl=None
        if not np.isfinite(order)
        else PredictedWhirlSchema(
            order=finite(order) or 0.0,
            frequency_hz=_frequency(order, prediction.speed),
            amplitude_peak_um=micrometres(prediction.whirl_amplitude),
        ),
    )


def _frequency(order: float, speed: float) -> float | None:
    return finite(order * speed / (2 * np.pi))
